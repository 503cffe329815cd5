"""Gears, worms and racks in finite motion: whole turns count, whether their joints are cut or not."""

import numpy as np
import pytest

import mbsvib as mv
from mbsvib.equilibrium.motion import posed_model
from mbsvib.kinematics.couplings import joint_travel
from mbsvib.linalg.rotations import exponential
from tests.equilibrium.test_moved import four_bar
from tests.support.sizes import few


def turned(there, model, name):
    """The rotation of a body about z since ``model``."""
    relative = np.array(there.bodies[name].orientation) @ np.array(model.bodies[name].orientation).T
    return np.arctan2(relative[1, 0], relative[0, 0])


def gearbox(ratio):
    model = mv.Model("gearbox")
    for name, x in (("pinion", 0.0), ("wheel", 0.5)):
        model.add_body(name, 1.0, (0.1, 0.1, 0.1), (x + 0.01, 0, 0))
        model.add_joint(f"{name}.axle", "revolute", "ground", name, (x, 0, 0))
    model.add_gear("mesh", "pinion.axle", "wheel.axle", ratio)
    return model


@pytest.mark.parametrize("case", few([
    (0.5, -0.25), (0.5, -7.0), (-2.0, -0.25), (-2.0, -7.0), (20.0, -0.25), (20.0, -7.0),
], 5))  # fmt: skip
def test_gears_keep_their_ratio_over_many_turns(case):
    angle, ratio = case
    model = gearbox(ratio)
    there = model.moved({"pinion.axle.rz": angle})
    assert np.exp(1j * turned(there, model, "pinion")) == pytest.approx(np.exp(1j * angle), abs=1e-12)
    assert np.exp(1j * turned(there, model, "wheel")) == pytest.approx(np.exp(1j * ratio * angle), abs=1e-11)
    assert there.couplers == model.couplers
    assert there.linearize().dof == 1


def test_a_rack_goes_as_far_as_its_pinion_rolls():
    model = mv.Model("rack")
    model.add_body("pinion", 1.0, (0.1, 0.1, 0.1))
    model.add_body("rack", 1.0, (0.1, 0.1, 0.1), (0, -0.05, 0))
    model.add_joint("axle", "revolute", "ground", "pinion", (0, 0, 0))
    model.add_joint("rail", "prismatic", "ground", "rack", axis=(1, 0, 0))
    model.add_rack("teeth", "axle", "rail", 0.05)
    there = model.moved({"axle.rz": 9.0})
    assert there.bodies["rack"].position[0] == pytest.approx(0.45, abs=1e-14)
    back = there.moved({"rail.z": -0.45})
    assert np.allclose(back.bodies["pinion"].orientation, np.eye(3), rtol=0, atol=1e-13)


@pytest.mark.slow
def test_gears_on_the_joints_of_a_loop():
    """A wheel geared to the joint that the loop is cut at, or to one of the tree: the same wheel."""
    for pin in "ABCD":
        model, _ = four_bar()
        model.add_body("wheel", 1.0, (0.1, 0.1, 0.1), (0, 0, 1.0))
        model.add_joint("axle", "revolute", "ground", "wheel", (0, 0, 1.0))
        model.add_gear("mesh", f"{pin}.rz", "axle.rz", 3.0)
        there = model.moved({"A.rz": 2.5})
        part = model.joints[pin]
        angle = {"ground": 0.0} | {name: turned(there, model, name) for name in model.bodies}
        expected = 3.0 * (angle[part.second] - angle[part.first])
        assert np.exp(1j * angle["wheel"]) == pytest.approx(np.exp(1j * expected), abs=1e-11)


def test_the_worms_of_a_quadruped_turn_with_its_legs():
    model = mv.library.quadruped(worm_ratio=1 / 40)
    system = model.linearize()
    there = model.moved({"fl.gear1.rz": 0.1}, relaxed=True)
    system = there.linearize()
    assert system.dof == model.linearize().dof
    worm = model.couplers[next(name for name in model.couplers if name.startswith("fl") and "1" in name)]
    (shaft, first), (_, right) = worm.terms
    assert abs(right / first) == pytest.approx(40)
    body = model.joints[shaft.rpartition(".")[0]].second
    axis = np.array(there.joints[shaft.rpartition(".")[0]].axes)[:, 2]
    turn = np.array(there.bodies[body].orientation) @ np.array(model.bodies[body].orientation).T
    cosine = (np.trace(turn) - 1) / 2
    assert np.abs(turn @ axis - axis).max() < 1e-12
    assert cosine == pytest.approx(np.cos(4.0), abs=1e-12)


@pytest.mark.parametrize("angles", [(0.4, -0.7), (2.5, 1.0)])
def test_both_angles_of_a_universal_joint_are_read_off(angles):
    model = mv.Model()
    model.add_body("cross", 1.0, (0.1, 0.1, 0.1))
    first, second = np.array([1.0, 0.2, 0.0]), np.array([0.3, 1.0, 0.4])
    model.add_joint("u", "universal", "ground", "cross", (0, 0, 0), axis=first, axis2=second)
    there = posed_model(model).moved(np.array(angles))
    joint = model.joints["u"]
    unit = [v / np.linalg.norm(v) for v in (first, second)]
    expected = exponential(angles[0] * unit[0]) @ exponential(angles[1] * unit[1])
    assert np.allclose(there.pose.rotations[0], expected, rtol=0, atol=1e-15)
    assert [joint_travel(joint, d, there.pose) for d in ("rx", "ry")] == pytest.approx(angles, abs=1e-14)


def test_values_that_a_gear_ties_are_refused():
    with pytest.raises(mv.ModelError, match="loops and couplers leave no choice for pinion"):
        gearbox(2.0).moved({"pinion.axle.rz": 0.1, "wheel.axle.rz": 0.2})


@pytest.mark.slow
def test_a_motor_winds_a_spring_up_by_many_turns_of_its_pinion():
    model = gearbox(1 / 20)
    model.add_bushing("spring", "ground", "wheel", (0.5, 0, 0), (0, 0, 0, 0, 0, 10.0))
    model.add_load("motor", "pinion", torque=(0, 0, 0.25))
    result = model.equilibrium(report=True)
    assert len(result.load_steps) > 3
    there = result.model
    assert turned(there, model, "wheel") == pytest.approx(0.5, abs=1e-11)
    assert np.exp(1j * turned(there, model, "pinion")) == pytest.approx(np.exp(10j), abs=1e-10)
    assert there.linearize().K[0, 0] > 0


@pytest.mark.few(2)
@pytest.mark.parametrize("cut", ["output", "input"])
@pytest.mark.parametrize("angle", [0.6, 2.0, -4.5])
def test_a_wheel_behind_a_cardan_shaft(angle, cut):
    """tan(b) = tan(a) / cos(bend), on the same side of half a turn: no sum of steps of the angles, as in a train."""
    bend, ratio = 0.5, -3.0
    along = np.array((np.sin(bend), 0.0, np.cos(bend)))
    model = mv.Model("cardan")
    for name, at in (("first", (0, 0, -0.5)), ("second", 0.5 * along), ("wheel", (1.0, 0.0, 0.5))):
        model.add_body(name, 1.0, (0.1, 0.1, 0.1), at)
    model.add_joint("input", "revolute", "ground", "first", (0, 0, -1), axis=(0, 0, 1))
    model.add_joint("cross", "universal", "first", "second", (0, 0, 0), axis=(1, 0, 0), axis2=(0, 1, 0))
    model.add_joint("output", "cylindrical", "ground", "second", along, axis=along)
    model.add_joint("axle", "revolute", "ground", "wheel", (1.0, 0, 0), axis=(0, 0, 1))
    model.add_gear("mesh", "output.rz", "axle.rz", ratio)
    led = ("input.rz", angle) if cut == "output" else ("axle.rz", ratio * angle)
    there = model.moved(dict([led]), cut=[cut])
    x, y = np.cos(angle), np.sin(angle)
    if cut == "output":
        behind = np.arctan2(y, x * np.cos(bend))
        assert np.exp(1j * turned(there, model, "wheel")) == pytest.approx(np.exp(1j * ratio * behind), abs=1e-11)
    else:
        before = np.arctan2(y * np.cos(bend), x)
        assert np.exp(1j * turned(there, model, "first")) == pytest.approx(np.exp(1j * before), abs=1e-11)


@pytest.mark.parametrize(("free", "coordinate", "across", "along"), [
    (("rx", "ry", "rz"), "s.rx", {"s.ry": 0.7}, {"s.rx": 0.7}),
    (("x", "y", "z", "rx", "ry", "rz"), "s.rx", {"s.rz": 0.2}, {"s.z": 0.2}),
    (("rx", "rz"), "s.rx", {}, {"s.rz": 0.4, "s.rx": 0.3}),
    (("x", "z", "ry", "rz"), "s.x", {"s.ry": 0.5}, {"s.rz": 0.5}),
])  # fmt: skip
def test_couplers_are_refused_where_their_coordinate_is_another_one(free, coordinate, across, along):
    """Rates of a rotation vector are no angular velocities, and a second rotation turns the axes of translations."""
    model = mv.Model()
    model.add_body("b", 1.0, (0.1, 0.2, 0.25), (0.3, 0.1, 0.5))
    model.add_body("wheel", 1.0, (0.1, 0.1, 0.1), (1, 0, 0))
    model.add_joint("s", None, "ground", "b", (0, 0, 0), free=free)
    model.add_joint("axle", "revolute", "ground", "wheel", (1, 0, 0))
    model.add_coupler("c", {coordinate: 1.0, "axle.rz": -2.0})
    assert model.moved(along).linearize().dof == len(free)
    if across:
        for refused in (lambda: model.moved(across), lambda: model.family({name: [q] for name, q in across.items()})):
            with pytest.raises(mv.ModelError, match=f"coupler 'c': '{coordinate}' is .* which has turned by"):
                refused()
    assert model.replace("c", rates=True).moved(across).linearize().dof == len(free)
    if len(free) % 3 == 0:
        with pytest.raises(mv.ModelError, match=r"coupler 'c': joint 's' .* turns by a rotation vector"):
            model.cycle("axle.rz", [0.1], speed=1.0)


def test_the_inertia_of_a_drive_at_a_ball_joint_in_another_pose():
    """Three wheels that turn with the angular velocity add I to the inertia about the joint's axes in any pose."""
    model = mv.Model()
    model.add_body("b", 1.0, (0.1, 0.2, 0.25), (0.3, 0.1, 0.5))
    model.add_joint("s", "spherical", "ground", "b", (0, 0, 0))
    pose = {"s.rx": 0.5, "s.ry": -0.4, "s.rz": 0.8}
    alone = model.moved(pose).linearize().M
    for i, direction in enumerate(("rx", "ry", "rz")):
        model.add_body(f"wheel{i}", 1.0, (0.1, 0.1, 0.1), (1 + i, 0, 0))
        model.add_joint(f"axle{i}", "revolute", "ground", f"wheel{i}", (1 + i, 0, 0))
        model.add_coupler(f"c{i}", {f"s.{direction}": 2.0, f"axle{i}.rz": -1.0}, rates=True)
    M = model.moved(pose).linearize(["s.rx", "s.ry", "s.rz"]).M
    np.testing.assert_allclose(M, alone + 0.4 * np.eye(3), rtol=0, atol=1e-15)
    with pytest.raises(mv.ModelError, match=r"coupler 'c0': rates = True; expected .* False with a curvature"):
        model.replace("c0", curvature={"s.rx": 0.5})
