"""Loops whose axes are meant to be aligned: freedom comes back, eigenvalues are off by the tilt at most, trees stay."""

import warnings

import numpy as np
import pytest

import mbsvib as mv
from mbsvib.equations.loop_geometry import turned
from mbsvib.linalg.rotations import exponential
from tests.equations.tilted import LINKAGES, Tilted, Z, door, four_bar, six_bar, slider_crank, spherical_linkage

TILTS = [0.0, 1e-12, 1e-9, 1e-6, 1e-4, 1e-3]


@pytest.mark.few(9)
@pytest.mark.parametrize("seed", [1, 2, 3])
@pytest.mark.parametrize("tilt", TILTS)
@pytest.mark.parametrize("linkage", LINKAGES)
def test_freedom_comes_back_and_eigenvalues_are_off_by_the_tilt_at_most(linkage, tilt, seed):
    exact = linkage(0.0).linearize()
    system = linkage(tilt, seed).linearize(align=2.5e-3)
    assert system.dof == exact.dof == 1
    off = abs(system.modes().frequencies[0] / exact.modes().frequencies[0] - 1.0)
    assert off < 3.0 * tilt + 1e-12
    if tilt not in (1e-12,):  # which rounding may hide, or not
        assert (tilt > 0.0) == ("aligned within the tolerance" in system.explain())


def railed(tilt, seed=0):
    """A slider-crank whose piston is on two rails: they are parallel to each other, and normal to the hinges."""
    model = slider_crank(tilt, seed)
    axis = Tilted(tilt, seed + 1).off(np.array([1.0, 0.0, 0.0]))
    model.add_joint("rail", "prismatic", "ground", "piston", (0.8, 0.5, 0), axis=axis)
    return model


def ball_pair(tilt, seed=0):
    """A four-bar linkage with two balls, one above the other, for its last hinge."""
    model, x = four_bar(tilt, seed), 1.0 + 0.4 * tilt
    model = model.with_parts(joints={name: joint for name, joint in model.joints.items() if name != "D"})
    model.add_joint("low", "spherical", "rocker", "ground", (1.0, 0, -0.2))
    model.add_joint("high", "spherical", "rocker", "ground", (x, 0, 0.2))
    return model


def table(tilt, _seed=0):
    """A table on two slides that free both directions of a plane, one of them held along x."""
    scene = Tilted(tilt)
    scene.body("table", (0.5, 0.5, 0))
    scene.model.add_joint("one", None, "ground", "table", (0, 0, 0), free=("x", "y"))
    scene.model.add_joint("other", None, "ground", "table", (1, 1, 0), free=("x", "y"),
                          orientation=(0.6 * tilt, tilt, 0.3))  # fmt: skip
    scene.joint("rail", "prismatic", "ground", "table", (0, 1, 0), (1, 0, 0))
    scene.spring("table", (0.5, 0.5, 0))
    return scene.model


@pytest.mark.parametrize("linkage", [*LINKAGES, railed, ball_pair, table])
def test_axes_far_out_of_line_come_exactly_into_line(linkage):
    exact, system = linkage(0.0).linearize(), linkage(0.02, 4).linearize(align=0.05)
    assert system.dof == 1
    assert system.modes().frequencies == pytest.approx(exact.modes().frequencies, rel=0.15)


@pytest.mark.parametrize("linkage", [four_bar, six_bar])
def test_planar_linkages_are_off_by_the_square_of_the_tilt(linkage):
    exact = linkage(0.0).linearize().modes().frequencies[0]
    off = [abs(linkage(tilt, 1).linearize(align=2.5e-3).modes().frequencies[0] / exact - 1.0) for tilt in (1e-3, 1e-4)]
    assert off[0] < 10.0 * 1e-6
    assert off[1] < 0.02 * off[0]


@pytest.mark.parametrize("linkage", LINKAGES)
def test_nothing_changes_where_no_freedom_is_gained(linkage):
    exact = linkage(0.0)
    assert exact.aligned(1e-3) is exact
    assert exact.aligned(1e-3).alignments == ()


@pytest.mark.slow
def test_trees_and_loops_that_move_stay_bit_for_bit():
    tree = mv.Model("tree")
    tree.add_body("upper", 1.0, (0.1, 0.1, 0.1), (0, 0, 1))
    tree.add_body("lower", 1.0, (0.1, 0.1, 0.1), (0, 0, 2))
    tree.add_joint("A", "revolute", "ground", "upper", (0, 0, 0), axis=(0, 0, 1))
    tree.add_joint("B", "revolute", "upper", "lower", (0, 1e-4, 1), axis=(1e-4, 0, 1))
    for model in (tree, mv.library.stewart(), mv.library.seven_r(), mv.library.rssr()):
        before, after = model.linearize(), model.linearize(align=1e-2)
        assert model.aligned(1e-2) is model
        assert (before.M == after.M).all()
        assert (before.K == after.K).all()


def test_of_two_groups_only_the_locked_one_is_changed():
    """The joint of a tree and a loop that moves, both with axes that are nearly parallel, keep every bit."""
    model = four_bar(1e-4)
    model.add_body("arm", 1.0, (0.1, 0.1, 0.1), (0, 0, 1))
    model.add_joint("free", "revolute", "ground", "arm", (0, 0, 1), axis=(0, 1e-5, 1))
    after = model.aligned(1e-3)
    assert {change.joint for change in after.alignments} == set("ABCD")
    assert after.joints["free"] is model.joints["free"]
    assert after.bodies == model.bodies


def test_what_gives_no_freedom_is_undone():
    """Two hinges that nearly meet the line of a third, in another plane, are no part of what locks the four-bar."""
    model = four_bar(0.0)
    model.add_body("leaf", 1.0, (0.1, 0.1, 0.1), (0.3, 0.3, 0))
    model.add_joint("low", "revolute", "coupler", "leaf", (0.2, 0.3, 0), axis=(0, 1, 0))
    model.add_joint("high", "revolute", "coupler", "leaf", (0.2, 0.5, 0), axis=(0, 1, 1e-4))
    after = model.aligned(1e-3)
    assert {change.joint for change in after.alignments} == {"low", "high"}
    assert after.linearize().dof == 2


@pytest.mark.slow
@pytest.mark.parametrize("method", ["dense", "sparse"])
def test_every_engine_takes_the_aligned_joints(method):
    model = four_bar(1e-4, 2)
    model.add_input("F", "crank", (0, 1, 0))
    model.add_output("y", "crank", (0, 1, 0))
    aligned = model.aligned(1e-3)
    system = model.linearize(align=1e-3, method=method)
    expected = aligned.linearize().modes().frequencies
    assert system.modes(1).frequencies == pytest.approx(expected, rel=1e-9)
    for name in "ABCD":
        assert f"{name}: turned by" in system.explain()


def test_batches_compiled_plants_poses_and_families_take_the_aligned_joints():
    model = four_bar(1e-4, 2)
    aligned = model.aligned(1e-3)
    masses = [1.0, 2.0, 3.0]
    each = [aligned.with_values({"rocker.mass": mass}).linearize().modes().frequencies[0] for mass in masses]
    batch = model.linearize(values={"rocker.mass": masses}, align=1e-3)
    assert batch.modes().frequencies[:, 0] == pytest.approx(each, rel=1e-12)
    plant = model.compile("rocker.mass", align=1e-3)
    heavier = aligned.with_values({"rocker.mass": 2.0}).linearize()
    np.testing.assert_allclose(plant([2.0]).M, heavier.M, rtol=1e-12)
    moved = aligned.moved({"A.rz": 0.2}, relaxed=True)
    exact = four_bar(0.0).moved({"A.rz": 0.2}, relaxed=True)
    found = moved.linearize().modes().frequencies
    assert found == pytest.approx(exact.linearize().modes().frequencies, rel=1e-4)
    assert "A: turned by" in moved.linearize().explain()
    with pytest.raises(mv.MbsvibError, match="variant"):
        model.linearize(values={"C.orientation.rx": [0.0, 1e-4]}, align=1e-3)


def test_a_truss_that_is_locked_for_good_gets_no_advice():
    """A triangle of three bars on three pins, tilted: with its axes in line it is as rigid as before."""
    scene = Tilted(1e-4)
    a, b, c = (0, 0, 0), (1, 0, 0), (0.4, 0.7, 0)
    for name, ends in {"left": (a, c), "right": (b, c)}.items():
        scene.body(name, *ends)
    scene.joint("A", "revolute", "ground", "left", a)
    scene.joint("B", "revolute", "ground", "right", b)
    scene.joint("C", "revolute", "left", "right", c)
    model = scene.model
    assert model.aligned(1e-2) is model
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        assert model.linearize().dof == 0
    assert not [one for one in caught if "align" in str(one.message)]


@pytest.mark.parametrize("joint", "ABCD")
def test_the_warning_names_the_joint_farthest_from_the_median_and_a_tolerance_that_helps(joint):
    exact = four_bar(0.0)
    axes = {name: part.axis for name, part in exact.joints.items()}
    axes[joint] = (3e-4, -2e-4, 1.0)
    model = exact.replace(joint, axis=axes[joint])
    with pytest.warns(mv.NearSingularWarning, match=rf"joint '{joint}' by 0\.000361 rad .*linearize\(align=0\.001\)"):
        assert model.linearize().dof == 0
    assert model.linearize(align=1e-3).dof == 1


@pytest.mark.parametrize(("linkage", "seed"), [(door, 1), (spherical_linkage, 1)])
def test_loops_that_points_lock_are_told_with_advice_that_helps(linkage, seed):
    model = linkage(1e-4, seed)
    words = r"one line, parallel or through one point: joint '.*linearize\(align=0\.001\)"
    with pytest.warns(mv.NearSingularWarning, match=words):
        assert model.linearize().dof == 0
    assert model.linearize(align=1e-3).dof == 1


@pytest.mark.parametrize(("tilt", "dof"), [(1.8e-3, 1), (2e-3 * (1.0 + 5e-7), 1), (2.2e-3, 0)])
def test_the_tolerance_is_the_angle_from_the_mean(tilt, dof):
    """Two rails, each half the tilt from their mean; a third beside the first lets the second be too far from it."""
    model = mv.Model("rails")
    model.add_body("carriage", 1.0, (0.1, 0.1, 0.1))
    model.add_joint("left", "prismatic", "ground", "carriage", axis=(1, 0, 0))
    model.add_joint("right", "prismatic", "ground", "carriage", (0, 1, 0), axis=(np.cos(tilt), np.sin(tilt), 0))
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", mv.NearSingularWarning)
        assert model.linearize(align=1e-3).dof == dof
        model.add_joint("third", "prismatic", "ground", "carriage", (0, 2, 0), axis=(1, 0, 0))
        assert model.linearize(align=1e-3).dof == 0
        assert model.linearize(align=1.5e-3).dof == 1


@pytest.mark.parametrize(("offset", "dof"), [(0.058, 1), (0.06 * (1.0 + 5e-7), 1), (0.062, 0)])
@pytest.mark.parametrize("kind", ["revolute", "spherical"])
def test_the_tolerance_is_the_distance_from_the_mean_line_as_a_share(kind, offset, dof):
    """Two hinges, or a hinge and a ball, 1 m from each other, each half the offset from their mean line."""
    model = mv.Model("leaf")
    model.add_body("leaf", 1.0, (0.1, 0.1, 0.1), (0.4, 0, 0.5))
    model.add_joint("low", "revolute", "ground", "leaf", (0, 0, 0), axis=(0, 0, 1))
    model.add_joint("high", kind, "ground", "leaf", (offset, 0, np.sqrt(1.0 - offset**2)),
                    axis=None if kind == "spherical" else (0, 0, 1))
    after = model.aligned(0.03)
    assert [change.shift for change in after.alignments] == pytest.approx([0.5 * offset] * 2 * dof)
    if dof:
        np.testing.assert_allclose([joint.position[0] for joint in after.joints.values()], 0.5 * offset)
        assert after.linearize().dof == 1


@pytest.mark.parametrize("kinds", [("prismatic", "cylindrical"), ("cylindrical", "prismatic")])
def test_an_axis_about_and_along_which_a_joint_moves_counts_once(kinds):
    model = mv.Model("rails")
    model.add_body("carriage", 1.0, (0.1, 0.1, 0.1))
    for k, kind in enumerate(kinds):
        model.add_joint(kind, kind, "ground", "carriage", (0, k, 0), axis=(1, 2e-3 * k, 0))
    assert [change.angle for change in model.aligned(1.1e-3).alignments] == pytest.approx([1e-3, 1e-3], rel=1e-3)


def test_balls_are_left_where_they_free_nothing():
    """Two balls carry a bar that turns about their line, wherever that is; a hinge far from it locks it for good."""
    model = mv.Model("bar")
    model.add_body("bar", 1.0, (0.1, 0.1, 0.1), (0.4, 0, 0.5))
    model.add_joint("low", "spherical", "ground", "bar", (0, 0, 0))
    model.add_joint("high", "spherical", "ground", "bar", (1e-3, 0, 1))
    assert model.aligned(1e-2) is model
    model.add_joint("hinge", "revolute", "ground", "bar", (0.5, 0, 0.5), axis=(0, 0, 1))
    assert model.aligned(1e-2) is model


TURNED = {
    "revolute": {"axis": (1, 2, 3)}, "prismatic": {"axis": (1, 2, 3)}, "cylindrical": {"axis": (1, 2, 3)},
    "screw": {"axis": (1, 2, 3), "pitch": 0.2}, "spherical": {}, "planar": {"axis": (1, 2, 3)},
    "universal": {"axis": (1, 2, 3), "axis2": (3, 1, -1)}, "homokinetic": {"axis": (1, 2, 3)},
    None: {"free": ("z", "rx", "rz"), "orientation": (0.1, 0.2, 0.3)},
}


@pytest.mark.parametrize("kind", TURNED)
def test_joints_turn_with_all_of_their_axes(kind):
    model, rotation = mv.Model("turned"), exponential(np.array([0.3, -0.5, 0.7]))
    model.add_body("body", 1.0, (1, 1, 1))
    model.add_joint("joint", kind, "ground", "body", (1, 2, 3), **TURNED[kind])
    before, both = model.joints["joint"], np.kron(np.eye(2), rotation)
    after = turned(before, rotation)
    assert (after.position, after.kind, after.pitch) == (before.position, before.kind, before.pitch)
    for name, six in before.freedom:
        np.testing.assert_allclose(dict(after.freedom)[name], both @ six, rtol=0, atol=1e-14)
    locked = np.array([six for _, six in after.locked]).reshape(-1, 6)
    np.testing.assert_allclose(locked @ both @ np.array([six for _, six in before.freedom]).T, 0.0, atol=1e-14)
    np.testing.assert_allclose(after.axes, rotation @ before.axes, rtol=0, atol=1e-14)


def test_a_universal_joint_in_a_locked_loop_keeps_the_angle_of_its_axes():
    """The coupler of a four-bar on a universal joint: its first axis is tilted; the second one may stay free."""
    at = {"A": (0, 0, 0), "B": (0.2, 0.3, 0), "C": (0.9, 0.6, 0), "D": (1.0, 0, 0)}
    systems = {}
    for tilt in (0.0, 1e-4):
        scene = Tilted(tilt, 3)
        for name, ends in {"crank": "AB", "coupler": "BC", "rocker": "CD"}.items():
            scene.body(name, *(at[end] for end in ends))
        scene.joint("A", "revolute", "ground", "crank", at["A"])
        scene.joint("B", "revolute", "crank", "coupler", at["B"])
        first = scene.off(Z)
        second = scene.off(np.array([0.6, 0.8, 0.0]))
        second = second - (second @ first) * first / (first @ first)
        scene.model.add_joint("C", "universal", "coupler", "rocker", at["C"], axis=first, axis2=second)
        scene.joint("D", "revolute", "rocker", "ground", at["D"])
        scene.spring("crank", at["A"])
        systems[tilt] = scene.model.linearize(align=1e-3)
        assert systems[tilt].dof == 1
    np.testing.assert_allclose(systems[1e-4].modes().frequencies, systems[0.0].modes().frequencies, rtol=3e-4)


@pytest.mark.parametrize("value", [0.0, -1e-3, 0.2, float("nan"), "wide", True])
def test_a_tolerance_out_of_range_is_refused(value):
    with pytest.raises(mv.ModelError, match=r"linearize: align = .*0\.05"):
        four_bar(1e-3).linearize(align=value)


@pytest.mark.parametrize("at", [(0.0, 0.0, 0.0), (30.0, -20.0, 50.0)])
@pytest.mark.parametrize("scale", [1e-3, 1.0, 1e3])
def test_units_of_length_and_places_decide_nothing(scale, at):
    model = mv.Model("scaled")
    model.add_body("leaf", 1.0, np.array([0.1, 0.1, 0.1]) * scale**2, (np.array([0.4, 0, 0.5]) + at) * scale)
    for name, point in (("low", (0, 0, 0)), ("high", (5e-4, 0, 1))):
        model.add_joint(name, "revolute", "ground", "leaf", (np.array(point) + at) * scale, axis=(0, 0, 1))
    assert model.linearize(align=1e-3).dof == 1
    assert [change.shift / scale for change in model.aligned(1e-3).alignments] == pytest.approx([2.5e-4, 2.5e-4])
    assert model.aligned(1e-4) is model


def test_a_cluster_in_the_same_loops_that_locks_nothing_is_left_as_it_is():
    """A spatial loop on the crank of a locked four-bar has two hinges that are nearly parallel; it moves anyway."""
    model = four_bar(1e-4, 1)
    for name, at in (("rod", (0.2, 0.4, 0.5)), ("arm", (0.3, 0.8, 0.6)), ("swing", (0.1, 1.0, 0.2))):
        model.add_body(name, 1.0, (0.1, 0.1, 0.1), at)
    model.add_joint("S", "spherical", "crank", "rod", (0.2, 0.3, 0.3))
    model.add_joint("T", "spherical", "rod", "arm", (0.3, 0.6, 0.7))
    model.add_joint("E", "revolute", "arm", "swing", (0.2, 0.9, 0.5), axis=(1, 0, 0))
    model.add_joint("F", "revolute", "swing", "ground", (0.1, 1.2, 0), axis=(1, 1e-4, 2e-5))
    after = model.aligned(1e-3)
    assert {change.joint for change in after.alignments} == set("ABCD")
    assert after.joints["F"] is model.joints["F"]


def test_a_pair_of_parallel_axes_is_left_as_it_is_together():
    """Two rails in the same loops, parallel to each other and nearly normal to the hinges, which nothing needs."""
    model, axis = four_bar(1e-4, 1), (1.0, 0.0, 1e-4)
    for name, at in (("rod", (0.2, 0.4, 0.5)), ("carriage", (0.3, 0.8, 0.6))):
        model.add_body(name, 1.0, (0.1, 0.1, 0.1), at)
    model.add_joint("S", "spherical", "crank", "rod", (0.2, 0.3, 0.3))
    model.add_joint("T", "spherical", "rod", "carriage", (0.3, 0.6, 0.7))
    model.add_joint("E", "prismatic", "carriage", "ground", (0.2, 0.9, 0.5), axis=axis)
    model.add_joint("F", "prismatic", "carriage", "ground", (0.2, 1.4, 0.5), axis=axis)
    after = model.aligned(1e-3)
    assert {change.joint for change in after.alignments} == set("ABCD")
    assert after.linearize().dof == 2  # the crank, and the spin of the rod


def test_couplers_in_locked_loops_stay():
    """A wheel geared to the crank: its coordinate is one of the loops', and the gear one of their conditions."""
    model = four_bar(1e-4, 2)
    model.add_body("wheel", 1.0, (0.1, 0.1, 0.1), (0, 0, 1))
    model.add_joint("W", "revolute", "ground", "wheel", (0, 0, 1), axis=(0, 0, 1))
    model.add_gear("gear", "A", "W", -2.0)
    after = model.aligned(1e-3)
    assert {change.joint for change in after.alignments} == set("ABCD")
    assert after.linearize().dof == 1
    with pytest.warns(mv.NearSingularWarning, match="lock the motion of .* 1 more degree of freedom"):
        assert model.linearize().dof == 0


def test_loops_that_a_coupler_holds_are_left_as_they_are():
    """The rocker turns by another angle than the crank: no axis frees a gear of ratio 1 between both."""
    model = four_bar(1e-4, 2)
    model.add_gear("gear", "A", "D", 1.0)
    assert model.aligned(1e-3) is model


def test_a_ball_beside_an_axis_locks_a_loop_that_has_other_freedom():
    """A rod, which may spin, from a leaf to a ball that is meant to be on the axis of the leaf's hinge."""
    model = mv.Model("leaf")
    for name, at in (("leaf", (0.4, 0.2, 0.1)), ("rod", (0.25, 0.15, 0.6))):
        model.add_body(name, 1.0, (0.1, 0.1, 0.1), at)
    model.add_joint("hinge", "revolute", "ground", "leaf", (0, 0, 0), axis=(0, 0, 1))
    model.add_joint("tip", "spherical", "leaf", "rod", (0.5, 0.3, 0.2))
    model.add_joint("ball", "spherical", "ground", "rod", (1e-6, 0, 1))
    words = r"lock 1 motion by axes that nearly are on one line, .*: joint 'hinge' by .* and 'ball' by|joint 'ball' by"
    with pytest.warns(mv.NearSingularWarning, match=words):
        assert model.linearize().dof == 1
    assert model.linearize(align=1e-5).dof == 2
