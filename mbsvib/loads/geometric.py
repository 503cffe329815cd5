"""Geometric stiffness: the second-order terms of the forces in joints, springs and loads, as signed rows.

With theta the rotations of bodies (coordinates of the exponential map), (f, tau) a wrench on the second body b and its
opposite on the first body a, arms r from the centres of mass, and (d, delta) what b does relative to a at the point:

1. Each force at an arm, whoever exerts it, gives its body 1/2 theta . (tr(S) 1 - sym S) theta with S = sum of f r^T:
   one symmetric form for each body, three signed rows.
2. Joints and preloaded bushings, whose forces turn with the first body, add theta_a . (d x f + 1/2 delta x tau).
   In joints only free directions move, (d, delta) = sum of q (v, w): the product of q with one rotation of a.
   Two free rotations about the axes e, e', in the order in which they are named, add 1/2 tau . (e x e') q q'.
3. Line springs and rods of tension F and length L add F / (2 L) times the square of what their ends move across them.

A product p q is 1/4 (s p + q/s)^2 - 1/4 (s p - q/s)^2, with s such that both parts have one size.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from mbsvib.loops import EPS
from mbsvib.mobility import crossed_product

if TYPE_CHECKING:
    from mbsvib.kinematics import Array, Index
    from mbsvib.loads.felt import Felt
    from mbsvib.loads.pairs import Pairs

# Values of a body's form below this share of the forces that make it are rounding.
ZERO_FORM = 16.0 * EPS
_DIAGONAL = np.arange(3)


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


def body_rows(pairs: Pairs, position: Array) -> tuple[Index, Array, Array]:
    """Return the forms of the bodies as signed squares.

    Parameters
    ----------
    pairs : Pairs
        All forces that stay fixed in the world or turn as the rows of joints say.
    position : array, shape (3, bodies + 1)
        Centres of mass [m].

    Returns
    -------
    body : array, shape (rows,)
        Numbers of the bodies that turn.
    direction : array, shape (rows, 3)
        Unit vectors: the row is direction . theta of the body.
    stiffness : array, shape (rows,)
        Signed values [N m].
    """
    first, second = pairs.incidence(position.shape[1] - 1)
    on_first, on_second = forms(pairs, position)
    total = (on_first @ first + on_second @ second)[..., :-1].transpose(2, 0, 1)
    a, b = (np.abs(arm).sum(axis=0) * np.abs(pairs.force).sum(axis=0) for arm in pairs.arms(position))
    size = a @ first[:, :-1] + b @ second[:, :-1]
    values, vectors = np.linalg.eigh(total)
    body, which = np.nonzero(np.abs(values) > ZERO_FORM * size[:, None])
    return body, vectors[body, :, which], values[body, which]


def turning_rows(felt: Felt, force: Array, torque: Array, moved: Array, turned: Array) -> tuple[Array, Array, Index]:
    """Return what forces add that turn with their first body, as rows, signed stiffness and the pairs that own them.

    Parameters
    ----------
    felt : Felt
        What they feel.
    force, torque : array, shape (3, pairs)
        Wrenches on the second bodies [N, N m].
    moved : array, shape (felt rows, m)
        The felt rows in minimal coordinates.
    turned : array, shape (bodies + 1, 3, m)
        Rotations of the bodies, ground last.

    Returns
    -------
    rows : array, shape (rows, m)
        Rows in minimal coordinates.
    stiffness : array, shape (rows,)
        Signed values.
    owner : array, shape (rows,)
        Pairs.
    """
    lever = levers(felt, force, torque)
    used = np.flatnonzero(lever.any(axis=0) & (felt.carrier < len(turned) - 1))
    one, owner = moved[used], felt.owner[used]
    other = np.einsum("cn,ncm->nm", lever[:, used], turned[felt.carrier[used]])
    if felt.two.size:
        who, first, second = felt.two
        half = 0.5 * (torque[:, who] * felt.cross).sum(axis=0)
        one = np.concatenate((one, moved[first]))
        other = np.concatenate((other, half[:, None] * moved[second]))
        owner = np.concatenate((owner, who))
    return products(one, other, owner)


def levers(felt: Felt, force: Array, torque: Array) -> Array:
    """Return v x f + 1/2 w x tau for each felt twist (v, w), shape (3, rows)."""
    result = crossed_product(felt.twist[:3], force[:, felt.owner])
    result += 0.5 * crossed_product(felt.twist[3:], torque[:, felt.owner])
    return result


def line_rows(felt: Felt, force: Array, moved: Array, turned: Array) -> tuple[Array, Array]:
    """Return the rows across line springs and rods, and their signed stiffness F / L.

    Parameters
    ----------
    felt : Felt
        What they feel.
    force : array, shape (3, pairs)
        Forces on the second bodies [N].
    moved : array, shape (felt rows, m)
        The felt rows in minimal coordinates.
    turned : array, shape (bodies + 1, 3, m)
        Rotations of the bodies, ground last.

    Returns
    -------
    rows : array, shape (rows, m)
        What the end moves across the line against the start [m].
    stiffness : array, shape (rows,)
        Signed values [N/m].
    """
    rows = moved[len(felt.owner) :] + np.einsum("cn,ncm->nm", felt.swing, turned[felt.line_carrier])
    return rows, -(force[:, felt.line_owner] * felt.line).sum(axis=0) / felt.length


def products(one: Array, other: Array, owner: Index) -> tuple[Array, Array, Index]:
    """Return rows and signed stiffness whose energy is the sum of the products of two stacks of rows.

    Parameters
    ----------
    one, other : array, shape (n, m)
        Factors of each product.
    owner : array, shape (n,)
        Whose it is.

    Returns
    -------
    rows : array, shape (k, m)
        Two for each product that is not zero.
    stiffness : array, shape (k,)
        1/2 and -1/2.
    owner : array, shape (k,)
        Whose they are.
    """
    sizes = np.sqrt(np.square(one).sum(axis=1)), np.sqrt(np.square(other).sum(axis=1))
    used = np.flatnonzero((sizes[0] > 0.0) & (sizes[1] > 0.0))
    scale = np.sqrt(sizes[1][used] / sizes[0][used])[:, None]
    a, b = scale * one[used], other[used] / scale
    half = np.full(len(used), 0.5)
    return np.concatenate((a + b, a - b)), np.concatenate((half, -half)), np.tile(owner[used], 2)
