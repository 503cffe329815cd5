"""Robots from URDF files against closed forms and the same robots built by hand."""

from pathlib import Path

import numpy as np
import pytest

import mbsvib as mv

ARM = Path(__file__).parents[2] / "examples" / "robots" / "arm.urdf"


def link(name, mass=None, at="0 0 0", rpy="0 0 0", inertia=(1.0, 1.0, 1.0, 0.0, 0.0, 0.0)):
    if mass is None:
        return f'<link name="{name}"/>'
    tensor = " ".join(f'{key}="{value}"' for key, value in zip(("ixx", "iyy", "izz", "ixy", "ixz", "iyz"), inertia,
                                                               strict=True))  # fmt: skip
    return (f'<link name="{name}"><inertial><origin xyz="{at}" rpy="{rpy}"/><mass value="{mass}"/><inertia {tensor}/>'
            f"</inertial></link>")  # fmt: skip


def joint(name, kind, parent, child, at="0 0 0", rpy="0 0 0", axis="0 0 1", more=""):
    return (f'<joint name="{name}" type="{kind}"><parent link="{parent}"/><child link="{child}"/>'
            f'<origin xyz="{at}" rpy="{rpy}"/><axis xyz="{axis}"/>{more}</joint>')  # fmt: skip


def test_a_pendulum_swings_as_it_should(robot):
    path = robot(link("base") + link("rod", 2.0, "0 0 -0.4", inertia=(0.03, 0.03, 0.001, 0, 0, 0))
                 + joint("hinge", "revolute", "base", "rod", axis="0 1 0"))  # fmt: skip
    system = mv.load_urdf(path, gravity=(0, 0, -9.81)).linearize()
    expected = np.sqrt(2.0 * 9.81 * 0.4 / (0.03 + 2.0 * 0.4**2)) / (2 * np.pi)
    np.testing.assert_allclose(system.modes().frequencies, [expected], rtol=1e-13)
    assert (system.name, system.inputs, system.outputs) == ("robot", ("hinge.torque",), ("hinge.angle",))
    path.write_text(path.read_text(encoding="utf-8").replace(' name="robot"', ""), encoding="utf-8")
    assert mv.load_urdf(path).name == "robot"
    assert system.frequency_response([0.0])[0, 0, 0].real == pytest.approx(1.0 / (2.0 * 9.81 * 0.4), rel=1e-12)


def test_the_same_arm_by_denavit_and_hartenberg(robot):
    """Three revolute joints with turned axes, in a pose."""
    inertia = (0.02, 0.03, 0.02, 0.002, 0.001, -0.003)
    tensor = (0.02, 0.03, 0.02, 0.002, 0.001, -0.003)
    q, twist, length = (0.3, -0.7, 1.1), (0.5, -1.2, 0.4), (0.2, 0.4, 0.3)
    words, rows = link("base"), []
    for i in range(3):
        # frame i + 1 of Denavit and Hartenberg carries link i; that of URDF lies in the joint, so links lie beyond it
        before = f'{length[i - 1]} 0 0" rpy="{twist[i - 1]} 0 0' if i else '0 0 0" rpy="0 0 0'
        at, rpy = before.split('" rpy="')
        words += link(f"l{i}", 1.0 + i, f"{length[i]} 0 0", f"{twist[i]} 0 0", inertia)
        words += joint(f"j{i}", "continuous", f"l{i - 1}" if i else "base", f"l{i}", at, rpy)
        rows.append({"a": length[i], "alpha": twist[i], "theta": q[i], "mass": 1.0 + i, "inertia": tensor})
    ours = mv.load_urdf(robot(words), pose={f"j{i}": q[i] for i in range(3)}).linearize()
    other = mv.from_dh(rows).linearize()
    np.testing.assert_allclose(ours.M, other.M, rtol=1e-12, atol=1e-14)
    np.testing.assert_allclose(ours.B, other.B, atol=1e-14)


def test_angles_in_degrees_are_doubted(robot):
    path = robot(link("base") + link("l", 1.0) + link("s", 1.0) + joint("j", "continuous", "base", "l")
                 + joint("along", "prismatic", "l", "s"))  # fmt: skip
    doubt = "'j.rz' is displaced by 30 rad, 4.77 turns; is it in rad, not in degrees?"
    assert mv.load_urdf(path, pose={"j": 30.0, "along": 20.0}).doubts == (doubt,)
    assert mv.load_urdf(path, pose={"j": 0.5}).doubts == ()


def test_origins_turn_by_quaternions(robot):
    """A turn of 2 atan(1/2) about (1, 2, 2) / 3, of which the axes are rational."""
    words = link("base") + link("b", 1.0) + joint("j", "revolute", "base", "b", at='0 0 0" quat_xyzw="1 2 2 6')
    path = robot(words.replace(' rpy="0 0 0"', ""))
    turned = np.array(mv.load_urdf(path).joints["j"].axes)[:, 2]
    np.testing.assert_allclose(turned, np.array((28, -4, 35)) / 45, atol=1e-15)
    with pytest.raises(mv.ModelError, match=r"robot\.urdf: joint 'j': origin has both rpy and quat_xyzw"):
        mv.load_urdf(robot(words))


def test_fixed_joints_make_one_body(robot):
    path = robot(link("base") + link("foot", 5.0) + link("a", 2.0, "1 0 0") + link("b", 3.0, "0 0 0")
                 + joint("bolt", "fixed", "base", "foot", "0 0 -1")
                 + joint("slide", "prismatic", "foot", "a", axis="2 0 0")
                 + joint("weld", "fixed", "a", "b", "0 2 0", "0 0 1.5707963267948966"))  # fmt: skip
    model = mv.load_urdf(path, pose={"slide": 0.5}, stiffness=100.0, tip="b")
    assert list(model.bodies) == ["a"]
    body = model.bodies["a"]
    assert body.mass == 5.0
    # 2 kg at (1.5, 0), 3 kg at (0.5, 2) and one metre below the base
    np.testing.assert_allclose(body.position, (0.9, 1.2, -1.0), atol=1e-15)
    reduced = 2.0 * 3.0 / 5.0
    expected = (2 + reduced * 4, 2 + reduced, 2 + reduced * 5, reduced * 2)
    np.testing.assert_allclose(body.inertia[:4], expected, atol=1e-14)
    system = model.linearize()
    np.testing.assert_allclose(system.modes().frequencies, [np.sqrt(100.0 / 5.0) / (2 * np.pi)], rtol=1e-14)
    assert system.inputs[0] == "slide.force"
    assert system.outputs[:2] == ("slide.travel", "b.x")


def test_mimicking_joints_follow(robot):
    follows = '<mimic joint="l" multiplier="-2" offset="0.1"/>'
    path = robot(link("base") + link("left", 1.0) + link("right", 1.0)
                 + joint("l", "prismatic", "base", "left", axis="1 0 0")
                 + joint("r", "prismatic", "base", "right", axis="1 0 0", more=follows))  # fmt: skip
    model = mv.load_urdf(path, pose={"l": 0.2}, stiffness={"l": 10.0})
    np.testing.assert_allclose(model.bodies["right"].position, (-0.3, 0, 0), atol=1e-15)
    system = model.linearize()
    assert system.dof == 1
    np.testing.assert_allclose(system.modes().frequencies, [np.sqrt(10.0 / 5.0) / (2 * np.pi)], rtol=1e-14)


def test_joints_that_mimic_what_is_constant_are_held(robot):
    """Of a fixed joint q = offset, and with the factor 0 too: c hangs on b, 0.4 rad on, d on c, 0.1 + 2 * 0.4 m on."""
    follows = '<mimic joint="{}" multiplier="{}" offset="{}"/>'
    path = robot(link("base") + link("a", 1.0) + link("b", 1.0) + link("c", 1.0, "1 0 0") + link("d", 1.0)
                 + joint("j", "prismatic", "base", "a") + joint("bolt", "fixed", "a", "b")
                 + joint("e", "revolute", "b", "c", more=follows.format("bolt", 3, 0.4))
                 + joint("f", "prismatic", "c", "d", axis="1 0 0", more=follows.format("e", 2, 0.1)))  # fmt: skip
    model = mv.load_urdf(path, pose={"j": 0.5})
    assert list(model.bodies) == ["a"]
    turned = np.array((np.cos(0.4), np.sin(0.4), 0))
    np.testing.assert_allclose(model.bodies["a"].position, (turned + 0.9 * turned) / 4 + (0, 0, 0.5), atol=1e-15)
    path.write_text(path.read_text().replace('type="fixed"', 'type="revolute"').replace('multiplier="3"',
                                                                                        'multiplier="0"'))  # fmt: skip
    model = mv.load_urdf(path)
    assert (list(model.bodies), list(model.joints)) == (["a", "b"], ["j", "bolt"])
    path.write_text(path.read_text().replace('"bolt" type="revolute"', '"bolt" type="planar"')
                    .replace('multiplier="0"', 'multiplier="3"'))  # fmt: skip
    with pytest.raises(mv.ModelError, match=r"robot\.urdf: joint 'e': mimics 'bolt', but a planar joint"):
        mv.load_urdf(path)


@pytest.mark.parametrize("pose", [{"a": 0.2}, {"b": 0.5}, {"a": 0.2, "c": -1.9}])
def test_chains_of_mimics_add_up_their_offsets(robot, pose):
    """c = -3 b - 0.4, b = 2 a + 0.1: positions in the pose, and rates as the pose moves."""
    slide = {"axis": "0 0 1", "kind": "prismatic", "parent": "base"}
    follows = ['<mimic joint="b" multiplier="-3" offset="-0.4"/>', '<mimic joint="a" multiplier="2" offset="0.1"/>']
    path = robot(link("base") + link("c", 3.0) + link("b", 2.0) + link("a", 1.0)
                 + joint("c", child="c", more=follows[0], **slide) + joint("b", child="b", more=follows[1], **slide)
                 + joint("a", child="a", **slide))  # fmt: skip
    model = mv.load_urdf(path, pose=pose, stiffness={"c": 7.0})
    heights = [model.bodies[name].position[2] for name in "abc"]
    np.testing.assert_allclose(heights, (0.2, 0.5, -1.9), atol=1e-15)
    with pytest.raises(mv.ModelError, match=r"'b' at 0\.7, but it mimics 'a', which is at 0\.2, and so is at 0\.5"):
        mv.load_urdf(path, pose={"b": 0.7, "a": 0.2})
    system = model.linearize(independent=["a.joint.z"])
    moved = system.displacements([1.0])
    np.testing.assert_allclose([moved[name][2] for name in "abc"], (1.0, 2.0, -6.0), rtol=1e-14)
    np.testing.assert_allclose(system.K / system.M, [[7.0 * 36 / (1 + 2 * 4 + 3 * 36)]], rtol=1e-14)


def test_a_slide_moves_along_its_own_axes(robot):
    """Origins turned by roll, pitch and yaw in turn, R = Rz Ry Rx, and a second joint that goes along."""
    roll, pitch, yaw = 0.4, -0.7, 1.1
    path = robot(link("base") + link("sledge", 2.0, "0.1 0.2 0.3") + link("tool", 1.0)
                 + joint("s", "prismatic", "base", "sledge", "1 2 3", f"{roll} {pitch} {yaw}", "0 3 4")
                 + joint("t", "revolute", "sledge", "tool", "0.5 0 0", axis="1 0 0"))  # fmt: skip
    turn = [np.array(check) for check in (
        ((np.cos(yaw), -np.sin(yaw), 0), (np.sin(yaw), np.cos(yaw), 0), (0, 0, 1)),
        ((np.cos(pitch), 0, np.sin(pitch)), (0, 1, 0), (-np.sin(pitch), 0, np.cos(pitch))),
        ((1, 0, 0), (0, np.cos(roll), -np.sin(roll)), (0, np.sin(roll), np.cos(roll))),
    )]  # fmt: skip
    axes = turn[0] @ turn[1] @ turn[2]
    model = mv.load_urdf(path, pose={"s": 0.25, "t": 0.9}, tip="tool")
    start = np.array((1, 2, 3)) + 0.25 * axes @ (0, 0.6, 0.8)
    np.testing.assert_allclose(model.bodies["sledge"].position, start + axes @ (0.1, 0.2, 0.3), atol=1e-14)
    np.testing.assert_allclose(model.bodies["tool"].position, start + axes @ (0.5, 0, 0), atol=1e-14)
    moved = model.linearize().displacements([1.0, 0.0])
    np.testing.assert_allclose(moved["tool"][:3], axes @ (0, 0.6, 0.8), atol=1e-14)
    turned = model.linearize().displacements([0.0, 1.0])
    np.testing.assert_allclose(turned["tool"], (0, 0, 0, *axes[:, 0]), atol=1e-14)


def test_damping_is_the_file_s_unless_given(robot):
    path = robot(link("base") + link("rod", 1.0) + joint("hinge", "revolute", "base", "rod",
                                                         more='<dynamics damping="3"/>'))  # fmt: skip
    assert mv.load_urdf(path).springs["hinge.k"].damping[5] == 3.0
    assert mv.load_urdf(path, damping=0.0, stiffness=1.0).linearize().C[0, 0] == 0.0
    assert mv.load_urdf(path, damping={"hinge": 7.0}).linearize().C[0, 0] == pytest.approx(7.0, rel=1e-14)


def test_six_stiffnesses_let_bearings_give_way(robot):
    path = robot(link("base") + link("rod", 2.0, inertia=(0.1, 0.2, 0.3, 0, 0, 0))
                 + joint("hinge", "revolute", "base", "rod", axis="1 0 0"))  # fmt: skip
    system = mv.load_urdf(path, stiffness=(1e3, 2e3, 3e3, 40.0, 50.0, 60.0)).linearize()
    # z of the bushing is the axis: stiffness 3e3 along and 60 about x
    squares = (2 * np.pi * system.modes().frequencies) ** 2
    expected = sorted([3e3 / 2.0, 60.0 / 0.1, *(np.array((1e3, 2e3)) / 2.0), *_turns(system)])
    np.testing.assert_allclose(squares, expected, rtol=1e-12)


def _turns(system):
    """Rotations about y and z, whichever of these the bushing's x and y are."""
    K = system.K[np.ix_(*[[i for i, c in enumerate(system.coordinates) if c.endswith((".rx", ".ry"))]] * 2)]
    M = system.M[np.ix_(*[[i for i, c in enumerate(system.coordinates) if c.endswith((".rx", ".ry"))]] * 2)]
    assert sorted(np.diag(K)) == pytest.approx([40.0, 50.0])
    assert sorted(np.diag(M)) == pytest.approx([0.2, 0.3])
    return np.linalg.eigvals(np.linalg.solve(M, K))


def test_a_floating_robot_has_six_more(robot):
    words = link("base", 4.0) + link("rod", 1.0) + joint("base", "revolute", "base", "rod")
    model = mv.load_urdf(robot(words), floating=True)
    assert list(model.joints) == ["base.joint"]
    assert model.linearize().dof == 7
    assert mv.load_urdf(robot(words)).linearize().dof == 1


def test_the_arm_of_the_examples():
    model = mv.load_urdf(ARM, pose={"lift": 0.6, "elbow": 1.2}, stiffness=1e4, tip="tool")
    assert list(model.bodies) == ["shoulder", "upper_arm", "forearm", "wrist1", "wrist2", "wrist3"]
    assert sum(body.mass for body in model.bodies.values()) == pytest.approx(3.7 + 8.4 + 2.3 + 2.4 + 0.19 + 1.5)
    assert model.linearize().dof == 6


def test_gears_carry_the_weight():
    """The moment of what hangs on a joint, by hand."""
    model = mv.load_urdf(ARM, pose={"lift": 0.6, "elbow": 1.2}, stiffness=1e4, gravity=(0, 0, -9.81))
    held = model.equilibrium(preload="*.k")
    bodies = [*model.bodies.values()]
    for name, outward in (("lift", bodies[1:]), ("elbow", bodies[2:]), ("wrist_1", bodies[3:])):
        x = model.joints[name].position[0]
        moment = sum(9.81 * body.mass * (body.position[0] - x) for body in outward)  # of the weights, about y
        assert held.springs[f"{name}.k"].preload[5] == pytest.approx(-moment, rel=1e-9)
    assert held.linearize().dof == 6


@pytest.mark.parametrize(("words", "message"), [
    (link("a") + link("b"), "expected one link that no joint carries"),
    (link("a") + link("a"), "'a' is there twice"),
    (link("a") + link("b") + joint("j", "hinge", "a", "b"), "type = 'hinge'"),
    (link("base") + link("b") + joint("j", "fixed", "bas", "b"), "Did you mean 'base'"),
    (link("a") + link("b") + joint("j", "revolute", "a", "b", axis="0 0 0"), "not a direction"),
    (link("a") + link("b") + joint("j", "revolute", "a", "b", axis="0 0 one"), "3 finite numbers"),
    (link("a") + link("b") + joint("j", "fixed", "a", "b") + joint("k", "fixed", "a", "b"), "a URDF is a tree"),
    (link("a") + link("b", 1.0) + joint("j", "revolute", "a", "b", more='<mimic joint="x"/>'), "which is not a joint"),
    (link("a") + link("b", 1.0) + joint("j", "revolute", "a", "b", more='<mimic joint="j"/>'), "mimics itself"),
    (link("a") + link("b", -1.0) + joint("j", "revolute", "a", "b"), "mass"),
    (link("a") + link("b", 1.0).replace('value="1.0"', "") + joint("j", "revolute", "a", "b"),
     "value = None; expected 1"),
    (link("a") + link("b", 1.0).replace('ixx="1.0"', "") + joint("j", "revolute", "a", "b"),
     "ixx = None; expected 1"),
    ("<link", "no XML"),
    ("", r"robot\.urdf: <robot> has no <link>"),
])  # fmt: skip
def test_faulty_files_are_told(robot, words, message):
    with pytest.raises(mv.ModelError, match=message):
        mv.load_urdf(robot(words))


def test_joints_with_several_freedoms_have_no_position_and_no_single_stiffness(robot):
    path = robot(link("a") + link("b", 1.0) + joint("j", "floating", "a", "b"))
    with pytest.raises(mv.ModelError, match=r"joint 'j': pose = 0\.5, but a floating joint has no position"):
        mv.load_urdf(path, pose={"j": 0.5})
    six = (1.0, 2.0, 3.0, 4.0, 5.0, 6.0)
    for words, field in (({"stiffness": 10.0}, "stiffness"), ({"damping": 0.1}, "damping"),
                         ({"stiffness": six, "damping": 0.1}, "damping")):  # fmt: skip
        with pytest.raises(mv.ModelError, match=f"joint 'j': a floating joint takes six values of {field}, x y z rx"):
            mv.load_urdf(path, **words)
    spring = mv.load_urdf(path, stiffness=six, damping=six).springs["j.k"]
    np.testing.assert_array_equal((spring.stiffness, spring.damping), (six, six))


@pytest.mark.parametrize("kind", ["floating", "planar"])
def test_damping_without_direction_is_left_out_with_a_warning(robot, kind):
    path = robot(link("a") + link("b", 1.0) + joint("j", kind, "a", "b", more='<dynamics damping="3"/>'))
    with pytest.warns(mv.errors.LeftOutWarning, match=r"left out: damping in all directions of 'j'"):
        assert not mv.load_urdf(path).springs
    assert len(mv.load_urdf(path, damping=(1.0,) * 6).springs) == 1


def test_a_joint_that_needs_no_axis_may_have_none(robot):
    """Writers of files give fixed joints an axis of (0, 0, 0)."""
    path = robot(link("a") + link("b", 2.0) + link("c", 3.0) + joint("j", "floating", "a", "b", axis="0 0 0")
                 + joint("w", "fixed", "b", "c", axis="0 0 0"))  # fmt: skip
    system = mv.load_urdf(path).linearize()
    assert system.dof == 6
    np.testing.assert_allclose(np.sort(np.linalg.eigvalsh(system.M))[-3:], 5.0, rtol=1e-12)


@pytest.mark.parametrize(("kind", "effort", "motion"), [
    ("prismatic", "force", "travel"), ("revolute", "torque", "angle"), ("continuous", "torque", "angle"),
])  # fmt: skip
def test_ports_act_along_the_axis(robot, kind, effort, motion):
    """On a spring k a unit force or torque of the joint gives 1 / k, whatever its axis."""
    path = robot(link("a") + link("b", 2.0) + joint("j", kind, "a", "b", "1 2 3", "0.3 0.2 0.1", "1 -2 2"))
    system = mv.load_urdf(path, stiffness=40.0).linearize()
    assert (system.inputs, system.outputs) == ((f"j.{effort}",), (f"j.{motion}",))
    np.testing.assert_allclose(system.frequency_response([0.0]), [[[1.0 / 40.0]]], rtol=1e-12)


def test_faulty_arguments_are_told(tmp_path):
    with pytest.raises(mv.ModelError, match="Did you mean 'elbow'"):
        mv.load_urdf(ARM, pose={"elbo": 1.0})
    with pytest.raises(mv.ModelError, match="not a joint that moves"):
        mv.load_urdf(ARM, stiffness={"flange": 1.0})
    with pytest.raises(mv.ModelError, match="one number, or six"):
        mv.load_urdf(ARM, stiffness=(1.0, 2.0))
    with pytest.raises(mv.ModelError, match="is not a link"):
        mv.load_urdf(ARM, tip="hand")
    with pytest.raises(mv.ModelError, match="fixed to the ground"):
        mv.load_urdf(ARM, tip="base")
    with pytest.raises(mv.ModelError, match="cannot be read"):
        mv.load_urdf(tmp_path / "none.urdf")
    (tmp_path / "other.urdf").write_text("<sdf/>")
    with pytest.raises(mv.ModelError, match="expected <robot>"):
        mv.load_urdf(tmp_path / "other.urdf")


def test_rings_beside_the_tree_are_refused(robot):
    path = robot(link("base") + link("a", 1.0) + link("b", 1.0) + joint("ab", "revolute", "a", "b")
                 + joint("ba", "revolute", "b", "a"))  # fmt: skip
    with pytest.raises(mv.ModelError, match=r"link 'a' hangs in a ring of joints that does not reach the root 'base'"):
        mv.load_urdf(path)


def test_dry_friction_is_left_out_and_named(robot):
    dynamics = '<dynamics damping="0.5" friction="{}"/>'
    words = [link("base")] + [link(f"l{i}", 1.0) for i in range(10)]
    words += [joint(f"j{i}", "revolute", "base" if i == 0 else f"l{i - 1}", f"l{i}",
                    more=dynamics.format(0.1 if i else 0.0)) for i in range(10)]  # fmt: skip
    path = robot("".join(words))
    with pytest.warns(mv.LeftOutWarning, match=r"left out: dry friction in 'j1', 'j2', .*'j8' and 1 more\."):
        model = mv.load_urdf(path)
    assert model.springs["j1.k"].damping[5] == 0.5
