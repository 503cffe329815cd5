"""Geometric stiffness: the second derivatives of the work of all forces at a pose.

A pair is what acts with a wrench F between two bodies: a load, a preloaded spring, a cut joint with its multipliers, a
coupler. With the twists S_k of the joint coordinates, s_k their signs on the way from the first to the second body, and
J = [s_1 S_1, s_2 S_2, ...] the relative displacement of the pair,

    K = sum over pairs of  J^T H J  +  1/2 F . [s_k S_k, s_l S_l]  for k before l on this way  (and its transpose)
        + sum over rods of the tree of  F . d2(log X) / dq dq

H are the second derivatives of the pair's own potential to exponential coordinates xi of the relative displacement, F
the first ones. A joint of the tree is a product of motions, which come one before the other too; only a rod is curved.
The bracket of twists is [S, S'] = (w x w', w x v' - w' x v), from the Baker-Campbell-Hausdorff series

    log(exp S_1 q_1 exp S_2 q_2 ...) = sum of S_k q_k + 1/2 sum over k before l of [S_k, S_l] q_k q_l + ...

Coordinates common to both bodies of a pair do not count, and no wrench in a joint of the tree is needed.

Source: Murray, Li & Sastry, A Mathematical Introduction to Robotic Manipulation (1994), section 2.2 and appendix A, for
twists and brackets; Geradin & Cardona, Flexible Multibody Dynamics (2001), for second derivatives of V + lambda . phi.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property, lru_cache

import numpy as np
from numpy.typing import NDArray

from mbsvib.common.arguments import DIRECTIONS
from mbsvib.common.arrays import Array, Bools, Index
from mbsvib.elements.joint_kinds import ROD, STRAIGHT, Motion
from mbsvib.kinematics.relative_motion import order_and_paths
from mbsvib.linalg.products import concatenated
from mbsvib.linalg.rotations import cross, skew
from mbsvib.mechanism.topology import FLOATS, Branch, Topology


@dataclass(frozen=True)
class TwistsAt:
    """Twists of the joint coordinates: ``angular`` and ``linear`` (..., 3, n) at ``point`` (..., 3, n) [m]; ``path``
    (bodies + 1, n) are their signs on the way from ground to each body, see ``Twists``.
    """

    angular: Array
    linear: Array
    point: Array
    path: NDArray[np.int8]

    def motion(self, first: Index, second: Index, point: Array) -> Array:
        """Return J (..., 6, p, n): rotation and displacement of second bodies against first ones at points (..., 3, p).
        """
        angular = self.angular[..., None, :]
        sign = np.asarray(self.path[second] - self.path[first], dtype=float)
        moved = cross(angular, point[..., None] - self.point[..., None, :]) + self.linear[..., None, :]
        result = np.empty((*moved.shape[:-3], 6, *moved.shape[-2:]), moved.dtype)
        np.multiply(angular, sign, out=result[..., :3, :, :])
        np.multiply(moved, sign, out=result[..., 3:, :, :])
        return result

    @cached_property
    def brackets(self) -> tuple[Array, Array]:
        """Brackets [S_k, S_l] (..., 3, n, n) of all pairs of twists about the point of l: rotations, translations."""
        of_l = [array[..., None, :] for array in (self.angular, self.linear, self.point)]
        of_k = [array[..., None] for array in (self.angular, self.linear, self.point)]
        shifts = cross(of_k[0], of_l[1]) - cross(of_l[0], of_k[1] + cross(of_k[0], of_l[2] - of_k[2]))
        return cross(of_k[0], of_l[0]), shifts

    @cached_property
    def sizes(self) -> tuple[Array, Array, float]:
        """Sizes of rotations and translations (..., n), and the largest coordinate of a point [m]."""
        turns, shifts = (np.sqrt(np.square(np.abs(array)).sum(axis=-2)) for array in (self.angular, self.linear))
        return turns, shifts, float(np.abs(self.point).max(initial=0.0))


@dataclass(frozen=True, slots=True)
class Pairs:
    """Wrenches between bodies, about their points, and the second derivatives of their potentials there.

    ``first``, ``second`` (p,): numbers of bodies. ``point`` (..., 3, p) [m] moves with the second body. ``wrench`` F
    (..., 6, p): first derivatives of the potential to (theta, v) [N m, N]. ``hessian`` H (..., p, 6, 6). ``torsion``
    (..., t, 6, 6) is the tangent without potential of the first t pairs, as of torques and follower forces; None
    without any.
    """

    first: Index
    second: Index
    point: Array
    wrench: Array
    hessian: Array
    torsion: Array | None = None

    @staticmethod
    def join(parts: list[Pairs]) -> Pairs:
        """Return all pairs in one; only the first of them may have a ``torsion``."""
        if len(parts) == 1:
            return parts[0]
        return Pairs(
            np.concatenate([part.first for part in parts]), np.concatenate([part.second for part in parts]),
            concatenated([part.point for part in parts], -1), concatenated([part.wrench for part in parts], -1),
            concatenated([part.hessian for part in parts], -3), parts[0].torsion,
        )  # fmt: skip


@dataclass(frozen=True, slots=True)
class GeometricStiffness:
    """Second derivatives in joint coordinates: ``symmetric`` and ``antisymmetric`` (..., n, n), None where no torque or
    follower load acts; ``transmitted`` (..., 6, n) is the wrench (moment, force) that each coordinate's joint
    transmits, about the point of its twist.
    """

    symmetric: Array
    antisymmetric: Array | None
    transmitted: Array


def geometric_stiffness(
    twists: TwistsAt, order: MotionOrder, pairs: Pairs, motion: Array, rod_curvature: Array | None = None
) -> GeometricStiffness:  # fmt: skip
    """Return the geometric stiffness of pairs.

    ``motion`` (..., 6, p, n): ``twists.motion`` of the pairs. ``rod_curvature`` (..., rods, 6, f, f): second
    derivatives of the exponential coordinates of the ``order.rods`` to their own coordinates, world axes.
    """
    ways = _ways(twists.path.tobytes(), twists.path.shape, pairs.first.tobytes(), pairs.second.tobytes())
    rows = motion.swapaxes(-3, -2)  # (..., p, 6, n)
    result = _flat(rows).swapaxes(-1, -2) @ _flat(pairs.hessian @ rows)
    if len(ways.both):
        half = _across(pairs, rows, ways)
        result = result + half + half.swapaxes(-1, -2)
    force, moment = _transmitted(twists, pairs, ways)
    bracket = _brackets(twists, order, force, moment, ways)
    result = result + bracket + bracket.swapaxes(-1, -2)
    transmitted = concatenated((sum(moment), sum(force)), -2)
    for number, (_, at) in enumerate(order.rods):
        assert rod_curvature is not None
        bent = np.einsum("...i,...ifg->...fg", transmitted[..., at[0]], rod_curvature[..., number, :, :, :])
        of_rod = np.zeros((*bent.shape[:-2], *result.shape[-2:]), bent.dtype)
        of_rod[..., at[:, None], at] = bent
        result = result + of_rod
    antisymmetric = None
    if pairs.torsion is not None:
        own = rows[..., : pairs.torsion.shape[-3], :, :]
        tangent = _flat(own).swapaxes(-1, -2) @ _flat(pairs.torsion @ own)
        result = result + 0.5 * (tangent + tangent.swapaxes(-1, -2))
        antisymmetric = 0.5 * (tangent - tangent.swapaxes(-1, -2))
    return GeometricStiffness(result, antisymmetric, transmitted)


@dataclass(frozen=True, slots=True)
class _Ways:
    """The ways of pairs between their bodies: ``sign`` (p, n) of the coordinates on them; the ``group`` (p,) of pairs
    whose bodies have the same ones in common, with the other coordinates ``beyond`` (groups, n); the pairs ``both``
    (b,) with coordinates on the way to both bodies, and a mask ``up`` (b, n) of those to the first.
    """

    sign: Array
    group: Index
    beyond: Array
    both: Index
    up: Bools


@lru_cache(maxsize=32)
def _ways(path: bytes, shape: tuple[int, ...], first: bytes, second: bytes) -> _Ways:
    """The ways of pairs, which depend on nothing but the tree and the bodies."""
    signs = np.frombuffer(path, np.int8).reshape(shape)
    a, b = signs[np.frombuffer(first, np.intp)], signs[np.frombuffer(second, np.intp)]
    sign = (b - a).astype(float)
    common = (a != 0) & (b != 0)
    if not len(common):
        return _Ways(sign, np.zeros(0, dtype=np.intp), np.ones((1, shape[1])), np.zeros(0, dtype=np.intp), common)
    beyond, group = np.unique(~common, axis=0, return_inverse=True)
    up = (a != 0) & ~common
    both = (up.any(axis=1) & ((b != 0) & ~common).any(axis=1)).nonzero()[0]
    return _Ways(sign, group.reshape(-1), beyond.astype(float), both, up[both])


def _across(pairs: Pairs, rows: Array, ways: _Ways) -> Array:
    """1/2 F . [S_k, S_l] of pairs with k on the way to their first and l on that to their second body."""
    here = rows[..., ways.both, :, :]
    before, after = here * ways.up[:, None], here * ~ways.up[:, None]
    matrix = 0.5 * bracket_form(np.swapaxes(pairs.wrench[..., ways.both], -1, -2))
    return np.asarray(_flat(before).swapaxes(-1, -2) @ _flat(matrix @ after))


def bracket_form(wrench: Array) -> Array:
    """Return X (..., 6, 6) with F . [a, b] = a . X b of wrenches F = (m, f) (..., 6): X = -[[m]x, [f]x; [f]x, 0]."""
    moment, force = skew(wrench[..., :3]), skew(wrench[..., 3:])
    top, bottom = (np.concatenate(blocks, axis=-1) for blocks in ((moment, force), (force, np.zeros_like(force))))
    return -np.concatenate((top, bottom), axis=-2)


def _transmitted(twists: TwistsAt, pairs: Pairs, ways: _Ways) -> tuple[list[Array], list[Array]]:
    """Forces and moments (..., 3, n) about the points of the twists, by group of pairs."""
    force = pairs.wrench[..., 3:, :, None] * ways.sign
    moment = pairs.wrench[..., :3, :, None] * ways.sign
    moment = moment + cross(pairs.point[..., None] - twists.point[..., None, :], force)
    groups = [slice(None)] if len(ways.beyond) == 1 else [ways.group == g for g in range(len(ways.beyond))]
    return [force[..., g, :].sum(axis=-2) for g in groups], [moment[..., g, :].sum(axis=-2) for g in groups]


def _brackets(twists: TwistsAt, order: MotionOrder, force: list[Array], moment: list[Array], ways: _Ways) -> Array:
    """1/2 F_l . [S_k, S_l] (..., n, n) for k before l, with the wrench F_l that l transmits of pairs beyond k."""
    turns, shifts = twists.brackets
    total = 0.0
    for f, m, beyond in zip(force, moment, ways.beyond, strict=True):
        one = (m[..., None, :] * turns + f[..., None, :] * shifts).sum(axis=-3)
        total = total + (one if beyond.all() else one * beyond[:, None])
    return np.asarray(0.5 * order.before * total)


def _flat(rows: Array) -> Array:
    return rows.reshape(*rows.shape[:-3], rows.shape[-3] * rows.shape[-2], rows.shape[-1])


Kinds = tuple[tuple[tuple[str, ...], bool, Motion], ...]


@dataclass(frozen=True, slots=True)
class MotionOrder:
    """Joint coordinates (n,) in the order of motions.

    ``before`` (n, n) is the sign of the coordinate k's joint along its path where k comes before l on the way from
    ground, else 0: in another joint, or in the same one, whose translations come before its rotations and whose
    successive rotations follow each other. ``joint`` (n,) is the number of each coordinate's joint, ``sign`` (n,)
    that of its joint along the path. ``rods`` are the coordinates of rods in the tree.
    """

    before: Array
    joint: Index
    sign: Array
    rods: tuple[tuple[int, Index], ...]


def motion_order(topology: Topology) -> MotionOrder:
    """Return the order of the joint coordinates of a tree."""
    kinds = tuple([(tuple([name for name, _ in joint.freedom]), joint.successive, joint.motion)
                   for joint in topology.joints])  # fmt: skip
    return _motion_order(topology.branches, kinds)


@lru_cache(maxsize=32)
def _motion_order(branches: tuple[Branch, ...], kinds: Kinds) -> MotionOrder:
    """``motion_order`` of a tree whose joints have these free directions, successive rotations and motions.

    It depends on nothing else, and is cached for mechanisms that are built again with other values.
    """
    order, path = order_and_paths(branches, tuple([len(free) for free, _, _ in kinds]))
    n = path.shape[1]
    before, number, sign = np.zeros((n, n)), np.zeros(n, dtype=np.intp), np.zeros(n)
    rods, start = [], 0
    for branch in order:
        free, successive, motion = (DIRECTIONS, False, STRAIGHT) if branch.joint == FLOATS else kinds[branch.joint]
        at = np.arange(start, start + len(free))
        start += len(free)
        number[at], sign[at] = branch.joint, branch.sign
        before[:, at] = path[branch.parent, :, None]
        if motion is ROD:
            rods.append((branch.joint, at))
        else:
            before[at[:, None], at] = _within(free, successive, branch.sign)
    for array in (before, number, sign):
        array.setflags(write=False)
    return MotionOrder(before, number, sign, tuple(rods))


def _within(free: tuple[str, ...], successive: bool, sign: int) -> Array:
    """The order of motions in a joint, a product of translations and rotations; the inverse of one that is reversed."""
    turns = np.array([name[0] == "r" for name in free], dtype=bool)
    number = np.arange(len(free))
    first = ~turns[:, None] & turns
    if successive:
        first |= turns[:, None] & turns & (number[:, None] < number)
    return sign * np.asarray(first if sign > 0 else first.T, dtype=float)
