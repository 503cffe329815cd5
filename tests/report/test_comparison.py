"""Modes of two designs in pairs, where frequencies coincide too."""

import numpy as np
import pytest

import mbsvib as mv
from mbsvib.report.comparison import compared_modes


def plate(angle, more=0.0):
    """A mass on three springs; two are turned by an angle in their plane, and equally stiff but for ``more``."""
    model = mv.Model("plate")
    model.add_body("mass", 1.0, (0.1, 0.1, 0.1), (0, 0, 0))
    model.add_joint("free", "custom", "ground", "mass", (0, 0, 0), free=("x", "y", "z"))
    c, s = np.cos(angle), np.sin(angle)
    model.add_bushing("k", "ground", "mass", (0, 0, 0), (100.0, 100.0 + more, 900.0, 0, 0, 0),
                      orientation=((c, -s, 0), (s, c, 0), (0, 0, 1)))  # fmt: skip
    return model.linearize()


@pytest.mark.slow
def test_equal_frequencies_are_paired_by_their_plane():
    """A small change of one of two equal springs picks shapes anywhere in the plane: they are all alike."""
    rows = compared_modes(plate(0.0), plate(0.6, more=1.0))["rows"]
    assert [row[2] for row in rows] == [1.0, 1.0, 1.0]
    assert rows[2][:2] == [2, 2]
    assert [row[:2] for row in compared_modes(plate(0.0), plate(0.0))["rows"]] == [[0, 0], [1, 1], [2, 2]]


def test_frequencies_apart_are_paired_by_their_shapes():
    rows = compared_modes(plate(0.0, more=50.0), plate(0.6, more=50.0))["rows"]
    np.testing.assert_allclose([row[2] for row in rows], [np.cos(0.6) ** 2, np.cos(0.6) ** 2, 1.0], atol=1e-6)
