"""Geometric stiffness: the second-order terms of the forces in joints, springs and loads, as signed rows.

With theta the rotations of bodies (coordinates of the exponential map), (f, tau) a wrench on the second body b and its
opposite on the first body a, arms r from the centres of mass, and (d, delta) what b does relative to a at the point:

1. Each force at an arm, whoever exerts it, gives its body 1/2 theta . (tr(S) 1 - sym S) theta with S = sum of f r^T:
   one symmetric form for each body, three signed rows.
2. Joints and preloaded bushings, whose forces turn with the first body, add theta_a . (d x f + 1/2 delta x tau).
   In joints only free directions move, (d, delta) = sum of q (v, w): the product of q with one rotation of a.
   Two rotations about the axes e, e' that are successive (``parts.joint``) add 1/2 tau . (e x e') q q'.
3. Line springs and rods of tension F and length L add F / (2 L) times the square of what their ends move across them.

A product p q is 1/4 (s p + q/s)^2 - 1/4 (s p - q/s)^2, with s such that both parts have one size.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from mbsvib.kinematics.loops import EPS

if TYPE_CHECKING:
    from mbsvib.common.arrays import Array
    from mbsvib.equations.applied_forces import Acting
    from mbsvib.equations.second_order_rows import Felt
    from mbsvib.equations.wrench_pairs import Pairs

# Values of a body's form below this share of the forces that make it are rounding.
ZERO_FORM = 16.0 * EPS
_DIAGONAL = np.arange(3)
# Six rotations (x, y, z, x + y, x + z, y + z), and what each of their squares gets of S_ij, in the order of S's rows.
SUMS = np.array([[1, 0, 0], [0, 1, 0], [0, 0, 1], [1, 1, 0], [1, 0, 1], [0, 1, 1]], dtype=float)
SQUARES = np.array([
    [0, 0.5, 0.5, 0.5, 1, 0, 0.5, 0, 1], [1, 0.5, 0, 0.5, 0, 0.5, 0, 0.5, 1], [1, 0, 0.5, 0, 1, 0.5, 0.5, 0.5, 0],
    [0, -0.5, 0, -0.5, 0, 0, 0, 0, 0], [0, 0, -0.5, 0, 0, 0, -0.5, 0, 0], [0, 0, 0, 0, 0, -0.5, 0, -0.5, 0],
])  # fmt: skip


def forms(pairs: Pairs, position: Array) -> tuple[Array, Array]:
    """Return tr(S) 1 - sym(S) with S = force arm^T, by the rotation of the first body and by that of the second.

    Parameters
    ----------
    pairs : Pairs
        Forces between bodies.
    position : array, shape (3, bodies + 1)
        Centres of mass [m].

    Returns
    -------
    first, second : array, shape (3, 3, n)
        Second derivatives [N m].
    """
    result = []
    for arm, sign in zip(pairs.arms(position), (-1.0, 1.0), strict=True):
        half = (-0.5 * sign) * pairs.force[:, None] * arm
        form = half + half.swapaxes(0, 1)
        form[_DIAGONAL, _DIAGONAL] -= 2.0 * np.einsum("iin->n", half)
        result.append(form)
    return result[0], result[1]


def body_rows(acting: Acting, force: Array, motion: Array) -> tuple[Array, Array]:
    """Return the forms of the bodies as signed squares of six rotations: about x, y, z, and the sums of two of these.

    With H = tr(S) 1 - sym S, theta . H theta = sum of H_xy (theta_x + theta_y)^2 and of the rest times theta_x^2.

    Parameters
    ----------
    acting : Acting
        All forces that stay fixed in the world or turn as the rows of joints say.
    force : array, shape (3, pairs)
        Their forces [N].
    motion : array, shape (bodies, 6, m)
        Motion of the bodies.

    Returns
    -------
    rows : array, shape (6 bodies, m)
        Rotations in minimal coordinates, body by body.
    stiffness : array, shape (6 bodies,)
        Signed values [N m], 0 where nothing but rounding is left.
    """
    outer = (force[:, None, None] * acting.arms.reshape(3, 2, -1)).reshape(9, -1)
    values = SQUARES.dot(outer.dot(acting.place))
    values *= np.abs(values) > ZERO_FORM * np.maximum.reduce(np.abs(outer)).dot(acting.touched)
    return (SUMS @ motion[:, 3:]).reshape(6 * len(motion), motion.shape[2]), values.T.reshape(-1)


def turning_rows(felt: Felt, acting: Acting, wrench: Array, moved: Array, motion: Array) -> tuple[Array, Array]:
    """Return what forces add that turn with their first body, as rows and signed stiffness.

    Parameters
    ----------
    felt : Felt
        What they feel.
    acting : Acting
        The geometry of the forces.
    wrench : array, shape (6, pairs)
        Wrenches on the second bodies [N, N m].
    moved : array, shape (felt rows, m)
        The felt rows in minimal coordinates.
    motion : array, shape (bodies, 6, m)
        Motion of the bodies.

    Returns
    -------
    rows : array, shape (2 p, m)
        Rows in minimal coordinates, two for each product of ``acting``.
    stiffness : array, shape (2 p,)
        Signed values.
    """
    count, owner = len(acting.turned), acting.turner
    lever = acting.levers @ wrench.take(owner[:count], axis=1).T[:, :, None]
    other = (lever.swapaxes(1, 2) @ motion.take(acting.turned, axis=0)[:, 3:])[:, 0]
    if felt.two.size:
        half = np.add.reduce(wrench[3:].take(owner[count:], axis=1) * felt.cross)
        half *= 0.5
        other = np.concatenate((other, half[:, None] * moved.take(felt.two[2], axis=0)))
    return products(moved.take(acting.one, axis=0), other)


def line_rows(felt: Felt, force: Array, moved: Array, motion: Array) -> tuple[Array, Array]:
    """Return the rows across line springs and rods, and their signed stiffness F / L.

    Parameters
    ----------
    felt : Felt
        What they feel.
    force : array, shape (3, pairs)
        Forces on the second bodies [N].
    moved : array, shape (felt rows, m)
        The felt rows in minimal coordinates.
    motion : array, shape (bodies, 6, m)
        Motion of the bodies.

    Returns
    -------
    rows : array, shape (rows, m)
        What the end moves across the line against the start [m].
    stiffness : array, shape (rows,)
        Signed values [N/m].
    """
    rows = moved[len(felt.owner) :]
    swings = (felt.line_carrier < len(motion)).nonzero()[0]
    if len(swings):
        turns = motion.take(felt.line_carrier.take(swings), axis=0)[:, 3:]
        rows = rows.copy()
        rows[swings] += (felt.swing.take(swings, axis=1).T[:, None] @ turns)[:, 0]
    return rows, np.add.reduce(force.take(felt.line_owner, axis=1) * felt.line) / -felt.length


def products(one: Array, other: Array) -> tuple[Array, Array]:
    """Return rows and signed stiffness whose energy is the sum of the products of two stacks of rows.

    Parameters
    ----------
    one, other : array, shape (n, m)
        Factors of each product.

    Returns
    -------
    rows : array, shape (2 n, m)
        Sums, then differences.
    stiffness : array, shape (2 n,)
        1/2, then -1/2; 0 for a product that is zero.
    """
    first, second = np.einsum("nm,nm->n", one, one), np.einsum("nm,nm->n", other, other)
    none = first * second == 0.0
    if np.count_nonzero(none):
        first[none] = second[none] = 1.0
    scale = np.sqrt(np.sqrt(second / first))[:, None]
    a, b, half = scale * one, other / scale, np.where(none, 0.0, 0.5)
    return np.concatenate((a + b, a - b)), np.concatenate((half, -half))
