"""Composite rows: sums of several relative displacements, for mass and stiffness between more than two bodies.

The mass of a beam element moves with both of its ends, the stiffness of a reduced model with all of its nodes. Such a
row is a small matrix times *base rows*, which are relative displacements of two bodies by the path rule.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from types import MappingProxyType
from typing import TYPE_CHECKING, Any

import numpy as np

from mbsvib.common.arrays import Array, Index
from mbsvib.elements.pose import Pose
from mbsvib.elements.rows import Rows
from mbsvib.elements.shared_rows import Expansion, Node, SharedRows
from mbsvib.linalg.components import stacked_all
from mbsvib.linalg.products import concatenated
from mbsvib.linalg.rotations import components_first, components_last

if TYPE_CHECKING:
    from scipy.sparse import csr_matrix

# Six rows: the displacement of a body at a point, in world axes
_SIX = np.eye(6)


@dataclass(frozen=True, slots=True)
class Composite:
    """Composite rows as arrays: base ``rows``, and ``blocks`` of matrices of equal shape.

    A block has numbers of base rows (e, b) and matrices (..., e, r, b). ``moves_with_ground`` is 1 for base rows that
    move with the ground, else 0.
    """

    rows: Rows
    moves_with_ground: Array
    blocks: tuple[tuple[Index, Array], ...]

    @property
    def count(self) -> int:
        """Number of composite rows."""
        return sum(matrix.shape[-3] * matrix.shape[-2] for _, matrix in self.blocks)

    def of(self, base: Array) -> Array:
        """Return the composite rows (..., rows, m) of the base rows (..., base, m)."""
        parts = [np.matmul(matrix, base[..., index, :]) for index, matrix in self.blocks]
        parts = [part.reshape(*part.shape[:-3], part.shape[-3] * part.shape[-2], part.shape[-1]) for part in parts]
        return np.asarray(concatenated(parts, -2))

    def back(self, forces: Array) -> Array:
        """Return the forces (..., base, n) along the base rows of forces (..., rows, n) along the composite rows."""
        n = forces.shape[-1]
        lead = np.broadcast_shapes(forces.shape[:-2], *[matrix.shape[:-3] for _, matrix in self.blocks])
        result, start = np.zeros((len(self.rows.first), *lead, n), forces.dtype), 0
        for index, matrix in self.blocks:
            e, r, b = matrix.shape[-3:]
            own = forces[..., start : start + e * r, :].reshape(*forces.shape[:-2], e, r, n)
            part = np.broadcast_to(np.einsum("...erb,...ern->...ebn", matrix, own), (*lead, e, b, n))
            np.add.at(result, index.reshape(-1), np.moveaxis(part.reshape(*lead, e * b, n), -2, 0))
            start += e * r
        return np.moveaxis(result, 0, -2)

    def of_sparse(self, base: csr_matrix) -> csr_matrix:
        """Return the composite rows of sparse base rows."""
        from scipy.sparse import csr_matrix

        row, column, value, start = [], [], [], 0
        for index, matrix in self.blocks:
            e, r, b = matrix.shape
            row.append(np.repeat(start + np.arange(e * r), b))
            column.append(np.repeat(index, r, axis=0).reshape(-1))
            value.append(matrix.reshape(-1))
            start += e * r
        shape = (start, base.shape[0])
        flat = [np.concatenate(part) for part in (value, row, column)]
        used = flat[0] != 0.0
        return csr_matrix((flat[0][used], (flat[1][used], flat[2][used])), shape=shape) @ base

    def of_ground_motion(self, linear: Array, angular: Array, origin: Array) -> Array:
        """Return the composite rows (..., rows, 1) of a motion of the ground, with which all bodies move rigidly."""
        point, force, moment = (components_last(array) for array in (
            self.rows.point, self.rows.force, self.rows.moment))  # fmt: skip
        displacement = np.cross(angular, point - origin) + linear
        base = (force * displacement).sum(axis=-1) + moment @ angular
        return self.of((base * self.moves_with_ground)[..., None])

    def in_pose(self, pose: Pose) -> Composite:
        """Return the same rows in a pose, or in many, in which their parts have moved without bending."""
        rows = self.rows
        force, moment = (components_first(pose.vectors(rows.second, array.T)) for array in (rows.force, rows.moment))
        point = components_first(pose.points(rows.second, rows.point.T))
        return replace(self, rows=replace(rows, point=point, force=force, moment=moment))


@dataclass(frozen=True, slots=True)
class ElasticRows:
    """Composite elastic and damping rows: ``stiffness``, ``damping`` and the name of the ``owner`` of each."""

    composite: Composite
    stiffness: Array
    damping: Array
    owner: tuple[str, ...]


def stack(
    parts: Sequence[SharedRows], number: Mapping[str, int], points: Mapping[Node, Any] = MappingProxyType({})
) -> Composite:  # fmt: skip
    """Return composite rows, matrices of equal shape together; ``number`` has all bodies and the ground.

    ``points`` are those of nodes that differ in variants, with components of variants.
    """
    index_of: dict[Node, int] = {}
    shapes: dict[tuple[int, ...], list[tuple[list[int], Array]]] = {}
    for rows in parts:
        start = [index_of.setdefault(node, len(index_of)) for node in rows.nodes]
        shapes.setdefault(rows.matrix.shape[-2:], []).append((start, rows.matrix))
    nodes = list(index_of)
    count = len(nodes)
    force, moment = np.tile(_SIX[:3], count), np.tile(_SIX[3:], count)
    second = np.repeat(np.array([number[node.body] for node in nodes], dtype=np.intp), 6)
    first = np.repeat(np.array([number[node.relative_to] for node in nodes], dtype=np.intp), 6)
    place = np.array([node.point for node in nodes], dtype=float)
    if points:
        place = stacked_all([points.get(node, node.point) for node in nodes])
    point = np.repeat(components_first(place), 6, axis=-1)
    blocks = tuple([
        ((6 * np.array([start for start, _ in group])[:, :, None] + np.arange(6)).reshape(len(group), -1),
         concatenated([matrix[..., None, :, :] for _, matrix in group], -3))
        for group in shapes.values()
    ])  # fmt: skip
    moves_with_ground = np.repeat(np.array([float(node.moves_with_ground) for node in nodes]), 6)
    return Composite(Rows(first, second, point, force, moment), moves_with_ground, blocks)


def in_order(parts: Sequence[SharedRows]) -> list[SharedRows]:
    """Return parts in the order of the rows of ``stack``: those whose matrices have equal shape together."""
    shapes: dict[tuple[int, ...], list[SharedRows]] = {}
    for rows in parts:
        shapes.setdefault(rows.matrix.shape[-2:], []).append(rows)
    return [rows for group in shapes.values() for rows in group]


def stack_elastic(parts: Sequence[SharedRows], number: Mapping[str, int], points: Mapping[Node, Any]) -> ElasticRows:
    """Return composite elastic and damping rows, in the order of ``stack``."""
    ordered = in_order(parts)

    def values(key: str) -> Any:
        return concatenated([np.zeros(rows.matrix.shape[-2]) if getattr(rows, key) is None else getattr(rows, key)
                             for rows in ordered], -1)  # fmt: skip

    owner = tuple([rows.owner for rows in ordered for _ in range(rows.matrix.shape[-2])])
    return ElasticRows(stack(parts, number, points), values("stiffness"), values("damping"), owner)


@dataclass(frozen=True, slots=True)
class Shared:
    """Rows between more than two bodies: ``mass`` rows, and ``elastic`` rows with owners numbered from ``first``."""

    mass: Composite | None
    elastic: ElasticRows | None
    first: int
    names: tuple[str, ...]

    @property
    def base(self) -> list[Rows]:
        """Base rows of the masses, then those of the elastic rows."""
        elastic = None if self.elastic is None else self.elastic.composite
        return [part.rows for part in (self.mass, elastic) if part is not None]

    def in_pose(self, pose: Pose) -> Shared:
        """Return the same rows in a pose, or in many, in which their parts have moved without bending."""
        mass = None if self.mass is None else self.mass.in_pose(pose)
        elastic = self.elastic
        if elastic is not None:
            elastic = replace(elastic, composite=elastic.composite.in_pose(pose))
        return replace(self, mass=mass, elastic=elastic)

    def inertia_rows(self, factor: Array, base: Array) -> Array:
        """Return W with the shared rows below those of the bodies."""
        if self.mass is None:
            return factor
        return np.asarray(concatenated((factor, self.mass.of(base[..., : len(self.mass.rows.first), :])), -2))

    def of_ground_motion(self, factor: Array, linear: Array, angular: Array, origin: Array) -> Array:
        """Return W u of a rigid motion u with the ground: ``factor`` of the bodies, then the shared rows."""
        if self.mass is None:
            return factor
        return np.asarray(concatenated((factor, self.mass.of_ground_motion(linear, angular, origin)), -2))

    def elastic_rows(
        self, base: Array, above: Array, stiffness: Array, damping: Array, owner: Index
    ) -> tuple[Array, Array, Array, Index]:
        """Return elastic rows, stiffness, damping and owners with the nonzero shared ones appended."""
        if self.elastic is None:
            return above, stiffness, damping, owner
        start = 0 if self.mass is None else len(self.mass.rows.first)
        rows = self.elastic.composite.of(base[..., start:, :])
        number = {name: self.first + i for i, name in enumerate(self.names)}
        owners = np.array([number[name] for name in self.elastic.owner], dtype=np.intp)
        acts = np.flatnonzero(np.any(rows, axis=(*range(rows.ndim - 2), rows.ndim - 1)))
        k, c = self.elastic.stiffness[..., acts], self.elastic.damping[..., acts]
        return (concatenated((above, rows[..., acts, :]), -2), concatenated((stiffness, k), -1),
                concatenated((damping, c), -1), np.concatenate((owner, owners[acts])))  # fmt: skip


def shared_rows(
    expansion: Expansion, number: Mapping[str, int], first: int, points: Mapping[Node, Any] = MappingProxyType({})
) -> Shared:  # fmt: skip
    """Return the rows between more than two bodies as arrays.

    ``first`` is the number of owners of other elastic rows, ``points`` are those of nodes that differ in variants.
    """
    names = tuple(dict.fromkeys(rows.owner for rows in expansion.elastic))
    return Shared(stack(expansion.mass, number, points) if expansion.mass else None,
                  stack_elastic(expansion.elastic, number, points) if expansion.elastic else None, first, names)
