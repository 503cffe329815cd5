"""Loops with discrete-time controllers under inputs exp(i omega t): the mean power of outputs, of all frequencies
together, and what sampling folds from one frequency to others.

Under such an input an output is exp(i omega t) times a function with the period h of sampling. Its mean square over a
period has no poles at those of the plant; it is taken by Gauss' rule between the events of a period.

Gradients of mean powers of loops with discrete-time controllers under inputs exp(i omega t).

Over a period h, with costates l' = -A^T l - C^T y that repeat as the states do, l(t + h) = exp(i omega h) l(t), the
integral of |y|^2 changes by 2 Re of the integral of l^H (dA x + dB u) + y^H (dC x + dD u), and of l^H (dE x + dF u) at
a sample x+ = E x + F u.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from scipy.linalg import expm

from mbsvib.common.arrays import Array, Complex
from mbsvib.feedback.excited_period import Excited, excited_motion, excited_states, period, shown_states, steady_state
from mbsvib.feedback.sampled_equations import SampledEquations
from mbsvib.feedback.sampled_norm import Motion, Slopes, flow, loop_slopes, with_rest

NODES = 16  # of Gauss' rule in a panel
TURN = 4.0  # largest change of phase, or decay, in a panel: 16 nodes leave 1e-14 of a product of two exponentials
BATCH = 128  # frequencies at a time


def mean_powers(loop: SampledEquations, w: Array, amplitudes: Complex) -> Array:
    """Return the mean squares |y|^2 (outputs, k, n) of a loop's outputs under inputs a exp(i omega t), averaged over
    time, at angular frequencies ``w`` (n,) [rad/s], for k ``amplitudes`` a (n, inputs, k) of all inputs at once.
    """
    parts = [_powers(loop, w[start : start + BATCH], amplitudes[start : start + BATCH])
             for start in range(0, len(w), BATCH)]  # fmt: skip
    return np.concatenate(parts, axis=2)


def _powers(loop: SampledEquations, w: Array, amplitudes: Complex) -> Array:
    at = period(loop, *loop.selected_ports)
    x = excited_states(loop, at, w)
    x = np.tensordot(at.sample, x, axes=1) + at.measured[:, :, None]
    result, turn = np.zeros((len(at.seen), amplitudes.shape[2], len(w))), np.ones(len(w), dtype=complex)
    stretches = ((at.flow, at.driven, at.seen), at.waiting), (at.after_action(), at.rest)
    for k, ((a, b, c), time) in enumerate(stretches):
        if k:
            x = np.tensordot(at.action, x, axes=1)
        added, x, turn = _over((a, b, c, at.direct), time, w, x, (turn, amplitudes))
        result += added
    return np.asarray(result / (at.waiting + at.rest))


def _over(
    space: tuple[Array, Array, Array, Array], time: float, w: Array, x: Complex, driven: tuple[Complex, Complex]
) -> tuple[Array, Complex, Complex]:
    """The integral of |y|^2 over a time, and state and phase of the input at its end.

    ``driven``: phase and amplitudes of the inputs.
    """
    (a, b, c, d), (turn, amplitudes) = space, driven
    result: Array = np.zeros((len(c), amplitudes.shape[2], len(w)))
    nodes, weights = np.polynomial.legendre.leggauss(NODES)
    stops, last = list[Excited](), 0.0
    for step in graded(a, time, w):
        if step != last:
            stops = [excited_motion(a, b, c, d, s, w) for s in (*(0.5 * step * (nodes + 1.0)).tolist(), step)]
            last = step
        for stop, share in zip(stops[:-1], 0.5 * step * weights, strict=True):
            there = np.tensordot(stop.base + stop.change, x, axes=1) + turn * stop.driven
            y = np.tensordot(c, there, axes=1) + d[:, :, None] * (turn * stop.turn)
            result += share * np.abs((y.transpose(2, 0, 1) @ amplitudes).transpose(1, 2, 0)) ** 2
        end = stops[-1]
        x = np.tensordot(end.base + end.change, x, axes=1) + turn * end.driven
        turn = turn * end.turn
    return result, x, turn


def graded(a: Array, time: float, w: Array) -> list[float]:
    """Return lengths [s] of panels of a time as of ``panels``, each twice as long as the one before where states that
    decay faster have decayed.
    """
    values, omega = np.linalg.eigvals(a), float(np.abs(w).max(initial=0.0))
    count, _ = panels(a, time, w)
    fast = 2.0 * (float((np.abs(values.imag) + np.maximum(values.real, 0.0)).max(initial=0.0)) + omega)
    doublings = max(0, int(np.log2(max(1, count) / max(1.0, fast * time / TURN))))
    rest = max(0, int(np.ceil(count * 0.5**doublings)) - 1)
    # shortest (1 + 1 + 2 + ... + 2^(k - 1)) is 2^k of them
    lengths = np.concatenate(([1.0], 2.0 ** np.arange(doublings), np.full(rest, 2.0**doublings)))
    return (lengths * (time / lengths.sum())).tolist() if count else []


def panels(a: Array, time: float, w: Array) -> tuple[int, float]:
    """Return number and length [s] of panels of a time for products of states x' = A x and inputs exp(i omega t)."""
    fastest = 2.0 * (float(np.linalg.norm(a, 2)) + float(np.abs(w).max(initial=0.0)))
    count = int(np.ceil(fastest * time / TURN))
    return count, time / max(1, count)


def demanded(loop: SampledEquations, w: Array) -> Complex:
    """Return the forces (actuators, inputs, n) that the controllers demand at the samples under inputs exp(i omega t).
    """
    return steady_state(loop, w, [], loop.selected_ports[1]).value


def held(loop: SampledEquations, w: Array) -> Complex:
    """Return what forces held from sample to sample do to the outputs at ``w`` (outputs, actuators, n), per unit of the
    component of the sequence of forces there.
    """
    hold = np.sinc(w / (2.0 * np.pi * loop.rate)) * np.exp(-1j * w * (0.5 / loop.rate + loop.delay))
    system, names = loop.plant.system, loop.outputs
    return np.asarray(system.frequency_response(w, list(names), list(loop.actuators)) * hold)


def white_densities(loop: Any, w: Array) -> Array:
    """Return the one-sided densities (outputs, inputs, n) of a loop's outputs at ``w`` (n,), with what sampling folds
    from all other frequencies, for white noise of unit density at each input, which is not sampled at once.

    A pulse a time t before a sample adds h(t) to the component exp(i omega t) of an output; the sum of the squares of
    the responses at omega and all that are folded there is the integral of |h|^2 over a period, divided by it.
    """
    parts = [_white_densities(loop, w[start : start + BATCH]) for start in range(0, len(w), BATCH)]
    return np.concatenate(parts, axis=2)


def _white_densities(loop: Any, w: Array) -> Array:
    at, (shown, sources) = period(loop, *loop.selected_ports), loop.selected_ports
    # h = B^T x, and back in time x' = A^T x + C^T exp(i omega t)
    x, turn = shown_states(loop, at, w), np.ones(len(w), dtype=complex)
    result, each = np.zeros((len(sources), len(shown), len(w))), np.tile(np.eye(len(shown)) + 0j, (len(w), 1, 1))
    for (a, b, c), time, event in ((at.after_action(), at.rest, at.action), (flow(at), at.waiting, at.sample)):
        added, x, turn = _over((a.T, c.T, b.T, np.zeros_like(at.direct.T)), time, w, x, (turn, each))
        result, x = result + added, _times(event.T, x)
    result = loop.rate * result.swapaxes(0, 1)
    if at.direct.any():  # it is not sampled, and is in the response at omega alone
        g = loop.response(w)
        result += 2.0 * at.direct[:, :, None] * g.real - at.direct[:, :, None] ** 2
    return np.asarray(result)


class Inputs(NamedTuple):
    """Inputs a exp(i omega t), ``amplitudes`` a (inputs, k, n) at frequencies ``w`` (n,) with ``weights`` (n,)."""

    w: Array
    amplitudes: Complex
    weights: Array

    def of(self, response: Complex) -> Complex:
        """Return a response (rows, inputs, n) to these amplitudes, (rows, k, n)."""
        return np.asarray((response.transpose(2, 0, 1) @ self.amplitudes.transpose(2, 0, 1)).transpose(1, 2, 0))

    def outer(self, left: Complex, right: Complex) -> Array:
        """Return 2 Re of the sum of left^* right^T over cases and weighted frequencies."""
        return np.asarray(2.0 * np.einsum("ikn,jkn,n->ij", left.conj(), right, self.weights, optimize=True).real)


class Stretch(NamedTuple):
    """States and costates over a stretch of time in panels: ``space`` A, B, C, D, ``stops`` at the ``shares`` of
    Gauss's rule and the end of a panel, ``back`` exp(A^T t) over a panel, and ``starts``, the states (states, k, n) and
    phases (n,) at the beginning of panels and, last, at the end.
    """

    space: tuple[Array, Array, Array, Array]
    stops: list[Excited]
    shares: Array
    back: Array
    starts: list[tuple[Complex, Complex]]

    @property
    def end(self) -> tuple[Complex, Complex]:
        """State and phase at the end."""
        return self.starts[-1]

    def backward(self, costate: Complex, inputs: Inputs) -> tuple[Complex, list[Array]]:
        """Return the costate at the beginning, of one at the end, and the gradients to A, B, C, D."""
        (a, b, c, d), n = self.space, len(self.space[0])
        total = [np.zeros_like(matrix) for matrix in (a, b, c, d)]
        for x, turn in self.starts[-2::-1]:
            end = self.stops[-1]
            pushed = _times(end.base[n:, :n] + end.change[n:, :n], x) + turn * inputs.of(end.driven)[n:]
            costate = _times(self.back, costate - pushed)
            both = np.concatenate((x, costate))
            for stop, share in zip(self.stops[:-1], self.shares, strict=True):
                there = _times(stop.base + stop.change, both) + turn * inputs.of(stop.driven)
                u = inputs.amplitudes * (turn * stop.turn)
                y = _times(c, there[:n]) + _times(d, u)
                pairs = (there[n:], there[:n]), (there[n:], u), (y, there[:n]), (y, u)
                for matrix, (left, right) in zip(total, pairs, strict=True):
                    matrix += share * inputs.outer(left, right)
        return costate, total


def power_slopes(loop: SampledEquations, w: Array, amplitudes: Complex, weights: Array) -> Slopes:
    """Return the gradients of the sum over frequencies (n,) [rad/s] of ``weights`` (n,) times the mean powers of the
    only output of a loop, of all cases of ``amplitudes`` (n, inputs, k) together.
    """
    parts = [_slopes(loop, Inputs(w[at], amplitudes[at].transpose(1, 2, 0), weights[at]))
             for at in np.split(np.arange(len(w)), range(BATCH, len(w), BATCH))]  # fmt: skip
    return Slopes(loop.rate * np.sum([part.plant for part in parts], axis=0),
                  loop.rate * np.sum([part.law for part in parts], axis=0))  # fmt: skip


def _slopes(loop: SampledEquations, inputs: Inputs) -> Slopes:
    at, one = period(loop, *loop.selected_ports), np.ones(len(inputs.w), dtype=complex)
    x = inputs.of(excited_states(loop, at, inputs.w))
    sampled = _times(at.sample, x) + _times(at.measured, inputs.amplitudes)
    waiting = _stretch(flow(at), at.direct, at.waiting, inputs, (sampled, one))
    moved, turn = waiting.end
    rest = _stretch(at.after_action(), at.direct, at.rest, inputs, (_times(at.action, moved), turn))
    turn = rest.end[1]

    def backward(last: Complex) -> tuple[Complex, list[Array], list[Array]]:
        costate, later = rest.backward(last, inputs)
        costate, earlier = waiting.backward(_times(at.action.T, costate), inputs)
        return costate, earlier, later

    # what costates of 0 at the end leave at the beginning; those that repeat are that and what the period makes of them
    left = _times(at.sample.T, backward(np.zeros_like(x))[0]).transpose(2, 0, 1)
    over = [np.linalg.matrix_power(part.back, len(part.starts) - 1) for part in (waiting, rest)]
    whole = at.sample.T @ over[0] @ at.action.T @ over[1]
    first = np.linalg.solve(np.eye(len(whole)) - turn[:, None, None] * whole, left).transpose(1, 2, 0)
    costate, earlier, later = backward(turn * first)
    a, b, c = with_rest(at, (earlier[0], earlier[1], earlier[2]), (later[0], later[1], later[2]))
    sample = inputs.outer(costate, x), inputs.outer(costate, inputs.amplitudes)
    return loop_slopes(loop, at, sample, (a, b, c), earlier[3] + later[3])


def _stretch(motion: Motion, d: Array, time: float, inputs: Inputs, start: tuple[Complex, Complex]) -> Stretch:
    """A stretch of time from a state and a phase."""
    (a, b, c), n = motion, len(motion[0])
    count, step = panels(a, time, inputs.w)
    nodes, shares = np.polynomial.legendre.leggauss(NODES)
    wide = np.block([[a, np.zeros_like(a)], [-c.T @ c, -a.T]])
    none = np.zeros((0, 2 * n))
    stops = [excited_motion(wide, np.concatenate((b, -c.T @ d)), none, np.zeros((0, b.shape[1])), s, inputs.w)
             for s in (*(0.5 * step * (nodes + 1.0)).tolist(), step)]  # fmt: skip
    starts, end = [start], stops[-1]
    for _ in range(count):
        x, turn = starts[-1]
        moved = _times(end.base[:n, :n] + end.change[:n, :n], x) + turn * inputs.of(end.driven)[:n]
        starts.append((moved, turn * end.turn))
    return Stretch((a, b, c, d), stops, 0.5 * step * shares, expm(a.T * step), starts)


def _times(matrix: Array, x: Complex) -> Complex:
    return np.asarray(np.tensordot(matrix, x, axes=1))
