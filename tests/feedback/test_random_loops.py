"""Closed loops of random plants against matrices built by hand, python-control and scipy."""

import control
import numpy as np
import pytest
from scipy.linalg import solve_continuous_lyapunov
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


@pytest.mark.few(2)
@pytest.mark.parametrize("seed", range(8))
def test_poles_responses_and_norms(seed):
    system, space, rng = plant(seed)
    law = control.ss(-np.diag(rng.uniform(1, 30, 2)), *rng.normal(size=(3, 2, 2)), inputs=SENSORS, outputs=ACTUATORS)
    loop, a = system.feedback(law), closed(space, law)
    poles = np.linalg.eigvals(a)
    assert distance(loop.poles(), poles) < 1e-12
    assert loop.stable == (poles.real.max() < 0.0)
    waves = poles[poles.imag > 0.0]
    waves = waves[np.argsort(np.abs(waves))]
    np.testing.assert_allclose(loop.vibrating, waves, rtol=1e-9)
    np.testing.assert_allclose(loop.damping_ratios, -waves.real / np.abs(waves), rtol=1e-9, atol=1e-10)
    part = loop.law["b", "p"]
    assert part.state_space().name == loop.law.name
    for made, whole in ((part.A, law.A), (part.B, law.B[:, :1]), (part.C, law.C[1:]), (part.D, law.D[1:, :1])):
        np.testing.assert_array_equal(made, whole)
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


def opened(space, law, i):
    """The loop gain at actuator i while the other one is closed, L = -K G, whose critical point is -1."""
    a, b, c = space
    j = 1 - i
    inside = np.block([[a + b[:, [j]] @ law.D[[j]] @ c, b[:, [j]] @ law.C[[j]]], [law.B @ c, law.A]])
    return -control.ss(inside, np.vstack((b[:, [i]], np.zeros((2, 1)))), np.hstack((law.D[[i]] @ c, law.C[[i]])), 0.0)


def first(values, at, without):
    """The least of some values and where it is."""
    return (values.min(), at[values.argmin()]) if len(values) else (without, np.nan)


@pytest.mark.few(1)
@pytest.mark.parametrize("seed", [16, 26, 36])
def test_margins_of_each_loop(seed):
    """Up to four limits of the gain on each side of 1, and phases of both signs at up to six crossings."""
    system, space, rng = plant(seed)
    strength = np.array([3.0, 30.0, 30.0])[:, None, None]
    law = control.ss(-np.diag(rng.uniform(1, 30, 2)), *rng.normal(size=(3, 2, 2)) * strength, inputs=SENSORS,
                     outputs=ACTUATORS)  # fmt: skip
    got = system.feedback(law).margins()
    w = np.geomspace(0.1, 1e3, 400)
    for i in range(2):
        gain = opened(space, law, i)
        gains, phases, _, at_gains, at_phases, _ = control.stability_margins(gain, returnall=True)
        at_gains, gains = at_gains[gains < 1e8], gains[gains < 1e8]  # crossings far away are rounding
        lower, upper, late = gains < 1.0, gains > 1.0, np.mod(np.radians(phases), 2.0 * np.pi) / at_phases
        least, at = first(-gains[lower], at_gains[lower], 0.0)
        expected = np.array([
            (-least, at), first(gains[upper], at_gains[upper], np.inf),
            first(np.abs(phases), at_phases, np.inf), first(late, at_phases, np.inf)]).T  # fmt: skip
        values = [(each[i], at[i]) for each, at in (
            (got.lower, got.lower_at), (got.gain, got.gain_at), (got.phase, got.phase_at), (got.delay, got.delay_at))]
        np.testing.assert_allclose(np.transpose(values), expected / [[1.0], [2.0 * np.pi]], rtol=1e-7, atol=1e-6)
        nearest = np.abs(1.0 + gain(2j * np.pi * got.modulus_at[i]))
        assert got.modulus_each[i] == pytest.approx(nearest, rel=1e-10)
        assert nearest <= np.abs(1.0 + gain(1j * w)).min() * (1.0 + 1e-12)
    a, b, c = space
    all_gains = -law * control.ss(a, b[:, :2], c, np.zeros((2, 2)))

    def distance(omega):
        """Of diagonal perturbations: the largest singular value of S with balanced entries beside the diagonal."""
        s = np.linalg.inv(np.eye(2) + np.moveaxis(all_gains(1j * omega), 2, 0))
        squares = np.abs(s[:, 0, 0]) ** 2 + np.abs(s[:, 1, 1]) ** 2 + 2.0 * np.abs(s[:, 0, 1] * s[:, 1, 0])
        return (0.5 * (squares + np.sqrt(squares**2 - 4.0 * np.abs(np.linalg.det(s)) ** 2))) ** -0.5

    assert got.modulus == pytest.approx(distance(2.0 * np.pi * np.array([got.frequency]))[0], rel=1e-10)
    assert got.modulus <= distance(w).min() * (1.0 + 1e-12)


@pytest.mark.slow
def test_a_loop_gain_that_is_not_real_at_an_end_of_the_band_limits_no_gain():
    """L = k / s - 1.5 p / (s + p) is -1 / 0.9 of the limit where w^2 = 2 p^2 / 3, for k = 0.6 p: s^2 + (1 - 0.9 g) p s
    + 0.6 g p^2 decays for all gains g from 0 to 1 / 0.9. At the low end of the band L is nearly imaginary, and its real
    part below -1."""
    p = 2.0
    plant = mv.StateSpace.from_arrays([[-p, 0.0], [0.0, 0.0]], [[1.5 * p], [-0.6 * p]], [[1.0, 1.0]], [[0.0]],
                                      inputs=["u"], outputs=["y"])  # fmt: skip
    got = plant.feedback([[1.0]], "y", "u").margins()
    assert got.lower.tolist() == [0.0]
    assert np.isnan(got.lower_at).all()
    assert got.gain == pytest.approx([1.0 / 0.9], rel=1e-9)
    assert got.gain_at == pytest.approx([p * np.sqrt(2.0 / 3.0) / (2.0 * np.pi)], rel=1e-9)
