"""Contributions: sums of weights over rows are the matrices that their definition says."""

import numpy as np
from scipy.sparse import csr_matrix

from mbsvib.elements.contribution import NONE, Contribution, Weights, rotation_rows
from mbsvib.linalg.products import squares_of_products
from mbsvib.sparse.geometric_stiffness import Products
from mbsvib.sparse.statement import antisymmetric

RNG = np.random.default_rng(3)


def weights(first, second, owner=None):
    first, second = np.array(first), np.array(second)
    return Weights(first, second, RNG.uniform(-2, 2, len(first)), np.arange(len(first)) if owner is None else owner)


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


def test_antisymmetric_form():
    rows, part = RNG.normal(size=(4, 3)), weights([0, 2], [1, 3])
    expected = sum(v * (np.outer(rows[i], rows[j]) - np.outer(rows[j], rows[i]))
                   for i, j, v in zip(part.first, part.second, part.value, strict=True))  # fmt: skip
    result = antisymmetric(part, csr_matrix(rows)).toarray()
    np.testing.assert_allclose(result, expected, atol=1e-14)
    assert np.array_equal(result, -result.T)


def test_an_antisymmetric_form_without_weights_is_none():
    assert antisymmetric(NONE, csr_matrix((0, 3))) is None


def test_joined_contributions_number_their_rows_one_after_the_other():
    one = Contribution.of(rotation_rows(np.array([0, 1]), np.eye(3)[:, :2], 2), stiffness=weights([0, 1], [0, 1]))
    rows = rotation_rows(np.array([1]), np.eye(3)[:, :1], 2)
    second = Contribution.of(rows, stiffness=weights([0], [0]), gyroscopic=NONE)
    both = Contribution.join([one, second, one])
    assert both.count == 5
    assert both.stiffness.first.tolist() == [0, 1, 2, 3, 4]
    assert both.gyroscopic is NONE
    assert Contribution.join([one]) is one
