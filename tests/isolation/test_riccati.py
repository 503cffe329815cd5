"""Riccati's equation: closed forms in any units, quiet sensors beside loud noise, plants without a frequency."""

import numpy as np
import pytest

import mbsvib as mv
from mbsvib import isolation
from mbsvib.isolation.riccati import riccati
from mbsvib.isolation.synthesis import closed_loop, h2_synthesis

# x' = w1 + u, z = (x, u), y = x + w2: both Riccati equations have 1 / sqrt(1 - g^-2), so that the least norm is sqrt(2)
INTEGRATOR = (np.zeros((1, 1)), np.array([[1.0, 0, 1]]), np.array([[1.0], [0], [1]]),
              np.array([[0.0, 0, 0], [0, 0, 1], [0, 1, 0]]))  # fmt: skip


@pytest.mark.parametrize("units", [(1.0, 1.0), (1e-9, 1e6), (1e8, 1e-5), (3e-7, 2e-7)])
@pytest.mark.parametrize("effort", [1e-12, 1.0, 1e9])
def test_double_integrator_in_any_units(units, effort):
    """X = [[2^1/2 e^1/4, e^1/2], [e^1/2, 2^1/2 e^3/4]] of x'' = u and x^2 + e u^2; other units of states were refused.
    """
    t = np.array(units)
    a, b = np.array([[0.0, 1.0], [0.0, 0.0]]), np.array([[0.0], [1.0]])
    cost, gain = riccati(a * t / t[:, None], b / t[:, None], (np.array([[1.0, 0.0]]) * t, np.zeros((1, 1))),
                         np.array([effort]))  # fmt: skip
    root = effort**0.25
    exact = np.array([[np.sqrt(2.0) * root, root**2], [root**2, np.sqrt(2.0) * root**3]])
    assert np.allclose(cost / np.outer(t, t), exact, rtol=1e-11)
    assert np.allclose(gain / t, [[root**-2, np.sqrt(2.0) / root]], rtol=1e-11)


@pytest.mark.parametrize("noise", [1.0, 1e-8, 1e-17])
def test_a_sensor_that_feels_what_drives_the_plant(noise):
    """x' = -x + w, y = x / 2 + w + n: 3 / 4 X^2 ... of which the part left by w was lost in a difference of squares."""
    cost, gain = riccati(np.array([[-1.0]]), np.array([[0.5]]), (np.array([[1.0]]), np.array([[1.0]])),
                         np.array([noise]))  # fmt: skip
    # 0 = 2 free X + left - c^2 X^2 / (1 + noise),  free = -1 - c / (1 + noise),  left = noise / (1 + noise)
    square, free, left = 0.25 / (1.0 + noise), -1.0 - 0.5 / (1.0 + noise), noise / (1.0 + noise)
    exact = left / (np.sqrt(free**2 + square * left) - free)
    assert cost[0, 0] == pytest.approx(exact, rel=1e-12)
    assert gain[0, 0] == pytest.approx((0.5 * exact + 1.0) / (1.0 + noise), rel=1e-12)


def test_a_slow_mode_beside_a_fast_one():
    """A closed pole at 1e-13 of the fastest decays as far as its own rounding tells."""
    a, b = np.diag([1e7, 1e-6]), np.eye(2)
    cost, gain = riccati(a, b, (np.zeros((1, 2)), np.zeros((1, 2))), np.ones(2))
    assert np.allclose(gain, np.diag([2e7, 2e-6]), rtol=1e-12)
    assert np.allclose(cost, gain, rtol=1e-12)


def test_lqg_of_a_floating_mass():
    """All poles of the plant are 0: the search for units of its states did not end."""
    model = mv.Model("maglev", gravity=None)
    model.add_body("payload", mass=10.0, inertia=(1.0, 1.0, 1.0), position=(0, 0, 0.2))
    model.add_joint("guide", "prismatic", "ground", "payload", position=(0, 0, 0), axis=(0, 0, 1))
    plant = isolation.actuated(model, "payload", "guide", directions="z")
    law = isolation.lqg(plant, ["guide.stroke"], 1e-6, noise=1e-8, performance=["displacement.z"])
    poles = plant.with_gains(law).poles()
    # s^4 = -1 / (m^2 effort) of the regulator, s^4 = -base / noise of the filter
    exact = np.outer([10.0, 100.0], np.exp(0.75j * np.pi * np.array([1.0, -1.0]))).ravel()
    assert all(np.abs(poles - pole).min() <= 1e-9 * abs(pole) for pole in exact)


def test_h2_in_closed_form():
    """Both Riccati solutions are 1: u = -x, and a filter of gain 1."""
    made = h2_synthesis(INTEGRATOR, 1, 1, "test")
    assert made.A[0, 0] == pytest.approx(-2)
    assert made.B[0, 0] * made.C[0, 0] == pytest.approx(-1)
    assert made.D[0, 0] == 0.0
    a, b, c, d = INTEGRATOR
    with pytest.raises(mv.ResponseError, match="feedthrough from w to z"):
        h2_synthesis((a, b, c, d + 1.0), 1, 1, "test")


@pytest.mark.parametrize(("effort", "noise", "gauge"), [(3.0, 0.2, 7.0), (0.1, 40.0, 1e-4)])
def test_h2_with_cost_noise_and_gauge_in_closed_form(effort, noise, gauge):
    """z = (x, r u), y = g (x + n w2): u = -x / r with a filter of gain 1 / n; a second gauge halves the variance."""
    a, b, c, d = (matrix.copy() for matrix in INTEGRATOR)
    c[2], d[1, 2], d[2, 1] = gauge, effort, gauge * noise
    made = h2_synthesis((a, b, c, d), 1, 1, "test")
    assert made.A[0, 0] == pytest.approx(-1.0 / effort - 1.0 / noise)
    assert made.B[0, 0] * made.C[0, 0] == pytest.approx(-1.0 / (effort * noise * gauge))
    b, c = np.insert(b, 2, 0.0, axis=1), np.vstack((c, 5.0 * c[2:]))
    d = np.array([[0, 0, 0, 0], [0, 0, 0, effort], [0, gauge * noise, 0, 0], [0, 0, 5.0 * gauge * noise, 0]])
    both, filtered = h2_synthesis((a, b, c, d), 2, 1, "test"), np.sqrt(2.0) / noise
    assert both.A[0, 0] == pytest.approx(-1.0 / effort - filtered)
    np.testing.assert_allclose(both.B[0] * both.C[0, 0] * [1.0, 5.0], -filtered / (2.0 * effort * gauge), rtol=1e-9)


@pytest.mark.parametrize("parts", [[(1e-5, 1e-9), (1e4, 1e-6)], [(1e8, 1e2), (1e-4, 1e-10)]])
def test_h2_of_two_floating_masses_of_which_one_is_fast(parts):
    """z = (x, r u), x'' = w1 + u, y = x + n w2: poles s^4 = -1 / r^2 and -1 / n^2; SLICOT found no controller."""
    effort, noise = np.array(parts).T
    push, zero = np.kron(np.eye(2), [[0.0], [1.0]]), np.zeros((2, 4))
    seen = np.kron(np.eye(2), [[1.0, 0.0]])
    d = np.zeros((6, 6))
    d[2:4, 4:], d[4:, 2:4] = np.diag(effort), np.diag(noise)
    plant = np.diag([1.0, 0, 1.0], 1), np.hstack((push, zero.T[:, :2], push)), np.vstack((seen, zero, seen)), d
    made = h2_synthesis(plant, 2, 2, "test")
    poles = np.linalg.eigvals(closed_loop(plant, (made.A, made.B, made.C, made.D), 2, 2)[0])
    exact = np.outer([*effort**-0.5, *noise**-0.5], np.exp(0.75j * np.pi * np.array([1.0, -1.0]))).ravel()
    assert all(np.abs(poles - pole).min() <= 1e-6 * abs(pole) for pole in exact)


def test_h2_needs_costs_and_noise_of_their_own():
    a, b, c, d = INTEGRATOR
    with pytest.raises(mv.ResponseError, match="Each control must cost"):
        h2_synthesis((a, b, c, d * [[1], [0], [1]]), 1, 1, "test")
    with pytest.raises(mv.ResponseError, match="each measurement have noise of its own"):
        h2_synthesis((a, b, np.vstack((c, c[2:])), np.vstack((d, d[2:]))), 2, 1, "test")
