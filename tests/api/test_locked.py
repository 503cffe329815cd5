"""Mechanisms without degree of freedom: every question has an answer, and every response is the matrix D."""

import inspect

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

import mbsvib as mv
from mbsvib.api.batch import Batch
from mbsvib.api.sparse_system import SparseSystem
from mbsvib.cli import _looking

OMEGA, TIME = np.array([0.0, 1.0, 30.0]), np.linspace(0.0, 1.0, 5)


def locked(inputs=True, outputs=True, element=None, joint_force=True, gravity=None):
    """Two welded bodies; an element between the second one and the ground."""
    model = mv.Model("locked", gravity=gravity)
    model.add_body("a", 2.0, (1, 1, 1), position=(0, 0, 1))
    model.add_body("b", 3.0, (1, 1, 1), position=(0, 1, 1))
    model.add_joint("foot", "fixed", "ground", "a")
    model.add_joint("weld", "fixed", "a", "b")
    if element == "spring":
        model.add_spring("leg", "ground", "b", start=(0, 0, 0), end=(0, 1, 1), stiffness=3.0, damping=1.0)
    elif element == "maxwell":
        model.add_maxwell("leg", "ground", "b", (0, 0, 0), (0, 1, 1), stiffness=3.0, damping=5.0, static_stiffness=2.0)
    elif element == "rotor":
        model.add_rotor("leg", "b", axis=(0, 0, 1), inertia=0.1, speed=10.0)
    if inputs:
        model.add_input("F", "b", "z")
        model.add_base_motion("floor", "z")
    if outputs:
        model.add_output("x", "b", "z")
        model.add_output("v", "b", "z", quantity="velocity")
        model.add_output("acc", "b", "z", quantity="acceleration")
        if joint_force:
            model.add_force_output("f", "foot", "z")
        if element in ("spring", "maxwell"):
            model.add_force_output("leg.force", "leg")
    return model


def triangle():
    """A body on two hinges that lock each other."""
    model = mv.Model("triangle")
    model.add_body("a", 2.0, (1, 1, 1), position=(0, 0, 1))
    model.add_joint("j", "revolute", "ground", "a", position=(0, 0, 0), axis=(1, 0, 0))
    model.add_joint("k", "revolute", "ground", "a", position=(0, 1, 1), axis=(1, 0, 0))
    model.add_input("F", "a", "z")
    model.add_output("x", "a", "z")
    return model


def on_a_spring():
    """A body without mass on a spring, which follows at once."""
    model = mv.Model("node")
    model.add_body("n", 0.0, (0, 0, 0), position=(0, 0, 1))
    model.add_joint("rail", "prismatic", "ground", "n")
    model.add_spring("k", "ground", "n", start=(0, 0, 0), end=(0, 0, 1), stiffness=4.0)
    model.add_input("F", "n", "z")
    model.add_output("x", "n", "z")
    model.add_force_output("f", "k")
    return model


def hung():
    """The welded bodies under their weight and a load."""
    model = locked(gravity=(0, 0, -9.81))
    model.add_load("push", "b", force=(1, 2, 3), torque=(0.1, 0, 0))
    return model


SCENES = {
    "locked": locked, "spring": lambda: locked(element="spring"), "maxwell": lambda: locked(element="maxwell"),
    "rotor": lambda: locked(element="rotor"), "no inputs": lambda: locked(inputs=False, element="maxwell"),
    "no outputs": lambda: locked(outputs=False, element="maxwell"), "neither": lambda: locked(False, False),
    "triangle": triangle, "node": on_a_spring, "hung": hung,
}  # fmt: skip
FEEDTHROUGH = {
    "locked": [[0, 0], [0, 0], [0, 1], [1, -5]], "triangle": [[0]], "node": [[0.25], [1]],
    "maxwell": [[0, 0], [0, 0], [0, 1], [1, -5], [0, 0]],
}  # fmt: skip


def steps(system, **more):
    return system.time_response(TIME, np.ones((len(system.inputs), 5)), **more)


def finite_h2_norm(system):
    """It is infinite where an output sees an input at once."""
    if not (system.inputs and system.outputs and system.D.any()):
        return system.h2_norm()
    with pytest.raises(mv.ResponseError, match="at once, so that the norm is infinite"):
        return system.h2_norm()


def linear_range(system):
    """Motions without mass have none."""
    if not system.dof:
        return system.linear_range()
    with pytest.raises(mv.ModelError, match="give every motion a mass"):
        return system.linear_range()


def noise(system):
    return dict.fromkeys(system.inputs, 1.0)


def uncertain_masses(system):
    """A mass matters to the force in the foot alone."""
    if "f" not in system.outputs or "floor" not in system.inputs:
        without_mass = "n.mass" in system.parameters  # 0, which is no value between 0 and 10
        with pytest.raises(mv.ModelError, match="limits on both sides" if without_mass else "changes nothing"):
            system.uncertain({"*.mass": (0.0, 10.0) if without_mass else 0.1})
        return None
    plant = system.uncertain({"*.mass": 0.1})
    results = plant, plant.robust_stability(), plant.worst_gain(), plant.worst_rms("x", noise(system))
    return [str(result) for result in results]


VERBS = {
    "modes": lambda s: [str(s.modes()), s.modes(1), s.modes(2, near=3.0), s.modes(rtol=1e-13), s.modes().table()],
    "poles": lambda s: s.poles(),
    "frequency_response": lambda s: [s.frequency_response(OMEGA), s.frequency_response([])],
    "time_response": lambda s: [steps(s), steps(s, hold="zero"), steps(s, initial=(np.zeros(s.dof), np.zeros(s.dof)))],
    "linear_range": lambda s: str(linear_range(s)),
    "step_info": lambda s: str(s.step_info()),
    "transmission_zeros": lambda s: [s.transmission_zeros(), s.transmission_zeros(None, s.inputs[-1:])],
    "frequency_grid": lambda s: [s.frequency_grid(), s.frequency_grid(s.outputs[:1], s.inputs[:1], 5, f_min=1.0)],
    "with_ports": lambda s: [s.with_ports(), s[:, :], s[s.outputs[:1], s.inputs[:1]].frequency_response(OMEGA)],
    "feedback": lambda s: s.feedback(np.zeros((len(s.inputs), len(s.outputs))), s.outputs, s.inputs).poles(),
    "reduced": lambda s: [s.reduced(error=1.0), s.reduced(len(s.poles()))],
    "reachable": lambda s: [s.reachable(), s.reachable(s.outputs[:1], s.inputs[:1])],
    "state_space": lambda s: [s.state_space(name) for name in ("physical", "modal", "balanced")],
    "reactions": lambda s: s.reactions,
    "stiffness_shares": lambda s: str(s.stiffness_shares()),
    "explain": lambda s: s.explain(),
    "displacements": lambda s: [s.displacements(np.zeros(s.dof)), s.displacements(np.zeros((s.dof, 3)))],
    "eigenvalue_sensitivities": lambda s: s.eigenvalue_sensitivities(),
    "mode_sensitivities": lambda s: s.mode_sensitivities(),
    "frequency_response_sensitivities": lambda s: s.frequency_response_sensitivities(OMEGA),
    "time_response_sensitivities": lambda s: s.time_response_sensitivities(TIME, np.ones((len(s.inputs), 5))),
    "compliance_sensitivities": lambda s: s.compliance_sensitivities(),
    "matrix_derivatives": lambda s: s.matrix_derivatives(),
    "h2_norm": finite_h2_norm,
    "hinf_norm": lambda s: s.hinf_norm(),
    "psd": lambda s: s.psd(None, noise(s), [1.0, 2.0]),
    "rms": lambda s: [s.rms(None, noise(s)), s.rms(None, noise(s), band=(1.0, 10.0))],
    "budget": lambda s: str(s.budget(noise(s), band=(1.0, 10.0))),
    "uncertain": lambda s: uncertain_masses(s),
    "deflection_shape": lambda s: str(s.deflection_shape(3.0)),
    "mode_contributions": lambda s: s.mode_contributions(OMEGA),
}  # fmt: skip
# What needs an input and an output.
OF_PORTS = {"reachable", "frequency_response_sensitivities", "compliance_sensitivities", "h2_norm", "hinf_norm",
            "psd", "rms", "budget"}  # fmt: skip


NO_PORTS = (r"no (in|out)puts are asked for, which leaves nothing of 'locked'|'locked' has no outputs; add one by"
            r"|expected the density of each input that is driven")  # fmt: skip


def verbs(kind):
    return {name for name, item in inspect.getmembers(kind, inspect.isfunction) if not name.startswith("_")}


@pytest.mark.few(1)
@pytest.mark.parametrize("scene", SCENES)
def test_every_question_has_an_answer(scene):
    system = SCENES[scene]().linearize()
    ports = bool(system.inputs and system.outputs)
    for verb, ask in VERBS.items():
        if ports or verb not in OF_PORTS:
            ask(system)
            continue
        with pytest.raises(mv.ResponseError, match=NO_PORTS):
            ask(system)


def test_no_question_is_missing():
    assert verbs(mv.System) <= set(VERBS)


@pytest.mark.few(1)
@pytest.mark.parametrize("name", FEEDTHROUGH)
def test_responses_are_those_of_the_feedthrough(name):
    system, d = SCENES[name]().linearize(), np.array(FEEDTHROUGH[name], dtype=float)
    assert_allclose(system.D, d, rtol=1e-15)
    assert_allclose(system.frequency_response(OMEGA), np.repeat(d[:, :, None], 3, axis=2), rtol=1e-14)
    u = np.stack([np.sin(TIME + i) for i in range(d.shape[1])])
    assert_allclose(system.time_response(TIME, u), d @ u, rtol=1e-14)
    assert system.hinf_norm().value == pytest.approx(np.linalg.norm(d, 2), rel=1e-14)
    for o, i in np.argwhere(d):  # what no input reaches
        zeros = system.transmission_zeros(system.outputs[o], system.inputs[i])
        assert_allclose(zeros, system.poles(), rtol=1e-14)
    if not d[0, 0] and len(system.poles()):
        with pytest.raises(mv.ResponseError, match="x does not respond to F, so that every s is a zero"):
            system.transmission_zeros("x", "F")
    for realization in ("physical", "modal", "balanced"):
        assert_allclose(system.state_space(realization).D, d, rtol=1e-14)


def test_derivatives_are_those_of_the_feedthrough():
    """The foot carries F - 5 a; the node yields F / k."""
    system = SCENES["locked"]().linearize()
    assert_allclose(system.frequency_response_sensitivities([3.0], ["b.mass"])[0, 3, :, 0], [0.0, -1.0])
    assert_allclose(system.time_response_sensitivities(TIME, np.ones((2, 5)), ["b.mass"])[0, 3], -1.0)
    node = on_a_spring().linearize()
    assert_allclose(node.compliance_sensitivities(["k.stiffness"])[0, :, 0], [-1.0 / 16.0, 0.0], atol=1e-14)
    assert_allclose(node.hinf_norm("x", "F", ["k.stiffness"]).slopes, [-1.0 / 16.0])


def test_an_element_on_a_locked_body_relaxes_by_itself():
    system = SCENES["maxwell"]().linearize()
    modes = system.modes()
    assert_allclose(system.poles(), [-3.0 / 5.0], rtol=1e-14)
    assert_array_equal(modes.kinetic_energy["a"], [0.0])
    assert system.h2_norm(["x", "leg.force"], "F", []).value == 0.0
    record = _looking._columns(modes)
    assert (record["real_1"], record["real_2"]) == ([pytest.approx(-0.6)], [None])


def test_variants():
    batch = locked(joint_force=False).linearize(values={"a.mass": [1.0, 2.0, 3.0]})
    asked = {
        "modes": lambda: [batch.modes(), batch.modes(rtol=1e-13), batch.modes()[1]],
        "frequency_response": lambda: batch.frequency_response(OMEGA),
        "time_response": lambda: batch.time_response(TIME, np.ones((2, 5))),
        "state_space": lambda: [batch.state_space(name) for name in ("physical", "modal", "balanced")],
        "displacements": lambda: [batch.displacements(np.zeros(0)), batch.displacements(np.zeros((3, 0)))],
        "explain": batch.explain, "slice": lambda: batch.slice(0, 2).modes(),
    }  # fmt: skip
    assert verbs(Batch) == set(asked)
    for ask in asked.values():
        ask()
    assert_allclose(asked["frequency_response"](), np.broadcast_to(batch.D[..., None], (3, 3, 2, 3)))
    assert {motion.shape for motion in asked["displacements"]()[0].values()} == {(3, 6)}


@pytest.mark.slow
def test_sparse():
    model = locked()
    sparse, dense = model.linearize(method="sparse"), model.linearize()
    assert_allclose(sparse.frequency_response(OMEGA), dense.frequency_response(OMEGA), rtol=1e-14)
    assert_allclose(sparse.static_compliance(), dense.D, rtol=1e-14)
    assert sparse.reachable().dof == 0
    part = sparse[sparse.outputs[:1], sparse.inputs[1:]]
    assert_allclose(part.frequency_response(OMEGA), dense.frequency_response(OMEGA)[:1, 1:], rtol=1e-14)
    assert "locked" in sparse.explain()
    u = np.ones((2, 5))
    for ask in (lambda: sparse.modes(1), lambda: sparse.reduced(1), lambda: sparse.state_space(modes=1),
                lambda: sparse.time_response(TIME, u, modes=1), lambda: sparse.mode_sensitivities(modes=1)):
        with pytest.raises(mv.ResponseError, match="'locked' is fully locked: it has no modes"):
            ask()
    asked = {"modes", "reduced", "state_space", "time_response", "frequency_response", "static_compliance", "reachable",
             "explain", "mode_sensitivities", "with_ports"}  # fmt: skip
    assert verbs(SparseSystem) == asked | {"truncation_error"}


@pytest.mark.slow
def test_worst_gain_is_that_of_the_largest_masses():
    """The foot carries F - m a, the masses are at most 2.2 and 3.3 kg; nothing moves, so that nothing is unstable."""
    plant = locked().linearize().uncertain({"*.mass": 0.1})
    worst, expected = plant.worst_gain(), np.linalg.norm([[0, 1], [1, -5.5]], 2)
    assert worst.lower == pytest.approx(expected, rel=1e-12)
    assert expected <= worst.upper <= 1.002 * expected
    assert plant.robust_stability().upper == np.inf
