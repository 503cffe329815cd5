"""The asymptote of a transmissibility at high frequency, from the Markov parameters of its equations."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, TypeAlias

import numpy as np

from mbsvib.api.system import System
from mbsvib.feedback.feedback_loop import FeedbackLoop
from mbsvib.linalg.balancing import scaled
from mbsvib.random.direct import direct, without_rounding

if TYPE_CHECKING:
    from collections.abc import Iterator

    from mbsvib.common.arrays import Array

Linear: TypeAlias = System | FeedbackLoop

STEEPEST = 12  # maximum order: a response that falls faster is rounding where the asymptote holds
AFTER = 2  # parameters after the leading one, from which the start of the asymptote follows


@dataclass(frozen=True, slots=True)
class Asymptote:
    """||T(i w)|| -> ``size`` / w^``order``, the dominant term above the angular frequency ``start`` [rad/s]."""

    order: int
    size: float
    start: float


def asymptote(linear: Linear, into: list[int], out: list[int], left: Array, right: Array) -> Asymptote | None:
    """Return the asymptote of the Frobenius norm of diag(left) T diag(right).

    T(s) = H0 + H1 / s + H2 / s^2 + ...

    ``left`` (outputs,), ``right`` (inputs,): weights. Returns None where T is 0, or falls with more than the twelfth
    power of the frequency.
    """
    unit = float(np.abs(linear.poles()).max(initial=0.0)) or 1.0  # [1/s], so that powers stay of one size
    if isinstance(linear, System) and not linear.massless:
        parameters = _second_order(linear, into, out, unit)
    else:
        parameters = _first_order(linear, into, out, unit)
    sizes: list[float] = []
    order = 0
    for k, markov in zip(range(STEEPEST + AFTER + 1), parameters, strict=False):
        size = float(np.linalg.norm(left[:, None] * markov * right))
        if sizes or size > 0.0:
            order = order if sizes else k
            sizes.append(size)
        if len(sizes) > AFTER or (k == STEEPEST and not sizes):
            break
    if not sizes:
        return None
    start = max([(size / sizes[0]) ** (1.0 / j) for j, size in enumerate(sizes[1:], 1)]) or 1.0
    return Asymptote(order, sizes[0] * unit**order, start * unit)


def _second_order(system: System, into: list[int], out: list[int], unit: float) -> Iterator[Array]:
    """Markov parameters of M q'' + C q' + K q = B u with time in 1/``unit`` [s], zeros where they are rounding.

    q(s) = sum of x_k / s^(k + 2), M x_0 = B u, M x_k = -C x_(k-1) - K x_(k-2). Terms with the same number of damper
    factors are summed together, so that those of weak dampers are not taken for rounding of springs.
    """
    inverse = np.linalg.inv(system.M)
    size = np.abs(inverse)
    rounding = size @ np.abs(system.M) @ size
    rates = [system.C / unit, system.K / unit**2]
    rows = [system.Ca[out], system.Cv[out] / unit, system.Cq[out] / unit**2]
    b = system.B[:, into]
    none = np.zeros_like(b), np.zeros_like(b)
    yield direct(system)[np.ix_(out, into)]
    # by the number of damper factors: motions, and their rounding errors, in parts of ZERO_MARKOV
    motions: list[dict[int, tuple[Array, Array]]] = [{}, {0: (inverse @ b, rounding @ np.abs(b))}]
    while True:
        before, last = motions[-2:]
        following = {}
        for count in {count + 1 for count in last} | set(before):
            motion, error = np.zeros_like(b), np.zeros_like(b)
            for rate, part in zip(rates, (last.get(count - 1, none), before.get(count, none)), strict=True):
                motion = motion - inverse @ (rate @ part[0])
                error = error + rounding @ (np.abs(rate) @ np.abs(part[0])) + size @ (np.abs(rate) @ part[1])
            following[count] = motion, error
        motions = [before, last, following]
        total = np.zeros((len(out), len(into)))
        for count in {count for part in motions for count in part}:
            parts = [part.get(count, none) for part in reversed(motions)]
            value = np.sum([row @ part[0] for row, part in zip(rows, parts, strict=True)], axis=0)
            error = np.sum([np.abs(row) @ part[1] for row, part in zip(rows, parts, strict=True)], axis=0)
            total += without_rounding(value, error)
        yield total
        motions = motions[1:]


def _first_order(linear: Linear, into: list[int], out: list[int], unit: float) -> Iterator[Array]:
    """Markov parameters D, C B, C A B, ... with time in 1/``unit`` [s], zeros where they are rounding."""
    space = linear.state_space("physical" if isinstance(linear, System) else "modal")
    a, power, c = scaled(space.A / unit, space.B[:, into] / unit, space.C[out])
    yield direct(linear)[np.ix_(out, into)]
    while True:
        markov, size = c @ power, np.linalg.norm(c, axis=1)[:, None] * np.linalg.norm(power, axis=0)
        yield without_rounding(markov, size)
        power = a @ power
