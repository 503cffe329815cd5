"""The model: parts in, read-only views out, and replace()."""

import copy
import pickle

import numpy as np
import pytest
from hypothesis import given

import mbsvib as mv
from mbsvib.api.model import ADDERS
from mbsvib.files.words import COMPOUND
from tests.support.arm import arm
from tests.support.random_models import open_trees, rebuilt

GROUPS = ("bodies", "joints", "springs", "inputs", "outputs")


def parts(model):
    return [part for group in GROUPS for part in getattr(model, group).values()]


def test_views_keep_the_order_of_the_calls():
    model = arm()
    assert list(model.bodies) == ["arm", "hand"]
    assert list(model.joints) == ["hinge", "wrist"]
    assert list(model.springs) == ["mount", "strut"]
    assert list(model.inputs) == ["push", "shake"]
    assert list(model.outputs) == ["sway", "tension"]


@pytest.mark.parametrize("group", GROUPS)
def test_views_are_read_only(group):
    view = getattr(arm(), group)
    with pytest.raises(TypeError):
        view["new"] = None
    with pytest.raises((TypeError, AttributeError)):
        del view[next(iter(view))]
    with pytest.raises(AttributeError):
        setattr(arm(), group, {})


def test_adders_return_the_part_that_they_keep():
    model = mv.Model()
    body = model.add_body("b", 1.0, (1, 1, 1))
    assert model.bodies["b"] is body


def test_ground_is_no_body():
    assert "ground" not in arm().bodies


def test_every_part_knows_its_adder():
    assert {type(part) for part in parts(arm())} <= set(ADDERS)
    adders = {adder for adder in dir(mv.Model) if adder.startswith("add_")}
    several = {f"add_{kind}" for kinds in COMPOUND.values() for kind in kinds} | {"add_port"}
    assert adders - several == set(ADDERS.values())


def test_repr_counts():
    assert repr(arm()) == "Model('robot': 2 bodies, 2 joints, 2 springs, 2 inputs, 2 outputs)"


@pytest.mark.slow
@given(open_trees())
def test_words_rebuild_any_model(model):
    again = rebuilt(model)
    assert parts(again) == parts(model)
    assert repr(again) == repr(model)


def test_replace_changes_one_part_of_a_new_model():
    model = arm()
    other = model.replace("arm", mass=5.0, position=np.array([0, 0, 0.25]))
    assert (other.bodies["arm"].mass, other.bodies["arm"].position) == (5.0, (0.0, 0.0, 0.25))
    assert (model.bodies["arm"].mass, model.bodies["arm"].position) == (2.0, (0.0, 0.0, 0.5))
    same = [part for part in parts(other) if part.name != "arm"]
    assert same == [part for part in parts(model) if part.name != "arm"]
    assert other.name == "robot"
    assert [list(getattr(other, g)) for g in GROUPS] == [list(getattr(model, g)) for g in GROUPS]


@pytest.mark.parametrize(("element", "changes"), [
    ("hinge", {"kind": "spherical", "axis": None}), ("mount", {"damping": [2.0] * 6}), ("strut", {"stiffness": 7}),
    ("push", {"direction": "y"}), ("shake", {"position": (1, 0, 0)}), ("sway", {"quantity": "velocity"}),
    ("tension", {"element": "mount"}),
])  # fmt: skip
def test_replace_reaches_every_kind_of_part(element, changes):
    part = {p.name: p for p in parts(arm().replace(element, **changes))}[element]
    for key, value in changes.items():
        stored = getattr(part, key)
        assert stored == (value if value is None or isinstance(value, (str, int)) else tuple(map(float, value)))


def test_replace_drops_what_is_derived():
    joint = arm().replace("hinge", axis=(1, 0, 0)).joints["hinge"]
    assert joint.freedom == (("rz", (0.0, 0.0, 0.0, 1.0, 0.0, 0.0)),)


def test_replace_checks_as_adding_does():
    with pytest.raises(mv.ModelError, match=r"body 'arm': mass = -1"):
        arm().replace("arm", mass=-1)


def test_replace_of_an_unknown_element_suggests():
    with pytest.raises(mv.ModelError, match=r"no element 'struts' in model 'robot'.*Did you mean 'strut'\?"):
        arm().replace("struts", stiffness=1)


def test_replace_with_an_unknown_word_names_both():
    with pytest.raises(mv.ModelError, match=r"'strut'.*stifness"):
        arm().replace("strut", stifness=1)


def test_renaming_a_body_reaches_what_refers_to_it_or_is_refused():
    """A body under a new name leaves joints that name the old one."""
    with pytest.raises(mv.ModelError, match="'arm'"):
        arm().replace("arm", name="forearm")


def test_an_input_and_an_output_of_one_name_are_both_reached_or_told_apart():
    """One name may stand for an input and an output; replace must not change a part that was not meant."""
    model = arm()
    model.add_input("x", "hand", "x")
    model.add_output("x", "hand", "x")
    with pytest.raises(mv.ModelError, match="quantity"):
        model.replace("x", quantity="velocity")


@pytest.mark.parametrize("copied", [copy.copy, copy.deepcopy, lambda part: pickle.loads(pickle.dumps(part))])
def test_parts_can_be_copied_and_sent_elsewhere(copied):
    for part in parts(arm()):
        assert copied(part) == part
        assert copied(part).constructor_kwargs() == part.constructor_kwargs()


def test_parts_are_equal_by_what_was_said():
    assert parts(arm()) == parts(arm())
    assert len(set(parts(arm()))) == len(parts(arm()))


def test_a_model_without_bodies_is_refused_in_words():
    with pytest.raises(mv.ModelError, match="'empty' has no body"):
        mv.Model("empty").linearize()


def test_linearize_sees_what_was_added_last():
    model = arm()
    assert model.linearize().dof == 4
    model.add_body("tool", 1.0, (1, 1, 1))
    assert model.linearize().dof == 10
    model.add_joint("grip", "fixed", "hand", "tool")
    assert model.linearize().dof == 4


def test_linearize_leaves_the_model_as_it_is():
    model = arm()
    before = parts(model)
    first, second = model.linearize(), model.linearize()
    assert parts(model) == before
    assert (first.K == second.K).all()


def test_linearize_as_a_function():
    assert (mv.linearize(arm()).K == arm().linearize().K).all()


def test_what_is_added_to_a_copy_is_not_in_the_original():
    import copy

    model = mv.library.quarter_car()
    for item in (copy.copy(model), copy.deepcopy(model)):
        item.add_spring("more", "ground", "body", start=(1, 0, 0), end=(0, 0, 0), stiffness=1e3)
        assert "more" in item.springs
    assert "more" not in model.springs


def test_texts_count_as_people_do():
    model = mv.Model("one")
    model.add_body("b", 1.0, (1, 1, 1))
    model.add_joint("j", "revolute", "ground", "b", position=(0, 0, 0))
    model.add_input("t", "b", "rz")
    system = model.linearize()
    assert repr(model) == "Model('one': 1 body, 1 joint, 0 springs, 1 input, 0 outputs)"
    assert repr(system) == "System('one': 1 DOF, 1 input, 0 outputs)"
    assert repr(model.linearize(method="sparse")) == "SparseSystem('one': 1 DOF, 1 input, 0 outputs)"
    assert repr(system.state_space()) == "StateSpace('one', physical: 2 states, 1 input, 0 outputs)"
    assert repr(system.modes()) == "Modes('one': 1 mode, 0 Hz)"
    assert repr(mv.library.quarter_car().linearize().modes()).startswith("Modes('quarter_car': 2 modes, 1.")
