"""Cut joints: rank, redundant rows, minimal coordinates, and poses that are singular."""

import warnings

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st
from numpy.testing import assert_allclose

import mbsvib as mv
from tests.mechanism.test_topology import four_bar
from tests.support import overconstrained
from tests.support.compare import assert_same_matrices, linearized
from tests.support.exact import Exact
from tests.support.random_models import (
    closed_loops,
    moved,
    planar,
    planar_loops,
    rebuilt,
    rotation,
    seeds,
    turned,
)
from tests.support.sizes import examples


@pytest.mark.slow
@examples(20, slow=40)
@given(st.one_of(closed_loops(), planar_loops(), planar_loops(offset=st.just(1e4))))
def test_rank_and_redundant_rows(model):
    system, reference = linearized(model), Exact(model)
    assert (system.dof, len(system.redundant)) == (reference.dof, reference.redundant)
    for name in system.redundant:
        joint, direction = name.rsplit(".", 1)
        assert joint in system.cut_joints
        assert direction in dict(model.joints[joint].locked)


@pytest.mark.slow
@given(seeds(), st.integers(3, 6), st.integers(1, 2))
def test_planar_loops_have_three_redundant_rows_each(seed, bodies, loops):
    """Where the loops leave a freedom; a loop that locks itself has more."""
    model = planar(seed, bodies, loops)
    system = linearized(model)
    assume(system.dof == bodies - 3 * loops + loops)
    assert len(system.redundant) == 3 * loops


def test_redundant_rows_of_a_plane_are_those_out_of_it():
    system = four_bar().linearize()
    cut = system.cut_joints[0]
    assert set(system.redundant) == {f"{cut}.z", f"{cut}.rx", f"{cut}.ry"}


@pytest.mark.slow
@examples(15, slow=40)
@given(st.one_of(closed_loops(), planar_loops()), seeds())
def test_any_independent_coordinates_may_be_pinned(model, seed):
    """The same motion in other coordinates; those asked for are among the minimal ones."""
    system = linearized(model)
    everything = system.provenance.joint_coordinates
    assume(system.dof > 0)
    wanted = [str(name) for name in np.random.default_rng(seed).permutation(everything)[: system.dof]]
    reference = Exact(model)
    singular = np.linalg.svd([relative(system, everything, name) for name in wanted], compute_uv=False)
    if singular[-1] < 1e-10 * max(1.0, singular[0]):
        with pytest.raises(mv.ModelError, match="independent: the loops leave no choice"):
            model.linearize(independent=wanted)
        return
    assume(singular[-1] > 1e-3)
    other = linearized(model, independent=wanted)
    assert sorted(other.coordinates) == sorted(wanted)
    assert_same_matrices(other, reference, rtol=1e-11 / singular[-1] ** 2)


def relative(system, everything, name):
    """Row of B'': a joint coordinate per unit of the minimal ones."""
    matrix = system.provenance.reduction.matrix
    return np.eye(system.dof)[everything.index(name)] if matrix is None else matrix[everything.index(name)]


def test_one_pinned_coordinate_may_be_a_word():
    model = four_bar()
    for name in ("j1.rz", "j2.rz", "j4.rz"):
        if name.split(".")[0] in model.linearize().tree:
            assert model.linearize(independent=name).coordinates == (name,)


def test_unknown_and_cut_coordinates_cannot_be_pinned():
    model = four_bar()
    with pytest.raises(mv.ModelError, match=r"independent = 'j1.ry' is not a joint coordinate.*Did you mean 'j1.rz'"):
        model.linearize(independent=["j1.ry"])
    cut = model.linearize().cut_joints[0]
    with pytest.raises(mv.ModelError, match="cut"):
        model.linearize(independent=[f"{cut}.rz"])


@pytest.mark.parametrize("count", [2, 3])
def test_too_many_pinned_coordinates_are_refused(count):
    model = four_bar()
    names = [f"{name}.rz" for name in model.linearize().tree][:count]
    with pytest.raises(mv.ModelError, match=r"no choice in which all of j.* are independent"):
        model.linearize(independent=names)


def test_all_coordinates_of_a_loop_that_locks_nothing_may_be_pinned():
    model = mv.Model("idle loop")
    model.add_body("a", 1.0, (1, 1, 1))
    model.add_joint("pin", "revolute", "ground", "a", position=(0, 0, 0))
    model.add_joint("slack", None, "a", "ground", position=(0, 0, 1), free=("x", "y", "rz"))
    assert model.linearize().coordinates == ("pin.rz",)
    assert model.linearize(independent=["pin.rz"]).coordinates == ("pin.rz",)


@pytest.mark.slow
@examples(20, slow=20)
@given(closed_loops(ports=st.just(False)), seeds())
def test_any_joint_of_a_loop_may_be_cut(model, seed):
    """The mechanism is the same wherever its loops are cut: so are the natural frequencies."""
    system = linearized(model)
    cut = []
    rng = np.random.default_rng(seed)
    for name in rng.permutation(list(model.joints)):
        if len(cut) < len(system.cut_joints) and spans(model, [*cut, name]):
            cut.append(str(name))
    other = linearized(model, cut=cut)
    assert set(other.cut_joints) == set(cut)
    assert other.dof == system.dof
    if system.dof:
        first, second = system.modes().frequencies, other.modes().frequencies
        assert_allclose(first, second, rtol=1e-9, atol=1e-12 * first.max())


def spans(model, without):
    """Whether ground still reaches all bodies."""
    reached, size = {"ground"}, 0
    while len(reached) > size:
        size = len(reached)
        for joint in model.joints.values():
            if joint.name not in without and reached & {joint.first, joint.second}:
                reached |= {joint.first, joint.second}
    return len(reached) == len(model.bodies) + 1


def scaled(model, factor):
    """The same mechanism in another size; stiffness against rotation grows with the square of it."""

    def change(part, words):
        for key in ("position", "start", "end"):
            if key in words:
                words[key] = factor * np.array(words[key])
        if "inertia" in words:
            words["inertia"] = factor**2 * np.array(words["inertia"])
        if words.get("pitch") is not None:
            words["pitch"] = factor * words["pitch"]
        return words

    return rebuilt(model, change)


@pytest.mark.slow
@given(st.one_of(planar_loops(ports=st.just(False)), closed_loops(ports=st.just(False))), st.sampled_from([1e-4, 1e4]))
def test_rank_knows_no_units(model, factor):
    system, other = linearized(model), linearized(scaled(model, factor))
    assert other.dof == system.dof
    assert len(other.redundant) == len(system.redundant)


def flat(lift, turn=None):
    """A four-bar whose bars lie almost in one line: 1 + 1 + 1 against a ground of 3 long, lifted by ``lift``."""
    turn = np.eye(3) if turn is None else turn
    corners = np.array([(0, 0, 0), (1, lift, 0), (2, lift, 0), (3, 0, 0)]) @ turn.T
    model = mv.Model("flat")
    for i in range(3):
        model.add_body(f"b{i}", 1.0, (0.1, 0.1, 0.1), position=(corners[i] + corners[i + 1]) / 2)
    for k, pair in enumerate([("ground", "b0"), ("b0", "b1"), ("b1", "b2"), ("b2", "ground")]):
        model.add_joint(f"j{k}", "revolute", *pair, position=corners[k], axis=turn[:, 2])
    model.add_bushing("k", "ground", "b0", corners[0], (0, 0, 0, 100, 100, 100))
    return model


@pytest.mark.parametrize("turned", [False, True])
def test_a_stretched_four_bar_is_refused_by_name(turned):
    turn = rotation(np.random.default_rng(4)) if turned else None
    with pytest.raises(mv.SingularPoseError, match=r"j[0-3].*degrees of freedom|j[0-3].*too close"):
        flat(0.0, turn).linearize()


@pytest.mark.parametrize("lift", [2e-8, 1e-9])
def test_just_off_a_singular_pose_is_warned_of(lift):
    with pytest.warns(mv.NearSingularWarning, match=r"loops closed by j[0-3]: nearly singular"):
        system = flat(lift).linearize()
    assert system.dof == 1


@pytest.mark.parametrize("lift", [1.0, 1e-2, 1e-3])
def test_off_the_singular_pose_the_digits_are_there(lift):
    model = flat(lift)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", mv.NearSingularWarning)
        system = model.linearize()
    assert (system.dof, len(system.redundant)) == (1, 3)
    assert_same_matrices(system, Exact(model), rtol=1e-13 / lift**2)


@pytest.mark.few(2)
@pytest.mark.parametrize("factor", [1e-3, 100.0])
@pytest.mark.parametrize("seed", range(8))
def test_small_and_large_loops_far_from_the_origin(factor, seed):
    """Positions are rounded relative to the distance from the origin, not to the size of the loop."""
    model = moved(scaled(planar(seed, 4, 1, damped=False, ports=False), factor), (1e4, -3e3, 5e3))
    system, reference = model.linearize(), Exact(model)
    assert (system.dof, len(system.redundant)) == (reference.dof, reference.redundant)
    assert_allclose(system.modes().frequencies * 2 * np.pi, np.sqrt(reference.squares), rtol=1e-9)


@pytest.mark.few(12)
@pytest.mark.parametrize("place", ["as drawn", "turned", "turned and moved"])
@pytest.mark.parametrize("name", overconstrained.ALL)
def test_overconstrained_mechanisms_that_move(name, place):
    """Their constraints are redundant in every pose: legal, one degree of freedom, and no false alarm."""
    model, redundant = overconstrained.ALL[name]()
    if place != "as drawn":
        model = turned(model, rotation(np.random.default_rng(3)))
    if place == "turned and moved":
        model = moved(model, (1e3, -2e3, 1e4))
    system, reference = model.linearize(), Exact(model)
    assert (system.dof, len(system.redundant)) == (1, redundant) == (reference.dof, reference.redundant)
    assert system.modes().frequencies[0] * 2 * np.pi == pytest.approx(np.sqrt(reference.squares[0]), rel=1e-9)


def triangle(springs=True):
    """Three bars in a triangle on ground: nothing moves."""
    model = mv.Model("truss")
    model.add_body("left", 1.0, (0.1, 0.1, 0.1), position=(0.25, 0.5, 0))
    model.add_body("right", 1.0, (0.1, 0.1, 0.1), position=(0.75, 0.5, 0))
    model.add_joint("a", "revolute", "ground", "left", position=(0, 0, 0))
    model.add_joint("b", "revolute", "left", "right", position=(0.5, 1, 0))
    model.add_joint("c", "revolute", "right", "ground", position=(1, 0, 0))
    if springs:
        model.add_bushing("k", "left", "right", (0.5, 1, 0), (1e3,) * 6, (1.0,) * 6)
    model.add_input("push", "left", "x")
    model.add_base_motion("shake", "x")
    model.add_output("sway", "right", "x")
    model.add_output("felt", "right", "x", quantity="acceleration")
    return model


@pytest.mark.parametrize("springs", [True, False])
def test_a_locked_mechanism_has_no_degree_of_freedom(springs):
    """It is a legal answer, and everything downstream takes it: what the base does, an accelerometer still feels."""
    system = triangle(springs).linearize()
    assert (system.dof, system.coordinates, system.M.shape, system.B.shape) == (0, (), (0, 0), (0, 2))
    assert len(system.redundant) == 3
    modes = system.modes()
    assert (len(modes), modes.eigenvalues.shape, modes.frequencies.shape) == (0, (0,), (0,))
    assert "locked" in str(modes)
    assert "locked" in system.explain()
    assert repr(modes)
    response = system.frequency_response([1.0, 2.0])
    assert_allclose(response, np.array([[[0, 0]] * 2, [[0, 0], [1, 1]]]), atol=0)
    assert_allclose(system.time_response([0, 1], [[1, 1], [2, 3]]), [[0, 0], [2, 3]], atol=0)
    for realization in ("physical", "modal"):
        first = system.state_space(realization)
        assert (first.A.shape, first.B.shape, first.C.shape) == ((0, 0), (0, 2), (2, 0))
        assert_allclose(first.D, [[0, 0], [0, 1]], atol=0)
    assert_allclose(system.displacements([])["left"], np.zeros(6), atol=0)


def test_a_locked_part_beside_a_moving_one():
    model = triangle()
    model.add_body("bell", 2.0, (0.5, 0.5, 0.5), position=(0.5, 1, -1))
    model.add_joint("hook", "revolute", "right", "bell", position=(0.5, 1, 0), axis=(1, 0, 0))
    model.add_bushing("kb", "right", "bell", (0.5, 1, 0), (0, 0, 0, 50.0, 0, 0))
    system = model.linearize()
    assert system.coordinates == ("hook.rz",)
    assert system.modes().frequencies[0] == pytest.approx(np.sqrt(50 / (0.5 + 2 * 1)) / (2 * np.pi), rel=1e-14)


def welded(more):
    """Two floating bodies welded by two crossed hinges, with a spring that therefore never acts, and one to ground."""
    model = mv.Model("welded")
    model.add_body("a", 1.0, (0.1, 0.1, 0.1))
    model.add_body("b", 1.0, (0.1, 0.1, 0.1), position=(1, 0.2, 0.1))
    model.add_joint("j1", "revolute", "a", "b", position=(0.5, 0, 0), axis=(0, 0, 1))
    model.add_joint("j2", "revolute", "a", "b", position=(0.5, 0.3, 0.2), axis=(0, 1, 0.5))
    model.add_spring("idle", "a", "b", (0, 0.1, 0.3), (1, 0.2, 0.1), stiffness=1e3, damping=1.0)
    model.add_spring("k", "ground", "b", (0, 0.1, 5.3), (1, 0.2, 0.1), stiffness=1e3)
    if more:  # a second loop over the same joint, which moves
        model.add_body("c", 1.0, (0.1, 0.1, 0.1), position=(0.3, 1, 0.4))
        model.add_joint("j3", "spherical", "a", "c", position=(0.1, 0.7, 0.2))
        model.add_joint("j4", "cylindrical", "c", "b", position=(0.6, 0.8, 0.7), axis=(1, 2, 3))
    return model


@pytest.mark.parametrize("more", [False, True])
def test_a_spring_between_parts_that_loops_weld_together_does_not_act(more):
    """It is named as idle, and the rigid-body modes stay exact zeros beside the one spring that acts."""
    model = welded(more)
    system, reference = model.linearize(), Exact(model)
    assert system.dof == reference.dof
    modes = system.modes()
    assert modes.rigid == reference.zeros
    assert not modes.eigenvalues[: 2 * reference.zeros].any()
    assert_allclose(modes.frequencies[reference.zeros :] * 2 * np.pi, np.sqrt(reference.squares[reference.zeros :]),
                    rtol=1e-11)  # fmt: skip
    assert "idle" in system.explain().split("without effect")[1].split("\n")[0]
