"""Mean squares under noise of any density, as integrals over the frequency.

A panel is no longer than the distance from its middle to the nearest pole, where Gauss' rule of sixteen points leaves
an error of 1e-14 of the integrand, next to a fourfold pole as well, which noise on a free mass has at 0. Where
densities or weights are given by functions, panels are halved until both halves agree with the whole. Beyond the last
pole the frequency is replaced by its inverse.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from mbsvib.responses.extrema import UNDAMPED, panels

if TYPE_CHECKING:
    from mbsvib.common.arrays import Array, Complex

    Integrand = Callable[[Array], Array]

GAUSS = 16  # points of Gauss' rule on a panel
# Damping ratio up to which a mode counts as undamped: its panels are next to those as narrow as rounding, left out.
NARROWEST = 10.0 * UNDAMPED
BATCH = 512  # frequencies at a time
BEYOND = 8.0  # times the highest pole or break-point: from there to infinity over 1/f
# Panels of unknown functions are halved so often at most, until both halves agree to this share of the sum.
HALVINGS, AGREE = 24, 1e-12
TAIL = 4  # panels over 1/f
MOST = 4096  # panels of unknown functions
FINER = 16  # panels in place of one for gradients of unknown functions


class Integral(NamedTuple):
    """Integrals (...) of the parts, and the largest ``error`` as a share of the largest of them."""

    value: Array
    error: float


@dataclass(frozen=True, eq=False)
class Rule:
    """Panels over a band: their ``ends`` (panels + 1,) [Hz] and, beyond the last, those over the inverse frequency.

    ``unknown``: whether the integrand has features that the poles do not tell.
    """

    ends: Array
    tail: Array
    unknown: bool

    def integral(self, of: Integrand, marks: bool = False) -> Integral:
        """Return the integral of a function of frequencies (n,) [Hz] with values (..., n).

        ``marks``: return those of each panel of ``ends`` in the last axis in place of their sum.
        """
        inside = _integrated(of, self.ends, self.unknown)
        if marks:
            return inside
        total, error = inside.value.sum(axis=-1), inside.error
        if len(self.tail):
            beyond = _integrated(lambda t: of(1.0 / t) / t**2, self.tail, self.unknown)
            total = total + beyond.value.sum(axis=-1)
            error += beyond.error
        largest = float(np.abs(total).max(initial=0.0))
        return Integral(total, error / largest if largest else 0.0)

    def nodes(self) -> tuple[Array, Array]:
        """Return frequencies and weights (n,) [Hz] of the integral, in finer panels where the integrand is unknown."""
        pieces = FINER if self.unknown else 1
        f, weight = _nodes(_split(self.ends, pieces))
        if not len(self.tail):
            return f, weight
        t, share = _nodes(_split(self.tail, pieces))
        return np.concatenate((f, 1.0 / t)), np.concatenate((weight, share / t**2))


def rule(
    poles: Complex, breaks: Array, span: tuple[float, float], unknown: bool, longest: float = np.inf,
    period: float = np.inf,
) -> Rule:  # fmt: skip
    """Return panels over the ``span`` [Hz], the end of which may be infinite.

    ``poles`` [1/s]: those of the responses and filters; ``breaks`` [Hz]: where panels are to end; ``longest``,
    ``period``: as of ``extrema.panels``.
    """
    low, high = span
    turns = poles / (2.0 * np.pi)
    known = np.concatenate((breaks, np.abs(turns)))
    last, tail = high, np.zeros(0)
    if high == np.inf:
        last = max(BEYOND * float(known.max(initial=1.0)), 2.0 * low)
        tail = np.linspace(0.0, 1.0 / last, TAIL + 1)
    if len(breaks):
        turns = np.append(turns, 0.0)  # tables are powers of the frequency
    return Rule(panels(turns, low, last, known, longest, period), tail, unknown)


def _integrated(of: Integrand, ends: Array, unknown: bool) -> Integral:
    """The integral over each panel (..., panels), and a bound of the largest error of their sum."""
    start, end = ends[:-1], ends[1:]
    whole = _by_gauss(of, start, end)
    if not unknown:
        return Integral(whole, 0.0)
    owner, total, error = np.arange(len(start)), np.zeros_like(whole), np.zeros(whole.shape[:-1])
    for level in range(HALVINGS):
        middle = 0.5 * (start + end)
        left, right = _by_gauss(of, start, middle), _by_gauss(of, middle, end)
        apart = np.abs(left + right - whole)
        size = np.abs(total).sum(axis=-1) + np.abs(whole).sum(axis=-1)
        far = (apart > AGREE * size[..., None]).reshape(-1, len(start)).any(axis=0)
        if level == HALVINGS - 1 or 2 * far.sum() > MOST:
            far[:] = False
        for k in np.flatnonzero(~far).tolist():
            total[..., owner[k]] += left[..., k] + right[..., k]
        error += apart[..., ~far].sum(axis=-1)
        if not far.any():
            break
        start, end = np.concatenate((start[far], middle[far])), np.concatenate((middle[far], end[far]))
        whole, owner = np.concatenate((left[..., far], right[..., far]), axis=-1), np.tile(owner[far], 2)
    return Integral(total, float(error.max(initial=0.0)))


def _by_gauss(of: Integrand, start: Array, end: Array) -> Array:
    """Gauss' rule on panels, (..., panels); 0 between ends that differ by rounding, such as two undamped poles."""
    wide = np.flatnonzero(end - start > UNDAMPED * end)
    f, weight = _gauss(start[wide], end[wide])
    values = np.concatenate([of(f[at : at + BATCH]) for at in range(0, max(len(f), 1), BATCH)], axis=-1)
    result = np.zeros((*values.shape[:-1], len(start)))
    result[..., wide] = (values * weight).reshape(*values.shape[:-1], len(wide), GAUSS).sum(axis=-1)
    return result


def _gauss(start: Array, end: Array) -> tuple[Array, Array]:
    """Nodes and weights (panels GAUSS,) of Gauss' rule on panels."""
    node, weight = np.polynomial.legendre.leggauss(GAUSS)
    half = 0.5 * (end - start)[:, None]
    return (0.5 * (start + end)[:, None] + half * node).reshape(-1), (half * weight).reshape(-1)


def _nodes(ends: Array) -> tuple[Array, Array]:
    return _gauss(ends[:-1], ends[1:])


def _split(ends: Array, pieces: int) -> Array:
    """The ends of panels in equal pieces."""
    share = np.arange(pieces) / pieces
    return np.append((ends[:-1, None] + np.diff(ends)[:, None] * share).reshape(-1), ends[-1])
