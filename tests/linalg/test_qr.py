"""Least-squares solutions of least norm, where rows are redundant as well."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from mbsvib.linalg.qr import minimum_norm_solution


@pytest.mark.parametrize("factor", [1.0, 1j, np.array([1.0, -2.0])])
@pytest.mark.parametrize(("rows", "rank"), [
    ([[1.0, 2.0, 0.0], [0.0, 1.0, 1.0], [1.0, 3.0, 1.0]], 2),  # a row that is the sum of two
    ([[1.0, 0.0, 0.0], [0.0, 1e-3, 0.0], [0.0, 0.0, 2.0]], 3),
    ([[1e3, 0.0, 0.0], [0.0, 1e-7, 0.0], [0.0, 0.0, 1.0]], 2),  # redundant as a share of the largest value
    ([[1e-14, 0.0, 0.0], [0.0, 3e-15, 0.0], [0.0, 0.0, 1e-14]], 0),  # redundant as a whole: rounding is no equation
])  # fmt: skip
def test_rows_that_are_rounding_are_no_equations(rows, rank, factor):
    a, right = np.array(rows), np.multiply.outer(np.array([1.0, 2.0, 3.0]), factor)
    u, values, v = np.linalg.svd(a)
    expected = v[:rank].T @ ((u[:, :rank].T @ right).T / values[:rank]).T
    assert_allclose(minimum_norm_solution(a, right), expected, rtol=1e-12, atol=1e-12)
