"""Base motion as an input of a run: what happens in a ground that accelerates, relative to it."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

import mbsvib as mv
from mbsvib import beams
from tests.support.slow_cases import some


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


@pytest.mark.slow
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


@pytest.mark.slow
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


def flexible():
    """A beam on the ground with an arm at its end, and a beam that the arm carries."""
    model = mv.Model("flexible")
    model.add_body("tip", 0.5, (0.01, 0.01, 0.01), (1.0, 0.0, 0.0))
    model.add_body("arm", 1.0, (0.1, 0.2, 0.2), (1.0, 0.0, -0.3))
    model.add_joint("pin", "revolute", "tip", "arm", (1.0, 0.0, 0.0), axis=(0, 1, 0))
    words = {"section": {"type": "rectangle", "width": 0.02, "height": 0.01},
             "material": {"E": 2.1e9, "nu": 0.3, "rho": 7800.0}, "elements": 2, "beta": 1e-4, "alpha": 0.5}  # fmt: skip
    model.add_beam("base", "ground", "tip", start=(0, 0, 0), end=(1, 0, 0), **words)
    model.add_beam("mast", "arm", None, start=(1, 0, -0.6), end=(1.3, 0, -0.8), **words)
    model.add_base_motion("shake", (1.0, 0.3, -0.5))
    model.add_output("tip", "tip", "z")
    model.add_output("arm", "arm", "ry")
    model.add_output("end", "mast.2", "x")
    for direction in ("x", "y", "rz"):
        model.add_force_output(f"ground {direction}", "ground", direction)
    return model


def with_superelements():
    """A lump on springs to the ground, and another that an arm carries."""
    model = mv.Model("lumps")
    model.add_body("arm", 1.0, (0.1, 0.2, 0.2), (0.4, 0.0, 0.1))
    model.add_joint("pin", "revolute", "ground", "arm", (0.0, 0.0, 0.0), axis=(0, 1, 0))
    model.add_bushing("hold", "ground", "arm", (0, 0, 0), (0, 0, 0, 0, 40.0, 0))
    to_other = np.eye(6)
    to_other[:3, 3:] = -np.cross(np.eye(3), (0.3, 0.0, 0.1))  # of the second node by the motion of the first
    rows = np.hstack((-to_other, np.eye(6)))
    stiffness = rows.T @ np.diag((900.0, 700.0, 800.0, 30.0, 40.0, 50.0)) @ rows
    mass = np.diag((0.2, 0.2, 0.2, 0.01, 0.01, 0.01, 0.5, 0.5, 0.5, 0.02, 0.03, 0.03))
    model.add_superelement("carried", mass, None, stiffness, {"a": (0.8, 0, 0), "b": (1.1, 0, 0.1)},
                           bodies={"a": "arm"})  # fmt: skip
    model.add_superelement("still", mass[6:, 6:], None, stiffness[6:, 6:], {"node": (0, 1, 0)}, grounded=True)
    model.add_base_motion("shake", (1.0, 0.3, -0.5))
    for name, body in (("arm", "arm"), ("b", "carried.b"), ("node", "still.node")):
        model.add_output(name, body, "z")
    model.add_output("acceleration", "carried.b", "x", quantity="acceleration")
    model.add_force_output("ground x", "ground", "x")
    return model


@pytest.mark.slow
@pytest.mark.parametrize("make", some([flexible, with_superelements], with_superelements))
def test_what_bends_in_a_ground_that_accelerates(make):
    """For small motion it answers as the linear equations do, but for what falls with the square."""
    model, t = make(), np.linspace(0.0, 0.06, 7)
    system, off = model.linearize(), []
    for size in (1.0, 0.25):
        u = size * np.linspace(0.5, 1.0, 7)
        run, linear = model.simulate(t, {"shake": u}, tolerance=1e-10), system.time_response(t, u[None])
        off.append(np.array([np.abs(run[name] - linear[i]).max() for i, name in enumerate(system.outputs)]))
        largest = np.abs(linear).max(axis=1)
    assert np.all(largest > 1e-6)
    assert np.all(off[1] <= np.maximum(off[0] / 13.0, 1e-8 * largest))


@pytest.mark.slow
@pytest.mark.parametrize("elements", some([1, 3], 1))
def test_the_weight_of_beams_is_that_of_an_accelerated_ground(elements):
    """Loads at the nodes are consistent with the mass matrix: not half of each element's mass at either node."""
    t, runs = np.linspace(0.0, 0.05, 26), []
    for gravity in ((0.0, 0.0, -9.81), None):
        model = mv.Model("cantilever", gravity=gravity)
        steel = beams.Material(E=2e11, rho=7800.0, nu=0.3)
        model.add_beam("b", "ground", None, beams.Circle(0.004), steel, (0, 0, 0), (0.4, 0.1, 0), elements=elements)
        model.add_output("z", f"b.{elements}", "z", relative_to="ground")
        if gravity is None:
            model.add_base_motion("up", "z")
        inputs = {} if gravity else {"up": np.full(t.shape, 9.81)}
        runs.append(model.simulate(t, inputs, tolerance=1e-10).outputs["z"])
    assert np.abs(runs[0]).max() > 5e-4
    np.testing.assert_allclose(runs[0], runs[1], atol=1e-8 * np.abs(runs[0]).max())
