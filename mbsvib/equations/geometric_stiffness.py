"""Geometric stiffness: the second-order terms of the forces in joints, springs and loads, as signed rows.

With theta the rotations of bodies (coordinates of the exponential map), (f, tau) a wrench on the second body b and its
opposite on the first body a, arms r from the centres of mass, and (d, delta) what b does relative to a at the point:

1. Each force at an arm, whoever exerts it, gives its body 1/2 theta . (tr(S) 1 - sym S) theta with S = sum of f r^T:
   one symmetric form for each body, three signed rows.
2. Joints and preloaded bushings, whose forces turn with the first body, add theta_a . (d x f + 1/2 delta x tau).
   In joints only free directions move, (d, delta) = sum of q (v, w): the product of q with one rotation of a.
   Two rotations about the axes e, e' that are successive (``parts.joint``) add 1/2 tau . (e x e') q q'.
3. Line springs and rods of tension F and length L add F / (2 L) times the square of what their ends move across them.

The rows and their weights are the same for dense and for sparse equations.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from mbsvib.elements.contribution import Contribution, Weights, turns
from mbsvib.elements.rows import Rows
from mbsvib.kinematics.loops import EPS
from mbsvib.linalg.vectors import skew

if TYPE_CHECKING:
    from mbsvib.common.arrays import Array
    from mbsvib.equations.second_order_rows import Felt
    from mbsvib.equations.wrench_pairs import Pairs
    from mbsvib.equations.wrenches import Applied

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


def geometric(pairs: Pairs, applied: Applied, felt: Felt, position: Array) -> Contribution:
    """Return the geometric stiffness of all forces at the pose.

    Parameters
    ----------
    pairs : Pairs
        All forces: the applied ones, then those in joints.
    applied : Applied
        What loads the mechanism.
    felt : Felt
        The relative displacements that forces feel.
    position : array, shape (3, bodies + 1)
        Centres of mass [m].

    Returns
    -------
    Contribution
        Rows and their weights; owners are numbers of pairs, and behind them of bodies.
    """
    parts = [_of_bodies(pairs, applied, position), _turning(pairs, felt, position.shape[1] - 1)]
    if len(felt.line_owner):
        parts.append(_across_lines(pairs, felt, position.shape[1] - 1))
    return Contribution.join(parts)


def _of_bodies(pairs: Pairs, applied: Applied, position: Array) -> Contribution:
    """The forms of bodies as weighted squares of six rotations: about x, y, z, and the sums of two of these.

    With H = tr(S) 1 - sym S, theta . H theta = sum of H_xy (theta_x + theta_y)^2 and of the rest times theta_x^2.
    Follower loads are left out: ``load_stiffness`` has them.
    """
    ground = position.shape[1] - 1
    fixed = np.ones(len(pairs.first))
    fixed[: applied.loads][applied.follower] = 0.0
    sums, bound = np.zeros((2, ground + 1, 9))
    for arm, body, sign in zip(pairs.arms(position), (pairs.first, pairs.second), (-fixed, fixed), strict=True):
        outer = (sign * pairs.force[:, None] * arm).reshape(9, -1).T
        np.add.at(sums, body, outer)
        np.add.at(bound, body, np.abs(outer))
    values = sums[:ground] @ SQUARES.T
    values[np.abs(values) <= ZERO_FORM * bound[:ground].max(axis=1)[:, None]] = 0.0
    body, which = np.nonzero(values)
    number = np.arange(len(body))
    weights = Weights(number, number, values[body, which], len(pairs.first) + body)
    return Contribution.of(turns(body, SUMS[which].T, ground), stiffness=weights)


def _turning(pairs: Pairs, felt: Felt, ground: int) -> Contribution:
    """What forces add that turn with their first body, and joints with two successive rotations: products of rows."""
    free = len(felt.owner)
    used = np.flatnonzero(felt.carrier < ground)
    twist, owner = felt.twist[:, used], felt.owner[used]
    both = np.concatenate((skew(twist[:3]), 0.5 * skew(twist[3:])), axis=1)
    lever = np.einsum("ijk,jk->ik", both, np.concatenate((pairs.force, pairs.torque))[:, owner])
    rows = Rows.join([felt.rows.take(slice(0, free)), turns(felt.carrier[used], lever, ground)])
    first, second, value = used, free + np.arange(len(used)), np.ones(len(used))
    if felt.two.size:
        who, one, other = felt.two
        half = 0.5 * np.einsum("cn,cn->n", pairs.torque[:, who], felt.cross)
        first, second = np.concatenate((first, one)), np.concatenate((second, other))
        value, owner = np.concatenate((value, half)), np.concatenate((owner, who))
    return Contribution.of(rows, stiffness=Weights(first, second, value, owner))


def _across_lines(pairs: Pairs, felt: Felt, ground: int) -> Contribution:
    """What line springs and rods add: the squares of what their ends move across them, with F / L."""
    across = felt.rows.take(slice(len(felt.owner), None))
    swings = np.flatnonzero(felt.line_carrier < ground)
    rows = Rows.join([across, turns(felt.line_carrier[swings], felt.swing[:, swings], ground)])
    number = np.arange(len(felt.line_owner))
    tension = -(pairs.force[:, felt.line_owner] * felt.line).sum(axis=0) / felt.length
    weights = Weights(number, number, tension, felt.line_owner)
    return Contribution.of(rows, stiffness=weights, row=np.concatenate((number, swings)))
