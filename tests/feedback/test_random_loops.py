"""Closed loops of random plants against matrices built by hand, python-control and scipy."""

import control
import numpy as np
import pytest
from scipy.linalg import expm, solve_continuous_lyapunov
from scipy.optimize import linear_sum_assignment

import mbsvib as mv

SENSORS, ACTUATORS = ["p", "v"], ["a", "b"]


def plant(seed):
    """A random system with three inputs, a displacement p and a velocity v; its M, C, K and its A, B, C."""
    rng = np.random.default_rng(seed)
    n = int(rng.integers(2, 6))
    mass, stiffness, damping = (r @ r.T for r in rng.normal(size=(3, n, n)))
    mass, stiffness = mass + n * np.eye(n), 100.0 * (stiffness + 0.5 * np.eye(n))
    damping = 0.3 * damping + 2e-3 * stiffness
    b, shown = rng.normal(size=(n, 3)), rng.normal(size=(2, n))
    zero = np.zeros(n)
    system = mv.System.from_matrices(mass, damping, stiffness, b, [shown[0], zero], [zero, shown[1]],
                                     inputs=["a", "b", "d"], outputs=SENSORS)  # fmt: skip
    a = np.block([[np.zeros((n, n)), np.eye(n)], [-np.linalg.solve(mass, np.hstack((stiffness, damping)))]])
    into = np.vstack((np.zeros((n, 3)), np.linalg.solve(mass, b)))
    return system, (a, into, np.block([[shown[:1], np.zeros((1, n))], [np.zeros((1, n)), shown[1:]]])), rng


def closed(space, law):
    a, b, c = space
    return np.block([[a + b[:, :2] @ law.D @ c, b[:, :2] @ law.C], [law.B @ c, law.A]])


def distance(values, exact):
    """The largest distance of values to exact ones, in pairs, relative to the largest."""
    table = np.abs(values[:, None] - exact)
    return table[linear_sum_assignment(table)].max() / np.abs(exact).max()


@pytest.mark.parametrize("seed", range(8))
def test_poles_responses_and_norms(seed):
    system, space, rng = plant(seed)
    law = control.ss(-np.diag(rng.uniform(1, 30, 2)), *rng.normal(size=(3, 2, 2)), inputs=SENSORS, outputs=ACTUATORS)
    loop, a = system.feedback(law), closed(space, law)
    poles = np.linalg.eigvals(a)
    assert distance(loop.poles(), poles) < 1e-12
    assert loop.stable == (poles.real.max() < 0.0)
    if not loop.stable:
        return
    b, c = np.vstack((space[1], np.zeros((2, 3)))), np.hstack((space[2], np.zeros((2, 2))))
    w = np.geomspace(0.1, 100.0, 400)
    exact = c @ np.linalg.solve(1j * w[:, None, None] * np.eye(len(a)) - a, b)
    np.testing.assert_allclose(loop.frequency_response(w).transpose(2, 0, 1), exact, atol=1e-11 * np.abs(exact).max())
    covariance = solve_continuous_lyapunov(a, -b @ b.T)
    assert loop.h2_norm().value == pytest.approx(np.sqrt(np.trace(c @ covariance @ c.T)), rel=1e-10)
    norm = loop.hinf_norm()
    peak = c @ np.linalg.solve(1j * norm.omega * np.eye(len(a)) - a, b)
    assert norm.value == pytest.approx(np.linalg.svd(peak, compute_uv=False)[0], rel=1e-10)
    assert np.linalg.svd(exact, compute_uv=False).max() <= norm.value * (1.0 + 1e-12)
    t, u = np.linspace(0.0, 4.0, 100), rng.normal(size=(3, 100))
    theirs = np.asarray(control.forced_response(control.ss(a, b, c, np.zeros((2, 3))), t, u).outputs)
    np.testing.assert_allclose(loop.time_response(t, u), theirs, atol=1e-11 * np.abs(theirs).max())


@pytest.mark.parametrize("seed", range(8))
@pytest.mark.parametrize("gain", [0.5, 3.0, -3.0])
def test_margins_of_one_loop(seed, gain):
    system, (a, b, c), _ = plant(seed)
    law = control.ss([[-5.0]], [[1.0]], [[40.0 * gain]], [[gain]])
    loop = system.feedback(law, "v", "a")
    if not loop.stable:
        return
    opened = -control.ss(a, b[:, :1], c[1:], [[0.0]]) * law
    gains, phases, distances = control.stability_margins(opened, returnall=True)[:3]
    gains = gains[gains < 1e12]  # crossings far away are rounding
    margins = loop.margins()
    assert margins.gain[0] == pytest.approx(gains[gains > 1.0].min(initial=np.inf), rel=1e-6)
    assert margins.lower[0] == pytest.approx(gains[gains < 1.0].max(initial=0.0), rel=1e-6)
    assert margins.phase[0] == pytest.approx(np.abs(phases).min(initial=np.inf), rel=1e-6)
    assert margins.modulus_each[0] == pytest.approx(distances.min(initial=1.0), rel=1e-4)


@pytest.mark.parametrize("seed", range(4))
def test_poles_of_sampled_loops(seed):
    system, (a, b, c), rng = plant(seed)
    law = control.ss(-np.diag(rng.uniform(1, 30, 2)), *rng.normal(size=(3, 2, 2)), inputs=SENSORS, outputs=ACTUATORS)
    step, n = 1 / 200.0, len(a)
    block = np.zeros((n + 2, n + 2))
    block[:n, :n], block[:n, n:] = a, b[:, :2]
    held = expm(block * step)
    discrete = control.c2d(law, step, "tustin")
    exact = np.linalg.eigvals(closed((held[:n, :n], held[:n, n:], c), discrete))
    assert distance(np.exp(step * system.feedback(law).sampled(200.0).poles()), exact) < 1e-11
