"""Lyapunov equations of lightly damped modes, whose answers are known in closed form."""

import numpy as np
import pytest

from mbsvib.linalg.lyapunov import Lyapunov


@pytest.mark.parametrize("ratio", [1e-1, 1e-3, 1e-6])
@pytest.mark.parametrize("turned", [False, True])
def test_the_covariance_of_light_damping_has_all_its_digits(ratio, turned):
    """x = (w z, z') of z'' + 2 d w z' + w^2 z = u has P = 1 / (4 d w): rounding that is not symmetric was not seen."""
    rng, omega = np.random.default_rng(3), np.array([3.0, 40.0, 41.0, 900.0])
    a, b, known = np.zeros((8, 8)), np.zeros((8, 4)), np.zeros((8, 8))
    for k, w in enumerate(omega):
        at = slice(2 * k, 2 * k + 2)
        a[at, at] = [[0.0, w], [-w, -2.0 * ratio * w]]
        b[2 * k + 1, k] = 1.0
        known[at, at] = np.eye(2) / (4.0 * ratio * w)
    turn = np.linalg.qr(rng.standard_normal((8, 8)))[0] if turned else np.eye(8)
    solver = Lyapunov(turn @ a @ turn.T)
    # turned equations are rounded, and light damping takes digits of that
    tolerance = 2e-15 + turned * 2e-16 * omega[-1] / (ratio * omega[0])
    for found in (solver.controlled(turn @ b @ b.T @ turn.T), solver.observed(turn @ b @ b.T @ turn.T)):
        assert np.array_equal(found, found.T)
        np.testing.assert_allclose(turn.T @ found @ turn, known, rtol=tolerance, atol=tolerance * known.max())
