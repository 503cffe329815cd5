"""Loops with discrete-time controllers under white noise: mean squares between samples as well, and the H2 norm.

Gradients of mean squares of loops with discrete-time controllers, to the entries of the plant and of the controller.

A period is a sequence of parts, x+ = E x + noise. With P the covariance of the state before a part and Q what a state
after it adds to the mean squares from there on, their sum over a period, tr(weight P) + own, has the gradients 2 Q E P
to E, Q to the noise, P to the weight and 1 to own. P and Q repeat after a period:

P = E P E^T + noise,  Q = E^T Q E + weight

Source: Bamieh & Pearson, Syst. Control Lett. 19 (1992) 1, for the equations of a period.
"""

from __future__ import annotations

from functools import partial
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import expm

from mbsvib.common.arrays import Array
from mbsvib.errors import ResponseError
from mbsvib.feedback.excited_period import Period, Stretch, doubled, period, short_time
from mbsvib.feedback.sampled_equations import SampledEquations
from mbsvib.linalg.balancing import balanced
from mbsvib.linalg.discrete import tustin_gradient
from mbsvib.linalg.lasting import separated
from mbsvib.linalg.rank import EPS
from mbsvib.linalg.spectrum import outside
from mbsvib.responses.norms import pole_words

Motion = tuple[Array, Array, Array]  # A, B, C, or gradients to them


LONGEST = 60  # doublings, after which a pole that is less than 1 by a rounding has decayed


def event(transition: Array, inputs: Array, outputs: int, intensities: Array, together: bool) -> Stretch:
    """Return a change of the state that takes no time, at which noise of some variances (s,) is sampled."""
    before = transition.shape[1]
    sampled = _outer((inputs * np.sqrt(intensities)).T, together)
    return Stretch(transition, sampled, np.zeros((outputs, before, before)), np.zeros((outputs, len(sampled))))


def free_motion(a: Array, b: Array, c: Array, _direct: Array, time: float, together: bool) -> Stretch:
    """Return the motion x' = A x + B w,  y = C x under white noise w over a time [s].

    noise = integral of exp(A s) b b^T exp(A^T s),  weight = integral of exp(A^T s) c^T c exp(A s),
    own = integral of (t - s) (c exp(A s) b)^2, over s from 0 to a short time t, which is doubled until it is the whole
    time; ``together``: of all sources and of all outputs in one
    """
    doublings, step, nodes, shares = short_time(time, float(np.linalg.norm(a, 2)))
    noise, weight, own = 0.0, 0.0, 0.0
    for s, share in zip(nodes, shares, strict=True):
        turn = expm(a * s)
        reached, seen = turn @ b, c @ turn
        noise, weight = noise + share * _outer(reached.T, together), weight + share * _outer(seen, together)
        squares = (c @ reached) ** 2
        own = own + share * (step - s) * (np.array([[squares.sum()]]) if together else squares)
    return doubled(Stretch(expm(a * step), np.asarray(noise), np.asarray(weight), np.asarray(own)), doublings)


def under_noise(at: Period, intensities: Array, together: bool = False) -> Stretch:
    """Return a whole period under white noise, of which some is sampled; arguments as of ``mean_squares``."""
    outputs = 1 if together else len(at.seen)
    return at.composed(partial(event, outputs=outputs, intensities=intensities, together=together),
                       partial(free_motion, together=together))  # fmt: skip


def _outer(rows: Array, together: bool) -> Array:
    """Products row^T row (rows, n, n), or their sum (1, n, n)."""
    return (rows.T @ rows)[None] if together else rows[:, :, None] * rows[:, None]


def h2_norm(loop: SampledEquations) -> float:
    """Return the H2 norm of a stable loop: the rms of its outputs under white noise, averaged over a period h.

    ||G||^2 = (tr(weight P) + own) / h,  P = E P E^T + noise

    Poles that do not decay are left out if the outputs do not show what noise does to them.

    Source: Bamieh & Pearson, Syst. Control Lett. 19 (1992) 1: the H2 problem for sampled-data systems.
    """
    direct, (y, _), (shown, sources) = loop.plant.space.D, loop.ports, loop.selected_ports
    system = loop.plant.system
    for rows, why in ((shown, "acts directly on output"), (y, "acts directly on what the controller samples,")):
        entries = direct[np.ix_(rows, sources)]
        if entries.any():
            o, i = np.unravel_index(int(np.abs(entries).argmax()), entries.shape)
            raise ResponseError(f"H2 norm of '{loop.name}': input '{system.inputs[sources[i]]}' {why} "
                                f"'{system.outputs[rows[o]]}', so that the norm is infinite. Choose displacements or "
                                f"velocities, and other inputs: outputs=[...], inputs=[...].")  # fmt: skip
    return float(np.sqrt(mean_squares(loop, np.zeros(len(sources)), together=True).sum()))


def mean_squares(loop: SampledEquations, intensities: Array, together: bool = False) -> Array:
    """Return the mean squares (outputs, sources) of a stable loop under white noises of unit intensity, averaged over a
    period h; infinite where an output shows what a source does to poles that do not decay.

    (tr(weight P) + own) / h,  P = E P E^T + noise

    P is the noise accumulated over so many periods that older noise has decayed; their number is doubled from one on.

    ``intensities`` (sources,): variances of those that are sampled sequences, 0 of others, which sampling must not meet
    directly. ``together``: of all sources and all outputs in one sum, refused if it is infinite.
    """
    whole = under_noise(period(loop, *loop.selected_ports), intensities, together)
    interval, infinite = _decaying(whole, loop, together)
    lasting = interval
    for _ in range(LONGEST):
        if np.abs(lasting.transition).max(initial=0.0) <= EPS**2:
            break
        lasting = lasting.then(lasting)
    total = np.tensordot(interval.weight, lasting.noise, axes=((1, 2), (1, 2))) + interval.own
    return np.where(infinite, np.inf, np.maximum(0.0, total * loop.rate))


def _decaying(interval: Stretch, loop: SampledEquations, refuse: bool) -> tuple[Stretch, NDArray[np.bool_]]:
    """The part of a period that decays, and which outputs show what which sources do to the rest (o, s); refused if
    that grows.
    """
    e, noise, weight, own = interval
    s, o, n = len(noise), len(weight), len(e)
    infinite = np.zeros((o, s), dtype=bool)
    parts = separated(e, noise.transpose(1, 0, 2).reshape(n, s * n), weight.reshape(o * n, n), outside)
    for group in parts.lasting:
        z, errors = group.part.poles, group.part.errors[0]
        if (refuse and group.shown.any()) or (np.abs(z) > 1.0 + errors).any():
            k = int(z.imag.argmax())
            pole = 0j if abs(z[k] - 1.0) <= errors[k] else complex(loop.rate * np.log(z[k]))
            what = "H2 norm" if refuse else "mean squares"
            raise ResponseError(f"{what} of '{loop.name}': {pole_words(pole)} does not decay, so that the norm is "
                                f"infinite. Give it damping, or change the controller.")  # fmt: skip
        infinite |= group.shown.reshape(o, n, s, n).any(axis=(1, 3))
    if not parts.lasting:
        return interval, infinite
    rest = parts.decaying
    return Stretch(rest.a, rest.left @ noise @ rest.left.T, rest.right.T @ weight @ rest.right, own), infinite


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
