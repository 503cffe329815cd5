"""Mode tracking by shapes from station to station, so that each mode keeps its number where frequencies cross.

Two shapes are compared by the modal assurance criterion, MAC = |a^H b|^2 / (a^H a b^H b), of vectors that carry their
weights: with a = W phi, W^T W = M, it is weighted by the mass matrix.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from mbsvib.common.arrays import AnyArray, Array, Bools, Complex, Index
from mbsvib.linalg.groups import linked_items
from mbsvib.linalg.rank import EPS

# Modes of neighbouring stations are matched if their MAC is at least this; otherwise the interval is halved, at most so
# many times. Modes of rotors that exchange their shapes over a wide interval may have 0.8 with the wrong ones.
ALIKE = 0.95
HALVINGS = 8
# Eigenvalues that differ by less than this share of their own size, or by a rounding of the largest, coincide.
REPEATED = 1e-9
# Modes whose frequencies differ by less than this share: changes as small turn their shapes within the plane of both.
NEXT = 1e-3


@dataclass(frozen=True, slots=True)
class Station:
    """Modes at one value ``at`` of a parameter: eigenvalues ``values`` (modes,), weighted shapes (rows, modes)."""

    at: float
    values: Complex
    vectors: AnyArray


@dataclass(frozen=True, slots=True)
class Reference:
    """The last known shapes of tracks, ``vectors`` (rows, tracks); ``sure`` (tracks,) tells those that are unique."""

    vectors: AnyArray
    sure: Bools


def upper(pairs: Complex) -> Complex:
    """Return one eigenvalue for each mode: the one with positive imaginary part, or the larger of two real ones.

    ``pairs`` (..., modes, 2): pairs of eigenvalues. Returns (..., modes): eigenvalues without negative imaginary parts.
    """
    first, second = pairs[..., 0], pairs[..., 1]
    nearer = np.where(second.real > first.real, second, first)
    return np.asarray(np.where(first.imag == 0.0, nearer, first.real + 1j * np.abs(first.imag)))


def clusters(values: Complex) -> Bools:
    """Tell which eigenvalues coincide, shape (modes, modes)."""
    size = np.abs(values)
    near = np.maximum(REPEATED * np.maximum(size[:, None], size), EPS * size.max(initial=0.0))
    return np.asarray(np.abs(values[:, None] - values) <= near)


def is_simple(values: Complex) -> Bools:
    """Tell which eigenvalues are simple: the modes of repeated ones have no unique shapes."""
    return np.asarray(clusters(values).sum(axis=1) == 1)


def mac(first: AnyArray, second: AnyArray) -> Array:
    """Return the modal assurance criterion of weighted shapes (rows, modes) with others, 1 for equal ones, 0 for zeros.
    """
    return np.asarray(np.abs(_unit(first).conj().T @ _unit(second)) ** 2)


def subspace_mac(shapes: AnyArray, frequencies: Array, others: AnyArray) -> Array:
    """Return the share (modes, others) of other shapes in the span of a mode and those next to it in frequency.

    It is the modal assurance criterion of a mode that stands alone. ``shapes`` (rows, modes), ``frequencies`` (modes,).
    """
    result = mac(shapes, others)
    for group in linked_items(np.abs(frequencies[:, None] - frequencies) <= NEXT * frequencies):
        basis, sizes, _ = np.linalg.svd(shapes[:, group], full_matrices=False)
        result[group] = mac(basis[:, sizes > EPS * sizes.max(initial=0.0)], others).sum(axis=0)
    return result


def reference(station: Station) -> Reference:
    """Return the modes of a station as the first reference of tracks."""
    return Reference(station.vectors, is_simple(station.values))


def match_next(
    before: Reference, at: float, after: Station, between: Callable[[float], Station] | None, halvings: int = HALVINGS
) -> tuple[Index, Reference]:
    """Return the number of each track's mode at the next station, and the reference for the one after it.

    ``between``: returns stations in between, for intervals in which shapes change much; they are halved ``halvings``
    times.
    """
    from scipy.optimize import linear_sum_assignment

    # a repeated eigenvalue has a space of shapes: a track is compared with its projection
    same = clusters(after.values)
    bases = {tuple(np.flatnonzero(row)): None for row in same if row.sum() > 1}
    alike = mac(before.vectors, after.vectors)
    spaces = {members: np.linalg.qr(_unit(after.vectors[:, list(members)]))[0] for members in bases}
    unit = _unit(before.vectors)
    for members, basis in spaces.items():
        alike[:, list(members)] = (np.abs(basis.conj().T @ unit) ** 2).sum(axis=0)[:, None]
    track, number = linear_sum_assignment(-alike)
    comparable = before.sure[track] & (np.linalg.norm(before.vectors, axis=0) > 0.0)
    if halvings and between is not None and not (alike[track, number][comparable] >= ALIKE).all():
        middle = 0.5 * (at + after.at)
        _, near = match_next(before, at, between(middle), between, halvings - 1)
        return match_next(near, middle, after, between, halvings - 1)
    vectors = after.vectors[:, number].astype(np.result_type(before.vectors, after.vectors))
    sure = before.sure | is_simple(after.values)[number]
    for members, basis in spaces.items():
        for t in np.flatnonzero(np.isin(number, members) & before.sure):
            vectors[:, t] = basis @ (basis.conj().T @ before.vectors[:, t])
    return np.asarray(number), Reference(vectors, sure)


def track_modes(stations: Sequence[Station], between: Callable[[float], Station] | None = None) -> list[Index]:
    """Return, for each station, the numbers (modes,) of the modes that the tracks of all modes of the first have there.

    ``between``: returns the station at a value between two.
    """
    order = [np.arange(len(stations[0].values))]
    tracks = reference(stations[0])
    for last, current in pairwise(stations):
        number, tracks = match_next(tracks, last.at, current, between)
        order.append(number)
    return order


def _unit(vectors: AnyArray) -> AnyArray:
    sizes = np.linalg.norm(vectors, axis=0)
    return np.asarray(vectors / np.where(sizes > 0.0, sizes, 1.0))
