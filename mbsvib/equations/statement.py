"""The sum of all contributions over minimal coordinates: rows, signed squares and antisymmetric matrices.

A product p q is 1/4 (s p + q/s)^2 - 1/4 (s p - q/s)^2, with s such that both parts have one size: so a symmetric form
stays a sum of weighted squares, of which no digit is lost in modes.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from mbsvib.kinematics.relative_motion import relative_motion
from mbsvib.linalg.rank import ZERO_SUM

if TYPE_CHECKING:
    from mbsvib.common.arrays import Array, Index
    from mbsvib.elements.contribution import Contribution, Weights
    from mbsvib.elements.rows import Rows
    from mbsvib.kinematics.loops import Reduction
    from mbsvib.kinematics.relative_motion import Twists



@dataclass(frozen=True, slots=True)
class JointRows:
    """What the tree says of rows: those ``alone`` are rotations of bodies, the ``others`` stand in ``between`` (k, n),
    in joint coordinates.
    """

    alone: Index
    others: Index
    between: Array


def joint_rows(rows: Rows, coordinates: Twists) -> JointRows:
    """Return relative displacements in joint coordinates, but for rotations of bodies.

    Parameters
    ----------
    rows : Rows
        Relative displacements.
    coordinates : Twists
        The joint coordinates of the tree.

    Returns
    -------
    JointRows
        Which rows are rotations, and the others.
    """
    turns = (rows.first == len(coordinates.path) - 1) & ~rows.force.any(axis=0)
    others = (~turns).nonzero()[0]
    return JointRows(turns.nonzero()[0], others, relative_motion(coordinates, rows.take(others)).dense(0, len(others)))


def minimal_rows(
    part: Contribution, coordinates: Twists, reduction: Reduction, motion: Array, known: JointRows | None = None
) -> Array:
    """Return the rows of a contribution in minimal coordinates.

    Parameters
    ----------
    part : Contribution
        Relative displacements.
    coordinates : Twists
        The joint coordinates of the tree.
    reduction : Reduction
        The minimal ones.
    motion : array, shape (bodies, 6, m)
        Motion of the bodies in minimal coordinates, of which their rotations are parts.
    known : JointRows, optional
        ``joint_rows(part.rows, coordinates)``, where it is known already.

    Returns
    -------
    array, shape (count, m)
        Rows, with exact zeros where loops hold them still.
    """
    rows, known = part.rows, known or joint_rows(part.rows, coordinates)
    base = np.empty((len(rows.first), motion.shape[2]))
    rotations = motion.take(rows.second.take(known.alone), axis=0)[:, 3:]
    base[known.alone] = (rows.moment.take(known.alone, axis=1).T[:, None] @ rotations)[:, 0]
    base[known.others] = reduction.apply_exactly(known.between)
    if part.count == len(base):
        return base
    result = np.zeros((part.count, base.shape[1]))
    np.add.at(result, part.row, base)
    return result


def signed_squares(weights: Weights, rows: Array) -> tuple[Array, Array, Index]:
    """Return a symmetric form of rows as weighted squares.

    Parameters
    ----------
    weights : Weights
        Weights of squares and products.
    rows : array, shape (count, m)
        The rows.

    Returns
    -------
    squares : array, shape (n, m)
        Rows of which the form is the sum of weighted squares.
    value, owner : array, shape (n,)
        Signed weights, and whose they are.
    """
    same = weights.first == weights.second
    pairs, own = (~same).nonzero()[0], same.nonzero()[0]
    first, second, value = weights.first, weights.second, weights.value
    other = value.take(pairs)[:, None] * rows.take(second.take(pairs), axis=0)
    squares, half = products(rows.take(first.take(pairs), axis=0), other)
    return (np.concatenate((rows.take(first.take(own), axis=0), squares)), np.concatenate((value.take(own), half)),
            weights.owner.take(np.concatenate((own, pairs, pairs))))  # fmt: skip


def products(one: Array, other: Array) -> tuple[Array, Array]:
    """Return rows and signed weights whose energy is the sum of the products of two stacks of rows.

    Parameters
    ----------
    one, other : array, shape (n, m)
        Factors of each product.

    Returns
    -------
    rows : array, shape (2 n, m)
        Sums, then differences.
    value : array, shape (2 n,)
        1/2, then -1/2; 0 for a product that is zero.
    """
    first, second = np.einsum("nm,nm->n", one, one), np.einsum("nm,nm->n", other, other)
    none = first * second == 0.0
    if np.count_nonzero(none):
        first[none] = second[none] = 1.0
    scale = np.sqrt(np.sqrt(second / first))[:, None]
    a, b, half = scale * one, other / scale, np.where(none, 0.0, 0.5)
    return np.concatenate((a + b, a - b)), np.concatenate((half, -half))


def antisymmetric(weights: Weights, rows: Array) -> Array | None:
    """Return an antisymmetric form of rows as a matrix.

    sum of value (d_i d_j^T - d_j d_i^T), where what is rounding of its products is zero

    Parameters
    ----------
    weights : Weights
        Weights of products.
    rows : array, shape (count, m)
        The rows.

    Returns
    -------
    array, shape (m, m), or None
        The matrix; None where it is zero.
    """
    one, other = rows[weights.first], weights.value[:, None] * rows[weights.second]
    part, size = one.T @ other, np.abs(one).T @ np.abs(other)
    result = part - part.T
    result[np.abs(result) <= ZERO_SUM * (size + size.T)] = 0.0
    return result if result.any() else None
