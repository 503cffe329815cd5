"""Margins against python-control on single loops, and closed forms of several."""

import control
import numpy as np
import pytest

import mbsvib as mv
from mbsvib import isolation, library
from tests.isolation.scenes import OMEGA, active_strut, one_axis, two_masses
from tests.support.sizes import few


def plant():
    return isolation.actuated(active_strut(damping=60.0), "payload", "leg", directions="z")


def loop_of(law):
    p = plant()
    return p.with_gains(isolation.controller(law, ["leg.rate"], ["leg.actuator"]))


def test_single_loop_against_python_control():
    # a lead and three lags: limited gain, phase and delay
    s = control.tf("s")
    law = control.ss(-3e6 * (s + 30) / (s + 600) / (s + 900) / (s + 400) * 300)
    loop = loop_of(law)
    got = loop.margins()
    space = loop.plant.system.state_space("modal")
    y, u = space.outputs.index("leg.rate"), space.inputs.index("leg.actuator")
    full = control.ss(space.A, space.B[:, [u]], space.C[[y]], space.D[[y]][:, [u]])
    gain, phase, modulus, *_ = control.stability_margins(-law * full)
    assert loop.stable
    assert got.gain == pytest.approx([gain], rel=1e-6)
    assert got.phase == pytest.approx([abs(phase)], rel=1e-6)
    assert got.modulus_each == pytest.approx([modulus], rel=1e-6)
    assert got.modulus == pytest.approx(modulus, rel=1e-6)
    # at the margins the loop just vibrates
    for factor, sign in ((0.999, True), (1.001, False)):
        assert loop_of(factor * got.gain[0] * law).stable is sign
    name, all_loops = got.table()["rows"]
    assert name == ("leg.actuator", f"0 ... {gain:.3g}", f"{abs(phase):.3g}", f"{1e3 * got.delay[0]:.3g}",
                    f"{modulus:.3g}")  # fmt: skip
    assert all_loops == ("disk margin (simultaneous)", f"{1.0 / (1.0 + modulus):.3g} ... {1.0 / (1.0 - modulus):.3g}",
                         f"{np.degrees(2.0 * np.arcsin(0.5 * modulus)):.3g}", "", f"{modulus:.3g}")  # fmt: skip


def test_force_feedback_has_infinite_gain_margin_and_ninety_degrees():
    p = isolation.actuated(one_axis(0.0), "payload", directions="z")
    got = p.with_gains(isolation.force_feedback(p, OMEGA)).margins()
    assert got.gain.tolist() == [np.inf]
    assert got.lower.tolist() == [0.0]
    assert got.phase == pytest.approx([90.0], rel=1e-9)
    # |g w / (w^2 - W^2)| = 1 at (g + sqrt(g^2 + 4 W^2)) / 2 where the loop lags by 90 degrees
    upper = 0.5 * (OMEGA + np.sqrt(5) * OMEGA)
    assert got.delay == pytest.approx([0.5 * np.pi / upper], rel=1e-6)
    assert got.modulus == pytest.approx(1.0, rel=1e-4)
    assert got.all_phases == pytest.approx(60.0, rel=1e-3)


def test_lower_gain_limits_what_needs_its_loop():
    # a negative spring makes the payload fall; positions are fed back
    p = isolation.actuated(active_strut(leg=-5e4), "payload", "leg", directions="z")
    law = control.tf([-300.0, -1.2e5], [1e-4, 1.0])
    loop = p.with_gains(isolation.controller(control.ss(law), ["leg.stroke"], ["leg.actuator"]))
    got = loop.margins()
    assert loop.stable
    assert got.lower == pytest.approx([2e4 / 1.2e5], rel=1e-4)


@pytest.mark.slow
def test_equal_loops_of_a_symmetric_platform():
    p = isolation.actuated(library.cubic_hexapod(), "platform")
    got = p.with_gains(isolation.velocity_feedback(p, 500.0)).margins()
    assert np.ptp(got.phase) <= 1e-6 * got.phase[0]
    assert got.gain.tolist() == [np.inf] * 6
    assert got.modulus >= 0.999


@pytest.mark.slow
def test_delay_margin_is_where_a_sampled_loop_becomes_unstable():
    p = plant()
    loop = p.with_gains(isolation.velocity_feedback(p, 2000.0))
    late = loop.margins().delay[0]
    rate = 200.0 / late
    for factor, sign in ((0.98, True), (1.02, False)):
        # a hold is late by half a sample
        assert loop.sampled(rate, factor * late - 0.5 / rate).stable is sign


def test_gain_margin_of_a_sampled_loop_is_at_half_the_rate():
    """Far above all modes the loop turns by 180 degrees at half the rate, and there alone."""
    p = plant()
    loop = p.with_gains(isolation.velocity_feedback(p, 2000.0)).sampled(1e4)
    got = loop.margins()
    assert 100 < got.gain[0] < 200
    for factor, sign in ((0.9999, True), (1.0001, False)):
        assert p.with_gains(isolation.velocity_feedback(p, 2000.0 * factor * got.gain[0])).sampled(1e4).stable is sign
    assert got.modulus == pytest.approx(1 - 1 / got.gain[0], rel=1e-3)


@pytest.mark.slow
@pytest.mark.parametrize("seed", few(range(8), 4))
def test_gain_margins_of_random_loops_are_where_poles_reach_the_axis(seed):
    """Two actuators with light dampers from 1e-6 on, each loop by itself while the other is closed."""
    rng = np.random.default_rng(seed)
    p = isolation.actuated(two_masses(c1=10 ** rng.uniform(-6, 0), c2=10 ** rng.uniform(-6, 0)), "payload",
                           directions="z")  # fmt: skip
    corner, gain = 10 ** rng.uniform(1.5, 3.5, 2), 10 ** rng.uniform(0, 2.5, 2)
    turn = np.diag(gain) * (1 + 0.2 * rng.normal(size=(2, 2)))

    def closed(factors):
        law = control.ss(-np.diag(corner), np.diag(corner), -np.diag(factors) @ turn, np.zeros((2, 2)))
        return p.with_gains(isolation.controller(law, ["lower.rate", "upper.rate"],
                                                 ["lower.actuator", "upper.actuator"]))  # fmt: skip

    loop = closed([1, 1])
    if not loop.stable:
        assert max(loop.poles().real) > 0
        return
    got = loop.margins()
    for i in range(2):
        largest = got.gain[i] if np.isfinite(got.gain[i]) else 1e5
        for factor in np.geomspace(1, 0.9999 * largest, 30):
            assert closed(np.where(np.arange(2) == i, factor, 1.0)).stable, factor
        if np.isfinite(got.gain[i]):
            assert not closed(np.where(np.arange(2) == i, 1.0001 * largest, 1.0)).stable


def test_a_band_of_two_frequencies_is_enough():
    p = plant()
    loop = p.with_gains(isolation.velocity_feedback(p, 2000.0))
    full, band = loop.margins(), loop.margins([1.0, 1e4])
    assert band.phase == pytest.approx(full.phase, rel=1e-12)
    assert band.delay == pytest.approx(full.delay, rel=1e-12)
    with pytest.raises(mv.ResponseError, match="the first and the last of a band"):
        loop.margins([3.0])


@pytest.mark.slow
def test_no_limit_of_all_gains_is_infinite():
    """Where the loop gain vanishes, 1 - modulus is rounding and its inverse no limit."""
    plant = isolation.actuated(library.stewart_isolator(), "platform")
    margins = plant.with_gains(isolation.force_feedback(plant, 40.0, 2.0)).margins()
    assert margins.all_gains[1] == np.inf
    assert "0.5 ... inf" in str(margins)


@pytest.mark.parametrize("gain", [-1.9, 1.2])
def test_delay_margin_of_accelerations_against_the_delayed_equation(gain):
    """m x'' + c x' + k x = g x''(t - T), by its solutions exp(i w t)."""
    m, c, k = 2.0, 12.0, 800.0
    plant = mv.System.from_matrices([[m]], [[c]], [[k]], [[1.0]], Ca=[[1.0]])
    got = plant.feedback([[gain]], plant.outputs, plant.inputs).margins()
    w = np.sqrt(np.roots([m * m - gain**2, c * c - 2 * m * k, k * k]).astype(complex))
    w = w.real[np.abs(w.imag) < 1e-9]
    late = np.mod(-np.angle((k - m * w * w + 1j * c * w) / (-gain * w * w)), 2 * np.pi) / w
    assert got.delay[0] == pytest.approx(min(late), rel=1e-9)


@pytest.mark.parametrize("gain", [-2.1, -9.0])
def test_no_delay_margin_where_more_than_the_acceleration_is_fed_back(gain):
    """The equation with a delay T is neutral: for g < -m and any T > 0 it has solutions near
    exp((log(-g / m) + i n pi) t / T), n even and large, which grow.
    """
    m, c, k, late = 2.0, 12.0, 800.0, 1e-3
    plant = mv.System.from_matrices([[m]], [[c]], [[k]], [[1.0]], Ca=[[1.0]])
    loop = plant.feedback([[gain]], plant.outputs, plant.inputs)
    s = complex(np.log(-gain / m), 1001 * np.pi) / late
    for _ in range(20):
        turned = gain * np.exp(-s * late)
        s -= (m * s * s + c * s + k - turned * s * s) / (2 * m * s + c + turned * (late * s - 2) * s)
    assert s.real == pytest.approx(np.log(-gain / m) / late, abs=1.0)
    assert s.real > 0
    got = loop.margins()
    assert loop.stable
    assert (got.delay[0], got.delay_at[0]) == (0.0, np.inf)
    assert loop.margins([0.1, 1e3]).delay[0] > 0.0
