"""Products of rows as signed squares: their sum is the symmetric form that they state."""

import numpy as np
from scipy.sparse import csr_matrix

from mbsvib.linalg.products import squares_of_products
from mbsvib.sparse.geometric_stiffness import Products

RNG = np.random.default_rng(3)


def test_squares_of_sparse_products_are_the_symmetric_form():
    first, second = RNG.normal(size=(5, 4)), RNG.normal(size=(5, 4))
    second[1], second[3] = -0.3 * first[1], 0.0
    products = Products(csr_matrix(first), csr_matrix(second), np.arange(5))
    squares, value, owner = products.squares()
    squares, expected = squares.toarray(), first.T @ second
    np.testing.assert_allclose(squares.T @ (value[:, None] * squares), expected + expected.T, atol=1e-14)
    assert owner.tolist() == [1, 0, 2, 4, 0, 2, 4], "one square of the parallel rows, none of the zero one"


def test_products_of_sizes_far_apart_keep_their_digits():
    first, second = RNG.normal(size=(3, 4)), 1e12 * RNG.normal(size=(3, 4))
    rows, value = squares_of_products(first, second)
    expected = first.T @ second + second.T @ first
    np.testing.assert_allclose(rows.T @ (value[:, None] * rows), expected, atol=1e-15 * np.abs(expected).max() * 8)


def test_a_product_with_nothing_is_nothing():
    rows, value = squares_of_products(np.zeros((1, 3)), np.ones((1, 3)))
    assert not value.any()
    assert np.isfinite(rows).all()
