"""Errors of reduced state spaces against responses in 60 digits: bounds hold where rounding is what is left."""

import flint
import numpy as np
import pytest
from scipy.linalg import block_diag

import mbsvib as mv


def matrix(array):
    return flint.acb_mat([[flint.acb(float(x)) for x in row] for row in array])


def exact_response(space, w):
    """C (i w - A)^-1 B of the numbers as they are, (outputs, inputs)."""
    a = matrix(space.A)
    s = flint.acb_mat([[flint.acb(0, float(w)) if i == j else 0 for j in range(len(space.A))]
                       for i in range(len(space.A))])  # fmt: skip
    return matrix(space.C) * (s - a).solve(matrix(space.B))


def largest_error(full, small, omega):
    flint.ctx.prec = 200
    return max(np.linalg.norm(np.array([[complex(x) for x in row] for row in
                                        (exact_response(full, w) - exact_response(small, w)).table()]), 2)
               for w in omega)  # fmt: skip


def vibrating(ratio, condition, seed):
    """Four modes with one damping ratio, the last one hardly driven, in states of some condition."""
    rng = np.random.default_rng(seed)
    a = block_diag(*[[[0.0, w], [-w, -2.0 * ratio * w]] for w in (1.4, 3.0, 7.0, 20.0)])
    b, c = np.zeros((8, 2)), np.zeros((2, 8))
    b[1::2], c[:, ::2] = rng.standard_normal((4, 2)), rng.standard_normal((2, 4))
    b[7] *= 1e-6
    first, last = (np.linalg.qr(rng.standard_normal((8, 8)))[0] for _ in range(2))
    turn = first @ np.diag(np.geomspace(1.0, 1.0 / condition, 8)) @ last
    return mv.StateSpace.from_arrays(turn @ a @ np.linalg.inv(turn), turn @ b, c @ np.linalg.inv(turn), 0)


@pytest.mark.few(2)
@pytest.mark.parametrize("seed", [5, 6])
@pytest.mark.parametrize("condition", [1.0, 500.0])
@pytest.mark.parametrize("ratio", [2e-7, 1e-4, 1e-2])
def test_bounds_hold_whatever_the_damping_and_the_states(ratio, condition, seed):
    full = vibrating(ratio, condition, seed)
    poles = full.poles()[::2]
    omega = (np.abs(poles.imag) + np.outer(np.linspace(-2.0, 2.0, 9), poles.real)).reshape(-1)
    for order in (6, 8):
        small = full.reduced(order=order)
        error = largest_error(full, small, omega)
        assert error <= small.error_bound
        assert small.error_bound <= 300.0 * error  # what rounding may add, where nothing else is left


@pytest.mark.parametrize("seed", [None, 1, 2, 3])
def test_an_integrator_stays_as_it_is_in_any_states(seed):
    """G = 1/s + sum of 1/(s + i); a bound was 5e14 for its rounding, or the integrator was truncated."""
    n = 9
    turn = np.eye(n) if seed is None else np.linalg.qr(np.random.default_rng(seed).standard_normal((n, n)))[0]
    full = mv.StateSpace.from_arrays(turn @ np.diag(-np.arange(float(n))) @ turn.T, turn @ np.ones((n, 1)),
                                     np.ones((1, n)) @ turn.T, 0)  # fmt: skip
    for error in (1e-3, 1e-5):
        small = full.reduced(error=error)
        assert small.states[:2] == ("lasting1", "hankel1")
        assert not small.A[0, 1:].any()
        assert not small.A[1:, 0].any()
        assert largest_error(full, small, np.geomspace(0.1, 100.0, 25)) <= small.error_bound <= error


def test_errors_below_rounding_are_refused():
    with pytest.raises(mv.ResponseError, match=r"reduced: error = 1e-12; rounding of the 8 states"):
        vibrating(1e-4, 500.0, 5).reduced(error=1e-12)
