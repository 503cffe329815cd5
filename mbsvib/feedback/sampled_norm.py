"""Loops with discrete-time controllers under white noise: mean squares between samples as well, and the H2 norm."""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from mbsvib.errors import ResponseError
from mbsvib.feedback.excited_period import doubled, period, short_time
from mbsvib.linalg.lasting import separated
from mbsvib.linalg.rank import EPS
from mbsvib.linalg.spectrum import outside
from mbsvib.responses.norms import pole_words

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from mbsvib.common.arrays import Array
    from mbsvib.feedback.sampled_equations import SampledEquations

LONGEST = 60  # doublings, after which a pole that is less than 1 by a rounding has decayed


class Stretch(NamedTuple):
    """A stretch of time or an event: x+ = E x + noise, for s sources of white noise and o outputs.

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
    from scipy.linalg import expm

    doublings, step, nodes, shares = short_time(time, float(np.linalg.norm(a, 2)))
    noise, weight, own = 0.0, 0.0, 0.0
    for s, share in zip(nodes, shares, strict=True):
        turn = expm(a * s)
        reached, seen = turn @ b, c @ turn
        noise, weight = noise + share * _outer(reached.T, together), weight + share * _outer(seen, together)
        squares = (c @ reached) ** 2
        own = own + share * (step - s) * (np.array([[squares.sum()]]) if together else squares)
    return doubled(Stretch(expm(a * step), np.asarray(noise), np.asarray(weight), np.asarray(own)), doublings)


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
    shown, sources = loop.selected_ports
    part = period(loop, shown, sources)
    outputs = 1 if together else len(shown)
    whole = part.composed(partial(event, outputs=outputs, intensities=intensities, together=together),
                          partial(free_motion, together=together))  # fmt: skip
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
