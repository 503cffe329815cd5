"""Names of inputs and outputs, and where panels go."""

import pytest

import mbsvib as mv
from mbsvib import plots
from mbsvib.plots import bode
from mbsvib.plots._curves import listed, pairs_of


def test_all_pairs_make_a_matrix(slider):
    panels = pairs_of(slider(), None, None)
    assert panels == ([(name, source) for name in ("x", "v", "a") for source in ("F", "ax")], 2)


def test_a_single_input_fills_rows(slider):
    assert pairs_of(slider(), None, "F") == ([("x", "F"), ("v", "F"), ("a", "F")], 3)
    assert pairs_of(slider(), ["x", "v", "x"], "F") == ([("x", "F"), ("v", "F")], 2)
    for outputs, count, columns in (("r*", 3, 3), (["x", "y", "z", "rx"], 4, 2)):
        panels, width = pairs_of(mv.library.build("stewart").linearize(), outputs, ["Fx"])
        assert (len(panels), width) == (count, columns)


def test_too_many_panels_are_refused_with_an_example():
    system = mv.library.build("stewart").linearize()
    with pytest.raises(mv.ResponseError, match=r"36 panels.*output 'x' and input 'Fx'"):
        pairs_of(system, None, None)


def test_unknown_names_suggest_the_nearest():
    system = mv.library.build("stewart").linearize()
    with pytest.raises(mv.ResponseError, match=r"input 'fx': system 'stewart' has no such input\. Did you mean 'Fx'"):
        bode(system, "x", "fx")
    with pytest.raises(mv.ResponseError, match=r"output 'q'.*It has x, y, z, rx, ry, rz"):
        bode(system, "q", "Fx")
    with pytest.raises(mv.ResponseError, match="list of outputs is empty"):
        bode(system, [], "Fx")


def test_a_system_without_outputs_says_what_to_do():
    model = mv.Model("bare")
    model.add_body("b", 1.0, (1, 1, 1))
    model.add_input("F", "b", "x")
    with pytest.raises(mv.ResponseError, match=r"has no outputs.*add_output"):
        bode(model.linearize())


def test_labels(slider):
    first, second = slider(), slider(damping=1.0)
    assert [label for label, _ in listed([first, second], None)] == ["slider (1)", "slider (2)"]
    assert [label for label, _ in listed([first, second], ["a", "b"])] == ["a", "b"]
    small = mv.library.chain(3).linearize()
    assert [label for label, _ in listed([small, small.reduced(2)], None)] == [
        f"{small.name}, 6 states", f"{small.name}, 2 states"]  # fmt: skip
    with pytest.raises(mv.ResponseError, match="1 labels for 2 systems"):
        listed([first, second], ["a"])
    with pytest.raises(mv.ResponseError, match="no system"):
        listed([], None)


RESULTS = ["root_locus", "isolation", "transmissibility", "front", "campbell", "path", "periodic"]


@pytest.mark.parametrize("name", RESULTS)
def test_other_results_than_expected_are_named(name):
    """They raised AttributeError, on a field of the result that was expected."""
    told = rf"plots\.{name}: \w+ = System 'quarter_car'; expected what .*\(\.\.\.\)"
    with pytest.raises(mv.ResponseError, match=told):
        getattr(plots, name)(mv.library.quarter_car().linearize())
