"""The least norm of D M D^-1, its scalings and slopes, at many points at once."""

import numpy as np
import pytest

from mbsvib.linalg import diagonal_norms as module
from mbsvib.linalg.diagonal_norms import diagonal_norms, highest_norms, scaled_norms


def matrices(count, n, seed=0):
    rng = np.random.default_rng(seed)
    return rng.normal(size=(count, n, n)) + 1j * rng.normal(size=(count, n, n))


@pytest.mark.parametrize("n", [1, 2, 3, 5])
def test_scalings_prove_the_bounds_and_slopes_prove_that_they_are_the_least(n):
    """W has diag(M W) = diag(W M): no change of D lowers Re tr(W D M D^-1), convex in ln D."""
    m = matrices(20, n)
    bound, d, w = diagonal_norms(m)
    np.testing.assert_allclose(scaled_norms(m, d), bound, rtol=1e-12)
    highest = highest_norms(m)
    assert (bound <= highest * (1.0 + 1e-9)).all()
    assert highest.max() == pytest.approx(bound.max(), rel=1e-7)
    assert (np.abs(np.linalg.eigvals(m)).max(axis=1) <= bound * (1.0 + 1e-12)).all()
    np.testing.assert_allclose(np.einsum("pij,pji->p", w, m), bound, rtol=1e-6)
    both = np.einsum("pij,pji->pi", m, w).real - np.einsum("pij,pji->pi", w, m).real
    assert np.abs(both).max() <= 2e-4 * bound.max()


@pytest.mark.parametrize("n", [2, 3, 5])
def test_slopes_against_differences(n):
    m, change, step = matrices(3, n, 1), matrices(3, n, 2), 1e-3
    values = [diagonal_norms(m + k * step * change)[0] for k in (-2.0, -1.0, 1.0, 2.0)]
    differences = (values[0] - 8.0 * values[1] + 8.0 * values[2] - values[3]) / (12.0 * step)
    np.testing.assert_allclose(np.einsum("pij,pji->p", diagonal_norms(m)[2], change).real, differences, atol=1e-3)


def test_triangular_and_zero_matrices():
    """The largest of the diagonal blocks, whatever acts on them one way."""
    m = np.zeros((3, 3, 3), dtype=complex)
    m[0] = [[1.0, 1e9, 1e-3], [0.0, 2.0, 3.0], [0.0, 12.0, 2.0]]
    m[1] = [[0.0, 5.0, 7.0], [0.0, 0.0, 1e200], [0.0, 0.0, 0.0]]
    bound, _, slopes = diagonal_norms(m)
    np.testing.assert_allclose(bound, [8.0, 0.0, 0.0], rtol=1e-12)  # 2 + sqrt(3 12)
    np.testing.assert_allclose([highest_norms(one[None])[0] for one in m], bound, rtol=1e-12)
    assert np.isfinite(slopes).all()


def test_equal_singular_values():
    """Of 2 (1 + i skew) of a Hadamard matrix all are equal, also with units; of a positive matrix: Perron's value."""
    hadamard = np.array([[1, 1, 1, 1], [1, -1, 1, -1], [1, 1, -1, -1], [1, -1, -1, 1]], dtype=complex)
    units = np.array([1.0, 1e3, 1e-6, 1e4])
    even = hadamard * units[:, None] / units
    positive = np.abs(matrices(1, 4, 3)[0])
    bound, d, _ = diagonal_norms(np.array([even, positive * units[:, None] / units]))
    np.testing.assert_allclose(bound, [2.0, np.abs(np.linalg.eigvals(positive)).max()], rtol=2e-7)
    np.testing.assert_allclose(d[0] * units / (d[0] * units)[0], 1.0, rtol=1e-9)


def test_derivatives_to_scalings_are_differences():
    m, step = matrices(1, 4)[0], 1e-5
    value, slope, curvature = (part[0] for part in module._derivatives(m[None]))
    assert value == pytest.approx(np.log(np.linalg.norm(m, 2)), rel=1e-14)
    for i in range(4):
        d = np.exp(np.outer([step, -step], np.eye(4)[i]))
        (ahead, behind), slopes, _ = module._derivatives(d[:, :, None] * m / d[:, None])
        assert slope[i] == pytest.approx((ahead - behind) / (2.0 * step), abs=1e-9)
        np.testing.assert_allclose(curvature[i], (slopes[0] - slopes[1]) / (2.0 * step), atol=1e-8)


@pytest.mark.parametrize("n", [2, 3, 6])
def test_points_that_are_not_the_highest_are_not_above_it(n):
    """Along a curve over frequency; sizes of other points lie between their least norm and the highest one."""
    a, b, c = matrices(3, n, n)
    f = np.linspace(0.0, 1.0, 60)[:, None, None]
    m = a + 3.0 * f * b + np.sin(6.0 * f) * c
    each, found = diagonal_norms(m)[0], highest_norms(m)
    assert found.max() == pytest.approx(each.max(), rel=1e-7)
    assert found.argmax() == each.argmax()
    assert (found >= each * (1.0 - 1e-7)).all()
    units = 10.0 ** np.random.default_rng(n).uniform(-9.0, 9.0, n)
    np.testing.assert_allclose(highest_norms(units[:, None] * m / units).max(), each.max(), rtol=2e-7)
