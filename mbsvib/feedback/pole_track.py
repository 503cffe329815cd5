"""Tracks of poles over a gain, one column each, and the gain that maximizes a measure of them."""

from __future__ import annotations

from bisect import bisect_right, insort
from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray

    from mbsvib.common.arrays import Array, Complex


HALVINGS = 6
# A step is short enough if every pole moves by less than this share of its distance to the nearest other one.
SHORT = 0.3
REAL = 0.05
ALIKE = 1e-7  # relative distance below which poles coincide
MOVED = 0.01  # share of its magnitude by which a pole must move to count as moved
# Rounding of repeated real poles: their relative imaginary parts; of integrators at rest: their relative magnitude.
OSCILLATES, AT_REST = 1e-6, 1e-9
GROWS = 1e-10  # a real part above this share of the largest pole is unstable
# Curves have a point for each change of a pole by this share of its magnitude, with a maximum number per step.
SMOOTH, MOST = 0.05, 24
# Poles are compared with no less than this share of the largest one: near zero every change is large.
LEAST = 1e-3
GOLDEN, SECTIONS = 0.5 * (3.0 - 5.0**0.5), 24  # golden ones: gains to 1e-5 of the steps between points


class Track:
    """Poles over gains, in columns that follow them.

    Parameters
    ----------
    at : callable
        Gain -> poles, in any order.
    gains : array, shape (n,)
        Ascending gains.
    """

    def __init__(self, at: Callable[[float], Complex], gains: Array) -> None:
        self._at = at
        rows = [at(float(gains[0]))]
        for low, high in pairwise(gains.tolist()):
            rows.append(followed(at, (low, rows[-1]), (high, at(high)), HALVINGS))
        self.poles: Complex = np.array(rows)
        self._poles = dict(zip(gains.tolist(), rows, strict=True))
        self._order = gains.tolist()

    def at(self, gain: float) -> Complex:
        """Return the poles at a gain between the first and the last one."""
        poles: Complex | None = self._poles.get(gain)
        if poles is None:
            low = self._order[bisect_right(self._order, gain) - 1]
            poles = self._poles[gain] = followed(self._at, (low, self._poles[low]), (gain, self._at(gain)), HALVINGS)
            insort(self._order, gain)
        return poles

    @property
    def curves(self) -> Complex:
        """Poles at all computed gains, in ascending order, (more, poles)."""
        return np.array([self._poles[gain] for gain in self._order])

    def refine(self) -> None:
        """Add gains where poles change much from one to the next."""
        largest = float(np.abs(self.poles[0]).max(initial=0.0)) or 1.0
        for low, high in pairwise(tuple(self._order)):
            one, other = self._poles[low], self._poles[high]
            size = np.maximum(np.maximum(np.abs(one), np.abs(other)), LEAST * largest)
            change = float((np.abs(other - one) / size).max(initial=0.0))
            for gain in np.linspace(low, high, min(int(np.ceil(change / SMOOTH)), MOST) + 1)[1:-1].tolist():
                self.at(gain)

    def highest(self, measure: Callable[[Complex], Array]) -> tuple[float, float, Complex]:
        """Return the gain at which a measure is highest, its value and the poles there, of stable loops only.

        Parameters
        ----------
        measure : callable
            Poles (n, poles) -> numbers (n,).

        Returns
        -------
        gain, value, poles
            The value is minus infinity if no loop is stable. Of gains that are as good, the lowest.
        """

        def height(poles: Complex) -> Array:
            return np.where(stable(poles), measure(poles), -np.inf)

        order = list(self._order)
        value = height(np.array([self._poles[gain] for gain in order]))
        best = int(value.argmax())
        if np.isneginf(value[best]):
            return order[0], -np.inf, self._poles[order[0]]
        top = order[best], float(value[best])
        low, high = order[max(best - 1, 0)], order[min(best + 1, len(order) - 1)]
        gains = [low + GOLDEN * (high - low), high - GOLDEN * (high - low)]
        heights = [float(height(self.at(gain)[None])[0]) for gain in gains]
        for _ in range(SECTIONS):
            left_is_higher = heights[0] >= heights[1]
            higher = 0 if left_is_higher else 1
            if heights[higher] > top[1] or (heights[higher] == top[1] and gains[higher] < top[0]):
                top = gains[higher], heights[higher]
            low, high = (low, gains[1]) if left_is_higher else (gains[0], high)
            trial = low + GOLDEN * (high - low) if left_is_higher else high - GOLDEN * (high - low)
            trial_height = float(height(self.at(trial)[None])[0])
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


def vibrates(poles: Complex) -> NDArray[np.bool_]:
    """Return whether poles (..., poles) oscillate; real poles and integrators with rounding errors do not."""
    size = np.abs(poles)
    largest = size.max(axis=-1, keepdims=True, initial=0.0)
    return np.asarray((np.abs(poles.imag) > OSCILLATES * size) & (size > AT_REST * largest))


def stable(poles: Complex) -> NDArray[np.bool_]:
    """Return whether all poles of (n, poles) are stable, (n,)."""
    largest = np.abs(poles).max(axis=1, keepdims=True)
    return np.asarray((poles.real <= GROWS * largest).all(axis=1))


def followed(
    at: Callable[[float], Complex], first: tuple[float, Complex], second: tuple[float, Complex], halvings: int
) -> Complex:
    """Return the poles at the other gain, in the order of those at the one."""
    from scipy.optimize import linear_sum_assignment

    (low, before), (high, after) = first, second
    distance = np.abs(before[:, None] - after)
    # squares keep the order of poles on the real axis, where sums of distances have many minima
    row, column = linear_sum_assignment(np.square(distance))
    step = distance[row, column]
    apart = np.abs(after[column][:, None] - after[column])
    size = np.maximum(np.abs(after[column]), AT_REST * np.abs(after).max(initial=0.0))
    apart[apart <= ALIKE * size[:, None]] = np.inf  # coinciding poles need not be distinguished
    # overdamped poles meet and separate on the real axis: there are no modes to follow
    waves = (np.abs(before[row].imag) > REAL * size) & (np.abs(after[column].imag) > REAL * size)
    if halvings and (waves & (step > SHORT * apart.min(axis=1, initial=np.inf))).any():
        middle = 0.5 * (low + high)
        between = followed(at, first, (middle, at(middle)), halvings - 1)
        return followed(at, (middle, between), second, halvings - 1)
    return np.asarray(after[column])
