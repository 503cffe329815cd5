"""Passes between samples that are far apart, against closed forms."""

import numpy as np
import pytest
from scipy.optimize import brentq

import mbsvib as mv
from mbsvib import library

OMEGA = 5.0


def oscillator(gravity=None):
    model = mv.Model("oscillator", gravity=gravity)
    model.add_body("m", 2.0, (1, 1, 1), (0, 0, 1.0))
    model.add_joint("rail", "prismatic", "ground", "m", (0, 0, 1.0), axis=(0, 0, 1))
    model.add_spring("k", "ground", "m", (0, 0, 0), (0, 0, 1.0), 2.0 * OMEGA**2)
    model.add_input("F", "m", "z")
    model.add_output("z", "m", "z")
    model.add_force_output("force", "k")
    return model


@pytest.mark.few(1)
@pytest.mark.parametrize("count", [2, 3, 4, 5, 9])
@pytest.mark.parametrize("name", ["rail.z", "force"])
def test_passes_do_not_depend_on_the_samples(count, name):
    """z = 0.1 cos(5 t) and the force 5 N cos(5 t) pass 0.3 of their amplitudes seven times."""
    end = 6.9 * np.pi / OMEGA
    run = oscillator().simulate(np.linspace(0.0, end, count), initial={"rail.z": 0.1})
    level = 0.03 if name == "rail.z" else 1.5
    phase = np.arccos(0.3)
    exact = np.array([phase, *(2 * np.pi * k + side * phase for k in (1, 2, 3) for side in (-1, 1))]) / OMEGA
    np.testing.assert_allclose(run.crossings(name, level), exact[exact < end], rtol=1e-8)


@pytest.mark.few(1)
@pytest.mark.parametrize(("amplitude", "count"), [(1e-9, 4), (1e-9, 40), (1e-6, 40), (1e-12, 40)])
def test_passes_of_motions_near_the_error_of_the_run(amplitude, count):
    """Below 1e-4 of the mechanism's size errors are larger shares of the motion; no pass is lost for that."""
    end = 6.9 * np.pi / OMEGA
    run = oscillator().simulate(np.linspace(0.0, end, count), initial={"rail.z": amplitude}, tolerance=1e-10)
    exact = np.pi / OMEGA * (0.5 + np.arange(7))
    np.testing.assert_allclose(run.crossings("z"), exact, atol=10.0 * 1e-14 / amplitude / OMEGA + 1e-8)


@pytest.mark.slow
@pytest.mark.parametrize("periods", [1, 2, 8])
def test_samples_at_whole_periods(periods):
    """All samples are alike, as if nothing moved."""
    t = np.arange(0, 3) * periods * 2 * np.pi / OMEGA
    run = oscillator().simulate(t, initial={"rail.z": 0.1})
    assert np.ptp(run["z"]) < 1e-8
    exact = np.pi / OMEGA * (0.5 + np.arange(4 * periods))
    np.testing.assert_allclose(run.crossings("z"), exact, rtol=1e-8)


@pytest.mark.slow
def test_swings_that_just_pass_or_just_do_not():
    run = oscillator().simulate([0.0, 3.0 * np.pi / OMEGA], initial={"rail.z": 0.1})
    for beyond in (1e-2, 1e-4, 1e-6):
        top = np.arccos(-(1.0 - beyond)) / OMEGA
        both = run.crossings("z", -0.1 * (1.0 - beyond))
        np.testing.assert_allclose(both[:2], [top, 2 * np.pi / OMEGA - top], rtol=1e-6)
        assert len(run.crossings("z", -0.1 * (1.0 + beyond))) == 0


@pytest.mark.slow
def test_an_event_in_a_long_interval_is_the_first_one():
    run = oscillator().simulate([0.0, 10.0], initial={"rail.z": 0.1}, until={"z": -0.0999})
    assert run.time[-1] == pytest.approx(np.arccos(-0.999) / OMEGA, rel=1e-7)
    assert run.ended_by == "z"


def test_inputs_go_on_from_times_within_an_interval():
    """z'' + 25 z = F / 2 with F = t: z = t / 50 - sin(5 t) / 250, from rest."""
    t = np.array([0.0, 4.0])
    run = oscillator().simulate(t, {"F": t})
    exact = brentq(lambda s: s / 50.0 - np.sin(OMEGA * s) / 250.0 - 0.04, 0.0, 4.0, xtol=1e-14)
    np.testing.assert_allclose(run.crossings("z", 0.04), [exact], rtol=1e-9)


@pytest.mark.slow
def test_a_chain_with_few_samples():
    model, end = library.pendulum_chain(2), 4.0
    dense = model.simulate(np.linspace(0.0, end, 81), initial={"pin1.rz": 2.0}).crossings("pin2.rz")
    for count in (2, 5):
        sparse = model.simulate(np.linspace(0.0, end, count), initial={"pin1.rz": 2.0}).crossings("pin2.rz")
        np.testing.assert_allclose(sparse, dense, rtol=1e-6)
    assert len(dense) >= 4
