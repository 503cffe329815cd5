"""Loops with discrete-time controllers under inputs exp(i omega t): the mean power of outputs, of all frequencies
together, and what sampling folds from one frequency to others.

Under such an input an output is exp(i omega t) times a function with the period h of sampling. Its mean square over a
period has no poles at those of the plant; it is taken by Gauss' rule between the events of a period.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from mbsvib.feedback.excited_period import excited_motion, excited_states, period, steady_state

if TYPE_CHECKING:
    from mbsvib.common.arrays import Array, Complex, Index
    from mbsvib.feedback.sampled_equations import SampledEquations

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
    count, step = panels(a, time, w)
    nodes, weights = np.polynomial.legendre.leggauss(NODES)
    stops = [excited_motion(a, b, c, d, s, w) for s in (*(0.5 * step * (nodes + 1.0)).tolist(), step)]
    for _ in range(count):
        for stop, share in zip(stops[:-1], 0.5 * step * weights, strict=True):
            there = np.tensordot(stop.base + stop.change, x, axes=1) + turn * stop.driven
            y = np.tensordot(c, there, axes=1) + d[:, :, None] * (turn * stop.turn)
            result += share * np.abs((y.transpose(2, 0, 1) @ amplitudes).transpose(1, 2, 0)) ** 2
        end = stops[-1]
        x = np.tensordot(end.base + end.change, x, axes=1) + turn * end.driven
        turn = turn * end.turn
    return result, x, turn


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


def folded(loop: SampledEquations, w: Array, sequence: Index) -> Complex:
    """Return the one-sided density (n, inputs, actuators, actuators) that sampling folds from all other frequencies
    into the forces demanded at ``w`` (n,), for white noise of unit density at each input.

    ``sequence``: numbers of the inputs that are sampled sequences themselves, of which nothing is folded.
    """
    from mbsvib.feedback.sampled_norm import event, free_motion

    shown, sources = loop.selected_ports
    part = period(loop, shown, sources)
    whole = part.composed(
        lambda e, f: event(e, f, len(shown), np.zeros(len(sources)), together=False),
        lambda a, b, c, d, time: free_motion(a, b, c, d, time, together=False))  # fmt: skip
    rows, _ = part.demand
    z = np.exp(1j * w / loop.rate)[:, None, None]
    reached = np.linalg.solve((z * np.eye(len(whole.transition)) - whole.transition).swapaxes(1, 2),
                              np.broadcast_to(rows.T, (len(w), *rows.T.shape))).swapaxes(1, 2)  # fmt: skip
    # intensity is half the one-sided density
    total = (reached[:, None] @ whole.noise) @ reached[:, None].conj().swapaxes(2, 3) / loop.rate
    own = demanded(loop, w).transpose(2, 1, 0)
    result = total - own[..., :, None] * own[..., None, :].conj()
    result[:, sequence] = 0.0
    return np.asarray(result)
