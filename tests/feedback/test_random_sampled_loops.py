"""Sampled loops of random plants with feedthrough, against linear maps from one instant to the next built by hand."""

import control
import numpy as np
import pytest
from scipy.linalg import expm, solve_discrete_lyapunov

import mbsvib as mv

INPUTS, OUTPUTS = ("a", "d", "b", "e"), ("z", "s", "y", "r")
ACTUATORS, SENSORS = ("b", "a"), ("r", "s")
DISTURBANCES, SHOWN = ("e", "d"), ("y", "z")
U, Y = [2, 0], [3, 1]
W, Z = [3, 1], [2, 0]
RATE, STEPS = 40.0, 8  # samples [Hz], instants in a period
LATE = [0, 3, 8, 18]  # delays in such instants


def scene(late, noise=False):
    """A, B, C, D of a plant, its controller, and the loop; for ``noise``, disturbances act on no output at once."""
    rng = np.random.default_rng(late + 3)
    n = 4
    a = rng.normal(size=(n, n)) - 3.0 * np.eye(n)
    a[:2, 2:] += 9.0 * np.eye(2)
    a[2:, :2] -= 9.0 * np.eye(2)
    b, c, d = rng.normal(size=(n, 4)), rng.normal(size=(4, n)), 0.3 * rng.normal(size=(4, 4))
    if noise:
        d[:, W] = 0.0
    strength = np.array([0.7, 3.0, 0.7])[:, None, None]
    law = control.ss(np.diag(rng.uniform(-30, -1, 2)), *rng.normal(size=(3, 2, 2)) * strength, inputs=SENSORS,
                     outputs=ACTUATORS)  # fmt: skip
    plant = mv.StateSpace.from_arrays(a, b, c, d, inputs=INPUTS, outputs=OUTPUTS)
    return (a, b, c, d), law, plant.feedback(law).sampled(RATE, late / STEPS / RATE)


class Instants:
    """x+ = ``sample`` x + ``measured`` w at a sample, x+ = ``act`` x at each instant, after sampling, x+ = ``move`` x +
    ``driven`` w to the next one, y = ``shown`` x + D w.

    Behind the states of the plant, x has the forces on their way, of which the last ones act, and the states of the
    controller.
    """

    def __init__(self, space, law, late):
        a, b, c, d = space
        law = control.c2d(law, 1.0 / RATE, "tustin")
        self.n, k, queue = len(a), len(law.A), 2 * (late + 2)
        n, size = self.n, len(a) + queue + k
        self.demanded, self.acts, states = slice(n, n + 2), slice(n + queue - 2, n + queue), slice(n + queue, size)
        self.shown = np.zeros((4, size))
        self.shown[:, :n], self.shown[:, self.acts] = c, d[:, U]
        self.sample, self.measured = np.eye(size), np.zeros((size, 4))
        for rows, of_state, of_sensors in ((self.demanded, law.C, law.D), (states, law.A, law.B)):
            self.sample[rows], self.measured[rows] = of_sensors @ self.shown[Y], of_sensors @ d[Y]
            self.sample[rows, states] += of_state
        self.act = np.eye(size)
        self.act[n + 2 : n + queue, n + 2 : n + queue] = 0.0
        self.act[n + 2 : n + queue, n : n + queue - 2] = np.eye(queue - 2)
        self.space, self.step = (a, b), 1.0 / RATE / STEPS
        self.move, self.driven, self.added = self.motion(self.step)
        self.period = np.linalg.matrix_power(self.move @ self.act, STEPS) @ self.sample

    def motion(self, time):
        """The maps over a time, of the state and of held inputs, and the covariance that white noise adds."""
        (a, b), n, size = self.space, self.n, len(self.act)
        van_loan = expm(np.block([[-a, b[:, W] @ b[:, W].T], [np.zeros((n, n)), a.T]]) * time)
        held = expm(np.block([[a, b], [np.zeros((4, n + 4))]]) * time)[:n]
        move, driven, added = np.eye(size), np.zeros((size, 4)), np.zeros((size, size))
        move[:n, :n], move[:n, self.acts], driven[:n] = held[:, :n], held[:, n:][:, U], held[:, n:]
        added[:n, :n] = van_loan[n:, n:].T @ van_loan[:n, n:]
        return move, driven, added

    def response(self, u, d):
        """Outputs at the samples before forces change, and at all instants, under inputs held over a period."""
        x = np.zeros(len(self.move))
        before, after = [], []
        for w in u.T:
            before.append(self.shown @ x + d @ w)
            x = self.sample @ x + self.measured @ w
            for _ in range(STEPS):
                x = self.act @ x
                after.append(self.shown @ x + d @ w)
                x = self.move @ x + self.driven @ w
        return np.transpose(before), np.transpose(after)


@pytest.mark.parametrize("late", LATE)
def test_poles_equations_at_the_samples_and_time_response(late):
    space, law, loop = scene(late)
    by_hand = Instants(space, law, late)
    poles = np.linalg.eigvals(by_hand.period)
    poles = poles[np.abs(poles) > 1e-4]
    np.testing.assert_allclose(np.sort_complex(np.exp(loop.poles() / RATE)), np.sort_complex(poles), atol=1e-11)
    u = np.random.default_rng(1).normal(size=(4, 12))
    before, after = by_hand.response(u, space[3])
    t = np.arange(after.shape[1]) * by_hand.step
    response = loop.time_response(t, np.repeat(u, STEPS, axis=1), "zero")
    np.testing.assert_allclose(response, after, atol=1e-11 * np.abs(after).max())
    later = loop.time_response(t + 3.0, np.repeat(u, STEPS, axis=1), "zero")  # the first sample is the first time
    np.testing.assert_allclose(later, after, atol=1e-11 * np.abs(after).max())
    x, at, made = np.zeros(len(loop.sample_to_sample.A)), loop.sample_to_sample, []
    for w in u.T:
        made.append(at.C @ x + at.D @ w)
        x = at.A @ x + at.B @ w
    np.testing.assert_allclose(np.transpose(made), before, atol=1e-11 * np.abs(before).max())
    assert len(at.states) == len(at.A)
    part = loop.with_ports(("r", "z"), ("e", "d", "b")).sample_to_sample
    for made, whole in ((part.A, at.A), (part.B, at.B[:, [3, 1, 2]]), (part.C, at.C[[3, 0]]),
                        (part.D, at.D[np.ix_([3, 0], [3, 1, 2])])):  # fmt: skip
        np.testing.assert_array_equal(made, whole)


@pytest.mark.parametrize("late", LATE)
def test_responses_loop_gain_and_sensitivity(late):
    """G + G_u H (1 - K G_z)^-1 K G, with G_z from a force to what is sampled, by the map over a period."""
    (a, b, c, d), law, loop = scene(late)
    by_hand = Instants((a, b, c, d), control.ss([], [], [], np.zeros((2, 2))), late)
    size, law_z = len(by_hand.act), control.c2d(law, 1.0 / RATE, "tustin")
    passes = np.linalg.matrix_power(by_hand.move @ by_hand.act, STEPS)
    w = np.array([0.7, 11.0, 100.0, 300.0])
    response, loop_gain, sensitivity = loop.frequency_response(w), loop.loop_gain(w), loop.sensitivity(w)
    for i, omega in enumerate(w):
        z = np.exp(1j * omega / RATE)
        g_z = by_hand.shown[Y] @ np.linalg.solve(z * np.eye(size) - by_hand.period, passes[:, by_hand.demanded])
        k = law_z(z)
        s = np.linalg.inv(np.eye(2) - k @ g_z)
        g = c @ np.linalg.solve(1j * omega * np.eye(len(a)) - a, b) + d
        hold = (1.0 - 1.0 / z) / (1j * omega / RATE) * np.exp(-1j * omega * late * by_hand.step)
        exact = g + g[:, U] @ s @ k @ g[Y] * hold
        for made, expected in ((response, exact), (loop_gain, -k @ g_z), (sensitivity, s)):
            np.testing.assert_allclose(made[..., i], expected, atol=1e-11 * np.abs(expected).max())


@pytest.mark.parametrize("late", LATE)
def test_h2_norm(late):
    """Covariances of the outputs from instant to instant, and their mean by Gauss's rule."""
    space, law, loop = scene(late, noise=True)
    by_hand = Instants(space, law, late)
    nodes, weights = np.polynomial.legendre.leggauss(6)
    inside = [by_hand.motion(0.5 * by_hand.step * (1.0 + node)) for node in nodes]
    added = np.zeros_like(by_hand.added)
    for _ in range(STEPS):
        move = by_hand.move @ by_hand.act
        added = move @ added @ move.T + by_hand.added
    covariance = by_hand.sample @ solve_discrete_lyapunov(by_hand.period, added) @ by_hand.sample.T
    mean, rows = 0.0, by_hand.shown[Z]
    for _ in range(STEPS):
        covariance = by_hand.act @ covariance @ by_hand.act.T
        for weight, (move, _, noise) in zip(0.5 * weights / STEPS, inside, strict=True):
            mean += weight * np.trace(rows @ (move @ covariance @ move.T + noise) @ rows.T)
        covariance = by_hand.move @ covariance @ by_hand.move.T + by_hand.added
    assert loop.h2_norm(SHOWN, DISTURBANCES).value == pytest.approx(mean**0.5, rel=1e-10)


def test_many_frequencies_are_answered_like_few(monkeypatch):
    """More than are solved together are answered part by part."""
    _, _, loop = scene(3)
    w = np.linspace(1.0, 300.0, 50)
    together = loop.frequency_response(w)
    monkeypatch.setattr("mbsvib.feedback.excited_period.BATCH_BYTES", 64 * 1000)
    np.testing.assert_allclose(loop.frequency_response(w), together, rtol=1e-12)
