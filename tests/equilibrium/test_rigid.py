"""Beams and superelements that go along to another pose, and the preloads that hold them."""

import numpy as np
import pytest

import mbsvib as mv
from tests.superelements.craig_bampton import NODES, reduced

G = 9.81


def turn(angle):
    c, s = np.cos(angle), np.sin(angle)
    return np.array([[c, 0, s], [0, 1, 0], [-s, 0, c]])


def arm(angle=0.0, gravity=None, **words):
    """A flexible link between a hub on a motor and a gripper, built at an angle of the motor."""
    axes = turn(angle)
    model = mv.Model("arm", gravity=gravity)
    model.add_body("hub", 1.5, (0.002, 0.003, 0.004), orientation=axes)
    model.add_joint("motor", "revolute", "ground", "hub", (0, 0, 0), axis=(0, 1, 0))
    model.add_bushing("k", "ground", "hub", (0, 0, 0), (0, 0, 0, 0, 50.0, 0))
    model.add_body("grip", 0.3, (1e-3, 2e-3, 3e-3), axes @ [0.9, 0, 0.02], orientation=axes)
    words = words or {"start": (0, 0, 0), "end": axes @ [0.9, 0, 0], "elements": 4}
    model.add_beam("bar", "hub", "grip", {"type": "rectangle", "width": 0.01, "height": 0.03},
                   {"E": 7e10, "nu": 0.33, "rho": 2700.0}, **words)  # fmt: skip
    model.add_input("torque", "hub", "ry")
    model.add_output("middle", "bar.2", (0, 0, 1.0))
    model.add_output("jaw", "grip", (1.0, 0, 0), position=axes @ [1.0, 0, 0])
    return model


@pytest.mark.parametrize("angle", [0.4, -2.5])
def test_a_flexible_arm_in_another_pose(angle):
    """The same as one that is built there: its y axis, which followed from the horizontal, goes along."""
    there, built = arm().moved({"motor.rz": angle}, relaxed=True), arm(angle, start=(0, 0, 0),
                                                                       end=turn(angle) @ [0.9, 0, 0], elements=4,
                                                                       y_axis=(0, 1, 0))  # fmt: skip
    np.testing.assert_allclose(there.beams["bar"].end, built.beams["bar"].end, atol=1e-15)
    result, expected = (model.linearize().frequency_response([3.0, 100.0]) for model in (there, built))
    assert np.abs(result - expected).max() < 1e-12 * np.abs(expected).max()
    back = there.moved({"motor.rz": -angle}, relaxed=True)
    np.testing.assert_allclose(back.beams["bar"].points, arm().beams["bar"].points, atol=1e-15)


def test_the_torque_that_holds_an_arm_is_its_weights_moment():
    angle, line = 0.3, 2700 * 0.01 * 0.03
    with pytest.raises(mv.EquilibriumError, match=r"'motor\.rz'"):
        arm(angle, (0, 0, -G)).linearize()
    held = arm(angle, (0, 0, -G)).equilibrium(preload="k")
    moment = (line * 0.9**2 / 2 + 0.3 * 0.9) * G * np.cos(angle) + 0.3 * G * 0.02 * np.sin(angle)
    np.testing.assert_allclose(held.springs["k"].preload, (0, 0, 0, 0, -moment, 0), rtol=1e-13, atol=1e-13)
    assert held.beams == arm(angle, (0, 0, -G)).beams
    report = arm(0.0, (0, 0, -G)).moved({"motor.rz": angle}).equilibrium(preload=True, report=True)
    np.testing.assert_allclose(report.model.linearize().modes().natural, held.linearize().modes().natural, rtol=1e-11)
    bent = held.equilibrium(report=True)
    assert 1e-5 < abs(bent.displacements["hub"][4]) < 1e-2
    assert bent.model.beams["bar"].displacements is not None


@pytest.mark.parametrize("static", [0.0, 40.0])
def test_an_element_that_relaxes_holds_nothing_beside_a_beam(static):
    angle = 0.3
    plain, relaxing = arm(angle, (0, 0, -G)), arm(angle, (0, 0, -G))
    relaxing.add_maxwell("leg", "ground", "grip", (0.5, 0, 1), relaxing.bodies["grip"].position, 100.0, 5.0, static)
    held, beside = (model.equilibrium(preload="k") for model in (plain, relaxing))
    np.testing.assert_allclose(beside.springs["k"].preload, held.springs["k"].preload, rtol=1e-14)
    assert beside.springs["leg"] == relaxing.springs["leg"]
    assert beside.linearize().dof == held.linearize().dof + 1


def test_bent_lines_of_nodes():
    """Elements go along in one plane, and in space, where each has a horizontal y axis of its own."""
    plane = arm(nodes=[(0, 0, 0), (0.4, 0, 0.1), (0.6, 0, 0), (0.9, 0, 0)])
    there = plane.moved({"motor.rz": 0.4}, relaxed=True)
    np.testing.assert_allclose(there.beams["bar"].points, np.array(plane.beams["bar"].points) @ turn(0.4).T, atol=1e-15)
    np.testing.assert_allclose(there.linearize().modes().natural, plane.linearize().modes().natural, rtol=1e-12)
    space = arm(nodes=[(0, 0, 0), (0.4, 0.1, 0.1), (0.6, -0.1, 0.3), (0.9, 0, 0)])
    there = space.moved({"motor.rz": 0.4}, relaxed=True)
    assert np.shape(there.beams["bar"].y_axis) == (3, 3)
    np.testing.assert_allclose(there.linearize().modes().natural, space.linearize().modes().natural, rtol=1e-12)


def test_a_beam_that_would_have_to_bend():
    model = arm(start=(0, 0, 0), end=(0.9, 0, 0), elements=4, second_order=False)
    model.add_joint("clamp", "fixed", "ground", "grip", (0.9, 0, 0))
    with pytest.raises(mv.ModelError, match="leave no choice"):
        model.moved({"motor.rz": 0.04}, relaxed=True)
    there = model.moved({"motor.rz": 0.04})
    np.testing.assert_allclose(there.bodies["hub"].orientation, turn(0.04), atol=1e-12)
    np.testing.assert_allclose(there.bodies["grip"].position, (0.9, 0, 0.02), atol=1e-12)
    # the cubic through one clamped end and another that is turned, in axes that turn with the hub
    x, middle = 0.9 * np.array([0.25, 0.5, 0.75]), np.array(there.beams["bar"].points)[1:-1, 2]
    slope, length = np.tan(0.04), 0.9
    np.testing.assert_allclose(middle, -slope * x * (1 - x / length) ** 2, rtol=2e-2)
    assert there.springs["k"].preload[4] == pytest.approx(-50.0 * 0.04)


def test_superelements_turn_their_axes():
    model = mv.Model("swing")
    model.add_body("hub", 1.5, (0.002, 0.003, 0.004))
    model.add_joint("motor", "revolute", "ground", "hub", (0, 0, 0), axis=(0, 1, 0))
    model.add_bushing("k", "ground", "hub", (0, 0, 0), (0, 0, 0, 0, 50.0, 0))
    mass, stiffness = reduced(4)
    nodes = {"left": NODES[0], "right": NODES[-1]}
    model.add_superelement("flex", mass, None, stiffness, nodes=nodes, bodies={"left": "hub"})
    there = model.moved({"motor.rz": 0.7}, relaxed=True)
    np.testing.assert_allclose(there.linearize().modes().natural, model.linearize().modes().natural, rtol=1e-9)
    np.testing.assert_allclose(dict(there.superelements["flex"].nodes)["right"], turn(0.7) @ NODES[-1], atol=1e-14)


def test_preloads_beside_outputs_of_forces_in_beams():
    """What outputs and inputs refer to makes no difference to the preloads."""
    plain, seen = arm(gravity=(0, 0, -G)), arm(gravity=(0, 0, -G))
    seen.add_force_output("bent", "bar.e1", "ry")
    result, expected = (model.equilibrium(preload=True) for model in (seen, plain))
    assert result.springs["k"].preload == expected.springs["k"].preload
    assert "bent" in result.linearize().outputs
