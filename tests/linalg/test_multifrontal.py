"""Factors of sparse symmetric matrices by fronts."""

import numpy as np
import pytest
import scipy.sparse as sp
from numpy.testing import assert_allclose

from mbsvib.linalg.multifrontal import dissected, factored, fronts


def grid(n, m=None):
    line = [sp.diags([2.0 * np.ones(k), -np.ones(k - 1), -np.ones(k - 1)], [0, 1, -1]) for k in (n, m or n)]
    return (sp.kron(line[0], sp.eye(m or n)) + sp.kron(sp.eye(n), line[1])).tocsc()


def hub(n=400):
    """A chain whose every node is linked to one more node."""
    chain = sp.diags([3.0 * np.ones(n), -np.ones(n - 1), -np.ones(n - 1)], [0, 1, -1])
    return sp.bmat([[chain, -np.ones((n, 1))], [-np.ones((1, n)), [[2.0 * n]]]]).tocsc()


CASES = {"grid": grid(24, 31), "nodes": sp.kron(grid(12, 14), np.ones((3, 3)) + 3.0 * np.eye(3)).tocsc(), "hub": hub(),
         "parts": sp.block_diag([grid(9), grid(14), sp.eye(5)]).tocsc(), "one": sp.csc_matrix([[2.0]])}  # fmt: skip


@pytest.fixture(autouse=True)
def small_fronts(monkeypatch):
    monkeypatch.setattr("mbsvib.linalg.multifrontal.LEAF", 30)


@pytest.mark.few(3)
@pytest.mark.parametrize("case", CASES)
@pytest.mark.parametrize("share", [-0.1, 0.13, 0.6])
def test_solutions_and_inertia(case, share):
    matrix = CASES[case]
    n, values = matrix.shape[0], np.linalg.eigvalsh(matrix.toarray())
    shift = float(share * values[-1] + (1.0 - share) * values[0]) if share > 0.0 else -1.0
    shifted = (matrix - shift * sp.eye(n)).tocsc()
    if np.abs(values - shift).min() == 0.0:
        shift *= 0.99
        shifted = (matrix - shift * sp.eye(n)).tocsc()
    factor = factored(shifted, fronts(matrix.tocsr()))
    assert factor.negative() == np.count_nonzero(values < shift)
    right = np.random.default_rng(0).standard_normal((n, 3))
    assert_allclose(shifted @ factor.solve(right), right, atol=1e-9)
    assert_allclose(factor.solve(right[:, 0]), factor.solve(right)[:, 0], rtol=1e-9, atol=1e-12)
    assert_allclose(factor.solve(right * 1j), factor.solve(right) * 1j)
    x, change = factor.solve_closely(right, 1e-11)
    assert change < 1e-6
    assert_allclose(x, factor.solve(right), rtol=1e-8, atol=1e-10)


@pytest.mark.parametrize("case", CASES)
def test_complex_symmetric_matrices(case):
    matrix = (CASES[case] * (1.0 + 0.1j) - 0.7 * sp.eye(CASES[case].shape[0])).tocsc()
    right = np.random.default_rng(0).standard_normal((matrix.shape[0], 2))
    solution = factored(matrix, fronts(CASES[case].tocsr())).solve(right)
    assert_allclose(matrix @ solution, right, atol=1e-9)


@pytest.mark.slow
def test_every_unknown_is_eliminated_once_and_a_grid_fills_little():
    matrix = grid(60)
    parts = dissected(matrix.tocsr())
    assert np.array_equal(np.sort(np.concatenate([own for own, _ in parts])), np.arange(3600))
    assert all(parent > i or parent == -1 for i, (_, parent) in enumerate(parts))
    # 31/4 n^2 log2(n) numbers, George (1973), against 60^3 of a band
    assert fronts(matrix.tocsr()).entries < 31.0 / 4.0 * 3600 * np.log2(60) < 60**3


def test_a_singular_front_is_an_error():
    matrix = sp.csc_matrix(np.zeros((2, 2)))
    with pytest.raises(np.linalg.LinAlgError, match="singular"):
        factored(matrix, fronts(sp.csr_matrix(np.ones((2, 2)))))
