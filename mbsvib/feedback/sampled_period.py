"""Loops with discrete-time controllers from one sample to the next: what happens within a period, in order."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Protocol, Self, TypeVar

import numpy as np

from mbsvib.feedback.sampled_equations import split_delay
from mbsvib.linalg.balancing import column_units, scaled

if TYPE_CHECKING:
    from collections.abc import Callable

    from mbsvib.common.arrays import Array
    from mbsvib.feedback.sampled_equations import SampledEquations


# Integrals over times of at most this many radians and time constants, by Gauss's rule with so many nodes, are exact to
# rounding.
SHORT, NODES = 0.5, 8


class Part(Protocol):
    """A stretch of time, or an event."""

    def then(self, other: Self) -> Self:
        """Return both in a row."""


S = TypeVar("S", bound=Part)


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
