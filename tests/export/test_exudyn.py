"""The same mechanism in exudyn: eigenvalues of its own linearization, and motion by its own time integration."""

import warnings

import numpy as np
import pytest
from numpy.testing import assert_allclose

import mbsvib as mv
import mbsvib_export as mx

exudyn = pytest.importorskip("exudyn")


def eigenvalues(mbs):
    mass, stiffness, damping = (np.array(part) for part in mbs.ComputeLinearizedSystem(
        projectIntoConstraintNullspace=True)[:3])  # fmt: skip
    n = len(mass)
    a = np.block([[np.zeros((n, n)), np.eye(n)], [-np.linalg.solve(mass, stiffness), -np.linalg.solve(mass, damping)]])
    return np.linalg.eigvals(a)


def simulated(mbs, end, steps):
    settings = exudyn.SimulationSettings()
    settings.timeIntegration.numberOfSteps, settings.timeIntegration.endTime = steps, end
    settings.timeIntegration.verboseMode = 0
    settings.timeIntegration.newton.relativeTolerance = 1e-10
    settings.solution.file.write = False
    settings.solution.sensors.writePeriod = end / steps
    mbs.SolveDynamic(settings, solverType=exudyn.DynamicSolverType.TrapezoidalIndex2)


def stored(mbs, name):
    """Times and values of a sensor."""
    data = np.array(mbs.GetSensorStoredData(mbs.GetSensorNumber(name)))
    return data[:, 0], data[:, 1]


@pytest.mark.parametrize("name", ["stewart_isolator", "wafer_stage", "quarter_car", "inclined_chain", "quadruped",
                                  "ladder"])  # fmt: skip
def test_exudyn_linearizes_to_the_same_eigenvalues(name):
    """Universal, spherical, prismatic and revolute joints, loops, bushings and springs; differences in exudyn."""
    model = getattr(mv.library, name)()
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", mv.LeftOutWarning)
        found = eigenvalues(mx.to_exudyn(model))
    ours = model.linearize().modes().eigenvalues
    assert len(found) == len(ours)
    size = np.maximum(np.abs(ours), 1e-3 * np.abs(ours).max())
    assert (np.abs(found[:, None] - ours).min(axis=0) < 1e-8 * size).all()


def test_distance_joints_and_follower_loads_of_turned_bodies():
    """A body on a rigid rod has five motions; a load that follows it is stated in the body's own axes."""
    model = mv.Model("rod")
    turn = ((0.0, -1.0, 0.0), (1.0, 0.0, 0.0), (0.0, 0.0, 1.0))
    model.add_body("b", 2.0, (0.2, 0.3, 0.4), (0, 0, 1.0), orientation=turn)
    model.add_joint("rod", "distance", "ground", "b", (0.5, 0, 1.0), end=(0.1, 0.2, 1.1))
    model.add_bushing("k", "ground", "b", (0, 0, 1.0), (1e3, 2e3, 3e3, 40.0, 50.0, 60.0), (1, 2, 3, 0.1, 0.2, 0.3))
    ours, found = model.linearize().modes().eigenvalues, eigenvalues(mx.to_exudyn(model))
    assert len(found) == len(ours) == 10
    assert (np.abs(found[:, None] - ours).min(axis=0) < 1e-8 * np.abs(ours)).all()
    model.add_load("jet", "b", force=(1.0, 2.0, 3.0), follower=True)
    model.add_load("wind", "b", torque=(1.0, 2.0, 3.0))
    mbs = mx.to_exudyn(model)
    assert_allclose([mbs.GetLoad(k)["loadVector"] for k in range(2)], [np.transpose(turn) @ [1, 2, 3], [1, 2, 3]])


def held_by(kind, **changes):
    """A body on six springs and a joint."""
    model = mv.Model("held")
    model.add_body("b", 2.0, (0.2, 0.3, 0.4), (0, 0, 1.0))
    model.add_joint("j", kind, "ground", "b", (0, 0, 0.5), **changes)
    model.add_bushing("k", "ground", "b", (0, 0, 1.0), (1e3, 2e3, 3e3, 40.0, 50.0, 60.0), (1, 2, 3, 0.1, 0.2, 0.3))
    return model


@pytest.mark.parametrize(("kind", "changes"), [("universal", {"axis": (1, 0, 0), "axis2": (0, 1, 0)}),
                                               (None, {"free": ("x", "rz")})])  # fmt: skip
def test_joints_of_two_motions(kind, changes):
    model = held_by(kind, **changes)
    ours, found = model.linearize().modes().eigenvalues, eigenvalues(mx.to_exudyn(model))
    assert len(found) == len(ours) == 4
    assert (np.abs(found[:, None] - ours).min(axis=0) < 1e-8 * np.abs(ours)).all()


def pendulum():
    """A pendulum on a preloaded spring under gravity, a dead load and a follower load, all in balance."""
    model = mv.Model("pendulum", gravity=(0, 0, -9.81))
    model.add_body("rod", 2.0, (0.02, 0.02, 0.001), (0.0, 0.0, -0.5))
    model.add_joint("hinge", "revolute", "ground", "rod", (0, 0, 0), axis=(0, 1, 0))
    model.add_spring("k", "ground", "rod", (1.0, 0.0, -1.0), (0.0, 0.0, -1.0), 40.0, 0.8, preload=3.0)
    model.add_load("wind", "rod", force=(-4.0, 0.0, 0.0), position=(0.0, 0.0, -1.0))
    model.add_load("jet", "rod", force=(1.0, 0.0, 0.0), position=(0.0, 0.0, -1.0), follower=True)
    model.add_input("M", "rod", "ry")
    model.add_input("F", "rod", "x", position=(0, 0, -1.0))
    model.add_output("tip", "rod", "x", position=(0, 0, -1.0))
    model.add_output("angle", "rod", "ry")
    model.add_output("rate", "rod", "ry", quantity="velocity")
    model.add_output("ax", "rod", "x", position=(0, 0, -1.0), quantity="acceleration")
    return model


@pytest.mark.slow
def test_small_motion_under_loads_is_the_time_response():
    """Geometric stiffness of gravity, preload, dead and follower load: a second-order difference in the amplitude."""
    model, steps, end = pendulum(), 4000, 2.0
    system = model.linearize()
    t = np.linspace(0.0, end, steps + 1)
    off = []
    for amplitude in (0.4, 0.2):
        signals = {"M": lambda t, a=amplitude: a * np.sin(7.0 * t),
                   "F": lambda t, a=amplitude: a * (1.0 - np.cos(3.0 * t))}  # fmt: skip
        mbs = mx.to_exudyn(model, signals)
        simulated(mbs, end, steps)
        u = np.array([[signals[name](x) for x in t] for name in system.inputs])
        expected = system.time_response(t, u, hold="first")
        found = np.array([np.interp(t, *stored(mbs, name)) for name in system.outputs])
        off.append(np.abs(found - expected).max(axis=1) / np.abs(expected).max(axis=1))
    assert (off[0] < 0.02).all()
    assert (off[1] < 0.6 * off[0]).all()


def test_forces_between_two_bodies_and_constant_inputs():
    model = mv.Model("pair")
    for name, x in (("a", 0.0), ("b", 1.0)):
        model.add_body(name, 2.0, (1, 1, 1), (x, 0, 0))
        model.add_joint(f"slide_{name}", "prismatic", "ground", name, axis=(1, 0, 0))
        model.add_spring(f"k_{name}", "ground", name, (x - 0.5, 0, 0), (x, 0, 0), 300.0, 1.0)
    model.add_input("push", "b", "x", relative_to="a")
    model.add_output("gap", "b", "x", relative_to="a")
    mbs = mx.to_exudyn(model, {"push": 0.5})
    simulated(mbs, 1.0, 2000)
    system = model.linearize()
    t = np.linspace(0.0, 1.0, 2001)
    expected = system.time_response(t, np.full((1, 2001), 0.5))[0]
    assert_allclose(np.interp(t, *stored(mbs, "gap")), expected, atol=2e-3 * np.abs(expected).max())


def test_what_exudyn_has_nothing_for_is_refused_by_name():
    for model, words in (
        (mv.library.cantilever(), "tube: flexible parts"), (mv.library.rotor_stator(), "exudyn has no rotor"),
        (mv.library.pendulum_chain(), "m1: a body without mass"), (mv.library.engine_on_mounts(), "mount1: a bushing"),
        (mv.library.inclined_chain().with_values({"spring2.stiffness": -1.0}), "spring2: .* below 0"),
        (held_by("screw", pitch=0.1, axis=(0, 0, 1)), "j: exudyn has no joint of the kind 'screw'"),
        (held_by("homokinetic", axis=(0, 0, 1)), "j: exudyn has no joint of the kind 'homokinetic'"),
        (held_by(None, free=("x", "rx", "rz")), "j: exudyn has no joint of the kind 'custom'"),
    ):  # fmt: skip
        with pytest.raises(mv.ExportError, match=words):
            mx.to_exudyn(model)
    with pytest.raises(mv.ExportError, match="'torque' is not an input of 'pendulum'; it has M, F"):
        mx.to_exudyn(pendulum(), {"torque": 1.0})
    with pytest.raises(mv.ExportError, match="expected a Model"):
        mx.to_exudyn(pendulum().linearize())
    with pytest.raises(mv.ExportError, match=r"inputs = 'pendulum\.py'; expected the values of inputs by name"):
        mx.to_exudyn(pendulum(), "pendulum.py")


def test_what_is_left_out_is_told():
    with pytest.warns(mv.LeftOutWarning, match="road"):
        mx.to_exudyn(mv.library.quarter_car())
