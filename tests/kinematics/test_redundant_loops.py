"""Loops that are redundant as a whole or in part, about any axis: never refused, and never taken for a lock."""

from itertools import combinations

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.spatial.transform import Rotation

import mbsvib as mv
from tests.support.random_models import rotation
from tests.support.redundant import ARRANGEMENTS, COMMON, DIRECTIONS, PAIRS, PLACES, Pair
from tests.support.sizes import few

pytestmark = pytest.mark.filterwarnings("error::mbsvib.NearSingularWarning")
METHODS = ("dense", "sparse")


def some(seed, kinds=PAIRS):
    """Pairs of joints in line, each about an axis of its own, in turn in every arrangement, size and distance."""
    for k, pair in enumerate(kinds):
        rng = np.random.default_rng((seed, k))
        arrangement = ARRANGEMENTS[(seed + k) % len(ARRANGEMENTS)]
        yield Pair(pair, rng, arrangement, PLACES[(seed + k // 3) % len(PLACES)])


def check_as_drawn(pair):
    for method in METHODS:
        system = pair.model.linearize(method=method)
        pair.check(system)
        pair.check_names(system)
    if pair.arrangement == "one body" and pair.dof:
        result = 2 * np.pi * pair.model.linearize().modes().frequencies
        assert_allclose(result, pair.frequencies(), rtol=1e-8, err_msg=system.name)


def check_elsewhere(pair):
    """The same count in a pose to which the mechanism has moved along all its freedoms."""
    system = pair.model.linearize()
    if not system.dof:
        return
    unit = [1.0 if unit == "rad" else pair.size for unit in system.coordinate_units]
    steps = (pair.rng.uniform(-0.7, 0.7, size=system.dof) * unit).tolist()
    model = pair.model.moved(dict(zip(system.coordinates, steps, strict=True)), relaxed=True)
    for method in METHODS:
        pair.check(model.linearize(method=method))


def check_variants(pair, rng, count):
    """One batch of variants, each turned about another axis: the equations are those of single models."""
    joints = [joint for joint in pair.model.joints.values() if joint.name in "ab" and joint.kind != "distance"]
    if len(joints) < 2 or pair.arrangement == "two bodies in one":
        return
    turns = rng.uniform(-1.5, 1.5, size=(count, 3))
    values = {}
    for joint in joints:
        arm = np.array(joint.position) - pair.origin
        moved = pair.origin + Rotation.from_rotvec(turns).apply(arm)
        for k, axis in enumerate("xyz"):
            values |= {f"{joint.name}.position.{axis}": moved[:, k], f"{joint.name}.orientation.r{axis}": turns[:, k]}
    batch = pair.model.linearize(values=values)
    pair.check(batch.nominal)
    single = pair.model.with_values({name: array[-1] for name, array in values.items()})
    M = single.linearize(independent=batch.coordinates).M
    assert_allclose(batch.M[-1], M, rtol=0, atol=1e-7 * np.abs(M).max(initial=0.0))


@pytest.mark.slow
def test_any_two_joints_in_line():
    """The count is that of integers, the frequencies are those of the motions that both joints allow."""
    for pair in some(1):
        check_as_drawn(pair)


@pytest.mark.slow
def test_any_two_joints_in_line_after_moving():
    for pair in some(2, COMMON + PAIRS[::7]):
        check_elsewhere(pair)


@pytest.mark.slow
def test_any_two_joints_in_line_in_variants():
    for k, pair in enumerate(some(0, PAIRS[::2])):
        check_variants(pair, np.random.default_rng(k), 5)


def door(second=None, axis=None, rng=None, gap=0.7, arm=1.0):
    """A door on a hinge about a random axis, and a second joint on it, ``gap`` m further; also its origin and axes."""
    rng = np.random.default_rng(1) if rng is None else rng
    turn, origin = rotation(rng), rng.uniform(-1, 1, size=3)
    model = mv.Model("door", gravity=(0, 0, -9.81))
    model.add_body("door", 2.0, (0.1, 0.2, 0.3), origin + turn @ (0.5 * arm, 0.1, 0.3))
    model.add_joint("hinge", "revolute", "ground", "door", origin, axis=turn[:, 2])
    if second is not None:
        at = turn[:, 2] if axis is None else turn @ axis
        model.add_joint("second", second, "ground", "door", origin + gap * turn[:, 2], axis=at)
    model.add_bushing("k", "ground", "door", origin, (0, 0, 0, 0, 0, 30.0), orientation=turn)
    return model, origin, turn


@pytest.mark.parametrize("method", METHODS)
def test_explain_tells_of_a_loop_that_locks_nothing(method):
    model, _, _ = door("revolute")
    model.gravity = None
    text = model.linearize(method=method).explain()
    assert "second: 0 of 5 constraint rows independent; largest pivot dropped " in text
    dropped = float(text.split("largest pivot dropped ")[1].split()[0])
    assert dropped < 1e-14
    assert "redundant: second.x, second.y, second.z, second.rx, second.ry" in text


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("angle", [1e-11, 1e-8, 1e-5, 1e-2])
def test_a_lock_that_rests_on_a_small_angle_is_warned_of(method, angle):
    """Hinges out of line by so little lock each other, but hardly anyone means that."""
    model, _, _ = door("revolute", (angle, 0, 1))
    with pytest.warns(mv.NearSingularWarning, match=rf"lock .* hinge\.rz: joint 'second' by {angle:.3g} rad"):
        system = model.linearize(method=method)
    assert (system.dof, len(system.redundant)) == (0, 4)


def test_variants_of_a_door_that_is_locked():
    """In line one has a freedom that the others lack; nearly in line its lock is warned of."""
    model, origin, turn = door("revolute", rng=np.random.default_rng(3))
    locked = model.replace("second", position=origin + turn @ (0.2, 0, 0.7))
    locked.gravity = None

    def linearized(*second):
        positions = origin + np.array([(0.1, 0.1, 0.7), second]) @ turn.T
        return locked.linearize(values={f"second.position.{axis}": positions[:, k] for k, axis in enumerate("xyz")})

    with pytest.raises(mv.SingularPoseError, match=r"variant 1: its loops leave 1 degree of freedom, .* pose 0"):
        linearized(0, 0, 0.4)
    with pytest.warns(mv.NearSingularWarning, match="^variant 1: .*nearly singular"):
        assert linearized(1e-10, 0, 0.4).dof == 0
    assert linearized(1e-2, 0, 0.4).dof == 0


@pytest.mark.few(2)
@pytest.mark.parametrize("kinds", COMMON, ids=" and ".join)
def test_loops_of_a_centimetre_a_hundred_thousand_kilometres_off(kinds):
    """Points are rounded by 1e-6 of the loop: more than the poses nearby are off from this one."""
    for seed in range(3):
        pair = Pair(kinds, np.random.default_rng(seed), "two bodies on a third", (1e-2, 1e8))
        for method in METHODS:
            pair.check(pair.model.linearize(method=method))


@pytest.mark.slow
@pytest.mark.parametrize("kinds", [("cylindrical", "screw"), ("screw", "screw"), ("screw", "cylindrical")])
def test_screws_at_one_point_in_any_unit(kinds):
    """Loops without a size are measured by the pitch."""
    for seed in range(6):
        for size in (1e-6, 1e6):
            pair = Pair(kinds, np.random.default_rng(seed), "two bodies on a third", (size, 0.0))
            for method in METHODS:
                pair.check(pair.model.linearize(method=method))


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("digits", [4, 6, 9, 12])
@pytest.mark.filterwarnings("ignore::mbsvib.AccuracyWarning")
def test_frames_of_some_digits_are_taken_as_frames(digits, method):
    """Typed with a few digits, it is off from being orthonormal; joints about it are in line all the same."""
    for seed in range(4):
        turn = np.round(rotation(np.random.default_rng(seed)), digits)
        model = mv.Model("typed")
        model.add_body("door", 1.0, (0.1, 0.2, 0.3), (0.5, 0.2, 0.1))
        model.add_joint("hinge", "revolute", "ground", "door", (0, 0, 0), orientation=turn)
        words = {"orientation": turn} if seed % 2 else {"axis": turn[:, 2]}
        model.add_joint("second", "revolute", "door", "ground", 0.7 * turn[:, 2], **words)
        assert model.linearize(method=method).dof == 1


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize(("count", "ratio"), [(12, 0.1), (12, 10.0), (30, 1.3)])
def test_coaxial_shafts_of_many_sizes(count, ratio, method):
    """Each in two bearings, and joined to the next, over up to twelve decades of length."""
    rng = np.random.default_rng(count)
    axis = rotation(rng)[:, 2]
    model, along, before, origin = mv.Model("shafts"), 0.0, "ground", rng.uniform(-1, 1, size=3)
    for k in range(count):
        length, name = ratio**k, f"shaft {k}"
        inertia = np.full(3, length**3)
        model.add_body(name, length, inertia, origin + (along + 0.5 * length) * axis)
        for bearing, share in (("near", 0.2), ("far", 0.8)):
            at = origin + (along + share * length) * axis
            kind = "spherical" if bearing == "far" and k % 2 else "revolute"
            model.add_joint(f"{bearing} {k}", kind, "ground", name, at, axis=axis)
        if k:
            kind = ("revolute", "cylindrical", "spherical")[k % 3]
            model.add_joint(f"joint {k}", kind, before, name, origin + along * axis, axis=-3.0 * axis)
        before, along = name, along + length
    assert model.linearize(method=method).dof == count


@pytest.mark.slow
def test_a_hinge_that_is_small_against_its_bodies_moved_again_and_again():
    """Points of a body that turns are rounded by how far they are from its centre of mass."""
    for second in ("revolute", "spherical", "cylindrical"):
        model, _, _ = door(second, gap=0.01, arm=1e3)
        model.gravity = None
        for k in range(12):
            model = model.moved({"hinge.rz": 0.5 - 0.08 * k}, relaxed=True)
        for method in METHODS:
            assert model.linearize(method=method).dof == 1


@pytest.mark.slow
@pytest.mark.parametrize("arm", few([1e3, 1.0], 1))
def test_axes_through_one_point_moved_again_and_again(arm):
    """A spherical four-bar: its joints are one point but for rounding, by which it has no size."""
    rng = np.random.default_rng(2)
    axes = [axis / np.linalg.norm(axis) for axis in np.array([(0, 0, 1), (0.3, 0, 1), (0.5, 0.6, 1), (-0.2, 0.7, 1)])]
    model, center, turn = mv.Model("spherical"), rng.uniform(-1, 1, size=3), rotation(rng)
    bodies = ["ground", "crank", "coupler", "rocker", "ground"]
    for name in bodies[1:4]:
        model.add_body(name, 1.0, (0.1, 0.2, 0.3), center + arm * rng.uniform(-1, 1, size=3))
    for k, axis in enumerate(axes):
        model.add_joint(f"j{k}", "revolute", bodies[k], bodies[k + 1], center, axis=turn @ axis)
    model.add_bushing("k", "ground", "crank", center, (0, 0, 0, 5.0, 5.0, 5.0))
    model.add_input("push", "coupler", "x")
    model.add_force_output("pin", "j1", "x")
    for _ in range(6):
        result = []
        for method in METHODS:
            with pytest.warns(mv.UndeterminedForceWarning):
                system = model.linearize(method=method)
            assert (system.dof, len(system.redundant)) == (1, 3)
            assert "L = 1 m" in system.explain()
            result.append(float(system.frequency_response([2.0]).real[0, 0, 0]))
        assert result[0] == pytest.approx(result[1], rel=1e-11 * arm)
        model = model.moved({"j0.rz": 0.2}, relaxed=True)


@pytest.mark.slow
def test_two_equal_joints_in_one_place():
    """The second is redundant in this pose and in all others, whatever the first leaves free."""
    for k, free in enumerate(free for count in range(1, 6) for free in combinations(DIRECTIONS, count)):
        rng = np.random.default_rng(k)
        model, at, turn = mv.Model("twins"), rng.uniform(-1, 1, size=3), rotation(rng)
        model.add_body("door", 1.0, (0.1, 0.2, 0.3), at + turn @ (0.3, 0.2, 0.1))
        for name in "ab":
            model.add_joint(name, None, *(("ground", "door") if k % 2 else ("door", "ground")), at, orientation=turn,
                            free=free)  # fmt: skip
        system = model.linearize(method=METHODS[k % 2])
        assert (system.dof, len(system.redundant)) == (len(free), 6 - len(free)), free


@pytest.mark.slow
def test_a_thousand_axes():
    for seed in range(1000):
        for pair in some(seed, [COMMON[seed % len(COMMON)]]):
            check_as_drawn(pair)
            check_elsewhere(pair)


@pytest.mark.slow
def test_all_pairs_about_a_thousand_axes_in_variants():
    for k, pair in enumerate(some(1)):
        check_variants(pair, np.random.default_rng(k), 1000)


@pytest.mark.slow
def test_all_pairs_about_ten_axes():
    for seed in range(10):
        for pair in some(seed):
            check_as_drawn(pair)
            check_elsewhere(pair)


@pytest.mark.parametrize("values", [None, {"rod.position.x": [0.1, 0.2]}])
def test_what_loops_lock_moves_by_exactly_0(values):
    """Two bodies that loops hold together: 1e-16 in B and Cq made norms of an undamped mechanism infinite."""
    rng, model = np.random.default_rng(0), mv.Model()
    for body in ("a", "b"):
        model.add_body(body, 1.0, (0.1, 0.1, 0.1), position=rng.normal(size=3))
    model.add_joint("plane", "point_on_plane", "ground", "a", position=rng.normal(size=3), axis=rng.normal(size=3))
    model.add_joint("rod", "distance", "ground", "b", position=rng.normal(size=3), end=rng.normal(size=3))
    model.add_joint("hinge", "revolute", "a", "b", position=rng.normal(size=3), axis=rng.normal(size=3))
    model.add_joint("ball", "spherical", "a", "b", position=rng.normal(size=3))
    model.add_bushing("k", "ground", "b", rng.normal(size=3), (1e3, 1e3, 1e3, 10, 10, 10))
    model.add_input("t", "b", "y", relative_to="a")
    model.add_output("r", "b", "ry", relative_to="a")
    model.add_output("z", "b", "z")
    system = model.linearize(values=values)
    assert not np.any(system.B)
    assert not np.any(system.Cq[..., 0, :])
    if values is None:
        assert system.dof == 4
        assert system.h2_norm("z", "t").value == 0.0
