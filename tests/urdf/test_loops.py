"""Closed loops of URDF files: poses, dialects, what is refused, limits, rotors and motors."""

import re

import numpy as np
import pytest

import mbsvib as mv
from tests.urdf.scenes import (
    CASSIE,
    CASSIE_YAML,
    CONSTRAINT,
    DELTA,
    FIVE_BAR,
    FOUR_BAR,
    FRAMES,
    LOOP,
    joint,
    link,
    write,
)  # fmt: skip

HINGED = FOUR_BAR + CONSTRAINT.format("revolute")


def corners(model):
    """Crank pin and rocker pin of the four-bar."""
    return np.array(model.joints["b"].position), np.array(model.joints["tip"].position)


@pytest.mark.parametrize("a", [-0.5, 0.0, 0.2, 1.1, 2.5])
def test_four_bar_closes_as_triangles_say(tmp_path, a):
    """The rocker's pin is 0.35 from the crank's pin and 0.3 from its own bearing; the crank is exactly in its pose."""
    pin, tip = corners(mv.load_urdf(write(tmp_path, HINGED), pose={"a": a}))
    np.testing.assert_allclose(pin, (0.2 * np.sin(a), 0, 0.2 * np.cos(a)), rtol=1e-15, atol=1e-15)
    assert np.linalg.norm(tip - pin) == pytest.approx(0.35, rel=1e-12)
    assert np.linalg.norm(tip - (0.3, 0, 0)) == pytest.approx(0.3, rel=1e-12)


def test_free_joints_move_as_little_as_possible(tmp_path):
    """Without a pose, no neighbouring closed position is nearer to zero."""
    system = mv.load_urdf(write(tmp_path, FIVE_BAR), pose={"left_hip": -1.9}).linearize()
    assert system.dof == 2
    near = mv.load_urdf(write(tmp_path, HINGED))
    for joint_name in ("a", "b", "d"):
        assert joint_name in near.joints
    best = _angles(near)
    for step in (-0.01, 0.01):
        other = mv.load_urdf(write(tmp_path, HINGED), pose={"a": best[0] + step})
        # Gauss-Newton takes the shortest steps, which is near the shortest way
        assert np.linalg.norm(_angles(other)) > np.linalg.norm(best) - 0.02


def _angles(model):
    pin, tip = corners(model)
    a = np.arctan2(pin[0], pin[2])
    d = np.arctan2(tip[0] - 0.3, tip[2])
    along = tip - pin
    return np.array((a, np.arctan2(-along[2], along[0]) - a, d))


def test_dialects_agree(tmp_path):
    """A hinge in either dialect of the file, and as frames that coincide in a point."""
    first = mv.load_urdf(write(tmp_path, HINGED), pose={"a": 0.3}).linearize()
    for words in (FOUR_BAR + LOOP, FOUR_BAR + CONSTRAINT.format("revolute_joint")):
        other = mv.load_urdf(write(tmp_path, words), pose={"a": 0.3}).linearize()
        np.testing.assert_allclose(other.M, first.M, rtol=1e-11)
        assert other.coordinates == first.coordinates
    path = write(tmp_path, FOUR_BAR + FRAMES, "closed_loop: [[tip_A, tip_B]]\n")
    welded = mv.load_urdf(path, loops=tmp_path / "loops.yaml")  # 6d where no type is given: rocker and coupler in line
    assert welded.joints["tip_A"].kind == "fixed"
    np.testing.assert_allclose(welded.bodies["coupler"].orientation, welded.bodies["rocker"].orientation, atol=1e-12)


def test_misspelt_words_are_taken_with_a_warning(tmp_path):
    """Writers in the field say name= for link=, and leave out a letter."""
    words = LOOP.replace('predecessor link="coupler"', 'predecessor name="coupler"').replace("successor", "sucessor")
    told = "taken as meant: name= of <predecessor> of 'tip' as link=, <sucessor> of 'tip' as <successor>"
    with pytest.warns(mv.LeftOutWarning, match=told):
        model = mv.load_urdf(write(tmp_path, FOUR_BAR + words), pose={"a": 0.3})
    reference = mv.load_urdf(write(tmp_path, FOUR_BAR + LOOP), pose={"a": 0.3})
    np.testing.assert_array_equal(model.linearize().M, reference.linearize().M)


def test_joints_that_are_marked_independent_are_told_of(tmp_path):
    """URDF+ marks coordinates; linearize takes these names."""
    marked = FOUR_BAR.replace('<joint name="b"', '<joint independent="true" name="b"')
    with pytest.warns(mv.LeftOutWarning, match=r"marked as independent.*linearize\(independent=\['b.rz'\]\)"):
        model = mv.load_urdf(write(tmp_path, marked + LOOP), pose={"a": 0.3})
    assert model.linearize(independent=["b.rz"]).coordinates == ("b.rz",)
    mv.load_urdf(write(tmp_path, marked))  # of a tree all are independent


@pytest.mark.parametrize(("words", "message"), [
    (CONSTRAINT.format("rolling"), "constraint 'tip': type = 'rolling'; expected revolute, prismatic, universal"),
    (CONSTRAINT.format("planar"), "constraint 'tip': type = 'planar'"),
    (LOOP.replace("revolute", "rolling"), "loop 'tip': type = 'rolling'; expected revolute, continuous"),
    (LOOP.replace("revolute", "floating"), "loop 'tip': type = 'floating'"),
    (LOOP.replace(' type="revolute"', ""), "loop 'tip': type = None"),
    (LOOP.replace(' name="tip"', ""), "a <loop> has no name"),
    (LOOP.replace('link="coupler"', 'link="couple"'), "predecessor = 'couple' is not a link.* Did you mean 'coupler'"),
    (LOOP.replace("predecessor", "parent"), "<parent> is not understood"),
    (LOOP.replace("</loop>", "<ratio value='2'/></loop>"), "<ratio> is not understood"),
    (LOOP.replace("0 1 0", "0 0 0"), "axis = \\(0, 0, 0\\) is not a direction"),
    (LOOP.replace("0.35 0 0", "0.35 nan 0"), "xyz = '0.35 nan 0'; expected 3 finite numbers"),
    (LOOP.replace("0.35 0 0", "${l} 0 0"), "macro of xacro"),
    (LOOP + LOOP, "two loops have the name 'tip'"),
    ('<coupling name="c"><predecessor link="crank"/><successor link="rocker"/></coupling>', "value = None"),
    ('<coupling name="c"><predecessor link="crank"/><successor link="rocker"/><ratio value="0"/></coupling>',
     "coupling 'c': ratio = 0"),
    ('<coupling name="c"><predecessor link="crank"/><successor link="base"/><ratio value="2"/></coupling>',
     "coupling 'c' of 'crank' and 'base' ties a; expected two or more"),
    ('<loop_joint name="x" type="revolute"/>', "<loop_joint> 'x' connects links beside the tree"),
])  # fmt: skip
def test_what_is_not_understood_is_refused_by_name(tmp_path, words, message):
    with pytest.raises(mv.ModelError, match=message):
        mv.load_urdf(write(tmp_path, FOUR_BAR + words))


@pytest.mark.parametrize(("yaml", "message"), [
    ("closed_loop: [[tip_A, tip_C]]\n", "'tip_C' is not a link.* Did you mean 'tip_"),
    ("closed_loop: [[tip_A]]\n", "expected two names of frames"),
    ("closed_loop: 7\n", "closed_loop = 7; expected a list"),
    ("closed_loop: [[tip_A, tip_B]]\ntype: [5d]\n", "'5d'; expected 6d or 3d"),
    ("closed_loop: [[tip_A, tip_B]]\ntype: []\n", "expected a list with an entry for each of closed_loop"),
    ("closed_loop: []\njoint_name: [b]\njoint_type: [BALL]\n", "joint_type of 'b' = 'BALL'"),
    ("closed_loop: []\njoint_name: [b]\njoint_type: [UJOINT_XX]\n", "'UJOINT_XX'"),
    ("closed_loop: []\njoint_name: [k]\njoint_type: [FIXED]\n", "joint_name: 'k' is not a joint"),
    ("closed_loop: []\nname_mot: [k]\n", "name_mot: 'k' is not a joint"),
    ("closed_loop: []\nname_mot: [a]\narmature: [-1]\n", "armature: -1; expected a number that is not negative"),
    ("type: [6d]\n", "has no list closed_loop"),
    ("[1, 2\n", "line"),
])  # fmt: skip
def test_faulty_yaml_is_refused(tmp_path, yaml, message):
    path = write(tmp_path, FOUR_BAR + FRAMES, yaml)
    with pytest.raises(mv.ModelError, match=message):
        mv.load_urdf(path, loops=tmp_path / "loops.yaml")


def test_a_yaml_beside_is_remarked(tmp_path):
    path = write(tmp_path, FOUR_BAR + FRAMES)
    (tmp_path / "robot.yaml").write_text("closed_loop: [[tip_A, tip_B]]\ntype: [3d]\nhat: 1\n")
    with pytest.warns(mv.LeftOutWarning, match=r"robot\.yaml beside it has closed loops, which .*--loops"):
        assert mv.load_urdf(path).linearize().dof == 3
    with pytest.warns(mv.LeftOutWarning, match="of the YAML 'hat'"):
        assert mv.load_urdf(path, loops=tmp_path / "robot.yaml").linearize().dof == 1


@pytest.mark.slow
def test_loops_that_stay_open_are_told(tmp_path):
    """The crank away from the rocker: 0.5 - 0.65 m apart at most; the named joint holds the loop open, another not."""
    path = write(tmp_path, HINGED.replace("0.35 0 0", "0.15 0 0") + link("arm", 1.0)
                 + joint("arm", "revolute", "base", "arm"))  # fmt: skip
    gap = 0.5 - 0.45
    with pytest.raises(mv.ModelError) as refused:
        mv.load_urdf(path, pose={"a": -np.pi / 2, "arm": 0.1})
    told = re.search(r"loop 'tip' stays open by (\S+) m and (\S+) rad\. The pose of 'a' holds", str(refused.value))
    assert float(told[1]) == pytest.approx(gap, abs=1e-3)
    assert float(told[2]) < 1e-3
    with pytest.raises(mv.ModelError, match=r"loop 'ball\d' stays open .* The pose of .*'motor\d'.* holds it open"):
        mv.load_urdf(write(tmp_path, DELTA), pose={"motor0": 0.3, "elbow0": -0.2, "motor1": 0.3, "motor2": 0.3,
                                                   "swing0": 0.7, "elbow1": 0.5})  # fmt: skip
    with pytest.raises(mv.ModelError, match=r"loop 'tip' stays open by .* No positions of its joints near the pose"):
        mv.load_urdf(write(tmp_path, HINGED.replace("0.35 0 0", "3 0 0")))


def test_stretched_starts_are_left(tmp_path):
    """All links in one line, the gap along it: no slope closes it, from anywhere beside it they do."""
    words = (link("base") + link("one", 1.0) + link("two", 1.0) + joint("p", "continuous", "base", "one")
             + joint("q", "continuous", "one", "two", "0.3 0 0")
             + '<constraint name="end" type="spherical"><parent link="two"/><parent_origin xyz="0.3 0 0"/><child '
               'link="base"/><child_origin xyz="0.5 0 0"/></constraint>')  # fmt: skip
    model = mv.load_urdf(write(tmp_path, words))
    assert np.linalg.norm(model.joints["q"].position) == pytest.approx(0.3)
    assert model.joints["q"].position[0] == pytest.approx(0.25)
    np.testing.assert_allclose(model.joints["end"].position, (0.5, 0, 0), atol=1e-12)


def test_printed_digits_are_remarked(tmp_path):
    """An axis that is off by rounding to four digits: what is left is said, the joint is at the mean of both frames."""
    turned = HINGED.replace('<child_origin xyz="0 0 0.3"/>', '<child_origin xyz="0 0.00001 0.3" rpy="0.00002 0 0"/>')
    with pytest.warns(mv.AccuracyWarning, match=r"loops that close but for printed digits .*'tip' \(\d"):
        model = mv.load_urdf(write(tmp_path, turned), pose={"a": 0.2})
    assert model.joints["tip"].position[1] == pytest.approx(0.5e-5, rel=1e-3)
    assert np.linalg.norm(np.cross(model.joints["tip"].axis, (0, 1, 0))) / np.linalg.norm(
        model.joints["tip"].axis) == pytest.approx(1e-5, rel=1e-2)  # fmt: skip


def test_positions_beyond_limits(tmp_path):
    """Degrees for radians are noticed, a right angle is within 1.57, joints that no pose names are warned of."""
    path = write(tmp_path, HINGED)
    with pytest.raises(mv.ModelError, match=r"pose: 'd' at 20, beyond -3 to 3, the limits .* \[rad, not degrees\]"):
        mv.load_urdf(path, pose={"d": 20})
    words = link("a") + link("b", 1.0) + joint("j", "revolute", "a", "b").replace("-3", "0.5").replace('"3"', '"1.57"')
    assert mv.load_urdf(write(tmp_path, words), pose={"j": np.pi / 2}).bodies
    with pytest.warns(mv.LeftOutWarning, match=r"beyond the limits of the file: 'j' at 0, beyond 0\.5 to 1\.57"):
        mv.load_urdf(write(tmp_path, words))
    for limits in ('lower="-inf" upper="inf"', "", 'lower="0" upper="0"'):
        free = re.sub(r'<limit lower="\S+" upper="\S+"', f"<limit {limits}", words)
        assert mv.load_urdf(write(tmp_path, free), pose={"j": 100.0}).bodies
    with pytest.raises(mv.ModelError, match=r"limits from 0\.5 to -1 leave no position"):
        mv.load_urdf(write(tmp_path, words.replace("1.57", "-1")))
    closed = HINGED.replace('"-3" upper="3"', '"-0.01" upper="0.01"')
    with pytest.warns(mv.LeftOutWarning, match=r"beyond the limits of the file: 'b' at .*'d' at"):
        mv.load_urdf(write(tmp_path, closed), pose={"a": 0.2})


def test_couplings_tie_joints_by_their_ratio(tmp_path):
    """A rotor that turns ten times as fast as its arm, in any pose: J = J_arm + 100 J_rotor."""
    words = (link("base") + link("arm", 1.0, inertia=(1.0, 1.0, 1.0)) + link("rotor", 1.0, inertia=(0.1, 0.1, 0.1))
             + joint("j", "revolute", "base", "arm") + joint("r", "continuous", "base", "rotor")
             + '<coupling name="gear"><predecessor link="arm"/><successor link="rotor"/><ratio value="10"/></coupling>')
    model = mv.load_urdf(write(tmp_path, words), pose={"j": 0.2}, tip=["rotor"])
    np.testing.assert_allclose(model.linearize(independent=["j.rz"]).M, [[1.0 + 100 * 0.1]], rtol=1e-12)
    with pytest.raises(mv.ModelError, match=r"coupling 'gear' is not kept\. The pose of 'j', 'r' holds it open"):
        mv.load_urdf(write(tmp_path, words), pose={"j": 0.2, "r": 1.0})
    assert mv.load_urdf(write(tmp_path, words), pose={"j": 0.2, "r": 2.0}).couplers["gear"]
    turned = np.array(model.bodies["rotor"].orientation)
    np.testing.assert_allclose(turned[0], (np.cos(2.0), 0, np.sin(2.0)), atol=1e-12)


@pytest.mark.parametrize(("kind", "effort", "motion", "more", "inertia", "rotor"), [
    ("revolute", "torque", "angle", '<dynamics armature="0.5"/>', 1.0 + 0.5, '<drake:rotor_inertia value="0.01"/>'),
    ("prismatic", "force", "travel", '<dynamics armature="0.5"/>', 2.0 + 0.5, "<rotorInertia>0.01</rotorInertia>"),
])  # fmt: skip
def test_rotors_and_motors(tmp_path, kind, effort, motion, more, inertia, rotor):
    """m + armature + N^2 J; the motor's torque acts N times."""
    body = link("b", 2.0, inertia=(1.0, 1.0, 1.0))
    drive = ('<transmission name="t"><joint name="j"/><actuator name="m"><mechanicalReduction>20</mechanicalReduction>'
             f"{rotor}</actuator></transmission>")  # fmt: skip
    path = write(tmp_path, link("a") + body + joint("j", kind, "a", "b", more=more) + drive)
    model = mv.load_urdf(path, pose={"j": 0.3}, stiffness=5.0)
    system = model.linearize(independent=[f"j.{'rz' if kind == 'revolute' else 'z'}"])
    np.testing.assert_allclose(system.M, [[inertia + 400 * 0.01]], rtol=1e-12)
    static = system.frequency_response([0.0], outputs=[f"j.{motion}"], inputs=[f"j.{effort}", f"m.{effort}"])[0, :, 0]
    np.testing.assert_allclose(static, (1 / 5.0, 20 / 5.0), rtol=1e-12)
    with pytest.raises(mv.ModelError, match="transmission of 'm': 'k' is not a joint"):
        mv.load_urdf(write(tmp_path, path.read_text().split('">', 1)[1].replace("</robot>", "")
                           .replace('<joint name="j"/>', '<joint name="k"/>')))  # fmt: skip
    for word, value in (("20", "0"), ("0.01", "-1"), ("20", "twenty")):
        with pytest.raises(mv.ModelError, match="transmission of 'm'"):
            mv.load_urdf(write(tmp_path, link("a") + body + joint("j", kind, "a", "b") + drive.replace(word, value)))


def test_motors_of_a_yaml(tmp_path):
    """Armature and rotors go with the joints that name_mot names, by a part of the name too."""
    lists = "armature: [0.2, 0.3]\nrotor_inertia: [0.001, 0]\ngear_ratio: [10, 1]\n"
    path = write(tmp_path, CASSIE, CASSIE_YAML + lists)
    pose, loops = {"hip": 0.3, "motor": -0.1}, tmp_path / "loops.yaml"
    heavy = mv.load_urdf(path, pose=pose, loops=loops).linearize(independent=["hip.rz", "motor.rz", "ankle.rz"])
    loops.write_text(CASSIE_YAML)
    light = mv.load_urdf(path, pose=pose, loops=loops)
    added = heavy.M - light.linearize(independent=["hip.rz", "motor.rz", "ankle.rz"]).M
    np.testing.assert_allclose(added, np.diag((0.2 + 0.1, 0.3, 0.0)), atol=1e-12)
    assert light.joints["ball"].kind == "universal"
    assert not {"ball.torque", "rod_A.torque"} & set(light.inputs)


def test_spherical_joints_of_a_yaml(tmp_path):
    """The rod turns about itself, without inertia about other lines than its own axis; bodies stay where they were."""
    path = write(tmp_path, CASSIE, CASSIE_YAML.replace("UJOINT_YX", "SPHERICAL"))
    model = mv.load_urdf(path, pose={"hip": 0.3, "motor": -0.1}, loops=tmp_path / "loops.yaml", stiffness={"ball": 3.0})
    assert model.joints["ball"].kind == "spherical"
    assert model.springs["ball.k"].stiffness == (0, 0, 0, 3.0, 3.0, 3.0)
    assert model.linearize().dof == 4


def test_tips_of_merged_links(tmp_path):
    """Frames on fixed joints are places: no bodies, found by name."""
    path = write(tmp_path, HINGED + FRAMES)
    model = mv.load_urdf(path, pose={"a": 0.2}, tip=["tip_A", "crank"])
    assert "tip_A" not in model.bodies
    np.testing.assert_allclose(model.inputs["tip_A.Fx"].position, model.joints["tip"].position, atol=1e-12)
    assert {"tip_A.rz", "crank.x"} <= set(model.outputs)
    with pytest.raises(mv.ModelError, match="tip = 'tip_C' is not a link"):
        mv.load_urdf(path, pose={"a": 0.2}, tip=["crank", "tip_C"])
    with pytest.raises(mv.ModelError, match="tip = 3; expected a name, or a list of names"):
        mv.load_urdf(path, pose={"a": 0.2}, tip=3)


@pytest.mark.parametrize("chain", [False, True])
def test_mimics_and_loops(tmp_path, chain):
    """The rocker turns as far as the crank and 0.02 rad more: the loop closes where both agree; also by way of a third.
    """
    follows = '<mimic joint="{}" multiplier="{}" offset="{}"/>'
    more = link("third", 1.0) + joint("s", "revolute", "base", "third", more=follows.format("a", -2, 0.1))
    follows = follows.format("s", -0.5, 0.07) if chain else follows.format("a", 1, 0.02)
    bearing = '<origin xyz="0.3 0 0" rpy="0 0 0"/><axis xyz="0 1 0"/>'
    path = write(tmp_path, HINGED.replace(bearing, bearing + follows) + more * chain)
    a, _, d = _angles(mv.load_urdf(path))
    assert d == pytest.approx(a + 0.02, abs=1e-11)


def test_loops_within_one_body_are_named(tmp_path):
    weld = '<constraint name="tip" type="link"><parent link="tip_A"/><child link="tip_B"/></constraint>'
    inside = FRAMES.replace("rocker", "coupler").replace("0 0 0.3", "0.35 0 0") + weld
    with pytest.warns(mv.LeftOutWarning, match="joints within one body: 'tip'"):
        assert mv.load_urdf(write(tmp_path, FOUR_BAR + inside)).linearize().dof == 3
