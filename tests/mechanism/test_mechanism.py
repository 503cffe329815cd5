"""The mechanism as data: copies that share nothing, groups with other parts, and what is kept until one is added."""

import pickle
from copy import copy

import numpy as np
import pytest

import mbsvib as mv
from mbsvib.mechanism.mechanism import GROUPS
from mbsvib.mechanism.topology import span


def swing():
    model = mv.Model("swing", gravity=(0, 0, -9.81))
    model.add_body("rod", 1.0, (0.1, 0.1, 0.01), (0, 0, -0.5))
    model.add_joint("hinge", "revolute", "ground", "rod", (0, 0, 0), axis=(0, 1, 0))
    model.add_maxwell("damper", "ground", "rod", (1, 0, -0.5), (0, 0, -0.5), 100.0, 5.0)
    return model


def count(calls):
    def bodies(model):
        calls.append(len(model.bodies))
        return calls[-1]

    return bodies


def test_what_is_derived_is_kept_until_a_part_is_added():
    model, calls = swing(), []
    ask = count(calls)
    assert [model.derived(ask), model.derived(ask)] == [1, 1]
    model.add_body("more", 1.0, (1, 1, 1), (0, 0, 1))
    assert model.derived(ask) == 2
    model.gravity = None
    assert model.derived(ask) == 2
    assert calls == [1, 2, 2]


def test_the_tree_follows_parts_that_are_added():
    model = swing()
    before = span(model)
    assert span(model) is before
    model.add_body("more", 1.0, (1, 1, 1), (0, 0, 1))
    assert span(model).bodies == ("rod", "more")


@pytest.mark.parametrize("of", [copy, lambda model: pickle.loads(pickle.dumps(model))], ids=["copy", "pickle"])
def test_copies_have_all_parts_and_share_no_group(of):
    model = swing()
    expected = model.linearize().modes().eigenvalues
    other = of(model)
    assert type(other) is mv.Model
    assert other.groups() == model.groups()
    other.add_spring("k", "ground", "rod", (1, 0, -1), (0, 0, -1), 50.0)
    assert list(model.springs) == ["damper"]
    assert np.array_equal(model.linearize().modes().eigenvalues, expected)
    assert not np.array_equal(other.linearize().modes().eigenvalues, expected)


def test_other_parts_take_the_place_of_a_group_only():
    model = swing()
    plain = model.with_parts(springs={}, gravity=None)
    assert type(plain) is mv.Model
    assert (len(plain.springs), plain.gravity) == (0, None)
    assert {key: group for key, group in plain.groups().items() if key != "springs"} == {
        key: group for key, group in model.groups().items() if key != "springs"}  # fmt: skip
    assert (len(model.springs), model.gravity) == (1, (0.0, 0.0, -9.81))
    # the name of its node is free again
    plain.add_maxwell("damper", "ground", "rod", (1, 0, -0.5), (0, 0, -0.5), 200.0, 5.0)
    assert plain.springs["damper"].stiffness == 200.0


def test_names_of_nodes_go_with_their_beam():
    model = mv.Model("mast")
    model.add_beam("mast", "ground", None, {"type": "tube", "radius": 0.05, "wall": 0.005},
                   {"E": 2.1e11, "nu": 0.3, "rho": 7800}, (0, 0, 0), (0, 0, 1), elements=2)  # fmt: skip
    assert "mast.1" in model.nodes
    bare = model.with_parts(composed={})
    assert not bare.nodes
    with pytest.raises(mv.ModelError, match=r"'mast.1' is not a body"):
        bare.add_input("F", "mast.1", "x")
    model.add_input("F", "mast.1", "x")


def test_groups_are_those_of_the_files_in_their_order_and_read_only():
    groups = swing().groups()
    assert tuple(groups) == GROUPS
    with pytest.raises(TypeError):
        groups["bodies"]["rod"] = None


def test_gravity_is_checked_whenever_it_is_given():
    model = swing()
    with pytest.raises(mv.ModelError, match="gravity = 'down'"):
        model.gravity = "down"
    with pytest.raises(mv.ModelError, match="gravity"):
        model.with_parts(gravity=(0, 1))


def test_groups_that_are_none_are_refused():
    model = mv.library.quarter_car()
    with pytest.raises(mv.ModelError, match=r"no group 'load'. Did you mean 'loads'\? There are bodies, composed"):
        model.with_parts(load={})
