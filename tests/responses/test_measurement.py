"""Measured data: what it says of itself, and what it refuses."""

from dataclasses import replace

import numpy as np
import pytest

import mbsvib as mv
from mbsvib.responses.measurement import Measurement, Node, Point


def roved():
    """Three of four pairs were measured; the second input acts against the second output."""
    responses = np.ones((2, 2, 3), dtype=complex)
    responses[0, 1] = np.nan
    return Measurement(
        np.array([1.0, 2.0, 3.0]), responses, ("a", "b"), ("m", "m"), (Point(1, 3), Point(2, -1)), ("F", "G"),
        ("N", "N"), (Point(1, 4), Point(2, 1)), (Node(1, "plate", (0.0, 0.0, 0.0)),),
    )  # fmt: skip


def test_pairs_and_driving_points():
    data = roved()
    assert data.is_measured.tolist() == [[True, False], [True, True]]
    assert data.driving_points == (("b", "G"),)
    assert repr(data) == "Measurement(2 inputs, 2 outputs, 3 frequencies, 1 node, 0 modes)"
    assert mv.Measurement is Measurement
    with pytest.raises(ValueError, match="read-only"):
        data.responses[0, 0, 0] = 1.0


def test_what_does_not_fit_together():
    with pytest.raises(mv.ResponseError, match=r"responses has shape \(2, 2, 3\); expected \(2, 2, 2\)"):
        replace(roved(), omega=np.array([1.0, 2.0]))
    with pytest.raises(mv.ResponseError, match="outputs = a, a with 2 units and 2 points; expected names that differ"):
        replace(roved(), outputs=("a", "a"))
    with pytest.raises(mv.ResponseError, match="inputs = F, G with 1 units"):
        replace(roved(), input_units=("N",))
