"""Figures of singular values: rounding of zeros is not drawn."""

import json

import numpy as np
import pytest

import mbsvib as mv
from mbsvib import plots
from mbsvib.linalg.singular_values import singular_values
from tests.support.cli import invoke


def drawn(axes):
    """Values of the lines that show anything, (lines, n)."""
    return np.array([line.get_ydata() for line in axes.lines if np.isfinite(line.get_ydata()).any()])


def test_singular_values_that_are_zero_are_not_drawn():
    """Fx moves ry and Fy moves rx of a Stewart platform, Fz neither: the third singular value is zero by symmetry."""
    system = mv.library.stewart().linearize()
    panels = plots.singular_values(system).axes
    lines = [drawn(axes) for axes in panels[:4]]
    assert [len(values) for values in lines] == [3, 2, 2, 3]
    assert all(np.nanmin(values) > 1e-12 * np.nanmax(values) for values in lines)
    assert [text.get_text() for text in panels[1].texts] == ["1 singular value of zero"]
    assert not panels[0].texts


@pytest.mark.slow
def test_the_command_tells_zeros_as_zeros():
    groups = json.loads(invoke(["sigma", "stewart", "--from", "100", "--to", "2000", "--json"]).stdout)["groups"]
    least = [np.array(group["singular_values"])[-1] for group in groups]
    assert [bool(values.any()) for values in least] == [True, False, False, True]


@pytest.mark.parametrize("ratio", [1e-16, 1e-12])
def test_rounding_of_a_matrix_of_rank_one(ratio):
    rng = np.random.default_rng(0)
    q, p = (np.linalg.qr(rng.normal(size=(3, 3)) + 1j * rng.normal(size=(3, 3)))[0] for _ in range(2))
    matrix = (q * [1.0, ratio, 0.0]) @ p
    values = singular_values(np.stack((matrix, 1e9 * matrix), axis=2))
    expected = [1.0, ratio if ratio > 1e-14 else 0.0, 0.0]
    np.testing.assert_allclose(values, np.outer(expected, [1.0, 1e9]), rtol=1e-3)
