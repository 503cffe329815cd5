"""Tracks of poles over a gain, one column each, and the gain that maximizes a measure of them.

Two poles belong together if the trapezoidal rule takes the one to the other, and if their derivatives agree:

    r_ij = |b_j - a_i - h (a_i' + b_j') / 2|,    d_ij = h |b_j' - a_i'|

The first term is of third order in the step h, the second of second order. Poles that cross differ by the second term,
nearly equal poles that move together by the first. Where a pair of poles meets on the real axis and goes on as two real
poles, there is no derivative and no continuation: by convention, the pole with the positive imaginary part becomes the
right one. Where two real poles go on as a pair, the one of a mode, or else the right one, takes the positive imaginary
part. So modes end in zeros, and the choice depends on the poles alone, not on the steps.
"""

from __future__ import annotations

from bisect import bisect_right, insort
from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from mbsvib.common.arrays import Array, Complex, Index
from mbsvib.linalg.groups import linked_items
from mbsvib.linalg.spectrum import spectrum

ALIKE = 1e-7  # relative distance below which poles coincide
OSCILLATES = 1e-6  # relative imaginary parts that rounding gives to repeated real poles
SEPARATE = 1e-12  # reciprocal condition of the products of left and right vectors below which poles are defective
DEFECTIVE = 1e2  # distances and errors of coinciding poles by which A in their subspace may differ from a multiple of 1


@dataclass(frozen=True)
class GainSpectrum:
    """Eigenvalues ``poles`` (n,) of the state ``matrix`` (n, n) at a ``gain``, in ascending order of magnitude."""

    gain: float
    matrix: Array

    @property
    def poles(self) -> Complex:
        """Eigenvalues [1/s], (n,), 0 where they differ from it by rounding; those with positive imaginary part come
        before their conjugates.
        """
        return self._decomposition[0]

    @cached_property
    def values(self) -> Complex:
        """Eigenvalues, exactly real where they differ from that by rounding."""
        poles = self.poles.copy()
        poles.imag[np.abs(poles.imag) <= OSCILLATES * np.abs(poles)] = 0.0
        return poles

    @property
    def errors(self) -> Array:
        """Bounds of the rounding of the eigenvalues [1/s], (n,)."""
        return self._decomposition[1]

    @cached_property
    def tolerance(self) -> Array:
        """Distance from each eigenvalue below which another one coincides with it [1/s], (n,)."""
        return np.maximum(ALIKE * np.abs(self.values), self.errors)

    def slopes(self, change: Array) -> Complex:
        """Return the derivatives (n,) of ``values``; zero where an eigenvalue is defective and has none.

        For a simple eigenvalue lambda' = y^H A' x / (y^H x); for one of multiplicity m, the m eigenvalues of
        (Y^H X)^-1 Y^H A' X with its left and right vectors Y and X, in ascending order of real plus imaginary part.

        ``change`` (n, n): derivative A' of the state matrix.

        Source: Lancaster, P. (1964), On eigenvalues of matrices dependent on a parameter, Numer. Math. 6, theorem 7.
        """
        _, _, left, right, scale = self._decomposition
        rows = left.conj().T
        moved = (change / scale[:, None] * scale) @ right
        overlap = np.einsum("ij,ji->i", rows, right)
        regular = np.abs(overlap) > SEPARATE
        result = np.einsum("ij,ji->i", rows, moved) / np.where(regular, overlap, np.inf)
        of_a, of_change = (matrix / scale[:, None] * scale for matrix in (self.matrix, change))
        for clusters in self._clusters:
            y, x = (np.linalg.qr(vectors.T[clusters].swapaxes(1, 2))[0] for vectors in (left, right))
            y = y.conj().swapaxes(1, 2)
            overlaps, rates = y @ x, y @ of_change @ x
            sizes = np.linalg.svd(overlaps, compute_uv=False)
            regular = sizes[:, -1] > SEPARATE * sizes[:, 0]
            overlaps[~regular] = np.eye(clusters.shape[1])
            within = np.linalg.solve(overlaps, y @ of_a @ x)  # a multiple of 1 where each eigenvalue has a vector
            values = self.values[clusters]
            within -= values.mean(axis=1)[:, None, None] * np.eye(clusters.shape[1])
            spread = np.abs(values - values[:, :1]).max(axis=1) + self.errors[clusters].max(axis=1)
            regular &= np.abs(within).max(axis=(1, 2)) <= DEFECTIVE * spread
            rates[~regular] = 0.0
            slopes = np.linalg.eigvals(np.linalg.solve(overlaps, rates))
            in_order = np.argsort(slopes.real + slopes.imag, axis=-1, kind="stable")
            result[clusters] = np.take_along_axis(slopes, in_order, axis=-1)
        return np.asarray(result)

    @cached_property
    def _clusters(self) -> list[Index]:
        """Columns (clusters, multiplicity) of repeated eigenvalues, one array for each multiplicity."""
        values = self.values
        groups = linked_items(np.abs(values[:, None] - values) <= np.minimum(self.tolerance[:, None], self.tolerance))
        sizes = sorted({len(group) for group in groups})
        return [np.array([group for group in groups if len(group) == size]) for size in sizes]

    @cached_property
    def _decomposition(self) -> tuple[Complex, Array, Complex, Complex, Array]:
        """Eigenvalues, errors, left and right vectors (n, n) as columns, in states of the units ``scale`` (n,)."""
        of_a = spectrum(self.matrix)
        order = np.lexsort((-of_a.values.imag, np.abs(of_a.values)))
        values = np.where(of_a.at_zero, 0.0, of_a.values)[order]
        return (values, of_a.errors[order], of_a.left[:, order].astype(complex),
                of_a.right[:, order].astype(complex), np.ldexp(1.0, of_a.power))  # fmt: skip


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


# A step in which poles are not matched with certainty is halved so often, until poles meet but for rounding; in total,
# so many steps are tried between two gains.
HALVINGS, TRIALS = 40, 400
MOVED = 0.01  # share of its magnitude by which a pole must move to count as moved
# Curves have a point for each change of a pole by this share of its magnitude, with a maximum number per step
SMOOTH, MOST = 0.05, 24
ROUNDS = 4  # of adding points, which resolve square roots where poles meet
# Poles are compared with no less than this share of the largest one: near zero every change is large.
LEAST = 1e-3
GOLDEN, SECTIONS = 0.5 * (3.0 - 5.0**0.5), 24  # golden ones: gains to 1e-5 of the steps between points


class Track:
    """Poles over gains, in columns that follow them.

    ``at``: gain -> state matrix (poles, poles), with the same states at all gains. ``gains`` (n,): ascending.
    """

    def __init__(self, at: Callable[[float], Array], gains: Array) -> None:
        self._at = at
        first = GainSpectrum(float(gains[0]), at(float(gains[0])))
        self._spectra, self._columns = {first.gain: first}, {first.gain: np.arange(len(first.poles))}
        self._order = [first.gain]
        self._modes = first.values.imag > 0.0
        self.poles: Complex = np.array([self.at(gain) for gain in gains.tolist()])

    def at(self, gain: float) -> Complex:
        """Return the poles at a gain that is not below the first one."""
        if gain not in self._spectra:
            low = self._order[bisect_right(self._order, gain) - 1]
            spectrum = GainSpectrum(gain, self._at(gain))
            columns = self._columns[low]
            self._columns[gain] = self._followed(self._spectra[low], spectrum, columns)
            self._spectra[gain] = spectrum
            insort(self._order, gain)
        return self._spectra[gain].poles[self._columns[gain]]

    def _followed(self, first: GainSpectrum, last: GainSpectrum, columns: Index) -> Index:
        """Return which poles of the last gain continue columns of the first."""
        trials = 0
        least = (last.gain - first.gain) * 0.5**HALVINGS
        reached, ahead = first, [last]
        while ahead:
            modes = np.empty_like(self._modes)
            modes[columns] = self._modes
            order, certain = matched(reached, ahead[-1], modes)
            trials += 1
            middle = 0.5 * (reached.gain + ahead[-1].gain)
            if certain or trials > TRIALS or ahead[-1].gain - reached.gain <= least or not (
                reached.gain < middle < ahead[-1].gain):  # fmt: skip
                reached, columns = ahead.pop(), order[columns]
            else:
                ahead.append(GainSpectrum(middle, self._at(middle)))
        return columns

    def stable(self, gain: float) -> bool:
        """Return whether the loop is stable at a gain."""
        return stable(self.at(gain), self.errors(gain))

    def errors(self, gain: float) -> Array:
        """Return bounds of the rounding of the poles at a gain."""
        self.at(gain)
        return np.asarray(self._spectra[gain].errors[self._columns[gain]])

    @property
    def curves(self) -> Complex:
        """Poles at all computed gains, in ascending order, (more, poles)."""
        return np.array([self.at(gain) for gain in self._order])

    def refine(self) -> None:
        """Add gains where poles change much from one to the next."""
        largest = float(np.abs(self.poles[0]).max(initial=0.0)) or 1.0
        for _ in range(ROUNDS):
            for low, high in pairwise(tuple(self._order)):
                first, second = self.at(low), self.at(high)
                size = np.maximum(np.maximum(np.abs(first), np.abs(second)), LEAST * largest)
                change = float((np.abs(second - first) / size).max(initial=0.0))
                for gain in np.linspace(low, high, min(int(np.ceil(change / SMOOTH)), MOST) + 1)[1:-1].tolist():
                    self.at(gain)

    def highest(self, measure: Callable[[Complex], Array]) -> tuple[float, float, Complex]:
        """Return the gain at which a measure is highest, its value and the poles there, of stable loops only.

        ``measure``: poles (n, poles) -> numbers (n,). The value is minus infinity if no loop is stable. Of equally good
        gains, the lowest is returned.
        """

        def height(gain: float) -> float:
            return float(measure(self.at(gain)[None])[0]) if self.stable(gain) else -np.inf

        order = list(self._order)
        value = np.array([height(gain) for gain in order])
        best = int(value.argmax())
        if np.isneginf(value[best]):
            return order[0], -np.inf, self.at(order[0])
        top = order[best], float(value[best])
        low, high = order[max(best - 1, 0)], order[min(best + 1, len(order) - 1)]
        gains = [low + GOLDEN * (high - low), high - GOLDEN * (high - low)]
        heights = [height(gain) for gain in gains]
        for _ in range(SECTIONS):
            left_is_higher = heights[0] >= heights[1]
            higher = 0 if left_is_higher else 1
            if heights[higher] > top[1] or (heights[higher] == top[1] and gains[higher] < top[0]):
                top = gains[higher], heights[higher]
            low, high = (low, gains[1]) if left_is_higher else (gains[0], high)
            trial = low + GOLDEN * (high - low) if left_is_higher else high - GOLDEN * (high - low)
            trial_height = height(trial)
            gains, heights = ([trial, gains[0]], [trial_height, heights[0]]) if left_is_higher else (
                [gains[1], trial], [heights[1], trial_height])  # fmt: skip
        return *top, self.at(top[0])


def ratios(poles: Complex) -> Array:
    """Return damping ratios; 0 where a pole is."""
    size = np.abs(poles)
    return np.divide(0.0 - poles.real, size, out=np.zeros_like(size), where=size > 0.0)


def has_moved(poles: Complex) -> NDArray[np.bool_]:
    """Return whether each column of poles (n, poles) leaves its first place by more than a hundredth of its size."""
    return np.asarray(np.abs(poles - poles[0]).max(axis=0) > MOVED * np.abs(poles[0]))


def least_damping(poles: Complex, columns: NDArray[np.bool_]) -> Array:
    """Return the least damping ratio of some columns of poles (n, poles) that vibrate, (n,); 1 where none does."""
    return np.asarray(np.where(columns & vibrates(poles), ratios(poles), 1.0).min(axis=1, initial=1.0))


def vibrates(poles: Complex, errors: Array | float = 0.0) -> NDArray[np.bool_]:
    """Return whether poles (..., poles) oscillate; real poles, and those that ``errors`` of rounding keep from 0, do
    not.
    """
    size = np.abs(poles)
    return np.asarray((np.abs(poles.imag) > OSCILLATES * size) & (size > errors))


def stable(poles: Complex, errors: Array) -> bool:
    """Return whether poles (poles,) are stable: none is further right of the imaginary axis than its error."""
    return bool((poles.real <= errors).all())
