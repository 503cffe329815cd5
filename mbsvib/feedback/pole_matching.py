"""Poles at one gain, each with the pole at another gain that continues it, and whether this is certain.

Two poles belong together if the trapezoidal rule takes the one to the other, and if their derivatives agree:

    r_ij = |b_j - a_i - h (a_i' + b_j') / 2|,    d_ij = h |b_j' - a_i'|

The first term is of third order in the step h, the second of second order. Poles that cross differ by the second term,
nearly equal poles that move together by the first. Where a pair of poles meets on the real axis and goes on as two real
poles, there is no derivative and no continuation: by convention, the pole with the positive imaginary part becomes the
right one. Where two real poles go on as a pair, the one of a mode, or else the right one, takes the positive imaginary
part. So modes end in zeros, and the choice depends on the poles alone, not on the steps.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from mbsvib.linalg.groups import linked_items

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from mbsvib.common.arrays import Array, Complex, Index
    from mbsvib.feedback.gain_spectrum import GainSpectrum

SHORT = 0.3  # share of the differences with two poles exchanged, and of their distance, below which a match is certain
CROSSING = 1e-5  # share of a pole's magnitude; poles that pass each other at a larger distance do not cross


def matched(first: GainSpectrum, second: GainSpectrum, modes: NDArray[np.bool_]) -> tuple[Index, bool]:
    """Return ``order`` (n,) and whether it is certain: ``second.values[order]`` continue ``first.values``.

    It is certain if position and slope tell this order from all others; if not, the step must be shorter. ``modes``
    (n,): which poles of the first gain were modes at the outset.
    """
    from scipy.optimize import linear_sum_assignment

    step = second.gain - first.gain
    change = (second.matrix - first.matrix) / step
    before, after = first.slopes(change) * step, second.slopes(change) * step
    distance = second.values - first.values[:, None]
    residual = np.abs(distance - 0.5 * (before[:, None] + after))
    turn = np.abs(after - before[:, None])
    # squares keep the order of poles on the real axis, where sums of distances have many minima
    order = linear_sum_assignment(np.square(residual + 0.5 * turn))[1]
    size = np.abs(first.values) + np.abs(second.values[order])
    closest = _closest(first.values, second.values[order], after[order] - before)
    equal = _equal(first, np.arange(len(order))) | _equal(second, order)
    crossing = np.where(equal, np.inf, CROSSING * (size[:, None] + size))
    separated = _separated(residual[:, order], turn[:, order], closest, crossing)
    certain = True
    for columns in linked_items(~separated):
        # in an ambiguous set the order of real plus imaginary part stays: right ones are those with positive parts
        ours = columns[_ascending(first.values[columns])]
        theirs = np.sort(order[columns])
        theirs = theirs[_ascending(second.values[theirs])]
        copies = _coincide(first, ours) and _coincide(second, theirs)
        pair = _conjugate(first.values[ours]) or _conjugate(second.values[theirs])
        certain &= (copies or pair) and _same_kind(first, ours) and _same_kind(second, theirs)
        if not first.values[ours].imag.any() and second.values[theirs].imag.all():
            ours = ours[np.argsort(modes[ours], kind="stable")]
        order[ours] = theirs
    return order, certain


def _separated(residual: Array, turn: Array, closest: Array, crossing: Array) -> NDArray[np.bool_]:
    """Return which poles cannot be exchanged, (n, n); chosen differences are on the diagonals.

    Poles closer than ``crossing`` cross; it is infinite for those that are equal at one of the gains.
    """
    own_residual, exchanged_residual = _swaps(residual)
    own_turn, exchanged_turn = _swaps(turn)
    nearer = (own_residual < SHORT * np.minimum(exchanged_residual, closest)) & (exchanged_turn >= SHORT * own_turn)
    # poles that pass each other at the distance e move along a hyperbola, which leaves its asymptotes by e^2 / turn
    passing = np.sqrt(own_residual * exchanged_turn)
    by_slope = (own_turn < SHORT * exchanged_turn) & (passing < crossing)
    by_slope &= np.isfinite(crossing) | (own_residual < SHORT * exchanged_residual)
    return np.asarray(nearer | by_slope)


def _closest(start: Complex, end: Complex, curvature: Complex) -> Array:
    """Return a lower bound (n, n) of the distances of poles along their paths; ``curvature`` is h (b' - a') of each.

    A path of constant second derivative deviates from the straight line by an eighth of that.
    """
    first, last, relative = (values[:, None] - values for values in (start, end, curvature))
    along = last - first
    length = np.abs(along) ** 2
    share = np.divide(-(first * along.conj()).real, length, out=np.zeros_like(length), where=length > 0.0)
    share = np.clip(share, 0.0, 1.0)
    return np.asarray(np.abs(first + share * along) - 0.125 * np.abs(relative))


def _swaps(difference: Array) -> tuple[Array, Array]:
    """Return the differences of two poles as they are, and exchanged, (n, n) each."""
    matched = np.diag(difference)
    return matched[:, None] + matched, difference + difference.T


def _ascending(values: Complex) -> Index:
    """Return the order of real plus imaginary part; of equals, the order in which they are."""
    return np.argsort(values.real + values.imag, kind="stable")


def _equal(spectrum: GainSpectrum, columns: Index) -> NDArray[np.bool_]:
    """Return which poles of some columns are equal but for rounding, (columns, columns)."""
    values, tolerance = spectrum.values[columns], spectrum.tolerance[columns]
    return np.asarray(np.abs(values[:, None] - values) <= np.maximum(tolerance[:, None], tolerance))


def _coincide(spectrum: GainSpectrum, columns: Index) -> bool:
    """Return whether poles are equal but for rounding."""
    values = spectrum.values[columns]
    return bool((np.abs(values - values[0]) <= spectrum.tolerance[columns].max()).all())


def _conjugate(values: Complex) -> bool:
    """Return whether the first half of poles in ascending order are the conjugates of the second half."""
    half = len(values) // 2
    return bool((values[:half].imag < 0.0).all() and (values[half:].imag > 0.0).all())


def _same_kind(spectrum: GainSpectrum, columns: Index) -> bool:
    """Return whether poles in ascending order are copies of one, or of two: a pair, or two real ones."""
    half, odd = divmod(len(columns), 2)
    return _coincide(spectrum, columns) or (
        not odd and _coincide(spectrum, columns[:half]) and _coincide(spectrum, columns[half:]))  # fmt: skip
