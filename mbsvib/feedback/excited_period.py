"""A period of a loop with discrete-time controllers under inputs w exp(i omega t), and its frequency response.

Between samples the plant moves from the state at a sample, under the input and under forces that are held. Nothing here
is infinite at a pole of the plant: integrals over a time are whole functions of its matrix.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import NamedTuple, TypeVar

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import expm

from mbsvib.common.arrays import Array, Complex
from mbsvib.common.memory import BATCH_BYTES
from mbsvib.errors import ResponseError
from mbsvib.feedback.sampled_equations import SampledEquations, split_delay
from mbsvib.linalg.balancing import column_units, scaled
from mbsvib.linalg.products import product
from mbsvib.linalg.rank import EPS, ZERO_RESPONSE
from mbsvib.linalg.spectrum import spectrum
from mbsvib.responses.first_order_solver import FirstOrderSolver, first_order_solver

# Integrals over times of at most this many radians and time constants, by Gauss's rule with so many nodes, are exact to
# rounding.
SHORT, NODES = 0.5, 8


S = TypeVar("S", "Excited", "Stretch")


def short_time(time: float, fastest: float) -> tuple[int, float, Array, Array]:
    """Return how often a short time is doubled to be ``time`` [s], this time, and nodes and weights of Gauss's rule.

    ``fastest``: highest frequency, or rate of decay, of what is integrated [1/s].
    """
    doublings = max(int(np.frexp(fastest * time / SHORT)[1]), 0)
    step = float(np.ldexp(time, -doublings))
    nodes, weights = np.polynomial.legendre.leggauss(NODES)
    return doublings, step, 0.5 * step * (nodes + 1.0), 0.5 * step * weights


def doubled(part: S, doublings: int) -> S:
    """Return a part of a period, so often in a row with itself."""
    for _ in range(doublings):
        part = part.then(part)
    return part


@dataclass(frozen=True)
class Period:
    """A period: a sample, the time until the controllers act, an action, and the time until the next sample.

    The state is that of ``loop.sample_to_sample``, with states of the plant and forces scaled by powers of two.
    Between sample and action, the ``actuators`` demanded forces, in the units ``unit`` (actuators,), stand before the
    delayed ones.

    ``sample`` (after, before) and ``measured`` (after, inputs): x+ = E x + F w at a sample; ``action`` (after, before);
    ``flow``, ``driven``, ``seen``, ``direct``: A, B, C, D between events. ``start``: number of the first force.
    ``acting`` are the forces that act, between sample and action; before and after they are ``actuators`` places lower.
    ``waiting`` and ``rest`` [s]: times between sample and action, and from there to the next sample.
    """

    sample: Array
    measured: Array
    action: Array
    flow: Array
    driven: Array
    seen: Array
    direct: Array
    unit: Array
    start: int
    acting: slice
    waiting: float
    rest: float

    @property
    def demand(self) -> tuple[Array, Array]:
        """Forces that the controllers demand at a sample, of the state (actuators, states), of the inputs."""
        forces = slice(self.start, self.start + len(self.unit))
        return self.sample[forces] * self.unit[:, None], self.measured[forces] * self.unit[:, None]

    def after_action(self) -> tuple[Array, Array, Array]:
        """Return A, B, C of the states after an action, which are those without demanded forces."""
        kept = [*range(self.start), *range(self.start + len(self.unit), len(self.flow))]
        return self.flow[np.ix_(kept, kept)], self.driven[kept], self.seen[:, kept]

    def composed(
        self, event: Callable[[Array, Array], S], motion: Callable[[Array, Array, Array, Array, float], S]
    ) -> S:
        """Return the period composed of its parts.

        ``event`` takes E (after, before) and F (after, inputs) of x+ = E x + F w; ``motion`` takes A, B, C, D and the
        time [s] of x' = A x + B w, y = C x + D w.
        """
        waiting = motion(self.flow, self.driven, self.seen, self.direct, self.waiting)
        rest = motion(*self.after_action(), self.direct, self.rest)
        action = event(self.action, np.zeros((len(self.action), self.driven.shape[1])))
        return event(self.sample, self.measured).then(waiting).then(action).then(rest)


def period(loop: SampledEquations, shown: list[int], sources: list[int]) -> Period:
    """Return a period of a closed loop; ``shown``, ``sources``: numbers of outputs and inputs of the plant."""
    space, (y, u) = loop.plant.space, loop.ports
    a, b, c = scaled(space.A, space.B, space.C)
    ka, kb, kc, kd = loop.discrete
    n, m, k = len(a), len(u), len(ka)
    periods, remainder = split_delay(loop.rate, loop.delay)
    delayed = m * (periods + 1)
    size = n + m + delayed + k
    last = slice(n + delayed, n + m + delayed)  # what acts
    unit = column_units(b[:, u], float(np.abs(a).max(initial=0.0)) or loop.rate)
    # a sample: the forces demanded join the state, and the controller's states advance
    observed, direct = np.zeros((len(y), n + delayed + k)), space.D[np.ix_(y, sources)]
    observed[:, :n], observed[:, n + delayed - m : n + delayed] = c[y], space.D[np.ix_(y, u)] * unit
    sample, measured = np.zeros((size, n + delayed + k)), np.zeros((size, len(sources)))
    sample[:n, :n], sample[n + m : n + m + delayed, n : n + delayed] = np.eye(n), np.eye(delayed)
    sample[n : n + m], sample[n + m + delayed :] = kd @ observed, kb @ observed
    sample[n : n + m, n + delayed :] += kc
    sample[n + m + delayed :, n + delayed :] += ka
    measured[n : n + m], measured[n + m + delayed :] = kd @ direct, kb @ direct
    sample[n : n + m] /= unit[:, None]
    measured[n : n + m] /= unit[:, None]
    # an action: each force moves up by one place, the last one is dropped
    action = np.delete(np.eye(size), np.s_[last], axis=0)
    flow, driven, seen = np.zeros((size, size)), np.zeros((size, len(sources))), np.zeros((len(shown), size))
    flow[:n, :n], flow[:n, last], driven[:n] = a, b[:, u] * unit, b[:, sources]
    seen[:, :n], seen[:, last] = c[shown], space.D[np.ix_(shown, u)] * unit
    return Period(sample, measured, action, flow, driven, seen, space.D[np.ix_(shown, sources)], unit, n, last,
                  remainder, 1.0 / loop.rate - remainder)  # fmt: skip


# A response is taken from a circle about its frequency if this lies closer to a pole on the unit circle, where the loop
# may not decay but the response need not contain it: others lose digits to rounding there.
BESIDE = 1e-6
# So many points on a circle of this radius [rad in a period], or of this share of the distance of the next pole, which
# leaves 4^-24 of the terms of the series.
POINTS, RADIUS, APART = 24, 0.1, 0.25


class Excited(NamedTuple):
    """A stretch of time, or an event, under an input exp(i omega t) that is 1 when it begins, at n frequencies.

    x+ = (J + E) x + U w and, with the output y of the stretch, integral of exp(-i omega t) y = P x + Q w: ``base`` J
    and ``change`` E (after, before), of which J is exact, as 1 is in a short time; ``driven`` U (after, inputs, n),
    ``seen`` P^T (before, outputs, n), ``direct`` Q (outputs, inputs, n); ``turn`` exp(i omega t) (n,) at its end.
    """

    base: Array
    change: Array
    driven: Complex
    seen: Complex
    direct: Complex
    turn: Complex

    def then(self, other: Excited) -> Excited:
        """Return both in a row."""
        before, after = self.base + self.change, other.base + other.change
        back = 1.0 / self.turn
        later = _each(other.seen.transpose(1, 0, 2), self.driven)
        return Excited(
            other.base @ self.base, other.change @ before + other.base @ self.change,
            product(after, self.driven) + self.turn * other.driven,
            self.seen + back * product(np.ascontiguousarray(before.T), other.seen),
            self.direct + other.direct + back * later, self.turn * other.turn,
        )  # fmt: skip


class Stretch(NamedTuple):
    """A stretch of time, or an event, under white noise: x+ = E x + noise, for s sources of white noise and o outputs.

    ``transition`` E (after, before); ``noise`` (s, after, after) covariance of what each source adds; ``weight`` (o,
    before, before), so that x^T weight x is the integral of y^2 without noise; ``own`` (o, s) the integral of the
    variance of y that noise within the stretch causes.
    """

    transition: Array
    noise: Array
    weight: Array
    own: Array

    def then(self, other: Stretch) -> Stretch:
        """Return both in a row."""
        e, f = self.transition, other.transition
        between = np.tensordot(other.weight, self.noise, axes=((1, 2), (1, 2)))
        return Stretch(f @ e, f @ self.noise @ f.T + other.noise, self.weight + e.T @ other.weight @ e,
                       self.own + other.own + between)  # fmt: skip


def _each(left: Complex, right: Complex) -> Complex:
    """Products (rows, columns, n), frequency by frequency."""
    return np.asarray((left.transpose(2, 0, 1) @ right.transpose(2, 0, 1)).transpose(1, 2, 0))


def _sum(factors: Array, phases: Complex) -> Complex:
    """Sum of real matrices (nodes, rows, columns) times numbers (nodes, n), (rows, columns, n)."""
    (nodes, rows, columns), n = factors.shape, phases.shape[1]
    wide = np.moveaxis(factors, 0, 2).reshape(rows * columns, nodes)
    return np.asarray(product(wide, phases).reshape(rows, columns, n))


def excited_motion(a: Array, b: Array, c: Array, d: Array, time: float, w: Array | Complex) -> Excited:
    """Return the motion x' = A x + B w, y = C x + D w over a time [s], at angular frequencies ``w`` (n,) [rad/s].

    U = integral of exp(A (t - s)) B exp(i omega s),  P = integral of C exp((A - i omega) s),
    Q = integral of (t - s) C exp((A - i omega) s) B + t D, over s from 0 to a short time t, which is doubled until it
    is the whole time
    """
    fastest = max(float(np.linalg.norm(a, 2)) if len(a) else 0.0, float(np.abs(w).max(initial=0.0)))
    doublings, step, s, share = short_time(time, fastest)
    flow = expm(a * s[:, None, None])
    reached, shown = share[:, None, None] * (flow @ b), share[:, None, None] * (c @ flow)
    back = np.exp(-1j * w * s[:, None])
    driven = _sum(reached, np.exp(1j * w * step) * back)
    seen = _sum(shown.transpose(0, 2, 1), back)
    direct = _sum((step - s)[:, None, None] * (c @ reached), back) + step * d[:, :, None]
    change = a @ np.tensordot(share, flow, axes=1)  # exp(A t) - 1
    result = doubled(Excited(np.eye(len(a)), change, driven, seen, direct, np.exp(1j * w * step)), doublings)
    return result._replace(turn=np.exp(1j * w * time))


class SteadyState(NamedTuple):
    """A loop under inputs exp(i omega t), at n frequencies: ``value`` (rows, inputs, n) and the size of its terms.

    Rows: the forces demanded at the sample at t = 0, then the component exp(i omega t) of each output.
    """

    value: Complex
    terms: Array


def steady_state(loop: SampledEquations, w: Array, shown: list[int], sources: list[int]) -> SteadyState:
    """Return the response of a loop at angular frequencies ``w`` (n,) [rad/s].

    y = (P x + Q w) / h,  (exp(i omega h) - J - E) x = U w, over a period h

    ``shown``, ``sources``: numbers of outputs and inputs of the plant.
    """
    beyond = w[np.abs(w) * EPS > loop.rate]
    if len(beyond):
        raise ResponseError(f"frequency_response: omega = {beyond[0]:g} rad/s; '{loop.name}' is sampled at "
                            f"{loop.rate:g} Hz, and beyond {loop.rate / EPS:g} rad/s rounding of "
                            f"omega is more than a turn in a period.")  # fmt: skip
    at = period(loop, shown, sources)
    solver, slow = _slow_solver(loop, at)
    of_a = spectrum(slow)
    size = len(slow) * (len(shown) + len(sources)) + len(shown) * len(sources)
    batch = max(1, BATCH_BYTES // (64 * max(1, size)))

    def evaluate(w: Array | Complex) -> SteadyState:
        parts = [_at(at, solver, w[start : start + batch]) for start in range(0, max(1, len(w)), batch)]
        return SteadyState(*[np.concatenate(values, axis=2) for values in zip(*parts, strict=True)])

    s = np.expm1(1j * w / loop.rate)
    distance = np.abs(s[:, None] - of_a.values)
    pole = (distance <= of_a.errors).any(axis=1)
    near = pole | ((distance <= BESIDE) & (np.abs(np.abs(1.0 + of_a.values) - 1.0) <= of_a.errors)).any(axis=1)
    value, terms = np.empty((2, len(at.unit) + len(shown), len(sources), len(w)), dtype=complex)
    value[:, :, ~pole], terms[:, :, ~pole] = evaluate(w[~pole])
    for k in np.flatnonzero(near).tolist():
        regular, around, hidden = _on_circle(evaluate, float(w[k]), of_a.values, at.waiting + at.rest)
        if pole[k]:
            regular, hidden = np.where(hidden, regular, np.nan), np.ones_like(hidden)
        value[:, :, k] = np.where(hidden, regular, value[:, :, k])
        terms[:, :, k] = np.where(hidden, around, terms[:, :, k])
    return SteadyState(value, terms.real)


def _excited(at: Period, w: Array | Complex) -> Excited:
    outputs = len(at.seen)

    def event(transition: Array, inputs: Array) -> Excited:
        nothing = np.zeros((transition.shape[1], outputs, len(w)), complex)
        driven = np.repeat(inputs.astype(complex)[:, :, None], len(w), axis=2)
        return Excited(transition, np.zeros_like(transition), driven, nothing,
                       np.zeros((outputs, *driven.shape[1:]), complex), np.ones(len(w), complex))  # fmt: skip

    return at.composed(event, partial(excited_motion, w=w))


def _at(at: Period, solver: FirstOrderSolver, w: Array | Complex) -> SteadyState:
    """The response at some frequencies (n,), complex ones too."""
    excited, rate = _excited(at, w), 1.0 / (at.waiting + at.rest)
    x = _states(at, solver, excited, w)
    seen, (rows, through) = excited.seen.transpose(1, 0, 2), at.demand
    outputs = rate * (_each(seen, x) + excited.direct)
    terms = rate * (np.einsum("osn,sin->oin", np.abs(seen), np.abs(x)) + np.abs(excited.direct))
    return SteadyState(
        np.concatenate((product(rows, x) + through[:, :, None], outputs)),
        np.concatenate((product(np.abs(rows), np.abs(x)) + np.abs(through)[:, :, None], terms)),
    )


def _states(at: Period, solver: FirstOrderSolver, excited: Excited, w: Array | Complex) -> Complex:
    """The states (states, inputs, n) before the sample at t = 0."""
    scale = np.ldexp(1.0, solver.power)[:, None, None]
    x: Complex = np.empty_like(excited.driven)
    for part, solution in solver.states(np.expm1(1j * w * (at.waiting + at.rest)), w, excited.driven / scale):
        x[:, :, part] = scale * solution
    return x


def excited_states(loop: SampledEquations, at: Period, w: Array) -> Complex:
    """Return the states (states, inputs, n) of a loop before the sample at t = 0 under inputs exp(i omega t)."""
    return _states(at, _slow_solver(loop, at)[0], _excited(at, w), w)


def shown_states(loop: SampledEquations, at: Period, w: Array) -> Complex:
    """Return what the states before a sample add from there on to the component exp(i omega t) of each output, a phase
    of 0 at this sample, (states, outputs, n): z P (z - J - E)^-1, transposed.
    """
    slow, turn = _slow_solver(loop, at)[1], 1j * w * (at.waiting + at.rest)
    inside = np.expm1(turn)[:, None, None] * np.eye(len(slow)) - slow.T
    x = np.linalg.solve(inside, _excited(at, w).seen.transpose(2, 0, 1))
    return np.asarray(np.exp(turn) * x.transpose(1, 2, 0))


def _slow_solver(loop: SampledEquations, at: Period) -> tuple[FirstOrderSolver, Array]:
    """The solver of a period less 1, and its matrix."""
    excited = _excited(at, np.zeros(1))
    slow, none = excited.base - np.eye(len(excited.base)) + excited.change, np.empty((len(excited.base), 0))
    return first_order_solver(slow, none, none.T, loop.name), slow


def _on_circle(
    evaluate: Callable[[Complex], SteadyState], w: float, values: Complex, step: float
) -> tuple[Complex, Array, NDArray[np.bool_]]:  # fmt: skip
    """The response at a pole or next to one, (rows, inputs), the size of its terms, and where it has none.

    By its Laurent series, from points on a circle in the plane of complex frequencies: a response that has no pole
    inside is its mean value, and all coefficients of negative powers are rounding.

    ``values``: eigenvalues of J + E - 1. ``step``: the period [s].
    """
    with np.errstate(divide="ignore"):
        turns = np.abs(np.log((1.0 + values) * np.exp(-1j * w * step)))  # distances of poles, times the step
    others = turns[turns > 2.0 * BESIDE]
    radius = min(RADIUS, APART * float(others.min(initial=np.inf)))
    circle = np.exp(2j * np.pi * (np.arange(POINTS) + 0.5) / POINTS)
    value, terms = evaluate(w + radius / step * circle)
    size = terms.mean(axis=2)
    powers = circle ** np.arange(1, len(turns) - len(others) + 1)[:, None]
    negative = np.abs(np.tensordot(value, powers, axes=(2, 1))).max(axis=2) / POINTS
    return value.mean(axis=2), size, negative <= ZERO_RESPONSE * size
