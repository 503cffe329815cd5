"""The spanning tree, the cut joints, and bodies that float."""

import itertools

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import mbsvib as mv
from tests.support.compare import linearized
from tests.support.random_models import closed_loops, open_trees, planar, planar_loops, rebuilt
from tests.support.sizes import examples

DEGREES = {"revolute": 1, "prismatic": 1, "cylindrical": 2, "spherical": 3}


def four_bar(kinds=("revolute",) * 4, order=range(4)):
    """Ground, 1, 2, 3 and ground again; joints j1 (ground-1), j2 (1-2), j3 (2-3), j4 (3-ground)."""
    model = mv.Model("four-bar")
    for i, at in enumerate([(0, 0.5, 0), (0.6, 1.1, 0), (1.2, 0.6, 0)]):
        model.add_body(str(i + 1), 1.0, (0.1, 0.1, 0.1), position=at)
    joints = [("ground", "1", (0, 0, 0)), ("1", "2", (0, 1, 0)), ("2", "3", (1.2, 1.2, 0)),
              ("3", "ground", (1.2, 0, 0))]  # fmt: skip
    for k in order:
        first, second, at = joints[k]
        model.add_joint(f"j{k + 1}", kinds[k], first, second, position=at)
    return model


@pytest.mark.parametrize("order", list(itertools.permutations(range(4))))
def test_a_four_bar_is_cut_at_its_coupler(order):
    system = four_bar(order=order).linearize()
    assert system.dof == 1
    assert system.cut_joints in (("j2",), ("j3",))
    assert set(system.tree) == {"j1", "j2", "j3", "j4"} - set(system.cut_joints)


@pytest.mark.parametrize(("kinds", "cut"), [
    (("revolute", "spherical", "revolute", "revolute"), "j2"),
    (("revolute", "revolute", "spherical", "revolute"), "j3"),
    (("spherical", "revolute", "revolute", "revolute"), "j2"),  # body 1 by 3 either way: fewer joints win
    (("revolute", "revolute", "revolute", "cylindrical"), "j3"),  # paths of 1, 2, 2 against 1, 2, 3
])  # fmt: skip
def test_the_cut_leaves_the_shortest_paths(kinds, cut):
    assert four_bar(kinds).linearize().cut_joints == (cut,)


def distances(model):
    """Smallest sum of degrees of freedom on the way from ground to each body, by relaxation."""
    result = {"ground": 0} | dict.fromkeys(model.bodies, np.inf)
    for _ in range(len(result)):
        for joint in model.joints.values():
            for a, b in ((joint.first, joint.second), (joint.second, joint.first)):
                result[b] = min(result[b], result[a] + len(joint.freedom))
    return result


@pytest.mark.slow
@given(st.one_of(closed_loops(), planar_loops(), open_trees()))
def test_the_tree_holds_a_shortest_path_to_every_body(model):
    system = linearized(model)
    assert sorted((*system.tree, *system.cut_joints)) == sorted(model.joints)
    assert len(system.tree) == len(model.bodies)
    shortest, reached = distances(model), {"ground": 0}
    for name in system.tree:  # from ground outwards
        joint = model.joints[name]
        parent, child = (joint.first, joint.second) if joint.first in reached else (joint.second, joint.first)
        assert parent in reached
        assert child not in reached
        reached[child] = reached[parent] + len(joint.freedom)
    assert reached == shortest


@pytest.mark.slow
@given(open_trees())
def test_open_chains_are_not_cut(model):
    system = model.linearize()
    assert (system.cut_joints, system.redundant) == ((), ())
    assert system.dof == sum(len(joint.freedom) for joint in model.joints.values())
    names = [f"{joint.name}.{d}" for joint in model.joints.values() for d, _ in joint.freedom]
    assert list(system.coordinates) == names


def test_a_floating_body_has_six_coordinates_of_its_own():
    model = mv.Model("free")
    model.add_body("ship", 2.0, (1, 1, 1), position=(1, 2, 3))
    system = model.linearize()
    assert system.coordinates == ("ship.x", "ship.y", "ship.z", "ship.rx", "ship.ry", "ship.rz")
    assert system.coordinate_units == ("m", "m", "m", "rad", "rad", "rad")
    assert np.array_equal(system.displacements(np.eye(6))["ship"], np.eye(6))


def test_a_floating_pair_has_one_free_joint():
    model = mv.Model("pair")
    model.add_body("ship", 2.0, (1, 1, 1))
    model.add_body("mast", 1.0, (1, 1, 1), position=(0, 0, 1))
    model.add_joint("foot", "revolute", "ship", "mast", position=(0, 0, 0.5), axis=(1, 0, 0))
    system = model.linearize()
    assert system.dof == 7
    assert set(system.coordinates) == {"foot.rz", *(f"ship.{d}" for d in ("x", "y", "z", "rx", "ry", "rz"))}
    assert system.tree == ("foot",)


def test_parts_on_ground_and_floating_parts_side_by_side():
    model = four_bar()
    model.add_body("ship", 2.0, (1, 1, 1))
    system = model.linearize()
    assert system.dof == 7
    assert "ship" in system.explain()


@pytest.mark.parametrize("cut", ["j1", "j2", "j3", "j4"])
def test_the_user_may_name_the_cut(cut):
    for words in ([cut], cut, (cut,)):
        assert four_bar().linearize(cut=words).cut_joints == (cut,)


def test_an_unknown_cut_is_refused_with_a_suggestion():
    with pytest.raises(mv.ModelError, match=r"cut = 'j22' is not a joint of model 'four-bar'\. Did you mean 'j2'\?"):
        four_bar().linearize(cut=["j22"])


def test_a_cut_that_leaves_a_body_hanging_is_refused():
    with pytest.raises(mv.ModelError, match=r"from all other bodies, from body '[12]' on"):
        four_bar().linearize(cut=["j1", "j3"])
    model = mv.Model("open")
    model.add_body("b", 1.0, (1, 1, 1))
    model.add_joint("only", "revolute", "ground", "b", position=(0, 0, 0))
    with pytest.raises(mv.ModelError, match=r"\['only'\].*from all other bodies, from body 'b'"):
        model.linearize(cut=["only"])


def test_a_cut_does_not_stay_with_the_model():
    model = four_bar()
    first = model.linearize().cut_joints
    assert model.linearize(cut=["j1"]).cut_joints == ("j1",)
    assert model.linearize().cut_joints == first


def test_two_joints_between_the_same_bodies_make_a_loop():
    model = mv.Model("door")
    model.add_body("door", 1.0, (0.1, 0.1, 0.1), position=(0.5, 0, 0))
    model.add_joint("low", "revolute", "ground", "door", position=(0, 0, -1))
    model.add_joint("high", "revolute", "ground", "door", position=(0, 0, 1))
    system = model.linearize()
    assert system.dof == 1
    assert system.cut_joints == ("high",)
    assert len(system.redundant) == 5
    assert all(name.startswith("high.") for name in system.redundant)


@pytest.mark.slow
@examples(20, slow=20)
@given(st.integers(0, 2**31), st.integers(0, 10))
def test_the_order_of_the_calls_changes_neither_count_nor_cumulative_freedom(seed, order):
    model = planar(seed, bodies=4, loops=2)
    first, second = linearized(model), linearized(rebuilt(model, order=order))
    assert first.dof == second.dof
    assert len(first.redundant) == len(second.redundant)
    assert len(first.cut_joints) == len(second.cut_joints)


def test_mechanisms_with_the_same_connections_share_their_tree_and_others_do_not():
    model = four_bar()
    first, second = (variant.linearize() for variant in (model, model.with_values({"j2.position.x": 0.1})))
    branches = first.provenance.topology.branches
    assert second.provenance.topology.branches is branches
    assert np.abs(first.M - second.M).max() > 1e-3
    ball = ("revolute", "spherical", "revolute", "revolute")
    assert four_bar(ball).linearize().provenance.topology.branches != branches
    assert four_bar(order=(3, 2, 1, 0)).linearize().provenance.topology.branches != branches
