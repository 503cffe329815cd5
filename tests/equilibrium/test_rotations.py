"""Finite rotations against mpmath."""

from functools import cache

import mpmath as mp
import numpy as np
import pytest

from mbsvib.linalg.rotations import exponential, inverse_jacobian, logarithm, orthonormal, second_order

VECTORS = [
    (0.0, 0.0, 0.0), (1e-9, 2e-9, -1e-9), (0.02, -0.03, 0.01), (0.3, -0.2, 0.5), (1.0, -2.0, 1.5), (3.0, 0.5, 0.2),
]  # fmt: skip



def log(r):
    """The rotation vector in mpmath, away from half a turn."""
    axial = mp.matrix([r[2, 1] - r[1, 2], r[0, 2] - r[2, 0], r[1, 0] - r[0, 1]]) / 2
    sine = mp.norm(axial)
    return axial * (mp.atan2(sine, (r[0, 0] + r[1, 1] + r[2, 2] - 1) / 2) / sine if sine else 1)


@cache
def turn(w):
    with mp.workdps(60):
        return mp.expm(mp.matrix(_skew(w)))


def product(e, w):
    with mp.workdps(60):
        return log(turn(tuple(e)) * turn(w))


def _skew(w):
    x, y, z = (mp.mpf(v) for v in w)
    return [[0, -z, y], [z, 0, -x], [-y, x, 0]]


@pytest.mark.parametrize("w", VECTORS)
def test_exponential_and_logarithm(w):
    with mp.workdps(40):
        exact = np.array(mp.expm(mp.matrix(_skew(w))).tolist(), dtype=float)
    assert np.allclose(exponential(np.array(w)), exact, rtol=0, atol=1e-15)
    assert np.allclose(logarithm(exact), w, rtol=0, atol=1e-14)


def test_logarithm_of_half_a_turn_and_next_to_it():
    axis = np.array([1.0, -2.0, 2.0]) / 3.0
    for angle in (np.pi, np.pi - 1e-9, np.pi - 0.05):
        w = logarithm(exponential(angle * axis))
        assert np.allclose(exponential(w), exponential(angle * axis), rtol=0, atol=1e-14)
        assert abs(w @ axis) == pytest.approx(angle, abs=1e-8)


@pytest.mark.parametrize("w", VECTORS)
def test_first_and_second_order_of_the_logarithm(w):
    moment = np.array([0.7, -1.3, 0.4])
    h = mp.mpf("1e-12")
    unit = lambda *k: [h * sum(1 if i == j else 0 for j in k) for i in range(3)]  # noqa: E731
    minus = lambda v: [-x for x in v]  # noqa: E731
    with mp.workdps(60):
        first = np.array([[float(v) for v in (product(unit(k), w) - product(minus(unit(k)), w)) / (2 * h)]
                          for k in range(3)]).T  # fmt: skip
        value = lambda e: sum(mp.mpf(m) * v for m, v in zip(moment, product(e, w), strict=True))  # noqa: E731
        both = lambda i, j, sign: [a + sign * b for a, b in zip(unit(i), unit(j), strict=True)]  # noqa: E731
        even = lambda e: value(e) + value(minus(e))  # noqa: E731
        mixed = lambda i, j: (even(both(i, j, 1)) - even(both(i, j, -1))) / (4 * h * h)  # noqa: E731
        second = np.array([[float(mixed(i, j)) for j in range(3)] for i in range(3)])
    assert np.allclose(inverse_jacobian(np.array(w)), first, rtol=0, atol=1e-13)
    # the antisymmetric part of the second derivative, which does not become small with w, leaves no rounding
    assert np.allclose(second_order(np.array(w), moment), second, rtol=0, atol=1e-13 * np.abs(second).max() + 1e-20)


def test_rounding_is_taken_out_of_a_rotation():
    r = exponential(np.array([0.3, 0.4, -0.2])) + 1e-9 * np.arange(9).reshape(3, 3)
    better = orthonormal(r)
    assert np.abs(better.T @ better - np.eye(3)).max() < 1e-15
    assert np.abs(better - r).max() < 1e-8


def test_stacks_of_rotations_are_those_of_each():
    rng = np.random.default_rng(3)
    vectors = rng.normal(size=(2, 4, 3))
    vectors[0, 1] = 0.0
    vectors[1, 2] *= np.pi / np.linalg.norm(vectors[1, 2])  # half a turn
    rotations = exponential(vectors)
    back = logarithm(rotations)
    for i, j in np.ndindex(2, 4):
        assert np.allclose(rotations[i, j], exponential(vectors[i, j]), rtol=0, atol=1e-15)
        assert np.allclose(back[i, j], logarithm(rotations[i, j]), rtol=0, atol=1e-15)
        assert np.allclose(exponential(back[i, j]), rotations[i, j], rtol=0, atol=1e-14)
