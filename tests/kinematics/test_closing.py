"""Many poses at once: loops closed by Newton's method on coordinates that depend on others."""

import numpy as np
import pytest

import mbsvib as mv
from mbsvib.equilibrium.moved import Poses
from mbsvib.linalg.rotations import exponential, jacobian
from tests.equilibrium.test_moved import four_bar
from tests.kinematics.test_dead_centre import rocker


def test_angles_of_a_rocker_over_a_turn_of_its_crank():
    model, _ = four_bar(angle=0.8)
    turns = np.linspace(-3.0, 6.0, 7)
    poses = Poses.of(model, ["A.rz"], None).at(turns[:, None])
    turned = poses.rotations[:, poses.number["rocker"]]
    expected = np.array([rocker(0.8 + turn) - rocker(0.8) for turn in turns])
    np.testing.assert_allclose(np.arctan2(turned[:, 1, 0], turned[:, 0, 0]), expected, rtol=0, atol=2e-15)


def test_the_first_guess_follows_a_rocker_to_second_order():
    model, _ = four_bar(angle=0.8)
    closing, step = Poses.of(model, ["A.rz"], None).to_second_order().closing, 1e-3
    names = closing.kinematics.coordinates.names
    # the first body of joint D is the rocker
    curvature = -(rocker(0.8 + step) - 2.0 * rocker(0.8) + rocker(0.8 - step)) / step**2
    np.testing.assert_allclose(2.0 * closing.curvature[0, names.index("D.rz")], curvature, rtol=1e-5, atol=0)


def test_poses_of_a_batch_know_how_far_their_bodies_have_moved():
    steps = np.array([[0.04], [-0.05]])
    alone = Poses.of(mv.library.rssr(), ["ball12.rx"], None)
    poses = alone.to_second_order()
    there = poses.at(steps)
    np.testing.assert_array_equal(there.change[0], there.centre - there.origin)
    np.testing.assert_array_equal(there.change[1], there.rotations - np.eye(3))
    np.testing.assert_allclose(poses.closing.kinematics.openings(there), 0.0, rtol=0, atol=2e-15)
    turns = [alone.at(step[None]).rotations[0] for step in steps]
    np.testing.assert_allclose(there.rotations, turns, rtol=0, atol=4e-15)


def test_the_pose_that_cannot_be_reached_is_told_by_its_number():
    model, _ = four_bar(angle=0.8)
    with pytest.raises(mv.ModelError, match=r"^variant 1: .* closed up to D\.rz = 0\.\d+ and no further"):
        Poses.of(model, ["D.rz"], None).at(np.array([[-0.2], [1.5], [0.1]]), "variant", 0)


def test_the_jacobian_of_the_exponential():
    w = np.array([[0.0, 0.0, 0.0], [0.01, -0.02, 0.03], [0.4, -2.0, 1.1]])
    for direction in np.eye(3):
        step = exponential(w + 2e-20j * direction)
        spin = step.imag @ step.real.swapaxes(-1, -2) / 2e-20
        expected = np.stack((spin[:, 2, 1], spin[:, 0, 2], spin[:, 1, 0]), axis=-1)
        np.testing.assert_allclose(jacobian(w) @ direction, expected, rtol=0, atol=1e-15)
