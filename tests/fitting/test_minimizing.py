"""The search of a fit against scipy: bounds, curved valleys, what is not told, values that no mechanism has."""

from types import SimpleNamespace

import numpy as np
import pytest
from scipy.optimize import least_squares, lsq_linear

from mbsvib.errors import ModelError
from mbsvib.fitting.problem import Sums, minimized


class Linear:
    """0.5 |A x - b|^2 within bounds, as a problem that ``minimized`` takes."""

    known, numbers = True, 0

    def __init__(self, a, b, low, high):
        self.a, self.b, self.variables = a, b, SimpleNamespace(
            limits=lambda: (low, high), within=lambda x: np.clip(x, low, high))

    def function(self, x):
        return self.a @ x - self.b, self.a

    def sums(self, x, far):
        r, j = self.function(x)
        return Sums(0.5 * float(r @ r), j.T @ r, j.T @ j)

    def cost(self, x, far):
        return self.sums(x, far).cost


@pytest.mark.parametrize("seed", range(6))
def test_searches_end_where_those_of_scipy_do(seed):
    rng = np.random.default_rng(seed)
    a, b = rng.standard_normal((9, 4)) * [1.0, 1e3, 1e-3, 1.0], rng.standard_normal(9)
    free = np.linalg.lstsq(a, b, rcond=None)[0]
    low, high = free - np.abs(free) * rng.uniform(-0.5, 2.0, 4), np.full(4, np.inf)
    low[0], high[0] = -np.inf, free[0] - 0.4 * np.abs(free[0])
    found = minimized(Linear(a, b, low, high), np.clip(np.zeros(4), low, high), False)
    assert found.converged
    expected = lsq_linear(a, b, (low, high), tol=1e-12)
    assert found.cost == pytest.approx(expected.cost, rel=1e-4)
    np.testing.assert_allclose(found.x, expected.x, rtol=1e-2, atol=1e-2 * np.abs(free).min())


class Valley(Linear):
    """Rosenbrock's function, beside a direction that tells nothing; no mechanism where the second is above 1.7."""

    def cost(self, x, far):
        if x[1] > 1.7:
            raise ModelError("no mechanism", element="x", field="x")
        return super().cost(x, far)

    def function(self, x):
        r = np.array([1e2 * (x[1] - x[0] ** 2), 10.0 * (1.0 - x[0]), 0.0])
        return r, np.array([[-2e2 * x[0], 1e2, 0.0], [-10.0, 0.0, 0.0], [0.0, 0.0, 0.0]])


def test_a_search_follows_a_curved_valley_and_leaves_what_is_not_told():
    infinite = np.full(3, np.inf)
    costs = []
    found = minimized(Valley(None, None, -infinite, infinite), np.array([-1.2, 1.0, 0.3]), False, costs.append)
    assert found.converged
    np.testing.assert_allclose(found.x, [1.0, 1.0, 0.3], atol=1e-5)
    assert (np.diff(costs) < 0.0).all()
    assert found.steps == len(costs) - 1
    bound = np.array([0.5, np.inf, np.inf])
    held = minimized(Valley(None, None, -infinite, bound), np.array([-1.2, 1.0, 0.3]), False)
    expected = least_squares(lambda x: Valley.function(None, x)[0][:2], [-1.2, 1.0, 0.3], bounds=(-infinite, bound))
    np.testing.assert_allclose(held.x[:2], expected.x[:2], atol=1e-4)
    lowest = np.array([-np.inf, 1.75, -np.inf])
    stuck = minimized(Valley(None, None, lowest, infinite), np.array([-1.2, 2.0, 0.3]), False)
    assert not stuck.converged
    np.testing.assert_array_equal(stuck.x, [-1.2, 2.0, 0.3])
