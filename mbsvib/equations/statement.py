"""Contributions in minimal coordinates: rows, signed squares and antisymmetric matrices.

A product p q is 1/4 (s p + q/s)^2 - 1/4 (s p - q/s)^2, with s such that s p and q/s have the same size. So a symmetric
form remains a sum of weighted squares, from which modes are computed without loss of digits.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from mbsvib.kinematics.relative_motion import Twists, relative_motion
from mbsvib.linalg.rank import ZERO_SUM

if TYPE_CHECKING:
    from mbsvib.common.arrays import Array, Index
    from mbsvib.elements.contribution import Contribution, Weights
    from mbsvib.elements.rows import Rows
    from mbsvib.kinematics.loops import Reduction


@dataclass(frozen=True, slots=True)
class JointRows:
    """Numbers of rows that are ``rotations`` of bodies, and of ``others``, which are ``matrix`` (k, n) in joint
    coordinates.
    """

    rotations: Index
    others: Index
    matrix: Array


def joint_rows(rows: Rows, coordinates: Twists) -> JointRows:
    """Return relative displacements in joint coordinates, except for rotations of bodies."""
    rotations = (rows.first == len(coordinates.path) - 1) & ~rows.force.any(axis=0)
    others = (~rotations).nonzero()[0]
    matrix = relative_motion(coordinates, rows.take(others)).dense(0, len(others))
    return JointRows(rotations.nonzero()[0], others, matrix)


def minimal_rows(
    contribution: Contribution, coordinates: Twists, reduction: Reduction, motion: Array,
    in_joint_coordinates: JointRows | None = None,
) -> Array:  # fmt: skip
    """Return the rows of a contribution in minimal coordinates.

    ``motion`` (bodies, 6, m): motion of the bodies in minimal coordinates, which contains their rotations.
    ``in_joint_coordinates``: ``joint_rows(contribution.rows, coordinates)``, if available. Returns rows (count, m) with
    exact zeros for displacements that loops do not allow.
    """
    rows, known = contribution.rows, in_joint_coordinates or joint_rows(contribution.rows, coordinates)
    base = np.empty((len(rows.first), motion.shape[2]))
    rotations = motion.take(rows.second.take(known.rotations), axis=0)[:, 3:]
    base[known.rotations] = (rows.moment.take(known.rotations, axis=1).T[:, None] @ rotations)[:, 0]
    base[known.others] = reduction.apply_exactly(known.matrix)
    if contribution.count == len(base):
        return base
    result = np.zeros((contribution.count, base.shape[1]))
    np.add.at(result, contribution.row, base)
    return result


def squares_of_products(first: Array, second: Array) -> tuple[Array, Array]:
    """Return rows and signed weights of squares whose sum is the sum of products of two stacks of rows.

    ``first``, ``second`` (..., n, m): factors of each product. Returns ``rows`` (..., 2 n, m): sums, then differences;
    ``value`` (..., 2 n): 1/2, then -1/2; 0 for a product that is zero.
    """
    first_size, second_size = (np.einsum("...nm,...nm->...n", rows, rows) for rows in (first, second))
    zero = first_size * second_size == 0.0
    if np.count_nonzero(zero):
        first_size, second_size = np.where(zero, 1.0, first_size), np.where(zero, 1.0, second_size)
    scale = np.sqrt(np.sqrt(second_size / first_size))[..., None]
    a, b, half = scale * first, second / scale, np.where(zero, 0.0, 0.5)
    return np.concatenate((a + b, a - b), axis=-2), np.concatenate((half, -half), axis=-1)


def antisymmetric(weights: Weights, rows: Array) -> Array | None:
    """Return an antisymmetric form of rows as a matrix.

    sum of value (d_i d_j^T - d_j d_i^T), with zeros for rounding errors

    ``rows`` (count, m). Returns the matrix (m, m), None if it is zero.
    """
    first, second = rows[weights.first], weights.value[:, None] * rows[weights.second]
    part, size = first.T @ second, np.abs(first).T @ np.abs(second)
    result = part - part.T
    result[np.abs(result) <= ZERO_SUM * (size + size.T)] = 0.0
    return result if result.any() else None
