"""Joints of which loops tie some coordinates of one vector: all that are held are exactly where they are to be."""

import numpy as np
import pytest
from scipy.optimize import newton
from scipy.spatial.transform import Rotation

import mbsvib as mv
from mbsvib.equilibrium.motion import kinematics_of
from mbsvib.kinematics.closing import Closing
from tests.equilibrium.test_moved import check_pose, without_springs


def rotation_vector(model, there, name):
    """The rotation vector of a joint since ``model``, in its own axes, from the orientations of its bodies."""
    joint = model.joints[name]
    first, second = (Rotation.identity() if body == "ground" else
                     Rotation.from_matrix(there.bodies[body].orientation) *
                     Rotation.from_matrix(model.bodies[body].orientation).inv()
                     for body in (joint.first, joint.second))  # fmt: skip
    return np.array(joint.axes).T @ (first.inv() * second).as_rotvec()


@pytest.mark.slow
@pytest.mark.parametrize("size", [1.0, -4.0])
def test_spherical_feet_of_a_stewart_platform_of_which_loops_tie_one_component(size):
    model = mv.library.stewart_isolator()
    values = {"leg2.foot.rx": 0.04 * size, "leg4.foot.rx": -0.05 * size, "leg5.foot.rx": 0.03 * size}
    there = model.moved(values, relaxed=True)
    for leg in (2, 4, 5):
        turned = rotation_vector(model, there, f"leg{leg}.foot")
        assert np.allclose(turned[[0, 2]], [values[f"leg{leg}.foot.rx"], 0.0], rtol=0, atol=1e-13)
        assert abs(turned[1]) > 1e-2
    check_pose(without_springs(model), without_springs(there))


def tied(kind, count, base="ground"):
    """A body on a joint to ground, or to a body that turns about an oblique axis, that ``count`` rods tie as well."""
    model = mv.Model()
    if base != "ground":
        model.add_body(base, 1.0, (1.0, 1.0, 1.0))
        model.add_joint("turn", "revolute", "ground", base, (0.0, 0.0, 0.0), axis=(1.0, 2.0, 2.0))
    model.add_body("arm", 1.0, (1.0, 1.0, 1.0), (0.3, 0.1, 0.2))
    options = {"end": (0.1, 0.5, 0.9)} if kind == "distance" else {}
    model.add_joint("held", kind, base, "arm", (0.0, 0.0, 0.0), **options)
    for k, (one, other) in enumerate((((1.0, 0.1, 0.3), (1.2, 0.9, -0.2)), ((0.2, 1.0, 0.1), (0.9, 0.8, 1.1)))[:count]):
        model.add_joint(f"tie{k}", "distance", "arm", base, one, end=other)
    return model


@pytest.mark.parametrize(("kind", "count", "held", "turn"), [
    ("spherical", 1, {"held.rx": 0.16, "held.rz": -0.12}, 0.0), ("spherical", 2, {"held.ry": 0.5}, 0.0),
    ("homokinetic", 1, {"held.rx": 0.6}, 0.0), ("spherical", 1, {"held.rx": 0.16, "held.rz": -0.12}, 0.7),
])  # fmt: skip
def test_a_joint_that_rods_tie_holds_what_is_free(kind, count, held, turn):
    model = tied(kind, count, "carrier" if turn else "ground")
    there = model.moved(held | ({"turn.rz": turn} if turn else {}), cut=[f"tie{k}" for k in range(count)])
    turned = dict(zip(("held.rx", "held.ry", "held.rz"), rotation_vector(model, there, "held"), strict=True))
    for name, value in held.items():
        if name in turned:
            assert turned[name] == pytest.approx(value, abs=1e-13)
    assert max(abs(turned[name]) for name in turned if name not in held) > 1e-3
    check_pose(model, there)


@pytest.mark.parametrize("turn", [0.0, 0.7])
def test_the_end_of_a_rod_is_held_along_one_arc(turn):
    model = tied("distance", 1, "carrier" if turn else "ground")
    there = model.moved({"held.x": 0.3} | ({"turn.rz": turn} if turn else {}), cut=["tie0"])
    carried = Rotation.from_rotvec(turn * np.array((1.0, 2.0, 2.0)) / 3.0)
    joint, end = model.joints["held"], carried.inv().apply(there.joints["held"].end)
    rod = np.array(joint.end)
    length = np.linalg.norm(rod)
    assert np.linalg.norm(end) == pytest.approx(length, rel=1e-14)
    across = end - rod * (rod @ end) / length**2
    arc = length * np.arccos(rod @ end / length**2) * across / np.linalg.norm(across)
    along = np.array(joint.axes).T @ arc
    free = [name for name in ("x", "y") if f"held.{name}" in model.linearize(cut=["tie0"]).coordinates]
    assert along[0] == pytest.approx(0.3, abs=1e-13)
    assert "y" in free or abs(along[1]) > 1e-3
    check_pose(model, there)


@pytest.mark.parametrize("turn", [0.0, 0.3])
def test_a_beam_bends_until_a_held_component_is_at_its_value(turn):
    model = mv.Model()
    model.add_body("mass", 1.0, (0.1, 0.1, 0.1), (0.5, 0.0, 0.0))
    if turn:
        model.add_body("carrier", 1.0, (0.1, 0.1, 0.1))
        model.add_joint("turn", "revolute", "ground", "carrier", (0.0, 0.0, 0.0), axis=(0.0, 1.0, 0.0))
    model.add_joint("ball", "spherical", "carrier" if turn else "ground", "mass", (0.0, 0.0, 0.0))
    model.add_beam("beam", "mass", "ground", {"type": "circle", "radius": 0.005}, {"E": 2e11, "nu": 0.3, "rho": 7800.0},
                   start=(0.5, 0.1, 0.0), end=(0.5, 0.1, 2.0), elements=2)
    there = model.moved({"ball.rx": 0.1, "ball.rz": 0.08} | ({"turn.rz": turn} if turn else {}))
    assert np.allclose(rotation_vector(model, there, "ball")[[0, 2]], [0.1, 0.08], rtol=0, atol=1e-12)


@pytest.mark.parametrize(("kind", "names"), [("free", 6), ("spherical", 3), ("homokinetic", 2), ("distance", 5)])
@pytest.mark.parametrize("turned", [0.0, 0.9])
def test_values_change_as_steps_move_the_body(kind, names, turned):
    """A short step from a pose, and the change of the values of the coordinates, lead to the same pose."""
    model = tied(kind, 0, "carrier")
    closing = Closing(kinematics_of(model), (), ())
    kinematics = closing.kinematics
    assert len(kinematics.coordinates.names) == 1 + names
    generator = np.random.default_rng(1)
    q, step = turned * generator.uniform(0.2, 0.5, 1 + names), 1e-5 * generator.standard_normal(1 + names)
    reached = closing.near(q[None], closing.described)
    pose = reached.pose[0]
    for sign in (1.0, -1.0):
        change = closing.changes(reached, sign * step)
        there = kinematics.tree.at(pose, kinematics.at(pose)[0]).moved(sign * step)
        by_values = kinematics.motion.moved(q + change)
        assert np.allclose(by_values.centre, there.centre, rtol=0, atol=1e-9)
        assert np.allclose(by_values.rotations, there.rotations, rtol=0, atol=1e-9)


@pytest.mark.parametrize("angle", [0.5, 4.0, -4.5])
def test_a_held_rotation_vector_is_followed_beyond_half_a_turn(angle):
    """A point of the body on its third axis stays in a plane through that axis, which decides the component between.

    The plane is turned such that the way is free of dead points.
    """
    normal = np.array((np.cos(0.25 * angle), np.sin(0.25 * angle), 0.0))
    model = mv.Model()
    model.add_body("arm", 1.0, (1.0, 1.0, 1.0), (0.1, 0.2, 0.3))
    model.add_joint("held", "spherical", "ground", "arm", (0.0, 0.0, 0.0))
    model.add_joint("plane", "point_on_plane", "ground", "arm", (0.0, 0.0, 1.0), axis=normal)
    between = 0.0
    for share in np.linspace(0.0, 1.0, 41):
        between = newton(lambda y, share=share: normal @ Rotation.from_rotvec(
            (0.2 * share, y, angle * share)).as_matrix()[:, 2], between)  # fmt: skip
    there = model.moved({"held.rx": 0.2, "held.rz": angle}, cut=["plane"])
    expected = Rotation.from_rotvec((0.2, between, angle))
    turned = Rotation.from_matrix(there.bodies["arm"].orientation)
    assert np.allclose((turned * expected.inv()).as_rotvec(), 0.0, rtol=0, atol=1e-12)
