"""Inputs, base motions, outputs and force outputs."""

from dataclasses import FrozenInstanceError

import numpy as np
import pytest

import mbsvib as mv
from tests.support.arm import arm


@pytest.mark.parametrize(("direction", "wrench"), [
    ("x", (1, 0, 0, 0, 0, 0)), ("y", (0, 1, 0, 0, 0, 0)), ("z", (0, 0, 1, 0, 0, 0)),
    ("rx", (0, 0, 0, 1, 0, 0)), ("ry", (0, 0, 0, 0, 1, 0)), ("rz", (0, 0, 0, 0, 0, 1)),
    ((1, 2, 3), (1, 2, 3, 0, 0, 0)), ([0, 0, -2.5], (0, 0, -2.5, 0, 0, 0)),
    (np.arange(6.0), (0, 1, 2, 3, 4, 5)),
])  # fmt: skip
def test_directions_are_names_or_vectors_applied_as_given(direction, wrench):
    model = arm()
    parts = [
        model.add_input("p", "hand", direction), model.add_base_motion("q", direction),
        model.add_output("p", "hand", direction), model.add_force_output("q", "mount", direction),
    ]  # fmt: skip
    for part in parts:
        assert part.wrench == wrench
        assert part.direction == (direction if isinstance(direction, str) else wrench)


@pytest.mark.parametrize(("quantity", "relative_to", "absolute", "inertial"), [
    ("displacement", "ground", None, False), ("velocity", "ground", None, False),
    ("acceleration", "ground", None, True), ("acceleration", "arm", None, False),
    ("acceleration", "ground", False, False), ("acceleration", "ground", True, True),
])  # fmt: skip
def test_accelerations_are_absolute_unless_said_otherwise(quantity, relative_to, absolute, inertial):
    output = arm().add_output("p", "hand", "x", relative_to=relative_to, quantity=quantity, absolute=absolute)
    assert output.inertial is inertial


@pytest.mark.parametrize("quantity", ["displacement", "velocity"])
def test_only_accelerations_can_be_absolute_when_the_base_moves(quantity):
    """The input is an acceleration and is never integrated: an absolute displacement would be a wrong answer."""
    model = arm()
    model.add_output("p", "hand", "x", quantity=quantity, absolute=True)
    with pytest.raises(mv.ModelError, match=r"'p'.*absolute"):
        model.linearize()


def test_bodies_and_elements_by_name_or_by_object():
    model = arm()
    hand, strut = model.bodies["hand"], model.springs["strut"]
    assert model.add_input("p", hand, "x", relative_to=model.bodies["arm"]).relative_to == "arm"
    assert model.add_output("p", hand, "x").body == "hand"
    assert model.add_force_output("q", strut).element == "strut"


@pytest.mark.parametrize("form", [tuple, list, np.array])
def test_positions_as_lists_tuples_and_arrays(form):
    assert arm().add_input("p", "hand", "x", position=form([1, 2, 3])).position == (1.0, 2.0, 3.0)


def test_words_give_the_call_back():
    model = arm()
    calls = {
        "add_input": {"name": "p", "body": "hand", "direction": "x", "position": (1.0, 2.0, 3.0), "relative_to": "arm"},
        "add_base_motion": {"name": "q", "direction": "ry", "position": (1.0, 2.0, 3.0)},
        "add_output": {"name": "p", "body": "hand", "direction": (0.0, 0.0, 2.0, 0.0, 0.0, 0.0),
                       "quantity": "acceleration", "absolute": False},
        "add_force_output": {"name": "q", "element": "mount", "direction": "rz"},
    }  # fmt: skip
    for adder, words in calls.items():
        assert getattr(model, adder)(**words).constructor_kwargs() == words


def test_ports_are_immutable():
    model = arm()
    for part in (*model.inputs.values(), *model.outputs.values()):
        with pytest.raises(FrozenInstanceError):
            part.direction = "y"


def pan_and_lift(inertia=0.3):
    """Two hinges, each with its torque and angle; the second turns a sphere about an axis that the first turns."""
    model = mv.Model("pan_and_lift")
    for first, second, axis in (("ground", "pan", (0, 0, 1)), ("pan", "lift", (0, 1, 0))):
        model.add_body(second, 2.0, (inertia, inertia, inertia))
        model.add_joint(f"{second}.hinge", "revolute", first, second, (0, 0, 0), axis=axis)
        model.add_input(f"{second}.torque", second, (0, 0, 0, *axis), relative_to=first)
        model.add_output(f"{second}.angle", second, (0, 0, 0, *axis), relative_to=first)
    return model


def test_directions_of_ports_turn_with_the_body_to_which_they_are_relative():
    """Torque and angle of a hinge are those of its coordinate in all poses."""
    model, angles = pan_and_lift(), [0.0, 1.5]
    model.add_input("push", "lift", "x")
    family = model.family({"pan.hinge.rz": angles})
    plant = model.compile(["lift.mass"], pose=["pan.hinge.rz"])
    for i, angle in enumerate(angles):
        there = model.moved({"pan.hinge.rz": angle})
        for system in (family[i], there.linearize(), plant.system([2.0, angle])):
            assert system.coordinates == ("pan.hinge.rz", "lift.hinge.rz")
            np.testing.assert_allclose(system.B[:, :2], np.eye(2), rtol=0, atol=1e-15)
            np.testing.assert_allclose(system.Cq, np.eye(2), rtol=0, atol=1e-15)
        assert there.inputs["push"].direction == "x"


@pytest.mark.slow
def test_directions_of_ports_turn_in_runs():
    model = pan_and_lift()
    run = model.simulate([0.0, 0.5], {"lift.torque": [0.6, 0.6]}, initial={"pan.hinge.rz": 1.5})
    np.testing.assert_allclose(run["lift.angle"][-1], 0.5 * 0.6 / 0.3 * 0.5**2, rtol=1e-7)
    np.testing.assert_allclose(run["pan.angle"], 1.5, rtol=1e-12)
