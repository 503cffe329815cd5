"""Errors of eigenvalues: bounds hold where eigenvalues are known, each has its own, and units change nothing."""

import numpy as np
import pytest

from mbsvib.linalg.spectrum import decaying, spectrum


def unimodular(n, seed):
    """T and its inverse, both of whole numbers, so that T A T^-1 of whole numbers is exact."""
    rng = np.random.default_rng(seed)
    lower = np.tril(rng.integers(-1, 2, (n, n)), -1) + np.eye(n, dtype=int)
    upper = np.triu(rng.integers(-1, 2, (n, n)), 1) + np.eye(n, dtype=int)
    turn = lower @ upper
    return turn, np.rint(np.linalg.inv(turn.astype(float))).astype(int)


def jordan(values, size):
    """A block of each value and size."""
    a = np.zeros((sum(size),) * 2, dtype=int)
    start = 0
    for value, count in zip(values, size, strict=True):
        block = slice(start, start + count)
        a[block, block] = value * np.eye(count, dtype=int) + np.eye(count, k=1, dtype=int)
        start += count
    return a


@pytest.mark.few(6)
@pytest.mark.parametrize("size", [(1, 1, 1, 1), (2, 1, 1, 2), (3, 1, 1, 1), (4, 2, 1, 1)])
@pytest.mark.parametrize("seed", range(5))
def test_errors_bound_those_of_known_eigenvalues(size, seed):
    values = (0, -1, -3, -8)
    turn, back = unimodular(sum(size), seed)
    a = turn @ jordan(values, size) @ back
    of_a = spectrum(a.astype(float))
    error = np.abs(of_a.values[:, None] - np.array(values)).min(axis=1)
    assert (error <= of_a.errors).all()
    assert np.count_nonzero(of_a.at_zero) == np.count_nonzero(~of_a.decaying) == size[0]
    # the largest block's root of rounding, in parts of A, and not many orders above
    assert of_a.errors.max() <= 1e4 * np.linalg.norm(a, 2) * np.finfo(float).eps ** (1.0 / max(size)) * (10.0 * len(a))


def test_motions_that_do_not_act_on_each_other_have_errors_of_their_own():
    fast = np.array([[0.0, 1e6], [-1e6, -1.0]])
    a = np.block([[np.array([[-1e-9]]), np.zeros((1, 2))], [np.zeros((2, 1)), fast]])
    of_a = spectrum(a)
    slow = np.abs(of_a.values).argmin()
    assert of_a.decaying.all()
    assert of_a.errors[slow] < 1e-22
    a[0, 1], a[1, 0] = 1e-3, -1e-3  # now they do, and 1e-9 is what rounding of 1e6 makes
    of_a = spectrum(a)
    assert not of_a.decaying[np.abs(of_a.values).argmin()]


@pytest.mark.parametrize("power", [-40, -7, 13, 60])
def test_units_change_no_decision(power):
    rng = np.random.default_rng(3)
    turn = rng.standard_normal((6, 6))
    a = turn @ np.diag([0.0, -1.0, -2.0, -3.0, -4.0, -1e-12]) @ np.linalg.inv(turn)
    units = np.ldexp(1.0, power * np.arange(6) % 50)
    before, after = spectrum(a), spectrum(np.ldexp(units[:, None] * a / units, power))
    assert np.count_nonzero(before.at_zero) == np.count_nonzero(after.at_zero) == 2
    assert sorted(np.ldexp(after.errors, -power)) == pytest.approx(sorted(before.errors), rel=0.5)


def test_a_chain_that_runs_one_way_is_exact_in_any_units():
    a = np.array([[-1.0, 1e9, 0.0], [0.0, -1.0, 1e-9], [0.0, 0.0, 0.0]])
    of_a = spectrum(a)
    assert sorted(of_a.values.real.tolist()) == [-1.0, -1.0, 0.0]
    assert of_a.errors.max() < 1e-14


def test_clusters_keep_together_what_rounding_cannot_tell_apart():
    turn, back = unimodular(6, 1)
    a = np.zeros((6, 6), dtype=int)
    a[0, 1], a[2:4, 2:4], a[4, 4], a[5, 5] = 1, [[0, 3], [-3, 0]], -1, -2  # twice 0, +-3j, -1, -2
    of_a = spectrum((turn @ a @ back).astype(float))
    groups = of_a.clusters(~of_a.decaying)
    assert sorted(np.abs(of_a.values[g]).round(3).tolist() for g in groups) == [[0.0, 0.0], [3.0, 3.0]]


def test_real_parts_within_the_error_do_not_decay():
    values, errors = np.array([-1.0 + 1j, -1e-9 + 1j, 1e-9]), np.array([1e-3, 1e-8, 1e-8])
    assert decaying(values, errors).tolist() == [True, False, False]


def test_no_states():
    of_a = spectrum(np.zeros((0, 0)))
    assert of_a.clusters(~of_a.decaying) == []


@pytest.mark.parametrize("seed", range(4))
def test_fast_parts_that_nothing_acts_back_on_leave_slow_ones_alone(seed):
    """Undamped oscillators that parts 1e5 times as fast drive: solvers of the whole matrix made them grow or decay."""
    rng, n, omega = np.random.default_rng(seed), 40, 1100.0 * np.array([1.0, 2.0, 4.0])
    a = np.zeros((n + 6, n + 6))
    a[:n, :n] = 1e8 * (rng.normal(size=(n, n)) - 3.0 * np.sqrt(n) * np.eye(n))
    for k, w in enumerate(omega):
        at = slice(n + 2 * k, n + 2 * k + 2)
        a[at, at] = [[0.0, w], [-w, 0.0]]
    a[n:, :n] = rng.normal(size=(6, n))
    order = rng.permutation(n + 6)
    of_a = spectrum(a[np.ix_(order, order)])
    for w in omega:
        at = np.argmin(np.abs(of_a.values - 1j * w))
        assert abs(of_a.values[at] - 1j * w) <= of_a.errors[at] < 1e-13 * w
    assert np.count_nonzero(of_a.decaying) == n
