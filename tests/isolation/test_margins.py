"""Margins against python-control on single loops, and closed forms of several."""

import control
import numpy as np
import pytest

from mbsvib import isolation, library
from tests.isolation.scenes import OMEGA, active_strut, one_axis


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
    whole = control.ss(space.A, space.B[:, [u]], space.C[[y]], space.D[[y]][:, [u]])
    gain, phase, modulus, *_ = control.stability_margins(-law * whole)
    assert loop.stable
    assert got.gain == pytest.approx([gain], rel=1e-6)
    assert got.phase == pytest.approx([abs(phase)], rel=1e-6)
    assert got.modulus_each == pytest.approx([modulus], rel=1e-6)
    assert got.modulus == pytest.approx(modulus, rel=1e-6)
    # at the margins the loop just vibrates
    for factor, sign in ((0.999, True), (1.001, False)):
        assert loop_of(factor * got.gain[0] * law).stable is sign
    assert "gain may be times" in str(got)


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


def test_equal_loops_of_a_symmetric_platform():
    p = isolation.actuated(library.cubic_hexapod(), "platform")
    got = p.with_gains(isolation.velocity_feedback(p, 500.0)).margins()
    assert np.ptp(got.phase) <= 1e-6 * got.phase[0]
    assert got.gain.tolist() == [np.inf] * 6
    assert got.modulus >= 0.999


def test_delay_margin_is_where_a_sampled_loop_becomes_unstable():
    p = plant()
    loop = p.with_gains(isolation.velocity_feedback(p, 2000.0))
    late = loop.margins().delay[0]
    rate = 200.0 / late
    for factor, sign in ((0.98, True), (1.02, False)):
        # a hold is late by half a sample
        assert loop.sampled(rate, factor * late - 0.5 / rate).stable is sign
