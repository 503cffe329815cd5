"""Tracks of poles over a gain, one column each, and the gain that maximizes a measure of them."""

from __future__ import annotations

from bisect import bisect_right, insort
from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np

from mbsvib.feedback.gain_spectrum import OSCILLATES, GainSpectrum
from mbsvib.feedback.pole_matching import matched

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray

    from mbsvib.common.arrays import Array, Complex, Index

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
