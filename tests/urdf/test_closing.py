"""Gaps of loops and their derivatives by differences, for every kind of loop and of joint; axes that turn into line."""

from dataclasses import replace

import numpy as np
import pytest

import mbsvib as mv
from mbsvib.urdf.closing import ROWS, Assembly, ends, link_frames
from mbsvib.urdf.motion import FREEDOMS
from mbsvib.urdf.reading import read
from tests.urdf.scenes import joint, link, write

KINDS = ("revolute", "prismatic", "planar", "floating", "spherical", "universal")
TREE = link("base") + "".join(
    link(f"l{i}", 1.0) + joint(f"j{i}", "floating", "base" if i == 0 else f"l{i - 1}", f"l{i}", "0.1 0.2 0.3",
                               "0.3 -0.2 0.5", "1 2 2")
    for i in range(len(KINDS)))  # fmt: skip
LAST = f"l{len(KINDS) - 1}"
LOOP = (f'<constraint name="tip" type="universal"><parent link="l0"/><parent_origin xyz="0.2 -0.1 0.4" rpy="0.2 0.1 '
        f'-0.3"/><parent_axis xyz="2 1 -2"/><child link="{LAST}"/><child_origin xyz="0.1 0.1 0.2" rpy="-0.1 0.4 0.2"/>'
        f'<child_axis xyz="1 -2 0.5"/></constraint>')  # fmt: skip


def assembled(tmp_path, kind, held=None):
    """A chain of all kinds of joints, in which a loop of some kind is open, in a random position."""
    robot = read(write(tmp_path, TREE + LOOP))
    joints = {name: replace(part, kind=of, axis2=np.array((0.6, 0.0, -0.8)))
              for (name, part), of in zip(robot.joints.items(), KINDS, strict=True)}  # fmt: skip
    robot = replace(robot, joints=joints, loops=(replace(robot.loops[0], kind=kind),))
    rng = np.random.default_rng(3)
    positions = {name: rng.uniform(-0.6, 0.6, FREEDOMS[part.kind]) for name, part in joints.items()}
    return Assembly(robot, positions, held or {})


@pytest.mark.parametrize("kind", ROWS)
def test_derivatives_of_gaps_are_differences(tmp_path, kind):
    assembly = assembled(tmp_path, kind)
    x = assembly.start / assembly.scale
    gap, slopes = assembly._evaluate(x)
    assert gap.shape == (ROWS[kind],)
    assert np.abs(gap).min() > 1e-3
    h = 1e-5
    found = [(assembly._evaluate(x + h * step)[0] - assembly._evaluate(x - h * step)[0]) / (2 * h)
             for step in np.eye(len(x))]  # fmt: skip
    np.testing.assert_allclose(slopes, np.transpose(found), rtol=0, atol=1e-8)


@pytest.mark.parametrize("kind", ROWS)
def test_loops_of_every_kind_are_closed(tmp_path, kind):
    """What each kind locks is in place: points, axes that coincide or are normal, or all axes."""
    assembly = assembled(tmp_path, kind)
    positions, left = assembly.closed("robot.urdf")
    assert all(value < 1e-10 for value in left.values())
    robot = assembly.robot
    (p1, a1), (p2, a2) = ends(robot.loops[0], link_frames(robot, positions))
    axis = a1 @ robot.loops[0].axis
    between = p2 - p1
    if kind == "universal":
        np.testing.assert_allclose(axis @ a2 @ robot.loops[0].axis2, 0.0, atol=1e-9)
    elif kind in ("fixed", "prismatic"):
        np.testing.assert_allclose(a2, a1, atol=1e-9)
    elif kind != "spherical":
        np.testing.assert_allclose(a2 @ robot.loops[0].axis, axis, atol=1e-9)
    if kind == "prismatic":
        np.testing.assert_allclose(np.cross(between, axis), 0.0, atol=1e-9)
    elif kind == "planar":
        np.testing.assert_allclose(between @ axis, 0.0, atol=1e-9)
    else:
        np.testing.assert_allclose(between, 0.0, atol=1e-9)


def test_rotations_that_are_none_are_refused(tmp_path):
    for quaternion, words in (("0 0 0 0", r"quat_xyzw = \(0, 0, 0, 0\) is not a rotation"), ("0 0 0", "expected 4")):
        turned = joint("j", "revolute", "base", "b").replace('rpy="0 0 0"', f'quat_xyzw="{quaternion}"')
        with pytest.raises(mv.ModelError, match=words):
            mv.load_urdf(write(tmp_path, link("base") + link("b", 1.0) + turned))


@pytest.mark.parametrize(("motor", "ratio", "added"), [("m", 20, {"m.torque"}), ("m", 1, set()), ("", 20, set()),
                                                       ("j", 20, set())])  # fmt: skip
def test_motors_have_an_input_of_their_own_where_it_is_another_one(tmp_path, motor, ratio, added):
    drive = (f'<transmission name="t"><joint name="j"/><actuator name="{motor}"><mechanicalReduction>{ratio}'
             f"</mechanicalReduction></actuator></transmission>")  # fmt: skip
    words = link("base") + link("b", 1.0) + joint("j", "revolute", "base", "b") + drive
    assert set(mv.load_urdf(write(tmp_path, words)).inputs) == {"j.torque"} | added
