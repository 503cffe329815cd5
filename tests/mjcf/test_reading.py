"""Files of MuJoCo against closed forms, what arguments do, and what is said of what is left."""

from pathlib import Path

import numpy as np
import pytest

import mbsvib as mv
from tests.mjcf.scenes import ARM, FOUR_BAR, PENDULUM, ROD, SWING, body, world, write

pytest.importorskip("mujoco", reason="MuJoCo is not installed: pip install 'mbsvib[mjcf]'")

GRIPPER = Path(__file__).parents[2] / "examples" / "robots" / "gripper.xml"


def hertz(square):
    return np.sqrt(square) / (2 * np.pi)


def test_a_pendulum(tmp_path):
    system = mv.load_mjcf(write(tmp_path, PENDULUM)).linearize()
    expected = hertz(2.0 * 9.81 * 0.4 / (0.03 + 2.0 * 0.4**2))
    np.testing.assert_allclose(system.modes().frequencies, [expected], rtol=1e-13)
    assert (system.inputs, system.outputs) == (("hinge.torque",), ("hinge.angle",))
    assert system.name == "scene"


def test_springs_have_the_names_of_what_they_are_in(tmp_path):
    model = mv.load_mjcf(write(tmp_path, ARM))
    assert [*model.springs] == ["yaw.k", "roll.k", "reach.k", "wrist.k", "belt", "string", "servo.servo"]


def test_elements_of_one_name_are_told_apart(tmp_path):
    """In MuJoCo a body, its joint, a tendon and an actuator may have the same name."""
    model = mv.load_mjcf(write(tmp_path, world(
        body('<joint name="a" axis="0 1 0" stiffness="2"/>' + ROD, 'a" gravcomp=".5'),
        body('<joint name="b" axis="0 1 0"/>' + ROD, "b", "0 1 0"),
        more='<tendon><fixed name="a" stiffness="3"><joint joint="a" coef="1"/><joint joint="b" coef="2"/></fixed>'
             '</tendon><equality><joint name="b" joint1="a" joint2="b" polycoef="0 2 0 0 0"/></equality>'
             '<actuator><position name="a" joint="a" kp="5"/></actuator>')))  # fmt: skip
    assert [*model.joints] == ["a.joint", "b.joint", "a.wheel.axis"]
    assert [*model.springs] == ["a.joint.k", "a.tendon", "a.servo"]
    assert [*model.couplers] == ["a.wheel.turns", "b.tie"]
    assert [*model.loads] == ["a.gravcomp"]


def test_a_double_pendulum(tmp_path):
    """Point masses 3 and 2 kg on threads of 0.5 and 0.7 m."""
    mass = '<inertial pos="0 0 -{}" mass="{}" diaginertia="1e-12 1e-12 1e-12"/>'
    path = write(tmp_path, world(body('<joint name="a" axis="0 1 0"/>' + mass.format(0.5, 3)
                                      + body('<joint name="b" axis="0 1 0"/>' + mass.format(0.7, 2), "second",
                                             "0 0 -.5"))))  # fmt: skip
    system = mv.load_mjcf(path).linearize()
    # absolute angles: M = [[5 l1^2, 2 l1 l2], [.., 2 l2^2]], K = g diag(5 l1, 2 l2)
    M = np.array([[5 * 0.25, 2 * 0.35], [2 * 0.35, 2 * 0.49]])
    expected = np.sort(np.linalg.eigvals(np.linalg.solve(M, 9.81 * np.diag([2.5, 1.4]))))
    np.testing.assert_allclose(system.modes().frequencies, hertz(expected), rtol=1e-10)


def test_a_planar_arm_with_springs_and_a_payload(tmp_path):
    """Two links without inertia, a mass at the end: the static compliance is that of two springs at their levers."""
    light = '<inertial pos="0 0 0" mass="1e-9" diaginertia="1e-12 1e-12 1e-12"/>'
    path = write(tmp_path, world(body(
        '<joint name="shoulder" axis="0 1 0" stiffness="400" damping="2"/>' + light
        + body('<joint name="elbow" axis="0 1 0" stiffness="300" armature=".02"/>' + light
               + body('<inertial pos="0 0 0" mass="2" diaginertia=".01 .01 .01"/><site name="tip"/>', "load", ".4 0 0"),
               "fore", ".3 0 0"))))  # fmt: skip
    model = mv.load_mjcf(path, gravity=(0, 0, 0))
    assert list(model.bodies)[:2] == ["b", "fore"]
    system = model.linearize()
    sag = system.frequency_response([0.0])[system.outputs.index("tip.z"), system.inputs.index("tip.Fz"), 0].real
    assert sag == pytest.approx(0.7**2 / 400 + 0.4**2 / 300, rel=1e-12)
    M = np.array([[2 * 0.49 + 0.01, 2 * 0.28 + 0.01], [2 * 0.28 + 0.01, 2 * 0.16 + 0.01 + 0.02]])
    np.testing.assert_allclose(system.M, M, rtol=1e-8)


def test_stiffness_by_argument(tmp_path):
    path = write(tmp_path, FOUR_BAR.split("<equality>")[0])
    none = (0, 0, 0)
    given = mv.load_mjcf(path, stiffness=50.0, damping={"b": 7.0}, gravity=none)
    assert [spring.stiffness[5] for spring in given.springs.values()] == [50.0] * 3
    assert given.springs["a.k"].damping[5] == 0.1
    assert given.springs["b.k"].damping[5] == 7.0
    given = mv.load_mjcf(path, stiffness={"d": (1e5, 2e5, 3e5, 40.0, 50.0, 60.0)}, gravity=none)
    assert (given.joints["d"].kind, given.joints["a"].kind) == ("free", "revolute")
    assert given.springs["a.k"].stiffness[5] == 20.0
    assert given.linearize().dof == 2 + 6


def test_springs_hold_what_they_hold(tmp_path):
    """A spring that is wound in the pose carries the rod's weight there: the file's own balance."""
    wound = np.radians(30.0) + 2.0 * 9.81 * 0.4 * np.sin(np.radians(30.0)) / 50.0
    joint = f'<joint name="hinge" axis="0 1 0" stiffness="50" springref="{wound:.17g}"/>'
    path = write(tmp_path, world(body(joint + ROD)))
    model = mv.load_mjcf(path, pose={"hinge": np.radians(30.0)})
    assert model.springs["hinge.k"].preload[5] == pytest.approx(2.0 * 9.81 * 0.4 * 0.5, rel=1e-12)
    system = model.linearize()
    expected = hertz((50.0 + 2.0 * 9.81 * 0.4 * np.cos(np.radians(30.0))) / (0.03 + 2.0 * 0.4**2))
    np.testing.assert_allclose(system.modes().frequencies, [expected], rtol=1e-12)


def test_keyframes_and_controls(tmp_path):
    words = PENDULUM + ('<actuator><position name="servo" joint="hinge" kp="80" ctrlrange="-1 1"/></actuator><keyframe>'
                        '<key name="up" qpos="0.5" ctrl="0.6"/></keyframe>')  # fmt: skip
    path = write(tmp_path, words)
    assert mv.load_mjcf(path, keyframe="up").springs["servo.servo"].preload[5] == pytest.approx(8.0, rel=1e-12)
    assert mv.load_mjcf(path, keyframe=0, control={"servo": 0.5}).springs["servo.servo"].preload is None
    cut = mv.load_mjcf(path, control={"servo": 3.0})  # to the range, as MuJoCo has it
    assert cut.springs["servo.servo"].preload[5] == pytest.approx(80.0, rel=1e-12)
    assert mv.load_mjcf(path, leave="servo").springs == {}
    system = mv.load_mjcf(path).linearize()
    assert system.inputs == ("hinge.torque", "servo")
    np.testing.assert_allclose(system.B, [[1.0, 80.0]], rtol=1e-14)
    for words, message in (({"keyframe": "upp"}, "Did you mean 'up'"), ({"keyframe": 3}, "It has up"),
                        ({"control": {"serv": 1.0}}, "Did you mean 'servo'"), ({"leave": ["x"]}, "leave: 'x'"),
                        ({"leave": 3}, "leave = 3; expected a name"), ({"sites": [3]}, "sites = .3.; expected a name"),
                        ({"control": {"servo": None}}, "control = None")):  # fmt: skip
        with pytest.raises(mv.ModelError, match=message):
            mv.load_mjcf(path, **words)


def test_names_with_brackets_are_no_patterns(tmp_path):
    words = PENDULUM + '<actuator><motor name="m[0]" joint="hinge"/><motor name="m0" joint="hinge"/></actuator>'
    path = write(tmp_path, words.replace('<joint name="hinge"', '<site name="tip[0]"/><joint name="hinge"'))
    system = mv.load_mjcf(path, leave="m[0]", sites=["tip[0]"]).linearize()
    assert {"m0", "tip[0].Fx", "tip[0].Mz"} <= set(system.inputs)
    assert "m[0]" not in system.inputs


def test_joints_and_tendons_that_are_tied(tmp_path):
    slide = '<joint name="{}" type="slide" axis="1 0 0" stiffness="{}"/><geom size=".1" mass="{}"/>'
    slides = "".join(body(slide.format(*given), given[0]) for given in (("p", 10, 1), ("q", 20, 2), ("r", 30, 3)))
    ties = ('<tendon><fixed name="sum"><joint joint="q" coef="1"/><joint joint="r" coef="1"/></fixed></tendon>'
            '<equality><joint name="pair" joint1="p" joint2="q" polycoef="0 -2 0 0 0"/>{}</equality>')  # fmt: skip
    path = write(tmp_path, world(slides, more=ties.format('<tendon name="still" tendon1="sum"/>')))
    system = mv.load_mjcf(path).linearize()
    assert system.dof == 1  # q = s, p = -2 s, r = -s
    np.testing.assert_allclose(system.modes().frequencies, [hertz((40 + 20 + 30) / (4 + 2 + 3))], rtol=1e-12)
    path = write(tmp_path, world(slides, more=ties.format('<joint name="lock" joint1="r" active="true"/>')))
    model = mv.load_mjcf(path)
    assert model.joints["lock"].kind == "fixed"
    np.testing.assert_allclose(model.linearize().modes().frequencies, [hertz((40 + 20) / (4 + 2))], rtol=1e-12)
    path = write(tmp_path, world(slides, more=ties.format('<joint joint1="r" active="false"/>')))
    assert mv.load_mjcf(path).linearize().dof == 2
    assert mv.load_mjcf(path, leave=["pair"]).linearize().dof == 3
    weld = '<equality><weld name="glue" body1="p" body2="r"/></equality>'
    system = mv.load_mjcf(write(tmp_path, world(slides, more=weld))).linearize()
    np.testing.assert_allclose(system.modes().frequencies, [hertz(40 / 4), hertz(20 / 2)], rtol=1e-12)


def test_options_switch_things_off(tmp_path):
    def read(flag):
        path = write(tmp_path, words, head=f'<option gravity="0 0 -9.81"><flag contact="disable" {flag}/></option>')
        return mv.load_mjcf(path)

    words = PENDULUM.replace("axis", 'stiffness="3" damping="4" axis') + (
        '<equality><weld name="glue" body1="rod"/></equality><actuator><motor name="m" joint="hinge"/></actuator>')
    assert read("").gravity == (0, 0, -9.81)
    assert read('gravity="disable"').gravity is None
    assert list(read("").joints) == ["hinge", "glue"]
    assert list(read('equality="disable"').joints) == list(read('constraint="disable"').joints) == ["hinge"]
    assert read('spring="disable"').springs["hinge.k"].stiffness[5] == 0.0
    assert read('damper="disable"').springs["hinge.k"].damping[5] == 0.0
    assert list(read('actuation="disable"').inputs) == ["hinge.torque"]


def test_names(tmp_path):
    """Joints called as their bodies, elements without names, several joints of a body."""
    arm = '<joint name="arm"/><geom size=".1"/><site name="s"/><site/>' + body('<joint/><geom size=".1"/>', "hand")
    more = '<body><joint type="slide"/><joint type="slide" axis="1 0 0"/><geom size=".1"/></body>'
    path = write(tmp_path, world(body(arm, "arm"), more))
    model = mv.load_mjcf(path, gravity=(0, 0, 0), name="thing")
    assert model.name == "thing"
    assert list(model.bodies) == ["arm", "hand", "body3", "body3.body3.joint1"]
    assert list(model.joints) == ["arm.joint", "hand.joint", "body3.joint1", "body3.joint2"]
    assert model.linearize().dof == 4
    assert [name for name in model.inputs if name.endswith("Fx")] == ["s.Fx"]
    assert not [name for name in mv.load_mjcf(path, sites=()).inputs if name.endswith("Fx")]


def test_the_gripper_of_the_examples():
    model = mv.load_mjcf(GRIPPER)
    held = model.equilibrium()
    assert held.linearize().dof == 2
    assert {"grip", "left_tip.Fx", "right.torque"} <= set(model.inputs)
    # the same by the servo's set point alone
    with pytest.raises(mv.EquilibriumError):
        model.linearize()


def test_what_is_left_is_said(tmp_path):
    ball = ('<joint name="lift" type="slide" axis="0 0 1" range="0 1" limited="true" frictionloss="2" stiffness="5"/>'
            '<geom size=".1"/>')  # fmt: skip
    floor = '<geom type="plane" size="1 1 1" pos="0 0 -.09"/>'
    option = '<option viscosity=".1" gravity="0 0 0"/>'
    with pytest.warns(mv.LeftOutWarning, match="left out: ") as stated:
        mv.load_mjcf(write(tmp_path, world(floor, body(ball)), head=option))
    message = str(stated[0].message)
    for words in ("dry friction in 'lift'", "touches in this pose of 'lift'", "'world' with 'b'", "viscosity"):
        assert words in message
    filtered = '<actuator><position name="slow" joint="hinge" kp="2" timeconst=".1"/></actuator>'
    with pytest.warns(mv.LeftOutWarning, match="dynamics of what drives the input 'slow'"):
        assert mv.load_mjcf(write(tmp_path, PENDULUM + filtered)).springs["slow.servo"].stiffness[5] == 2.0
    slack = ('<worldbody><site name="o" pos="0 0 -1"/></worldbody><tendon><spatial name="rope" stiffness="9" '
             'springlength="0 2"><site site="o"/><site site="e"/></spatial></tendon>')  # fmt: skip
    rod = PENDULUM.replace(ROD, ROD + '<site name="e" pos="0 .1 -.5"/>')
    with pytest.warns(mv.LeftOutWarning, match="slack tendon 'rope'"):
        assert mv.load_mjcf(write(tmp_path, rod + slack)).springs == {}


def test_gaps_that_are_small_are_said(tmp_path):
    """All joints are named, so that none can close it."""
    path = write(tmp_path, SWING)
    with pytest.warns(mv.LeftOutWarning, match=r"gap in this pose of 'c' \(\d"):
        mv.load_mjcf(path, pose={"a": 1e-5, "b": 0.0, "d": 0.0})


@pytest.mark.parametrize("a", [0.3, -0.8, 1.2])
def test_open_loops_are_closed(tmp_path, a):
    """A parallelogram: the other rocker is as steep as the one that the pose names."""
    model = mv.load_mjcf(write(tmp_path, SWING), pose={"a": a})
    expected = (0.4 - 0.5 * np.sin(a), 0.0, -0.5 * np.cos(a))
    np.testing.assert_allclose(model.joints["c"].position, expected, atol=1e-12)
    np.testing.assert_allclose(model.bodies["right"].orientation, model.bodies["left"].orientation, atol=1e-12)
    with pytest.raises(mv.ModelError, match="equality 'c': gapes by"):
        mv.load_mjcf(write(tmp_path, SWING), pose={"a": a, "d": -a})


def test_loops_with_ball_joints_are_closed(tmp_path):
    """A rod of 0.5 m between a ball joint and a carriage that the pose moves far."""
    words = f"""<worldbody><body name="rod"><joint name="ball" type="ball"/>{ROD}<site name="e" pos=".3 0 -.4"/></body>
      <body name="cart" pos=".3 0 -.4"><joint name="along" type="slide" axis="0 1 0"/>
      <joint name="up" type="slide" axis="0 0 1"/>{ROD}<site name="f"/></body></worldbody>
      <equality><connect name="c" site1="e" site2="f"/></equality>"""
    model = mv.load_mjcf(write(tmp_path, words), pose={"along": 0.35})
    at = np.array(model.joints["c"].position)
    np.testing.assert_allclose((at[0], at[1], at @ at), (0.3, 0.35, 0.25), atol=1e-12)
    turned = np.array(model.bodies["rod"].orientation) @ (0.3, 0, -0.4)
    np.testing.assert_allclose(turned, at, atol=1e-12)


def test_equalities_set_joints_that_no_pose_names(tmp_path):
    words = PENDULUM + '<equality><joint name="c" joint1="hinge" polycoef=".3 0 0 0 0"/></equality>'
    free = PENDULUM.replace("<worldbody>", '<worldbody><body name="other"><joint name="j"/>' + ROD + "</body>")
    model = mv.load_mjcf(write(tmp_path, words.replace(PENDULUM, free)))
    np.testing.assert_allclose(model.bodies["rod"].position, (-0.4 * np.sin(0.3), 0, -0.4 * np.cos(0.3)), atol=1e-12)
    with pytest.raises(mv.ModelError, match=r"equality 'c': gapes by 0\.2"):
        mv.load_mjcf(write(tmp_path, words), pose={"hinge": 0.1})


def test_a_pose_beyond_the_range_is_refused(tmp_path):
    path = write(tmp_path, PENDULUM.replace("axis", 'range="-1.5 1.5" axis'))
    with pytest.raises(mv.ModelError, match=r"joint 'hinge': pose = 30, beyond its range .* \[rad, not degrees\]"):
        mv.load_mjcf(path, pose={"hinge": 30})


def test_angles_in_degrees_are_doubted(tmp_path):
    path = write(tmp_path, PENDULUM.replace("<worldbody>", '<worldbody><body><joint name="along" type="slide"/>' + ROD
                                            + "</body>"))  # fmt: skip
    assert mv.load_mjcf(path, pose={"hinge": 30, "along": 30.0}).doubts == (
        "'hinge.rz' is displaced by 30 rad, 4.77 turns; is it in rad, not in degrees?",)  # fmt: skip
    assert mv.load_mjcf(path, pose={"hinge": 0.5}).doubts == ()


def test_armature_feels_no_turning_of_the_ground(tmp_path):
    """And pushes it with no moment: it is inertia of the joint alone."""
    path = write(tmp_path, PENDULUM.replace("axis", 'armature="2" axis'), head="<option gravity='0 0 0'/>")
    model = mv.load_mjcf(path)
    model.add_base_motion("tilt", "ry")
    model.add_force_output("moment", "ground", "ry")
    system = model.linearize()
    own, tilt = 0.03 + 2 * 0.4**2, system.inputs.index("tilt")
    np.testing.assert_allclose(system.M, [[own + 2.0]], rtol=1e-13)
    np.testing.assert_allclose(system.B[0, tilt], -own, rtol=1e-13)
    np.testing.assert_allclose(np.abs(system.Ca[-1]), [own], rtol=1e-12)


@pytest.mark.parametrize(("words", "count"), [("<worldbody/>", 0), ('<worldbody><geom size="1"/></worldbody>', 0),
                                              ('<worldbody><body><geom size="1"/></body></worldbody>', 1)])  # fmt: skip
def test_files_in_which_nothing_moves_are_reported(tmp_path, words, count):
    with pytest.warns(mv.LeftOutWarning, match=f"nothing moves: {count} bodies without joints, .*<joint>"):
        assert not mv.load_mjcf(write(tmp_path, words)).bodies
