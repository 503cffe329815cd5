"""H2 norms of loops with slow poles beside fast ones, against fifty digits."""

import mpmath
import numpy as np
import pytest

import mbsvib as mv
from mbsvib.isolation.synthesis import closed_loop, h2_synthesis


def exact(a, b, c):
    """||G||^2 = tr(C P C^T), A P + P A^T + B B^T = 0, of the entries as they are, by linear equations for P."""
    n = len(a)
    with mpmath.workdps(50):
        one = mpmath.matrix(np.eye(n).tolist())
        m, w = mpmath.matrix(a.tolist()), mpmath.matrix(b.tolist())
        w = w * w.T
        whole = mpmath.matrix(n * n)
        for i, j, k in np.ndindex(n, n, n):
            whole[i * n + j, k * n + j] += m[i, k] * one[j, j]
            whole[i * n + j, i * n + k] += m[j, k] * one[i, i]
        solved = mpmath.lu_solve(whole, mpmath.matrix([-w[i, j] for i, j in np.ndindex(n, n)]))
        rows = c.T @ c
        return float(mpmath.sqrt(sum(mpmath.mpf(rows[i, j]) * solved[i * n + j] for i, j in np.ndindex(n, n))))


@pytest.mark.parametrize("k", [557.0, 400.0, 700.0, 90.0])
@pytest.mark.parametrize("noise", [5.7e-5, 1e-5, 1e-4])
def test_quiet_accelerometer_on_a_sprung_mass(k, noise):
    """The filter decays at 1e-3 1/s beside 1e3 1/s of the regulator: the norm was wrong by up to 8 %."""
    a = np.array([[0.0, 1.0], [-k, -4.3e-3]])
    b = np.array([[0.0, 0.0, 0.0], [-63.0, 0.0, -30.0]])
    c = np.array([[1.0, 0.0], [0.0, 0.0], [-64.5 * k, -64.5 * 4.3e-3]])
    plant = a, b, c, np.array([[0.0, 0.0, 0.0], [0.0, 0.0, 1.7e-5], [-4070.0, noise, 0.0]])
    made = h2_synthesis(plant, 1, 1, "test")
    a, b, c, d = closed_loop(plant, (made.A, made.B, made.C, made.D), 1, 1)
    got = mv.StateSpace.from_arrays(a, b, c, d).h2_norm().value
    assert got == pytest.approx(exact(a, b, c), rel=1e-8)
