"""Covariances of signals with any units: those of some noise are told from those of none."""

import numpy as np
import pytest

from mbsvib.linalg.covariances import are_covariances

SIZES = (1e-9, 3.0, 2e5)  # m, m/s^2, N


def covariance(correlation, sizes=SIZES):
    return np.multiply.outer(sizes, sizes) * (np.eye(3) + correlation * (np.ones((3, 3)) - np.eye(3)))


def test_units_do_not_matter():
    for sizes in (SIZES, (1.0, 1.0, 1.0)):
        assert are_covariances(covariance(0.99, sizes), definite=True)
        assert are_covariances(covariance(1.0, sizes))
        assert not are_covariances(covariance(1.0 + 1e-3, sizes))
        assert not are_covariances(covariance(-0.6, sizes))  # three signals cannot all oppose each other so much


@pytest.mark.parametrize("place", [(0, 1), (0, 2), (1, 2)])
def test_small_entries_count_as_much_as_large_ones(place):
    wrong = covariance(0.5)
    wrong[place] *= 1.01
    assert not are_covariances(np.array([covariance(0.5), wrong]))
    assert not are_covariances(wrong + 1j * np.eye(3))


def test_signals_without_noise():
    silent = covariance(0.5)
    silent[0] = silent[:, 0] = 0.0
    assert are_covariances(silent)
    assert not are_covariances(silent, definite=True)
    silent[0, 1] = silent[1, 0] = 1e3
    assert not are_covariances(silent)
    assert are_covariances(np.zeros((2, 3, 3)))
    assert not are_covariances(np.full((3, 3), np.nan))
