"""Runs of small motion against the linear model: what differs falls with the square of the amplitude."""

import numpy as np
import pytest

import mbsvib as mv
from tests.support.slow_cases import some

FREE = [("x", "ry", "rz"), ("y", "rx", "rz"), ("z", "rx", "ry"), ("x", "y", "rx", "ry"), ("y", "z", "ry", "rz"),
        ("x", "rx", "ry"), ("rx", "rz"), ("x", "y", "z", "rx", "rz"), ("y", "z", "rx"),
        ("x", "rx", "ry", "rz")]  # fmt: skip


def two_bodies():
    model = mv.Model()
    model.add_body("a", 2.0, (0.3, 0.4, 0.5, 0.02, 0.03, -0.01), position=(0.1, 0.2, 0.3))
    model.add_body("b", 1.0, (0.2, 0.1, 0.15), position=(0.5, 0.1, 0.4))
    model.add_bushing("ka", "ground", "a", position=(0.05, 0, 0.1), stiffness=(500, 400, 300, 50, 40, 60))
    model.add_bushing("kc", "ground", "b", position=(0.05, 0.4, 0.1), stiffness=(50, 40, 30, 5, 4, 6),
                      damping=[0.5] * 6)  # fmt: skip
    return model


def add_outputs(model):
    for body in ("a", "b"):
        for quantity in ("displacement", "velocity", "acceleration"):
            model.add_output(f"{body}.{quantity}", body, (0.1, 0.2, 0.3, 0.4, -0.5, 0.6), quantity=quantity)


def deviation(model, amplitude):
    """How far each output of a run is from the linear one, as a share of its size."""
    system = model.linearize()
    t = np.linspace(0.0, 0.3, 5)
    q = amplitude * np.random.default_rng(0).normal(size=system.dof)
    run = model.simulate(t, initial=dict(zip(system.coordinates, q.tolist(), strict=True)), tolerance=1e-10)
    linear = system.time_response(t, np.zeros((len(system.inputs), len(t))), initial=(q, 0 * q))
    return max(np.abs(run[name] - y).max() / np.abs(y).max() for name, y in zip(system.outputs, linear, strict=True))


@pytest.mark.slow
@pytest.mark.parametrize("swap", [False, True])
@pytest.mark.parametrize("free", some(FREE, *FREE[:4]), ids="-".join)
def test_loaded_custom_joints(free, swap):
    """Locked translations are those along axes of the first body, also where two rotations come one after the other."""
    model = two_bodies()
    model.add_joint("joint", None, *(("b", "a") if swap else ("a", "b")), position=(0.3, 0.1, 0.2), free=free)
    model.add_load("load", "b", force=(30, 40, 50), torque=(3, 5, -4), position=(0.2, 0.3, 0.1))
    model.add_bushing("kb", "a", "b", position=(0.3, 0.2, 0.25), stiffness=(80, 70, 60, 8, 9, 10))
    add_outputs(model)
    assert deviation(model.equilibrium(preload=True), 1e-5) < 1e-3


@pytest.mark.slow
def test_a_loop_that_is_redundant_as_a_whole():
    """The second of two coaxial hinges closes a loop that says nothing: rounding of it is no constraint."""
    model = two_bodies()
    axis = np.array([0.3, -0.5, 0.8])
    for i, ends in enumerate((("a", "b"), ("b", "a"))):
        model.add_joint(f"hinge{i}", "revolute", *ends, position=np.array([0.3, 0.1, 0.2]) + i * axis, axis=axis)
    model.add_bushing("kb", "a", "b", position=(0.3, 0.2, 0.25), stiffness=(80, 70, 60, 8, 9, 10))
    add_outputs(model)
    assert deviation(model, 1e-5) < 1e-3


@pytest.mark.parametrize(("node", "coupled"), [(2.0, 0.8), (0.0, 0.0)])
def test_a_mode_that_moves_no_node(node, coupled):
    """A mode within a part held by one node, which moves with the node's mass, or which nothing excites."""
    mass = np.diag((node, node, node, 0.05 * node, 0.05 * node, 0.05 * node, 1.0))
    mass[0, 6] = mass[6, 0] = coupled
    model = mv.Model()
    model.add_body("b", 1.0, (0.1, 0.1, 0.1))
    model.add_superelement("part", mass, None, np.diag((0, 0, 0, 0, 0, 0, 900.0)), {"node": (0, 0, 0)}, {"node": "b"})
    model.add_joint("slide", "prismatic", "ground", "b", axis=(1, 0, 0))
    model.add_spring("spring", "ground", "b", (-1, 0, 0), (0, 0, 0), stiffness=600.0)
    model.add_input("push", "b", (1, 0, 0))
    model.add_output("x", "b", (1, 0, 0))
    t = np.linspace(0.0, 0.4, 9)
    squares, modes = np.linalg.eig(np.linalg.solve([[1.0 + node, coupled], [coupled, 1.0]], np.diag((600.0, 900.0))))
    static = np.linalg.solve(modes, (3e-6 / 600.0, 0.0))  # x(0) = 0 under a constant force of 3e-6 N
    expected = modes[0] @ (static[:, None] * (1.0 - np.cos(np.sqrt(squares)[:, None] * t)))
    run = model.simulate(t, {"push": np.full(9, 3e-6)}, tolerance=1e-10)
    np.testing.assert_allclose(run["x"], expected, rtol=0, atol=3e-7 * np.abs(expected).max())


def test_a_superelement_on_the_ground_falls_by_its_weight():
    """A mass on springs is released: it swings about its sag m g / k along all directions of gravity."""
    gravity, m, k = np.array((3.0, 0.5, -9.81)), 2.0, 300.0
    spring = np.diag((k, k, k, 40.0, 40.0, 40.0))
    model = mv.Model("hung", gravity=gravity)
    model.add_superelement("part", np.diag((*(0.0,) * 6, m, m, m, 0.1, 0.1, 0.1)), None,
                           np.block([[spring, -spring], [-spring, spring]]), {"base": (0, 0, 0), "tip": (0, 0, 0)},
                           {"base": "ground"})  # fmt: skip
    for d in "xyz":
        model.add_output(d, "part.tip", d)
    t = np.linspace(0.0, 0.5, 6)
    run = model.simulate(t)
    for d, g in zip("xyz", gravity, strict=True):
        np.testing.assert_allclose(run[d], g * m / k * (1.0 - np.cos(np.sqrt(k / m) * t)), rtol=0, atol=1e-8)
