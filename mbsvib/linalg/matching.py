"""Modes followed from station to station by their shapes, so that each keeps its number through crossings.

Two shapes are compared by the modal assurance criterion, MAC = |a^H b|^2 / (a^H a b^H b), of vectors that carry their
weights: with a = W phi, W^T W = M, it is weighted by the mass matrix.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise
from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from numpy.typing import NDArray

    from mbsvib.common.arrays import Array, Complex, Index

    Mask = NDArray[np.bool_]

# Modes of neighbouring stations belong together if their shapes are at least so much alike (1: the same); elsewhere the
# way is halved, so many times at most.
ALIKE = 0.7
HALVINGS = 6
# Eigenvalues this near to each other, in parts of the largest, are one.
REPEATED = 1e-9


@dataclass(frozen=True, slots=True)
class Station:
    """Modes at a point ``at`` of a way: eigenvalues ``values`` (modes,), weighted shapes ``vectors`` (rows, modes)."""

    at: float
    values: Complex
    vectors: NDArray[Any]


@dataclass(frozen=True, slots=True)
class Reference:
    """What tracks looked like when last seen, ``vectors`` (rows, tracks); ``sure`` have a shape of their own."""

    vectors: NDArray[Any]
    sure: Mask


def upper(pairs: Complex) -> Complex:
    """Return one eigenvalue a mode: that which oscillates, of two real ones the one nearer to instability.

    Parameters
    ----------
    pairs : array, shape (..., modes, 2)
        Pairs of eigenvalues.

    Returns
    -------
    array, shape (..., modes)
        Eigenvalues without negative imaginary parts.
    """
    first, second = pairs[..., 0], pairs[..., 1]
    nearer = np.where(second.real > first.real, second, first)
    return np.asarray(np.where(first.imag == 0.0, nearer, first.real + 1j * np.abs(first.imag)))


def clusters(values: Complex) -> Mask:
    """Tell which eigenvalues coincide, shape (modes, modes)."""
    return np.asarray(np.abs(values[:, None] - values) <= REPEATED * np.abs(values).max(initial=0.0))


def alone(values: Complex) -> Mask:
    """Tell which eigenvalues are not repeated: modes of repeated ones have no shapes of their own."""
    return np.asarray(clusters(values).sum(axis=1) == 1)


def mac(one: NDArray[Any], other: NDArray[Any]) -> Array:
    """Return how much shapes are alike, 1 if the same.

    Parameters
    ----------
    one, other : array, shape (rows, modes)
        Weighted shapes.

    Returns
    -------
    array, shape (modes of one, modes of the other)
        Modal assurance criterion; 0 for a vector that is zero.
    """
    return np.asarray(np.abs(_unit(one).conj().T @ _unit(other)) ** 2)


def reference(station: Station) -> Reference:
    """Return the modes of a station as what others are compared with."""
    return Reference(station.vectors, alone(station.values))


def step(
    before: Reference, at: float, after: Station, between: Callable[[float], Station] | None, halvings: int = HALVINGS
) -> tuple[Index, Reference]:
    """Follow tracks to the next station, over more stations in between where shapes change much.

    Parameters
    ----------
    before : Reference
        The tracks so far.
    at : float
        Where they were seen.
    after : Station
        The next station.
    between : callable, optional
        Returns the station at a point in between; default: there is none to be had.
    halvings : int
        How often the way may be halved.

    Returns
    -------
    tuple
        The number of each track's mode at the station, and the tracks as seen from there.
    """
    from scipy.optimize import linear_sum_assignment

    # a repeated eigenvalue has a space of shapes: a track belongs to it by its projection
    same = clusters(after.values)
    bases = {tuple(np.flatnonzero(row)): None for row in same if row.sum() > 1}
    alike = mac(before.vectors, after.vectors)
    spaces = {members: np.linalg.qr(_unit(after.vectors[:, list(members)]))[0] for members in bases}
    unit = _unit(before.vectors)
    for members, basis in spaces.items():
        alike[:, list(members)] = (np.abs(basis.conj().T @ unit) ** 2).sum(axis=0)[:, None]
    track, number = linear_sum_assignment(-alike)
    told = before.sure[track] & (np.linalg.norm(before.vectors, axis=0) > 0.0)
    if halvings and between is not None and not (alike[track, number][told] >= ALIKE).all():
        middle = 0.5 * (at + after.at)
        _, near = step(before, at, between(middle), between, halvings - 1)
        return step(near, middle, after, between, halvings - 1)
    vectors = after.vectors[:, number].astype(np.result_type(before.vectors, after.vectors))
    sure = before.sure | alone(after.values)[number]
    for members, basis in spaces.items():
        for t in np.flatnonzero(np.isin(number, members) & before.sure):
            vectors[:, t] = basis @ (basis.conj().T @ before.vectors[:, t])
    return np.asarray(number), Reference(vectors, sure)


def follow(stations: Sequence[Station], between: Callable[[float], Station] | None = None) -> list[Index]:
    """Follow all modes of the first station.

    Parameters
    ----------
    stations : sequence of Station
        The stations in their order.
    between : callable, optional
        Returns the station at a point between two.

    Returns
    -------
    list of array, shape (modes,)
        For each station the numbers of the modes that the tracks have there.
    """
    order = [np.arange(len(stations[0].values))]
    seen = reference(stations[0])
    for last, here in pairwise(stations):
        number, seen = step(seen, last.at, here, between)
        order.append(number)
    return order


def _unit(vectors: NDArray[Any]) -> NDArray[Any]:
    sizes = np.linalg.norm(vectors, axis=0)
    return np.asarray(vectors / np.where(sizes > 0.0, sizes, 1.0))
