"""A period of a loop with discrete-time controllers under inputs w exp(i omega t), and its frequency response.

Between samples the plant moves from the state at a sample, under the input and under forces that are held. Nothing here
is infinite at a pole of the plant: integrals over a time are whole functions of its matrix.
"""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from mbsvib.common.memory import BATCH_BYTES
from mbsvib.feedback.loop_rounding import check_poles
from mbsvib.feedback.sampled_period import period
from mbsvib.linalg.products import product
from mbsvib.linalg.spectrum import spectrum
from mbsvib.responses.first_order_solver import first_order_solver

if TYPE_CHECKING:
    from mbsvib.common.arrays import Array, Complex
    from mbsvib.feedback.sampled_period import Period
    from mbsvib.feedback.sampled_plant import Sampled

# Integrals over times of at most this many radians and time constants, by Gauss's rule with so many nodes, are exact to
# rounding.
SHORT, NODES = 0.5, 8


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
        back = self.turn.conj()
        later = _each(other.seen.transpose(1, 0, 2), self.driven)
        return Excited(
            other.base @ self.base, other.change @ before + other.base @ self.change,
            product(after, self.driven) + self.turn * other.driven,
            self.seen + back * product(np.ascontiguousarray(before.T), other.seen),
            self.direct + other.direct + back * later, self.turn * other.turn,
        )  # fmt: skip


def _each(left: Complex, right: Complex) -> Complex:
    """Products (rows, columns, n), frequency by frequency."""
    return np.asarray((left.transpose(2, 0, 1) @ right.transpose(2, 0, 1)).transpose(1, 2, 0))


def _sum(factors: Array, phases: Complex) -> Complex:
    """Sum of real matrices (nodes, rows, columns) times numbers (nodes, n), (rows, columns, n)."""
    (nodes, rows, columns), n = factors.shape, phases.shape[1]
    wide = np.moveaxis(factors, 0, 2).reshape(rows * columns, nodes)
    return np.asarray(product(wide, phases).reshape(rows, columns, n))


def excited_motion(a: Array, b: Array, c: Array, d: Array, time: float, w: Array) -> Excited:
    """Return the motion x' = A x + B w, y = C x + D w over a time [s], at angular frequencies ``w`` (n,) [rad/s].

    U = integral of exp(A (t - s)) B exp(i omega s),  P = integral of C exp((A - i omega) s),
    Q = integral of (t - s) C exp((A - i omega) s) B + t D, over s from 0 to a short time t, which is doubled until it
    is the whole time
    """
    from scipy.linalg import expm

    fastest = max(float(np.linalg.norm(a, 2)) if len(a) else 0.0, float(np.abs(w).max(initial=0.0)))
    doublings = max(int(np.frexp(fastest * time / SHORT)[1]), 0)
    step = float(np.ldexp(time, -doublings))
    nodes, weights = np.polynomial.legendre.leggauss(NODES)
    s, share = 0.5 * step * (nodes + 1.0), 0.5 * step * weights
    flow = expm(a * s[:, None, None])
    reached, shown = share[:, None, None] * (flow @ b), share[:, None, None] * (c @ flow)
    back = np.exp(-1j * w * s[:, None])
    driven = _sum(reached, np.exp(1j * w * step) * back)
    seen = _sum(shown.transpose(0, 2, 1), back)
    direct = _sum((step - s)[:, None, None] * (c @ reached), back) + step * d[:, :, None]
    change = a @ np.tensordot(share, flow, axes=1)  # exp(A t) - 1
    result = Excited(np.eye(len(a)), change, driven, seen, direct, np.exp(1j * w * step))
    for _ in range(doublings):
        result = result.then(result)
    return result._replace(turn=np.exp(1j * w * time))


class SteadyState(NamedTuple):
    """A loop under inputs exp(i omega t): the ``forces`` (actuators, inputs, n) demanded at the sample at t = 0, and
    the component exp(i omega t) of the outputs, ``value`` (outputs, inputs, n); ``force_terms`` and ``terms`` are the
    sizes of the terms of both.
    """

    forces: Complex
    force_terms: Array
    value: Complex
    terms: Array


def steady_state(loop: Sampled, w: Array, shown: list[int], sources: list[int]) -> SteadyState:
    """Return the response of a loop at angular frequencies ``w`` (n,) [rad/s].

    y = (P x + Q w) / h,  (exp(i omega h) - J - E) x = U w, over a period h

    ``shown``, ``sources``: numbers of outputs and inputs of the plant.
    """
    at = period(loop, shown, sources)
    size = at.sample.shape[1] * (len(shown) + len(sources)) + len(shown) * len(sources)
    batch = max(1, BATCH_BYTES // (64 * max(1, size)))
    parts = [_batch(loop, at, w[start : start + batch]) for start in range(0, max(1, len(w)), batch)]
    return SteadyState(*[np.concatenate(values, axis=2) for values in zip(*parts, strict=True)])


def _batch(loop: Sampled, at: Period, w: Array) -> SteadyState:
    none, outputs = np.empty((at.sample.shape[1], 0)), len(at.seen)

    def event(transition: Array, inputs: Array) -> Excited:
        nothing = np.zeros((transition.shape[1], outputs, len(w)), complex)
        driven = np.repeat(inputs.astype(complex)[:, :, None], len(w), axis=2)
        return Excited(transition, np.zeros_like(transition), driven, nothing,
                       np.zeros((outputs, *driven.shape[1:]), complex), np.ones(len(w), complex))  # fmt: skip

    excited = at.composed(event, partial(excited_motion, w=w))
    slow = excited.base - np.eye(len(none)) + excited.change
    solver = first_order_solver(slow, none, none.T, loop.name)
    scale = np.ldexp(1.0, solver.power)[:, None, None]
    s = np.expm1(1j * w / loop.rate)
    check_poles(s, w, spectrum(slow), loop.name)
    solutions = solver.states(s, w, excited.driven / scale)
    x: Complex = np.empty_like(excited.driven)
    for part, solution in solutions:
        x[:, :, part] = scale * solution
    seen, (rows, through) = excited.seen.transpose(1, 0, 2), at.demand
    return SteadyState(
        np.asarray(product(rows, x) + through[:, :, None], dtype=complex),
        product(np.abs(rows), np.abs(x)) + np.abs(through)[:, :, None],
        loop.rate * (_each(seen, x) + excited.direct),
        loop.rate * (np.einsum("osn,sin->oin", np.abs(seen), np.abs(x)) + np.abs(excited.direct)),
    )
