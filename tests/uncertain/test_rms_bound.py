"""Proven bounds of root mean squares: closed forms, samples of parameters, units."""

import numpy as np
import pytest

from mbsvib import isolation, library
from tests.random.scenes import oscillator

K = oscillator().linearize().K[0, 0]


@pytest.mark.slow
def test_bound_of_a_damper_is_near_the_closed_form():
    """S / (4 c k) at the least damper: it is the worst at all frequencies, and bands add 10 % of the mean square."""
    worst = oscillator().linearize().uncertain({"s.damping": (2.0, 5.0)}).worst_rms("x", {"F": 1.0})
    exact = np.sqrt(1.0 / (4.0 * 2.0 * K))
    assert exact < worst.upper["x"] < 1.08 * exact
    assert "0.0134" in str(worst)  # rounded up


@pytest.mark.slow
def test_bound_holds_where_a_resonance_moves_far():
    """The largest of the densities at each frequency is not below the bound, nor far below it."""
    plant = oscillator().linearize().uncertain({"s.stiffness": 0.2, "s.damping": (2.0, 5.0)})
    worst = plant.worst_rms("x", {"F": 1.0})
    mass = oscillator().linearize().M[0, 0]
    f = np.linspace(0.0, 60.0, 60001)
    w = 2.0 * np.pi * f
    k = np.clip(mass * w**2, 0.8 * K, 1.2 * K)  # the stiffness nearest to resonance
    envelope = 1.0 / ((k - mass * w**2) ** 2 + (2.0 * w) ** 2)
    exact = np.sqrt(np.trapezoid(envelope, f))
    assert worst.lower["x"] < exact < worst.upper["x"] < 1.08 * exact


@pytest.mark.slow
def test_bound_of_a_loop_against_samples_and_in_other_units():
    stage = library.cubic_hexapod(stiffness=2e5, damping=20.0)
    active = isolation.actuated(stage, "platform")
    plant = active.system.uncertain({"leg*.k.stiffness": 0.1, "platform.mass": (9.0, 12.0)})
    loop = plant.feedback(isolation.force_feedback(active, 120.0, leak=0.6))
    floor = {"base.z": isolation.shaped([600.0], [1.0, 600.0], 1e-6)}
    worst = loop.worst_rms("acceleration.z", floor)
    assert worst.lower["acceleration.z"] < worst.upper["acceleration.z"] < 1.1 * worst.lower["acceleration.z"]
    for case in loop.sample(8, seed=2):
        assert case.rms("acceleration.z", floor)["acceleration.z"] < worst.upper["acceleration.z"]
    strong = {"base.z": isolation.shaped([600.0], [1.0, 600.0], 1e6)}
    ratio = loop.worst_rms("acceleration.z", strong).upper["acceleration.z"] / worst.upper["acceleration.z"]
    assert np.isclose(ratio, 1e6, rtol=1e-3)


def test_no_bound_where_values_make_it_unstable():
    worst = oscillator(c=0.5).linearize().uncertain({"s.damping": (-0.1, 2.0)}).worst_rms("x", {"F": 1.0})
    assert worst.lower["x"] == worst.upper["x"] == np.inf
