"""Machines beside each other: those out of reach of the ports asked for are left out."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

import mbsvib as mv
from tests.equations.test_controllable_part import beside, together
from tests.sparse import scenes

OMEGA = np.array([0.3, 17.0, 240.0])


@pytest.mark.slow
def test_one_chain_of_three():
    system = beside(400, 300, 500).linearize()
    part = system.reachable(["displacement1", "acceleration1", "M1"], "F1")
    assert part.dof == 300
    assert part.bodies == tuple(f"c1.{i}" for i in range(300))
    assert part.layout.size < system.layout.size / 3
    rows = [system.outputs.index(name) for name in part.outputs]
    full = system.frequency_response(OMEGA)[rows, 1:2]
    assert_allclose(part.frequency_response(OMEGA), full, rtol=1e-11)
    text = part.explain()
    assert "not controllable from F1: c0.0" in text
    assert "(900 in all)" in text
    single = beside(1, 300).linearize(method="dense").reachable("M1", "F1")
    assert_allclose(part.modes(5).frequencies, single.modes(5).frequencies, rtol=1e-11)


def test_ports_between_two_parts():
    """A force between two chains, and a sensor between them, of which only one is reached by another force."""
    model = beside(20, 30)
    model.add_input("pair", "c0.3", "y", relative_to="c1.4")
    model.add_output("gap", "c1.4", "y", relative_to="c0.7")
    system, dense = (model.linearize(method=method) for method in ("sparse", "dense"))
    for inputs, outputs in (("F0", "gap"), ("pair", "displacement1"), ("pair", "gap"), ("F1", ["gap", "M0"])):
        part = system.reachable(outputs, inputs)
        expected = dense.reachable(outputs, inputs)
        assert part.dof == expected.dof
        assert_allclose(part.frequency_response(OMEGA), expected.frequency_response(OMEGA), rtol=1e-10)
    assert system.reachable(["gap", "M0"], "F1").outputs == ("M0", "gap")


def test_base_motion_reaches_all_machines():
    model = beside(20, 30)
    model.add_base_motion("floor", "y")
    system = model.linearize(method="sparse")
    assert system.reachable(inputs="floor").dof == 50
    assert system.reachable("M1", "floor").dof == 30
    assert "nothing was removed" in system.reachable().explain()


def test_loops_stay_cut_where_they_were():
    model = together(mv.library.ladder(8), scenes.braced(21))
    system = model.linearize(method="sparse")
    part = system.reachable(inputs="a.Fx")
    assert part.cut_joints == tuple(name for name in system.cut_joints if name.startswith("a."))
    assert_allclose(part.modes(8).frequencies, mv.library.ladder(8).linearize().modes().frequencies, rtol=1e-11)


def test_later_changes_of_the_model_do_not_matter():
    model = beside(20, 30)
    system = model.linearize(method="sparse")
    model.add_body("late", 1.0, scenes.INERTIA)
    assert system.reachable(inputs="F0").dof == 20


def test_nothing_in_reach_is_refused():
    system = beside(20, 30).linearize(method="sparse")
    with pytest.raises(mv.ResponseError, match="'side by side' has no part that is controllable and observable"):
        system.reachable("M1", "F0")
    with pytest.raises(mv.ResponseError, match="input 'F7': system 'side by side' has no such input"):
        system.reachable(inputs="F7")
