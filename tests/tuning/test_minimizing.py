"""Minimisation where several smooth functions are equally large, and peaks of responses."""

import numpy as np
import pytest

import mbsvib as mv
from mbsvib.tuning.minimizing import _shortest, bfgs
from mbsvib.tuning.peaks import Response, eigen, peak


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


@pytest.mark.parametrize(("outputs", "inputs", "through"), [(1, 1, 0.0), (2, 3, 0.0), (3, 2, 0.1), (2, 2, 9.0)])
def test_peaks_are_norms_with_gradients(outputs, inputs, through):
    """The largest singular value over all frequencies is the H-infinity norm; its gradient, against differences."""
    rng = np.random.default_rng(outputs + 10 * inputs)
    full = rng.normal(size=(6 + outputs, 6 + inputs))
    full[:6, :6] = full[:6, :6] - full[:6, :6].T - 0.2 * np.eye(6)
    full[6:, 6:] *= through

    def response(matrix):
        a, b, c, d = matrix[:6, :6], matrix[:6, 6:], matrix[6:, :6], matrix[6:, 6:]
        return Response((a, b, c, d), eigen(a))

    highest, w = peak(response(full), [])
    ports = [f"u{k}" for k in range(inputs)], [f"y{k}" for k in range(outputs)]
    space = mv.StateSpace.from_arrays(full[:6, :6], full[:6, 6:], full[6:, :6], full[6:, 6:], *ports)
    assert highest == pytest.approx(space.hinf_norm().value, rel=1e-6)
    change, step = rng.normal(size=full.shape), 1e-6
    difference = (peak(response(full + step * change), [])[0] - peak(response(full - step * change), [])[0]) / 2 / step
    assert (response(full).slope(w) * change).sum() == pytest.approx(difference, rel=1e-3)
