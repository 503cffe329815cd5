"""Rows of bushings: one for each direction with stiffness or damping, or for each eigenvector of a 6x6 matrix."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from mbsvib.common.arguments import IDENTITY
from mbsvib.elements.bushing import matrix6, symmetric_part
from mbsvib.elements.element_rows import ElementRows
from mbsvib.elements.rows import Rows, columns, table
from mbsvib.linalg.products import eigenrows

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from mbsvib.common.arrays import Array, Index
    from mbsvib.elements.bushing import Bushing

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
        Rows of bushings with six values, then of bushings with matrices.
    """
    with_values: list[tuple[int, Bushing]] = []
    with_matrices: list[tuple[int, Bushing]] = []
    for item in parts:
        matrix = isinstance(item[1].stiffness[0], tuple) or isinstance(item[1].damping[0], tuple)
        (with_matrices if matrix else with_values).append(item)
    return ElementRows.join([*([_rows_of_values(with_values, number)] if with_values else []),
                             *([_rows_of_matrices(with_matrices, number)] if with_matrices else [])])  # fmt: skip


def _rows_of_values(parts: Numbered, number: Mapping[str, int]) -> ElementRows:
    k, c = table([part.stiffness for _, part in parts] + [part.damping for _, part in parts], 6).reshape(2, -1)
    used: Index = ((k != 0.0) | (c != 0.0)).nonzero()[0]
    which = used // 6
    return _in_world(parts, number, which, _SIX.take(used - 6 * which, axis=0), k.take(used), c.take(used))


def _rows_of_matrices(parts: Numbered, number: Mapping[str, int]) -> ElementRows:
    """One row for each eigenvector of K if C is proportional to it, else rows of K and rows of C.

    Both are the symmetric parts; ``cross_coupling`` of a bushing is the rest.
    """
    which, units, k, c = [], [np.zeros((0, 6))], [np.zeros(0)], [np.zeros(0)]
    for i, (_, part) in enumerate(parts):
        stiffness, damping = (symmetric_part(matrix6(value)) for value in (part.stiffness, part.damping))
        values, vectors = _eigenrows(stiffness if stiffness.any() else damping)
        ratio = _proportion(damping, stiffness)
        if ratio is not None:
            which += [i] * len(values)
            units.append(vectors)
            k.append(values)
            c.append(ratio * values)
        else:
            elastic = len(values) if stiffness.any() else 0
            damping_values, damping_vectors = _eigenrows(damping)
            which += [i] * (elastic + len(damping_values))
            units += [vectors[:elastic], damping_vectors]
            k += [values[:elastic], np.zeros_like(damping_values)]
            c += [np.zeros(elastic), damping_values]
    return _in_world(parts, number, np.array(which, dtype=np.intp), np.concatenate(units), np.concatenate(k),
                     np.concatenate(c))  # fmt: skip


def _in_world(parts: Numbered, number: Mapping[str, int], which: Index, unit: Array, k: Array, c: Array) -> ElementRows:
    """Rows in world axes along directions ``unit`` (n, 6) in the axes of the bushings ``which`` (n,)."""
    ends = columns([(number[b.first], number[b.second], i, *b.position) for i, b in parts], 6).take(which, axis=1)
    first, second, owner = ends[:3].astype(np.intp)
    both = np.ascontiguousarray(unit.T).reshape(2, 3, -1)
    if any(part.orientation is not IDENTITY for _, part in parts):
        axes = columns([x + y + z for x, y, z in [part.orientation for _, part in parts]], 9).take(which, axis=1)
        both = np.einsum("abn,cbn->can", axes.reshape(3, 3, -1), both)
    force, moment = both
    return ElementRows(Rows(first, second, ends[3:], force, moment), k, c, owner, unit)


def _proportion(damping: Array, stiffness: Array) -> float | None:
    """The ratio C / K of two proportional matrices, None where they are not proportional to rounding."""
    if not damping.any():
        return 0.0
    if not stiffness.any():
        return None
    largest = np.unravel_index(np.argmax(np.abs(stiffness)), stiffness.shape)
    ratio = float(damping[largest] / stiffness[largest])
    return ratio if np.allclose(damping, ratio * stiffness, rtol=1e-15, atol=0.0) else None


def _eigenrows(matrix: Array) -> tuple[Array, Array]:
    """Nonzero eigenvalues and their rows."""
    values, vectors = eigenrows(matrix)
    nonzero = values != 0.0
    return values[nonzero], vectors[nonzero]
