"""Functions of python-control called with names: those that are there without slycot, and those that need it."""

import control
import numpy as np
import pytest

import mbsvib as mv
import mbsvib_export as mx
from tests.export.plants import slider


def plant():
    """A disturbance and a force; what shall be small, and what is measured."""
    return mx.to_control(slider(inputs=("d", "F"), outputs=("z", "y")))


def loop_of(law):
    return control.interconnect([plant(), law], inputs=["d"], outputs=["z"])


def test_feedback_series_parallel_negate():
    single = plant()
    gain = control.StateSpace([], [], [], 0.1 * np.eye(2), inputs=["a", "b"], outputs=["d", "F"], name="gain")
    closed = mx.with_names(control.feedback, single, gain)
    assert (closed.input_labels, closed.output_labels) == (["d", "F"], ["z", "y"])
    assert np.array_equal(closed.A, control.feedback(single, gain).A)
    both = mx.with_names(control.series, gain, single)
    assert (both.input_labels, both.output_labels) == (["a", "b"], ["z", "y"])
    for result in (mx.with_names(control.parallel, single, single), mx.with_names(control.negate, single)):
        assert result.input_labels == ["d", "F"]


def test_states_of_plain_state_spaces_keep_their_names():
    one, two = (control.ss([[-k]], [[1.0]], [[1.0]], [[0.0]], states=[f"state{k}"], name=f"part{k}") for k in (1, 2))
    both = ["state1", "state2"]
    assert mx.with_names(control.feedback, one, two).state_labels == both
    assert mx.with_names(control.feedback, one, two, sign=1).state_labels == both
    assert sorted(mx.with_names(control.series, one, two).state_labels) == both
    assert mx.with_names(control.parallel, one, two).state_labels == both
    assert mx.with_names(control.negate, two).state_labels == ["state2"]
    series = mx.with_names(control.series, one, two)
    assert np.diag(series.A).tolist() == [-float(label[-1]) for label in series.state_labels]


@pytest.mark.parametrize(("call", "more"), [("balred", (1,)), ("minreal", ()), ("h2syn", (1, 1)), ("hinfsyn", (1, 1))])
def test_what_needs_slycot_says_so(call, more, monkeypatch):
    import sys

    monkeypatch.setitem(sys.modules, "slycot", None)
    stable = control.StateSpace(-np.eye(2), np.eye(2), np.eye(2), np.zeros((2, 2)))
    with pytest.raises(mv.ExportError, match=rf'{call} of python-control needs slycot.*pip install "mbsvib\[slycot\]"'):
        mx.with_names(getattr(control, call), stable, *more)


def test_errors_of_the_function_and_functions_that_are_not_known():
    with pytest.raises(mv.ExportError, match="lqr is none of balred"):
        mx.with_names(control.lqr, plant())
    with pytest.raises(TypeError, match="missing"):
        mx.with_names(control.feedback)
    with pytest.raises(ValueError, match="compatible inputs/outputs"):
        mx.with_names(control.feedback, plant(), control.StateSpace([], [], [], np.ones((1, 3))))


def generalized():
    """The plant with weights: force and noise on the inputs' side, displacement and effort on the outputs'."""
    single = slider(inputs=("d", "F"), outputs=("z", "y")).state_space("balanced")
    b = np.concatenate([single.B[:, :1], np.zeros((2, 1)), single.B[:, 1:]], axis=1)
    c = np.concatenate([single.C[:1], np.zeros((1, 2)), single.C[1:]])
    d = np.array([[0, 0, 0], [0, 0, 1e-4], [0, 1e-4, 0.0]])
    names = {"inputs": ["d", "noise", "F"], "outputs": ["z", "effort", "y"]}
    return control.StateSpace(single.A, b, c, d, **names, name="weighted")


@pytest.mark.parametrize("call", ["h2syn", "hinfsyn"])
def test_controllers_close_the_loop_by_their_names(call):
    pytest.importorskip("slycot", reason="slycot is not installed: pip install 'mbsvib[slycot]'")
    weighted = generalized()
    result = mx.with_names(getattr(control, call), weighted, 1, 1)
    law = result[0] if isinstance(result, tuple) else result
    assert (law.input_labels, law.output_labels, law.name) == (["y"], ["F"], "weighted_controller")
    loop = control.interconnect([weighted, law], inputs=["d", "noise"], outputs=["z", "effort"])
    assert loop.poles().real.max() < 0
    if isinstance(result, tuple):
        assert (result[1].input_labels, result[1].output_labels) == (["d", "noise"], ["z", "effort"])
        assert loop(30j) == pytest.approx(result[1](30j), rel=1e-6)


@pytest.mark.parametrize(("call", "more"), [("balred", (2,)), ("minreal", ())])
def test_reduced_plants_keep_their_names(call, more):
    pytest.importorskip("slycot", reason="slycot is not installed: pip install 'mbsvib[slycot]'")
    result = mx.with_names(getattr(control, call), plant(), *more)
    assert (result.input_labels, result.output_labels) == (["d", "F"], ["z", "y"])
    assert result(30j) == pytest.approx(plant()(30j), rel=1e-9)
