"""Sparse systems with some of their outputs and inputs."""

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

import mbsvib as mv
from tests.equations.test_controllable_part import beside
from tests.massless.test_random_networks import network

OMEGA = np.array([0.3, 17.0, 240.0])


def test_by_name_and_by_pattern():
    model = beside(20, 30)
    model.add_base_motion("floor", "x")
    system = model.linearize(method="sparse")
    part = system[["M1", "acceleration*"], ["floor", "F0"]]
    assert part.outputs == ("M1", "acceleration0", "acceleration1")
    assert part.inputs == ("floor", "F0")
    assert part.input_units[0] == "m/s^2"
    assert part.output_units == tuple(system.output_units[system.outputs.index(name)] for name in part.outputs)
    expected = system.frequency_response(OMEGA, list(part.outputs), list(part.inputs))
    assert_allclose(part.frequency_response(OMEGA), expected, rtol=1e-12, atol=1e-14 * np.abs(expected).max())
    assert_array_equal(part.modes(4).frequencies, system.modes(4).frequencies)
    small = part.reduced(20)
    assert (small.outputs, small.inputs) == (part.outputs, part.inputs)
    assert system[:, :].outputs == system.outputs


def test_what_massless_bodies_do_at_once_is_selected():
    model = network(2)
    system = model.linearize(method="sparse")
    dense = model.linearize(method="dense")
    output, source = system.outputs[-1], system.inputs[-1]
    part = system[output, source]
    assert_array_equal(part.separation.at_once, system.separation.at_once[-1:, -1:])
    assert_allclose(part.frequency_response(OMEGA), dense[output, source].frequency_response(OMEGA), rtol=1e-10)


def test_unknown_names_are_refused():
    system = beside(20).linearize(method="sparse")
    with pytest.raises(mv.ResponseError, match="M7"):
        system["M7", :]
    with pytest.raises(mv.ResponseError, match="expected outputs and inputs"):
        system["M0"]
