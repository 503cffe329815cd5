"""The references' linear algebra against mpmath's own."""

import mpmath
import numpy as np
import pytest

from tests.support import digits, fast_digits


@pytest.fixture(params=[50, 240])
def precision(request):
    with mpmath.workdps(request.param):
        yield mpmath.mpf(10) ** (4 - request.param)


@pytest.fixture(params=["real", "complex"])
def matrix(request, precision):
    rows = mpmath.matrix(np.random.default_rng(1).normal(size=(4, 4)).tolist()) / 3
    return rows if request.param == "real" else rows * mpmath.mpc(0, 1) + rows.T


@pytest.mark.few(2)
def test_matrices(matrix, precision):
    mp = mpmath
    assert mp.mnorm(fast_digits.product(matrix, matrix) - matrix * matrix) < precision
    assert mp.mnorm(fast_digits.inverse(matrix) - mp.inverse(matrix)) < precision
    assert mp.mnorm(fast_digits.exponential(matrix) - mp.expm(matrix)) < precision
    assert abs(fast_digits.determinant(matrix) - mp.det(matrix)) < precision
    values, expected = fast_digits.eigenvalues(matrix), mp.eig(matrix, left=False, right=False)
    assert max(min(abs(a - b) for b in expected) for a in values) < precision


def test_symmetric_eigenvalues(precision):
    matrix = mpmath.matrix([[2, 1, 0], [1, 2, 1], [0, 1, 2]])
    expected = [2 - mpmath.sqrt(2), 2, 2 + mpmath.sqrt(2)]
    result = fast_digits.symmetric_eigenvalues(matrix)
    assert max(abs(a - b) for a, b in zip(result, expected, strict=True)) < precision


def test_null_space_of_a_rank_told_by_a_pivot():
    """Two equal rows but for 1e-20, which counts as nothing, beside one of its own."""
    mp = digits.mp
    rows = [[1, 2, 3, 4], [1, 2, 3, 4 + mp.mpf("1e-20")], [0, 1, 0, 5]]
    basis, retained, dropped = digits.null_space([[mp.mpf(v) for v in row] for row in rows], 4)
    assert [len(row) for row in basis] == [2] * 4
    for row in (rows[0], rows[2]):
        assert all(abs(digits.dot(row, column)) < mp.mpf("1e-19") for column in digits.transpose(basis))
    assert retained > 1
    assert 0 < dropped < mp.mpf("1e-19")
