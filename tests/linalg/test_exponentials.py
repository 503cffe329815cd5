"""Exponentials of one matrix over many lengths of time, against those of scipy one by one."""

import numpy as np
from scipy.linalg import expm

from mbsvib.linalg.lyapunov import SHARED, steps


def test_steps_of_all_lengths():
    """Fast against the longest step; equal lengths share an exponential, also where they differ by a rounding."""
    rng = np.random.default_rng(2)
    a = 12.0 * (rng.normal(size=(5, 5)) - 2.0 * np.eye(5))
    equal = np.full(SHARED + 4, 0.3) + 1e-17 * rng.normal(size=SHARED + 4)
    length = rng.permutation(np.concatenate((rng.uniform(0.0, 1.0, 30), equal, [0.0, 1e-9])))
    over = steps(a, length, 5.0)
    assert len(over.shared) == 1
    assert (over.group == 0).sum() == len(equal)
    x = rng.normal(size=(5, len(length)))
    exact = np.array([expm(a * time) @ column for time, column in zip(length, x.T, strict=True)]).T
    np.testing.assert_allclose(over(x), exact, rtol=1e-9, atol=1e-12 * np.abs(exact).max())
