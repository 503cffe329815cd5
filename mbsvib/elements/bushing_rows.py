"""Rows of bushings: one for each of six directions, or for each eigenvector of a matrix."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from mbsvib.common.arguments import IDENTITY
from mbsvib.elements.element_rows import ElementRows
from mbsvib.elements.rows import Rows, columns, table
from mbsvib.linalg.products import eigenrows

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from mbsvib.common.arrays import Array, Index
    from mbsvib.elements.bushing import Bushing, Matrix6, Six

    Numbered = Sequence[tuple[int, Bushing]]

_SIX = np.eye(6)


def rows(parts: Numbered, number: Mapping[str, int]) -> ElementRows:
    """Return the rows of bushings.

    Parameters
    ----------
    parts : sequence of (int, Bushing)
        The bushings and their numbers among the model's connections.
    number : mapping
        Number of each body, ground included.

    Returns
    -------
    ElementRows
        Rows of those with six values, then of those with matrices.
    """
    six: list[tuple[int, Bushing]] = []
    full: list[tuple[int, Bushing]] = []
    for item in parts:
        matrix = isinstance(item[1].stiffness[0], tuple) or isinstance(item[1].damping[0], tuple)
        (full if matrix else six).append(item)
    return ElementRows.join([
        *([_of_values(six, number)] if six else []), *([_of_matrices(full, number)] if full else []),
    ])  # fmt: skip


def _of_values(parts: Numbered, number: Mapping[str, int]) -> ElementRows:
    k = table([part.stiffness for _, part in parts], 6).reshape(-1)
    c = table([part.damping for _, part in parts], 6).reshape(-1)
    used: Index = ((k != 0.0) | (c != 0.0)).nonzero()[0]
    which = used // 6
    unit = _SIX.take(used - 6 * which, axis=1).T
    return _in_world(parts, number, which, unit, k.take(used), c.take(used))


def _of_matrices(parts: Numbered, number: Mapping[str, int]) -> ElementRows:
    which, units, k, c = [], [np.zeros((0, 6))], [np.zeros(0)], [np.zeros(0)]
    for i, (_, part) in enumerate(parts):
        stiffness, damping = _matrix(part.stiffness), _matrix(part.damping)
        values, vectors = _eigenrows(stiffness if stiffness.any() else damping)
        share = _proportion(damping, stiffness)
        if share is not None:
            which += [i] * len(values)
            units.append(vectors)
            k.append(values)
            c.append(share * values)
        else:
            damping_values, damping_vectors = _eigenrows(damping)
            own = (values, np.zeros_like(damping_values)) if stiffness.any() else (0.0 * values[:0], damping_values * 0)
            which += [i] * (len(own[0]) + len(damping_values))
            units += [vectors[: len(own[0])], damping_vectors]
            k += [own[0], own[1]]
            c += [np.zeros_like(own[0]), damping_values]
    return _in_world(parts, number, np.array(which, dtype=np.intp), np.concatenate(units), np.concatenate(k),
                     np.concatenate(c))  # fmt: skip


def _in_world(parts: Numbered, number: Mapping[str, int], which: Index, unit: Array, k: Array, c: Array) -> ElementRows:
    """Return directions ``unit`` (n, 6) in the axes of the bushings ``which`` (n,) as rows in world axes."""
    ends = columns([(number[b.first], number[b.second], i, *b.position) for i, b in parts], 6).take(which, axis=1)
    first, second, owner = ends[:3].astype(np.intp)
    both = np.ascontiguousarray(unit.T).reshape(2, 3, -1)
    if any(part.orientation is not IDENTITY for _, part in parts):
        axes = columns([x + y + z for x, y, z in [part.orientation for _, part in parts]], 9).take(which, axis=1)
        both = (axes.reshape(3, 3, -1) * both[:, None]).sum(axis=2)
    force, moment = both
    return ElementRows(Rows(first, second, ends[3:], force, moment), k, c, owner, unit)


def _matrix(value: Six | Matrix6) -> Array:
    array = np.array(value, dtype=float)
    return np.diag(array) if array.ndim == 1 else array


def _proportion(damping: Array, stiffness: Array) -> float | None:
    """Return the factor by which damping is stiffness (exactly, to rounding), or None."""
    if not damping.any():
        return 0.0
    if not stiffness.any():
        return None
    largest = np.unravel_index(np.argmax(np.abs(stiffness)), stiffness.shape)
    share = float(damping[largest] / stiffness[largest])
    return share if np.allclose(damping, share * stiffness, rtol=1e-15, atol=0.0) else None


def _eigenrows(matrix: Array) -> tuple[Array, Array]:
    values, vectors = eigenrows(matrix)
    keep = values != 0.0
    return values[keep], vectors[keep]
