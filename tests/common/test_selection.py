"""Selection of signals by names, lists and patterns."""

import control
import numpy as np
import pytest

import mbsvib as mv
import mbsvib_export as mx
from mbsvib import library

SYSTEM = library.stewart_isolator().linearize()
W = np.array([10.0, 2000.0, 6000.0])


def test_order_of_names_is_kept_and_patterns_are_in_the_order_of_the_system():
    assert SYSTEM["z", "Fx"].outputs == ("z",)
    part = SYSTEM[["z", "x", "r*", "x"], ["Mz", "F?"]]
    assert part.outputs == ("z", "x", "rx", "ry", "rz")
    assert part.inputs == ("Mz", "Fx", "Fy", "Fz")
    assert SYSTEM[:, "Fx"].outputs == SYSTEM.outputs
    assert SYSTEM["x", :].inputs == SYSTEM.inputs
    assert SYSTEM[[], "Fx"].outputs == ()


@pytest.mark.parametrize("ask", [
    lambda s, **p: s.frequency_response(W, **p),
    lambda s, **p: s.time_response(np.linspace(0, 0.01, 9), np.ones((2 if p else len(s.inputs), 9)), **p),
    lambda s, **p: s.frequency_response_sensitivities(W, ["platform.mass"], **p)[0],
    lambda s, **p: s.compliance_sensitivities(["leg1.k.stiffness"], **p)[0],
])  # fmt: skip
def test_keywords_select_as_brackets_do(ask):
    ports = {"outputs": ["z", "x"], "inputs": ["Fz", "Fx"]}
    np.testing.assert_array_equal(ask(SYSTEM, **ports), ask(SYSTEM[["z", "x"], ["Fz", "Fx"]]))


@pytest.mark.slow
def test_responses_are_rows_and_columns_of_all():
    response = SYSTEM.frequency_response(W)
    rows = [SYSTEM.outputs.index(name) for name in ("z", "x")]
    columns = [SYSTEM.inputs.index(name) for name in ("Fz", "Fx")]
    part = SYSTEM[["z", "x"], ["Fz", "Fx"]]
    expected = response[np.ix_(rows, columns)]  # z and x do not act on each other: what stands there is rounding
    np.testing.assert_allclose(part.frequency_response(W), expected, rtol=1e-12, atol=1e-14 * abs(expected).max())
    assert part.modes() is SYSTEM.modes()
    assert part.hinf_norm(parameters=[]).value == pytest.approx(
        SYSTEM.hinf_norm(["z", "x"], ["Fz", "Fx"], []).value, rel=1e-13)  # fmt: skip
    np.testing.assert_allclose(part["x", "Fx"].transmission_zeros(), SYSTEM.transmission_zeros("x", "Fx"))


def test_names_in_arrays_are_names():
    assert SYSTEM[np.array(["z", "x"]), "Fx"].outputs == ("z", "x")
    with pytest.raises(mv.ResponseError, match=r"^output 'height': system"):
        SYSTEM.with_ports(np.array(["height"]))


def test_exports_and_interconnect_without_warnings():
    """Warnings are errors here: a signal that control.interconnect does not connect warns."""
    plant = mx.to_control(SYSTEM, outputs="z", inputs="Fz")
    assert (plant.output_labels, plant.input_labels) == (["z"], ["Fz"])
    law = control.ss([[-1.0]], [[1.0]], [[-1.0]], [[0.0]], inputs=["z"], outputs=["Fz"], name="law")
    closed = control.interconnect([plant, law], inplist=["stewart_isolator.Fz"], outlist=["z"], name="closed")
    assert closed.nstates == plant.nstates + 1
    assert mx.to_frd(SYSTEM, W, outputs="z", inputs="F*").frdata.shape == (1, 3, 3)


def test_synonyms():
    assert SYSTEM.mass is SYSTEM.M
    assert SYSTEM.damping is SYSTEM.C
    assert SYSTEM.stiffness is SYSTEM.K
    batch = library.quarter_car().linearize(values={"suspension.stiffness": [1e4, 2e4]})
    assert batch.stiffness is batch.K


def test_large_systems_take_names_too():
    chain = library.chain(400).linearize(method="sparse")
    out, into = chain.outputs[:1], chain.inputs[:1]
    np.testing.assert_allclose(chain.frequency_response([1.0], out, into), chain.frequency_response([1.0])[:1, :1])


REFUSALS = [
    ((slice(None), "x"), r"'x' is an output, and no input\. Outputs come first, then inputs"),
    (("Fx", "x"), r"'Fx' is an input, and no output"),
    (("xx", "Fx"), r"output 'xx': system 'stewart_isolator' has no such output\. Did you mean 'x'"),
    (("q*", "Fx"), r"the pattern 'q\*' picks no output"),
    ("x", r'expected outputs and inputs, system\["tilt", "motor"\]'),
    ((0, 1), "Numbers are refused"),
    (([0], "Fx"), "Numbers are refused"),
    ((slice(0, 2), "Fx"), "Numbers are refused"),
    (("x", "Fx", "y"), "expected outputs and inputs"),
    ((3.5, "Fx"), "expected a name, a pattern"),
]  # fmt: skip


@pytest.mark.parametrize(("key", "message"), REFUSALS, ids=[message for _, message in REFUSALS])
def test_refusals(key, message):
    with pytest.raises(mv.ResponseError, match=message):
        SYSTEM[key]
