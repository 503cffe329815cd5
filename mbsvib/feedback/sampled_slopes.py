"""Gradients of mean squares of loops with discrete-time controllers, to the entries of the plant and of the controller.

A period is a sequence of parts, x+ = E x + noise. With P the covariance of the state before a part and Q what a state
after it adds to the mean squares from there on, their sum over a period, tr(weight P) + own, has the gradients 2 Q E P
to E, Q to the noise, P to the weight and 1 to own. P and Q repeat after a period:

P = E P E^T + noise,  Q = E^T Q E + weight

Source: Bamieh & Pearson, Syst. Control Lett. 19 (1992) 1, for the equations of a period.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from mbsvib.feedback.excited_period import period, short_time
from mbsvib.feedback.sampled_norm import LONGEST, Stretch, event, free_motion
from mbsvib.linalg.balancing import balanced
from mbsvib.linalg.discrete import tustin_gradient
from mbsvib.linalg.lasting import separated
from mbsvib.linalg.rank import EPS
from mbsvib.linalg.spectrum import outside

if TYPE_CHECKING:
    from mbsvib.common.arrays import Array
    from mbsvib.feedback.excited_period import Period
    from mbsvib.feedback.sampled_equations import SampledEquations

    Motion = tuple[Array, Array, Array]  # A, B, C, or gradients to them


class Slopes(NamedTuple):
    """Gradients to [A B; C D] of the ``plant`` (states + outputs, states + inputs), and to those of the continuous
    controllers, the ``law`` (states + actuators, states + sensors).
    """

    plant: Array
    law: Array


def square_slopes(loop: SampledEquations, intensities: Array) -> Slopes:
    """Return the gradients of the mean square of the only output of a loop, which is finite, due to all its sources.

    ``intensities`` (sources,): as of ``mean_squares``.
    """
    at = period(loop, *loop.selected_ports)
    none = np.zeros((len(at.action), at.driven.shape[1]))
    waiting, rest = _doublings(flow(at), at.waiting), _doublings(at.after_action(), at.rest)
    parts = [event(at.sample, at.measured, 1, intensities, together=True), waiting[-1],
             event(at.action, none, 1, intensities, together=True), rest[-1]]  # fmt: skip
    before, after = _steady(parts[0].then(parts[1]).then(parts[2]).then(parts[3]))
    later = [after]
    for part in parts[:0:-1]:
        later.insert(0, part.transition.T @ later[0] @ part.transition + part.weight[0])
    slopes = []
    for part, q in zip(parts, later, strict=True):
        slopes.append(Stretch(2.0 * q @ part.transition @ before, q, before, np.ones(())))
        before = part.transition @ before @ part.transition.T + part.noise[0]
    motion = with_rest(at, _of_motion(flow(at), at.waiting, waiting, slopes[1]),
                       _of_motion(at.after_action(), at.rest, rest, slopes[3]))  # fmt: skip
    measured = 2.0 * slopes[0].noise @ at.measured * intensities
    found = loop_slopes(loop, at, (slopes[0].transition, measured), motion)
    return Slopes(loop.rate * found.plant, loop.rate * found.law)


def flow(at: Period) -> Motion:
    """Return A, B, C between a sample and an action."""
    return at.flow, at.driven, at.seen


def with_rest(at: Period, waiting: Motion, rest: Motion) -> Motion:
    """Return the sum of gradients to A, B, C before an action and after it, which has the states of ``after_action``.
    """
    a, b, c = (matrix.copy() for matrix in waiting)
    kept = np.delete(np.arange(len(a)), np.s_[at.start : at.start + len(at.unit)])
    a[np.ix_(kept, kept)] += rest[0]
    b[kept] += rest[1]
    c[:, kept] += rest[2]
    return a, b, c


def _doublings(motion: Motion, time: float) -> list[Stretch]:
    """The motion over a short time, and over twice as long each, up to the whole time."""
    doublings, step, *_ = short_time(time, float(np.linalg.norm(motion[0], 2)))
    parts = [free_motion(*motion, np.zeros(0), step, together=True)]
    for _ in range(doublings):
        parts.append(parts[-1].then(parts[-1]))
    return parts


def _steady(whole: Stretch) -> tuple[Array, Array]:
    """P and Q of a period; of poles that last, which no response contains, only the parts with all others."""
    e, noise, weight = whole.transition, whole.noise[0], whole.weight[0]
    parts = separated(e, noise, weight, outside)
    rest, p, q = parts.decaying, np.zeros_like(e), np.zeros_like(e)
    for part in (rest, *[group.part for group in parts.lasting]):
        half = 0.5 if part is rest else 1.0
        controlled = part.right @ _series(part.a, part.left @ noise @ rest.left.T, rest.a.T) @ rest.right.T
        observed = part.left.T @ _series(part.a.T, part.right.T @ weight @ rest.right, rest.a) @ rest.left
        p, q = p + half * (controlled + controlled.T), q + half * (observed + observed.T)
    return p, q


def _series(left: Array, middle: Array, right: Array) -> Array:
    """The sum over all k of left^k middle right^k, of which the powers of ``right`` decay."""
    total = middle
    for _ in range(LONGEST):
        if np.abs(right).max(initial=0.0) <= EPS**2:
            break
        total = total + left @ total @ right
        left, right = left @ left, right @ right
    return total


def _of_motion(motion: Motion, time: float, parts: list[Stretch], slopes: Stretch) -> Motion:
    """Gradients to A, B, C of a motion, of those to what it makes of a state over a time."""
    from scipy.linalg import expm

    (a, b, c), n = motion, len(motion[0])
    for part in parts[-2::-1]:
        slopes = _halved(slopes, part)
    to_e, to_noise, to_weight, to_own = slopes
    _, step, nodes, shares = short_time(time, float(np.linalg.norm(a, 2)))
    turns = expm(a * nodes[:, None, None])
    reached, shown, share = turns @ b, c @ turns, 2.0 * shares[:, None, None]
    late = (step - nodes)[:, None, None] * to_own * (c @ reached)
    to_reached, to_shown = share * (to_noise @ reached + c.T @ late), share * (shown @ to_weight)
    times = np.append(nodes, step)[:, None, None]
    to_turn = times * np.concatenate((to_reached @ b.T + c.T @ to_shown, to_e[None]))
    unit = float(np.abs(to_turn).sum(axis=(1, 2)).max()) or 1.0  # off the diagonal it is not to decide how expm squares
    wide = np.zeros((len(times), 2 * n, 2 * n))
    wide[:, :n, :n] = wide[:, n:, n:] = a.T * times
    wide[:, :n, n:] = to_turn / unit
    to_a = unit * expm(wide)[:, :n, n:].sum(axis=0)
    to_c = (share * late @ reached.swapaxes(1, 2) + to_shown @ turns.swapaxes(1, 2)).sum(axis=0)
    return to_a, (turns.swapaxes(1, 2) @ to_reached).sum(axis=0), to_c


def _halved(slopes: Stretch, part: Stretch) -> Stretch:
    """Gradients to a part, of those to this part twice in a row."""
    e, noise, weight = part.transition, part.noise[0], part.weight[0]
    to_e, to_noise, to_weight, to_own = slopes
    return Stretch(e.T @ to_e + to_e @ e.T + 2.0 * (to_noise @ e @ noise + weight @ e @ to_weight),
                   to_noise + e.T @ to_noise @ e + to_own * weight, to_weight + e @ to_weight @ e.T + to_own * noise,
                   2.0 * to_own)  # fmt: skip


def loop_slopes(
    loop: SampledEquations, at: Period, sampled: tuple[Array, Array], motion: Motion, direct: Array | None = None
) -> Slopes:
    """Return the gradients to the equations of a loop, of those to its period.

    ``sampled``: to E and F of a sample; ``motion``: to A, B, C between events; ``direct``: to D, where it counts.
    """
    space, (y, u), (shown, sources), law = loop.plant.space, loop.ports, loop.selected_ports, loop.law
    _, _, c, _, power = balanced(space.A, space.B, space.C, np.empty((0, len(space.A))))
    (to_sample, to_measured), (to_flow, driven, seen) = sampled, motion
    n, m, k, size = at.start, len(u), len(law.A), to_sample.shape[1]
    acting, states = slice(size - k - m, size - k), slice(size - k, size)
    observed = np.zeros((len(y), size))
    observed[:, :n], observed[:, acting] = c[y], space.D[np.ix_(y, u)] * at.unit
    rows = [*range(len(to_sample) - k, len(to_sample)), *range(n, n + m)]  # the controller's states, forces demanded
    unit = np.concatenate((np.ones(k), 1.0 / at.unit))[:, None]
    to_sample, to_measured = unit * to_sample[rows], unit * to_measured[rows]
    into = np.concatenate((loop.discrete[1], loop.discrete[3]))
    to_observed, through = into.T @ to_sample, space.D[np.ix_(y, sources)]
    to_law = np.concatenate((to_sample[:, states], to_sample @ observed.T + to_measured @ through.T), axis=1)
    plant = np.zeros((n + len(space.C), n + space.B.shape[1]))
    plant[:n, :n] = np.ldexp(to_flow[:n, :n], power[None, :] - power[:, None])
    for columns, to_b in ((u, to_flow[:n, at.acting] * at.unit), (sources, driven[:n])):
        np.add.at(plant, np.ix_(np.arange(n), n + np.array(columns)), np.ldexp(to_b, -power[:, None]))
    for outputs, to_c, to_d in ((y, to_observed[:, :n], to_observed[:, acting]),
                                (shown, seen[:, :n], seen[:, at.acting])):  # fmt: skip
        to_outputs = np.ix_(n + np.array(outputs), np.arange(n)), np.ix_(n + np.array(outputs), n + np.array(u))
        np.add.at(plant, to_outputs[0], np.ldexp(to_c, power))
        np.add.at(plant, to_outputs[1], to_d * at.unit)
    for outputs, to_d in ((y, into.T @ to_measured), (shown, np.zeros(()) if direct is None else direct)):
        np.add.at(plant, np.ix_(n + np.array(outputs), n + np.array(sources)), to_d)
    return Slopes(plant, tustin_gradient(law.A, law.B, law.C, to_law, loop.period))
