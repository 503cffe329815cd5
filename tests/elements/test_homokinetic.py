"""Homokinetic joints (constant velocity): finite motion, stiffness under load, and every engine that has joints."""

import numpy as np
import pytest

import mbsvib as mv
from mbsvib import plots
from mbsvib.api.in_equilibrium import in_equilibrium
from tests.equilibrium.test_moved import check_pose, pose_of
from tests.loads.test_against_lagrangian import off
from tests.loads.test_joint_forces import SIX, in_axes, with_all_joint_forces
from tests.sensitivities.differences import assert_as_variants, of_variants
from tests.support.lagrangian import Lagrangian

BEND = 0.8  # angle between two shafts


def shafts(kind="homokinetic", across=(0, 1, 0)):
    """Two shafts that meet at an angle, each in bearings of its own, and a joint between them where they meet."""
    model, out = mv.Model("shafts"), np.array([np.sin(BEND), 0, np.cos(BEND)])
    for name, axis, sign in (("driver", np.array([0, 0, 1.0]), -1), ("driven", out, 1)):
        model.add_body(name, 1.0, (0.3, 0.2, 0.1), position=0.4 * sign * axis)
        model.add_joint(f"{name}.bearing", "revolute", "ground", name, position=0.7 * sign * axis, axis=axis)
    if kind == "homokinetic":
        model.add_joint("joint", kind, "driver", "driven", position=(0, 0, 0), axis=np.array([0, 0, 1.0]) + out)
    else:
        second = np.cross(out, across)
        model.add_joint("joint", kind, "driver", "driven", position=(0, 0, 0), axis=across, axis2=second)
    model.add_spring("hold", "ground", "driver", (1, 0, 0), (0, 0.3, 0), 100.0)
    return model, out


@pytest.mark.parametrize("cut", ["joint", "driven.bearing"])
@pytest.mark.parametrize("angle", [0.4, -1.3, 2.9])
def test_both_shafts_turn_at_the_same_rate_whatever_the_angle(cut, angle):
    model, out = shafts()
    there = model.moved({"driver.bearing.rz": angle}, relaxed=True, cut=(cut,))
    turn = np.array(there.bodies["driven"].orientation)
    assert np.allclose(turn @ out, out, rtol=0, atol=1e-12)
    side = np.array([0, 1.0, 0])
    assert np.allclose(turn @ side, np.cos(angle) * side + np.sin(angle) * np.cross(out, side), rtol=0, atol=1e-12)
    for pose in (model, there):
        system = pose.linearize(independent=["driver.bearing.rz"], cut=[cut])
        assert system.dof == 1
        moves = system.displacements([1.0])
        assert np.allclose(moves["driven"][3:], out, rtol=0, atol=1e-12)
        assert np.allclose(moves["driver"][3:], (0, 0, 1), rtol=0, atol=1e-12)


def test_a_universal_joint_at_the_same_place_does_not():
    """Its ratio is cos b / (1 - sin^2 b sin^2 t): the comparison above tells the kinds from each other."""
    model, out = shafts("universal")
    system = model.linearize(independent=["driver.bearing.rz"])
    assert system.displacements([1.0])["driven"][3:] @ out == pytest.approx(np.cos(BEND), rel=1e-12)


def twice(kind):
    """A body on ground by two joints at one point, of which the second is named from the body to ground."""
    model = mv.Model("twice")
    model.add_body("body", 1.0, (0.3, 0.2, 0.1), position=(0.2, 0.1, 0.4))
    model.add_joint("first", "homokinetic", "ground", "body", position=(0, 0, 0))
    model.add_joint("second", kind, "body", "ground", position=(0, 0, 0))
    return model


@pytest.mark.parametrize("method", ["dense", "sparse"])
def test_constraints_of_poses_nearby_turn_with_both_bodies(method):
    """Two equal joints are redundant in every pose; a universal one is so in this pose only."""
    model = twice("homokinetic")
    for cut in (["first"], ["second"]):
        system = model.linearize(cut=cut, method=method)
        assert (system.dof, len(system.redundant)) == (2, 4)
        with pytest.raises(mv.SingularPoseError, match="in neighbouring poses"):
            twice("universal").linearize(cut=cut, method=method)


def test_variants_are_those_one_by_one():
    model, _ = shafts()
    values = {"joint.orientation.rx": [0.02, 0.04], "joint.orientation.rz": [0.3, -0.5]}
    batch = model.linearize(values=values)
    for i in range(2):
        single = model.with_values({name: value[i] for name, value in values.items()}).linearize()
        assert batch[i].coordinates == single.coordinates
        assert np.allclose(batch[i].M, single.M, rtol=1e-12, atol=1e-13)


def bent(kind="homokinetic", loop=False):
    """Two arms on two joints that springs and loads bend far, by 1.5 and 0.5 rad; a rod may close a loop."""
    model = mv.Model("bent", gravity=(0, 0, -9.81))
    model.add_body("a", 2.0, (0.1, 0.2, 0.15), position=(0.5, 0.05, 0.02))
    model.add_body("b", 1.5, (0.1, 0.12, 0.15), position=(1.2, -0.1, 0.1))
    model.add_joint("u", kind, "ground", "a", (0, 0, 0), orientation=(0.1, 1.4, -0.2))
    model.add_joint("v", kind, "b", "a", (0.9, 0, 0), orientation=(0.3, 1.2, 0.2))
    model.add_spring("s", "ground", "b", start=(0.2, 1.0, 0.6), end=(1.3, 0, 0.1), stiffness=40.0)
    model.add_spring("t", "a", "b", start=(0.2, 0.1, 0.3), end=(1.0, 0.2, 0.3), stiffness=30.0)
    model.add_load("f", "b", force=(1, 6, 2), torque=(0.3, -0.5, 0.2), position=(1.3, 0.1, 0))
    if loop:
        model.add_joint("rod", "distance", "ground", "b", (1, 1, 1), end=(1.2, 0.1, 0.1))
    model.add_input("push", "b", (1.0, 0.2, 0.3))
    model.add_output("seen", "b", (0.1, 0.2, 0.3), quantity="acceleration")
    return model


SCENES = [(False, ()), (True, ("rod",)), (True, ("u",)), (True, ("v",))]


@pytest.mark.slow
@pytest.mark.parametrize(("loop", "cut"), SCENES)
def test_equilibrium_and_stiffness_there_are_those_of_the_exact_lagrangian(loop, cut):
    model = bent(loop=loop)
    there, system = in_equilibrium(model, cut=cut)
    assert system.cut_joints == cut
    check_pose(model, there)
    assert off(there, system) < 1e-10
    assert np.abs(Lagrangian(model).at(pose_of(there, model)).residual).max() < 1e-9


@pytest.mark.parametrize("cut", [("rod",), ("u",)])
def test_a_universal_joint_is_another_one_under_load(cut):
    there, system = in_equilibrium(bent(loop=True), cut=cut)
    for name in "uv":
        there = there.replace(name, kind="universal")
    universal = there.linearize(cut=cut, independent=system.coordinates)
    assert np.allclose(universal.M, system.M, rtol=1e-13)
    assert np.abs(universal.K - system.K).max() > 1e-2 * np.abs(system.K).max()


@pytest.mark.few(1)
@pytest.mark.parametrize(("loop", "cut"), SCENES)
def test_forces_in_joints_change_as_the_static_response_says(loop, cut):
    there, _ = in_equilibrium(bent(loop=loop))
    there.add_input("more", "b", (0.3, -0.2, 0.5, 0.1, 0.2, -0.3))
    system = with_all_joint_forces(there).linearize(cut=cut)
    result = system.Cq @ np.linalg.solve(system.K, system.B[:, 1]) + system.D[:, 1]
    changed = []
    for size in (1e-3, -1e-3):
        pushed = there.replace("more")
        pushed.add_load("more.load", "b", size * np.array([0.3, -0.2, 0.5]), size * np.array([0.1, 0.2, -0.3]))
        at = pushed.equilibrium()
        reactions = {name: wrench for name, wrench in at.linearize(cut=cut).reactions.items() if name in "uv"}
        changed.append(in_axes(there, at, reactions))
    expected = (changed[0] - changed[1]) / 2e-3
    known = [system.outputs.index(f"{name}.{way}") for name in "uv" for way in SIX]
    assert np.abs(result[known] - expected).max() < 1e-6 * np.abs(expected).max()


@pytest.mark.few(2)
@pytest.mark.parametrize(("loop", "cut"), SCENES)
def test_sparse_equations_are_the_dense_ones(loop, cut):
    model = bent(loop=loop)
    model = model.replace("f", torque=(0, 0, 0))  # sparse equations take symmetric stiffness only
    there, dense = in_equilibrium(model, cut=cut)
    for name in there.joints:
        there.add_force_output(f"{name}.turn", name, (0, 0, 0, 0.3, 0.2, 1.0) if name in "uv" else "z")
    omega = np.array([0.0, 3.0, 40.0])
    expected = there.linearize(cut=cut).frequency_response(omega)
    result = there.linearize(cut=cut, method="sparse").frequency_response(omega)
    assert np.allclose(result, expected, rtol=1e-9, atol=1e-11 * np.abs(expected).max())
    assert np.allclose(expected[0], dense.frequency_response(omega)[0], rtol=1e-10)


@pytest.mark.slow
@pytest.mark.parametrize(("loop", "cut"), [SCENES[0], pytest.param(*SCENES[3], marks=pytest.mark.slow)])
def test_sensitivities_through_an_equilibrium_far_from_where_joints_are_described(loop, cut):
    """Axes of coordinates turn with the square root of the rotation, which a bend of 1.5 rad tells from its half."""
    model = bent(loop=loop)
    _, system = in_equilibrium(model, cut=cut)
    assert system.sensitivity_basis.loaded is not None
    names = ["a.mass", "u.orientation.ry", "v.position.y"]
    result = system.matrix_derivatives(names)
    for k, name in enumerate(names):
        assert_as_variants(result, k, system, of_variants(system, name), model.parameters[name], 1e-8, 1e-10)


@pytest.mark.few(2)
@pytest.mark.parametrize("free", [("rx", "ry"), ("ry", "rx"), ("rx", "rz"), ("rz", "ry")])
def test_two_rotations_by_name_are_those_of_a_universal_joint_in_the_order_of_their_names(free):
    there, _ = in_equilibrium(bent())
    named, universal, (i, k) = there, there, ("xyz".index(way[1]) for way in free)
    for name in "uv":
        axes = np.array(there.joints[name].axes)
        columns = np.zeros((3, 3))
        columns[:, i], columns[:, k], columns[:, 3 - i - k] = axes.T * [[1], [1], [1 if (k - i) % 3 == 1 else -1]]
        named = named.replace(name, kind=None, free=free, orientation=columns)
        universal = universal.replace(name, kind="universal")
    result, expected = named.linearize(), universal.linearize()
    assert result.coordinates == ("u." + free[0], "u." + free[1], "v." + free[0], "v." + free[1])
    size = np.abs(expected.K).max()
    assert np.abs(result.K - expected.K).max() < 1e-12 * size
    assert off(named, result) < 1e-10
    swapped = named.replace("u", free=free[::-1]).replace("v", free=free[::-1]).linearize()
    order = [1, 0, 3, 2]
    assert np.abs(swapped.K[np.ix_(order, order)] - result.K).max() > 1e-3 * size


@pytest.mark.parametrize("cut", ["u", "rod"])
def test_couplers_on_a_homokinetic_joint(cut):
    there, _ = in_equilibrium(bent(loop=True))
    there.add_coupler("tie", {"u.rx": 1.0, "u.ry": -0.5, "v.rx": 0.3})
    there = there.equilibrium(preload=True)
    system = there.linearize(cut=[cut])
    assert system.dof == 2
    assert off(there, system) < 1e-10


@pytest.mark.parametrize("kind", ["homokinetic", "universal"])
def test_couplers_on_a_homokinetic_joint_stay_in_the_pose_in_which_they_are_described(kind):
    """Its rotation vector is no linear function of its coordinates in another pose, as universal joints' angles are."""
    model = bent(kind)
    model.add_coupler("tie", {"u.rx": 1.0, "v.rx": 0.3})
    values = {"v.rx": 0.2, "u.ry": 0.3}
    if kind == "universal":
        check_pose(model, model.moved(values))
        return
    with pytest.raises(mv.ModelError, match=r"coupler 'tie': 'u.rx' .* of the homokinetic joint 'u', which has turned"):
        model.moved(values)
    with pytest.raises(mv.ModelError, match=r"coupler 'tie': 'u.rx' .* of the homokinetic joint 'u', which has turned"):
        model.equilibrium()


@pytest.mark.slow
def test_files_pictures_and_words(tmp_path):
    model = bent()
    for name in ("bent.yaml", "bent.json"):
        again = mv.load(mv.save(model, tmp_path / name))
        assert again.joints == model.joints
    there = model.moved({"u.rx": 0.3, "v.ry": -0.4})
    assert there.joints["u"].kind == "homokinetic"
    assert there.moved({"v.ry": 0.4, "u.rx": -0.3}).bodies["b"].position == pytest.approx(model.bodies["b"].position)
    assert len(plots.mechanism(model).axes) == 1
