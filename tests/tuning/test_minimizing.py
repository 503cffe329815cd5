"""Minimisation where several smooth functions are equally large."""

import numpy as np
import pytest

from mbsvib.tuning.minimizing import _shortest, bfgs


def valley(x):
    """Rosenbrock's function with a sharp floor: 10 |x2 - x1^2| + (1 - x1)^2, least at (1, 1)."""
    side = 10.0 if x[1] >= x[0] ** 2 else -10.0
    value = side * (x[1] - x[0] ** 2) + (1.0 - x[0]) ** 2
    return value, np.array([-2.0 * side * x[0] - 2.0 * (1.0 - x[0]), side])


@pytest.mark.parametrize("start", [(-1.2, 1.44), (-1.2, 1.0), (0.5, 0.25)])
def test_a_search_goes_on_along_a_sharp_valley(start):
    """At two of the starts both sides are equally high, and neither gradient alone leads down."""
    end = bfgs(valley, np.array(start), 2000)
    assert end.f < 1e-3
    assert end.history[0] == valley(np.array(start))[0]


def test_shortest_combination_of_gradients():
    np.testing.assert_allclose(_shortest(np.array([[1.0, 1.0], [1.0, -3.0]])), [1.0, 0.0], atol=1e-12)
    np.testing.assert_allclose(_shortest(np.array([[2.0, 1.0], [1.0, 1.0]])), [1.0, 1.0], atol=1e-12)
    np.testing.assert_allclose(_shortest(np.array([[1.0, 1.0], [-2.0, -2.0], [0.0, 3.0]])), 0.0, atol=1e-12)
