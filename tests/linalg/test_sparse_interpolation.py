"""Sparse polynomial interpolation: exact on polynomials, nested, and with nothing but downward closed sets."""

import numpy as np
import pytest

from mbsvib.linalg.sparse_interpolation import HIGHEST, SparseInterpolant, leja_points, newton_basis, points_of


def grown(function, variables, keep):
    """The interpolant whose indices satisfy ``keep``, and all that follow these."""
    result = SparseInterpolant.none(variables, 2)
    new = np.zeros((1, variables), dtype=np.intp)
    while len(new):
        result = result.with_values(new, function(points_of(new)))
        new = result.following(np.array([keep(index) for index in result.indices.tolist()]))
    return result


def test_polynomials_are_exact():
    def function(x):
        return np.stack((x[:, 0] ** 3 * x[:, 1] - 2.0 * x[:, 2], x[:, 1] ** 2 * x[:, 2] ** 2 + 1.0), axis=1)

    result = grown(function, 3, lambda index: sum(index) < 4)
    assert len(result.indices) == 35  # binomial (4 + 3 over 3)
    x = np.random.default_rng(1).uniform(-1.0, 1.0, (50, 3))
    np.testing.assert_allclose(result(x), function(x), rtol=0, atol=1e-13)
    np.testing.assert_allclose(result(points_of(result.indices)), function(points_of(result.indices)), atol=1e-13)


def test_values_at_points_of_one_variable_are_those_of_lagranges_polynomial():
    def function(x):
        return np.stack((np.exp(x[:, 0]), 1.0 / (3.0 + x[:, 0])), axis=1)

    result = grown(function, 1, lambda index: index[0] < 7)
    x = np.linspace(-1.0, 1.0, 9)
    points = leja_points()[:8]
    assert points[:3].tolist() == [1.0, -1.0, 0.0]
    wanted = np.zeros((9, 2))
    for k, at in enumerate(points):
        others = np.delete(points, k)
        wanted += ((x[:, None] - others) / (at - others)).prod(axis=1)[:, None] * function(points[k : k + 1, None])
    np.testing.assert_allclose(result(x[:, None]), wanted, rtol=0, atol=1e-14)


@pytest.mark.parametrize("seed", range(4))
def test_sets_stay_downward_closed(seed):
    rng = np.random.default_rng(seed)
    result = SparseInterpolant.none(3, 1)
    new = np.zeros((1, 3), dtype=np.intp)
    for _ in range(14):
        result = result.with_values(new, rng.normal(size=(len(new), 1)))
        new = result.following((rng.uniform(size=len(result.indices)) < 0.25) | (len(result.indices) < 4))
    known = set(map(tuple, result.indices.tolist()))
    assert len(known) == len(result.indices) > 20
    for index in known:
        for k, degree in enumerate(index):
            assert not degree or (*index[:k], degree - 1, *index[k + 1 :]) in known


def test_high_degrees_stay_bounded():
    points = leja_points()
    assert len(np.unique(points)) == HIGHEST + 1
    x = np.linspace(-1.0, 1.0, 2001)
    lagrange = sum(abs(newton_basis(x, HIGHEST) @ np.linalg.inv(newton_basis(points, HIGHEST))).T)
    assert lagrange.max() < 4.0 * HIGHEST  # Lebesgue constants of Leja points grow slowly
    with pytest.raises(ValueError, match="read-only"):
        points[0] = 0.0
