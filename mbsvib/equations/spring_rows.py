"""Spring-dampers as rows: each elastic direction is one relative displacement with a stiffness and a damping.

K = D^T diag(k) D and C = D^T diag(c) D share the rows D; a direction without stiffness or without damping has a zero
there, one without both is left out. Rows of inerters add D^T diag(b) D to M.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from mbsvib.common.arguments import IDENTITY
from mbsvib.elements import Bushing, Spring
from mbsvib.elements.families import FAMILIES
from mbsvib.elements.inerter import Inerter
from mbsvib.elements.rows import Rows, columns, table
from mbsvib.linalg.products import eigenrows

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping

    from mbsvib.common.arrays import Array, Index
    from mbsvib.elements.connection import Connection

_ROWS = {family.part: family.rows for family in FAMILIES if family.rows is not None}
_SIX = np.eye(6)


@dataclass(frozen=True, slots=True)
class Elements:
    """Elastic and damping rows: ``rows``, ``stiffness`` and ``damping`` (..., n), the number of the ``owner`` (n,)
    among the model's spring-dampers, and the direction ``unit`` (..., n, 6) in the owner's axes. ``inertance`` (n,) is
    None where no inerter is among them.
    """

    rows: Rows
    stiffness: Array
    damping: Array
    owner: Index
    unit: Array
    inertance: Array | None = None

    def only(self, kept: Index) -> Elements:
        """Return the rows of some numbers, in ascending order."""
        if len(kept) == len(self.owner):
            return self
        rows = self.rows
        return Elements(
            Rows(rows.first.take(kept), rows.second.take(kept), rows.point.take(kept, axis=-1),
                 rows.force.take(kept, axis=-1), rows.moment.take(kept, axis=-1)),
            self.stiffness.take(kept, axis=-1), self.damping.take(kept, axis=-1), self.owner.take(kept),
            self.unit.take(kept, axis=-2), None if self.inertance is None else self.inertance.take(kept),
        )  # fmt: skip

    @property
    def weights(self) -> tuple[tuple[int, Array], ...]:
        """Stiffness, damping and inertance, by the derivative of the displacement that each of them multiplies."""
        return tuple([(order, value) for order, value in enumerate((self.stiffness, self.damping, self.inertance))
                      if value is not None])  # fmt: skip


def stack(springs: Iterable[Connection], number: Mapping[str, int]) -> Elements:
    """Return the rows of all spring-dampers.

    Parameters
    ----------
    springs : iterable of Connection
        The model's spring-dampers, all of them plain.
    number : mapping
        Number of each body, ground included.

    Returns
    -------
    Elements
        Rows of the bushings, then of the line springs; ``owner`` counts in the order of ``springs``.
    """
    lines: list[tuple[int, Spring]] = []
    bushings: list[tuple[int, Bushing]] = []
    full: list[tuple[int, Bushing]] = []
    others: dict[type, list[tuple[int, Any]]] = {}
    for i, part in enumerate(springs):
        if isinstance(part, Spring):
            lines.append((i, part))
        elif not isinstance(part, Bushing):
            others.setdefault(type(part), []).append((i, part))
        elif isinstance(part.stiffness[0], tuple) or isinstance(part.damping[0], tuple):
            full.append((i, part))
        else:
            bushings.append((i, part))
    families = [_of_bushings(bushings, number)] if bushings else []
    if full:
        families.append(_of_matrices(full, number))
    families += [Elements(*_ROWS[kind](parts, number)) for kind, parts in others.items()]
    if lines or not families:
        families.append(_of_lines(lines, number))
    if len(families) == 1:
        return families[0]
    inertance = None
    if Inerter in others:
        inertance = np.concatenate([
            np.zeros(len(family.owner)) if family.inertance is None else family.inertance for family in families
        ])  # fmt: skip
    stiffness, damping, owner, unit = (np.concatenate([getattr(family, key) for family in families])
                                       for key in ("stiffness", "damping", "owner", "unit"))  # fmt: skip
    return Elements(Rows.join([family.rows for family in families]), stiffness, damping, owner, unit, inertance)


def _of_lines(lines: list[tuple[int, Spring]], number: Mapping[str, int]) -> Elements:
    line = columns(
        [(number[s.first], number[s.second], i, *s.start, *s.line, 0.0, 0.0, 0.0, s.stiffness, s.damping)
         for i, s in lines], 14,
    )  # fmt: skip
    first, second, owner = line[:3].astype(np.intp)
    unit = np.zeros((len(lines), 6))
    unit[:, 2] = 1.0
    return Elements(Rows(first, second, line[3:6], line[6:9], line[9:12]), line[12], line[13], owner, unit)


def _of_bushings(bushings: list[tuple[int, Bushing]], number: Mapping[str, int]) -> Elements:
    k = table([b.stiffness for _, b in bushings], 6).reshape(-1)
    c = table([b.damping for _, b in bushings], 6).reshape(-1)
    used: Index = ((k != 0.0) | (c != 0.0)).nonzero()[0]
    which = used // 6
    unit = _SIX.take(used - 6 * which, axis=1).T
    return _rows([b for _, b in bushings], number, which, unit, k.take(used), c.take(used),
                 np.array([i for i, _ in bushings], dtype=np.intp))  # fmt: skip


def _of_matrices(full: list[tuple[int, Bushing]], number: Mapping[str, int]) -> Elements:
    which, units, k, c = [], [], [], []
    for i, (_, bushing) in enumerate(full):
        stiffness, damping = _matrix(bushing.stiffness), _matrix(bushing.damping)
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
    empty = np.zeros(0)
    return _rows(
        [b for _, b in full], number, np.array(which, dtype=np.intp), np.concatenate([np.zeros((0, 6)), *units]),
        np.concatenate([empty, *k]), np.concatenate([empty, *c]), np.array([i for i, _ in full], dtype=np.intp),
    )  # fmt: skip


def _rows(
    bushings: list[Bushing], number: Mapping[str, int], which: Index, unit: Array, k: Array, c: Array, owner: Index
) -> Elements:
    """Turn directions in the bushings' axes into world rows."""
    place = columns([(number[b.first], number[b.second], *b.position) for b in bushings], 5).take(which, axis=1)
    first, second = place[:2].astype(np.intp)
    both = np.ascontiguousarray(unit.T).reshape(2, 3, -1)
    if any(b.orientation is not IDENTITY for b in bushings):
        axes = columns([x + y + z for x, y, z in [b.orientation for b in bushings]], 9).take(which, axis=1)
        both = (axes.reshape(3, 3, -1) * both[:, None]).sum(axis=2)
    force, moment = both
    return Elements(Rows(first, second, place[2:], force, moment), k, c, owner.take(which), unit)


def _matrix(value: tuple[float, ...] | tuple[tuple[float, ...], ...]) -> Array:
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
    values, rows = eigenrows(matrix)
    keep = values != 0.0
    return values[keep], rows[keep]


