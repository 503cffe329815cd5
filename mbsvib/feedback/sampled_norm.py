"""H2 norm of loops with discrete-time controllers: the rms under white noise, between samples as well."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from mbsvib.errors import ResponseError
from mbsvib.feedback.sampled_period import doubled, period, short_time
from mbsvib.linalg.lasting import separated
from mbsvib.linalg.rank import EPS
from mbsvib.linalg.spectrum import outside
from mbsvib.responses.norms import pole_words

if TYPE_CHECKING:
    from mbsvib.common.arrays import Array
    from mbsvib.feedback.sampled_equations import SampledEquations

LONGEST = 60  # doublings, after which a pole that is less than 1 by a rounding has decayed


class Stretch(NamedTuple):
    """A stretch of time or an event: x+ = E x + noise.

    ``transition`` E (after, before); ``noise`` (after, after) covariance of what white noise adds; ``weight`` (before,
    before), so that x^T weight x is the integral of y^T y without noise; ``own`` the integral of the variance of y that
    noise within the stretch causes.
    """

    transition: Array
    noise: Array
    weight: Array
    own: float

    @classmethod
    def event(cls, transition: Array, _inputs: Array) -> Stretch:
        """Return a change of the state that takes no time; no input acts at that moment."""
        after, before = transition.shape
        return cls(transition, np.zeros((after, after)), np.zeros((before, before)), 0.0)

    def then(self, other: Stretch) -> Stretch:
        """Return both in a row."""
        e, f = self.transition, other.transition
        return Stretch(f @ e, f @ self.noise @ f.T + other.noise, self.weight + e.T @ other.weight @ e,
                       self.own + other.own + float(np.sum(other.weight * self.noise)))  # fmt: skip


def free_motion(a: Array, b: Array, c: Array, _direct: Array, time: float) -> Stretch:
    """Return the motion x' = A x + B w,  y = C x under white noise w over a time [s].

    noise = integral of exp(A s) B B^T exp(A^T s),  weight = integral of exp(A^T s) C^T C exp(A s),
    own = integral of (t - s) tr(C exp(A s) B B^T exp(A^T s) C^T), over s from 0 to a short time t, which is doubled
    until it is the whole time
    """
    from scipy.linalg import expm

    doublings, step, nodes, shares = short_time(time, float(np.linalg.norm(a, 2)))
    noise, weight, own = np.zeros_like(a), np.zeros_like(a), 0.0
    for s, share in zip(nodes, shares, strict=True):
        turn = expm(a * s)
        reached, seen = turn @ b, c @ turn
        noise, weight = noise + share * reached @ reached.T, weight + share * seen.T @ seen
        own += share * (step - s) * float(np.sum((c @ reached) ** 2))
    return doubled(Stretch(expm(a * step), noise, weight, own), doublings)


def h2_norm(loop: SampledEquations) -> float:
    """Return the H2 norm of a stable loop: the rms of its outputs under white noise, averaged over a period h.

    ||G||^2 = (tr(weight P) + own) / h,  P = E P E^T + noise

    P is the noise accumulated over so many periods that older noise has decayed; their number is doubled from one on.
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
    interval = _decaying(period(loop, shown, sources).composed(Stretch.event, free_motion), loop)
    lasting = interval
    for _ in range(LONGEST):
        if np.abs(lasting.transition).max(initial=0.0) <= EPS**2:
            break
        lasting = lasting.then(lasting)
    total = float(np.sum(interval.weight * lasting.noise)) + interval.own
    return float(np.sqrt(max(0.0, total * loop.rate)))


def _decaying(interval: Stretch, loop: SampledEquations) -> Stretch:
    """The part of a period that decays; refused if the rest grows or is in the norm."""
    e, noise, weight, own = interval
    parts = separated(e, noise, weight, outside)
    for group in parts.lasting:
        z, errors = group.part.poles, group.part.errors[0]
        if group.shown.any() or (np.abs(z) > 1.0 + errors).any():
            k = int(z.imag.argmax())
            pole = 0j if abs(z[k] - 1.0) <= errors[k] else complex(loop.rate * np.log(z[k]))
            raise ResponseError(f"H2 norm of '{loop.name}': {pole_words(pole)} does not decay, so that the norm is "
                                f"infinite. Give it damping, or change the controller.")  # fmt: skip
    if not parts.lasting:
        return interval
    rest = parts.decaying
    return Stretch(rest.a, rest.left @ noise @ rest.left.T, rest.right.T @ weight @ rest.right, own)
