"""Base motion as an input of a run: what happens in a ground that accelerates, relative to it."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

import mbsvib as mv


def swing(gravity=(0.0, 0.0, -9.81)):
    """Two arms on hinges, far from small motion."""
    model = mv.Model("swing", gravity=gravity)
    for i, (first, size) in enumerate((("ground", 1.0), ("arm0", 0.7))):
        name, x = f"arm{i}", 0.3 * i
        model.add_body(name, 1.5 * size, (0.01, 0.05, 0.05), (x + 0.15, 0, -0.1 * i))
        model.add_joint(f"hinge{i}", "revolute", first, name, (x, 0, -0.1 * i), axis=(0, 1, 0))
    model.add_bushing("friction", "arm0", "arm1", (0.3, 0, -0.1), damping=(0, 0, 0, 0, 0.02, 0))
    model.add_base_motion("shake", (1.0, 0.0, 0.5))
    for quantity in ("displacement", "velocity", "acceleration"):
        model.add_output(f"{quantity} x", "arm1", "x", position=(0.6, 0, -0.1), quantity=quantity)
    model.add_output("relative", "arm1", "x", position=(0.6, 0, -0.1), quantity="acceleration", absolute=False)
    return model


def test_a_constant_acceleration_acts_like_gravity():
    t = np.linspace(0.0, 0.7, 31)
    shaken = swing().simulate(t, {"shake": 6.0}, tolerance=1e-10)
    tilted = swing((-6.0, 0.0, -12.81)).simulate(t, tolerance=1e-10)
    for name in ("hinge0.rz", "hinge1.rz"):
        assert np.ptp(shaken.coordinates[name]) > 1.0
        assert_allclose(shaken.coordinates[name], tilted.coordinates[name], atol=1e-8)
    for name in ("displacement x", "velocity x", "relative"):
        assert_allclose(shaken[name], tilted[name], atol=1e-6)
    assert_allclose(shaken["acceleration x"], shaken["relative"] + 6.0, rtol=1e-12)
    assert_allclose(tilted["acceleration x"], tilted["relative"], rtol=1e-12)
    assert np.abs(shaken.energy.balance).max() < 1e-8 * shaken.energy.kinetic.max()


def test_what_does_not_turn_answers_as_the_linear_equations_do():
    model, t = mv.library.quarter_car(), np.linspace(0.0, 1.0, 201)
    road = np.sin(9.0 * t) * t
    run = model.simulate(t, {"road": road, "load": 5.0 * t}, tolerance=1e-10)
    system = model.linearize()
    expected = system.time_response(t, np.array([road, 5.0 * t]), inputs=["road", "load"])
    for name in system.outputs:
        linear = expected[system.outputs.index(name)]
        assert_allclose(run[name], linear, atol=1e-7 * np.abs(linear).max())


def test_absolute_motion_is_not_told():
    model = swing()
    model.add_output("above", "arm1", "z", absolute=True)
    run = model.simulate([0.0, 0.1], {"shake": 1.0})
    with pytest.raises(mv.ResponseError, match="would integrate the acceleration of the ground"):
        run["above"]


def test_beams_are_refused_by_name():
    model = mv.library.cantilever()
    model.add_base_motion("shake", "z")
    with pytest.raises(mv.ModelError, match="or moves beams"):
        model.simulate([0.0, 1e-3], {"shake": 1.0})
