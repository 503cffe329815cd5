"""Mobility: is the number of degrees of freedom the same in neighbouring poses?

Redundant constraints are accepted where they stay redundant, as in planar loops. Where they are redundant in this pose
only (a four-bar linkage in one line), the number of degrees of freedom jumps and linear equations do not describe the
motion.

Source: Connelly & Whiteley, SIAM J. Discrete Math. 9 (1996) 453, for constraints to second order.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from mbsvib.common.tables import listed
from mbsvib.errors import SingularPoseError
from mbsvib.kinematics.relative_motion import body_motion, relative_motion
from mbsvib.linalg.qr import pivoted_qr
from mbsvib.linalg.rank import NEIGHBOUR_PIVOT, NEIGHBOUR_STEP, PARALLEL_AXES, RANK_FACTOR
from mbsvib.linalg.rotations import CYCLE
from mbsvib.mechanism.topology import FLOATS

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from mbsvib.common.arrays import Array, Index
    from mbsvib.kinematics.loops import Cuts, LoopGroup, Reduction
    from mbsvib.kinematics.relative_motion import Twists
    from mbsvib.mechanism.topology import Topology


@dataclass(frozen=True, slots=True)
class Rod:
    """The rod of a distance joint, which belongs to neither body: from ``start`` on ``first`` to ``end`` on ``second``,
    arrays (3, 1) or (3, variants, 1); ``row`` of the constraints and ``column`` of the coordinates follow it.
    """

    first: Index
    second: Index
    start: Array
    end: Array
    row: slice
    column: slice


def check_mobility(
    topology: Topology, coordinates: Twists, cuts: Cuts | None, reduction: Reduction, position: Array
) -> bool:
    """Refuse a pose in which fewer constraints are independent than in neighbouring poses.

    Only groups of loops with redundant rows are checked. ``position`` (bodies, 3): centres of mass [m], world axes.
    Returns whether loops are planar, which makes a check of neighbouring poses unnecessary.
    """
    groups = [group for group in reduction.groups if group.surplus]
    if cuts is None or reduction.matrix is None or not groups or not reduction.matrix.shape[1]:
        return False
    crossing, rods = crossing_axes(topology, cuts), rods_in_loops(topology, coordinates, cuts)
    # without these, each row is fixed in one body
    if not (crossing or rods) and _stays_planar(coordinates, cuts, groups):
        return True
    phi = phi_nearby(topology, coordinates, cuts, reduction, position, crossing, rods)
    for group in groups:
        scale = np.where(coordinates.turns[group.columns], 1.0, group.length)
        row_scale = cuts.row_scale(group.length).take(group.rows)[:, None]
        limit = max(NEIGHBOUR_PIVOT, RANK_FACTOR * group.noise)
        rank = rank_nearby(phi[group.rows[:, None], group.columns] * row_scale * scale, limit)
        if rank > group.rank:
            raise jump(group.joints, len(group.rows), group.rank, rank)
    return False


def rank_nearby(a: Array, limit: float) -> int:
    """Return the number of pivots of scaled constraint rows above a limit, in units of the largest if that exceeds one.
    """
    pivots = np.abs(pivoted_qr(a)[0].diagonal())
    return int(np.count_nonzero(pivots > limit * max(1.0, float(pivots.max(initial=0.0)))))


def jump(joints: Sequence[str], rows: int, here: int, nearby: int) -> SingularPoseError:
    """Return the error of loops closed by ``joints``, of whose ``rows`` more are independent in neighbouring poses."""
    return SingularPoseError(
        f"loops closed by {listed(joints)}: singular pose. {here} of their {rows} constraint rows are independent "
        f"here, {nearby} in neighbouring poses, so the number of degrees of freedom jumps and linear equations do not "
        f"describe the motion. Move the pose off the singular one."
    )


def _stays_planar(coordinates: Twists, cuts: Cuts, groups: list[LoopGroup]) -> bool:
    """Tell whether these loops move in parallel planes with as many independent constraints as planar loops can have.

    Then the same holds in all neighbouring poses, as axes stay normal to the planes.
    """
    columns = groups[0].columns if len(groups) == 1 else np.concatenate([group.columns for group in groups])
    if cuts.couplings is not None or not len(columns):
        return False
    angular, linear = coordinates.angular.take(columns, axis=1), coordinates.linear.take(columns, axis=1)
    normal = angular[:, np.add.reduce(np.abs(angular)).argmax()]
    length = np.sqrt(normal.dot(normal))
    if not length:
        return False
    normal = normal / length
    if np.count_nonzero(np.abs(normal.dot(linear)) > PARALLEL_AXES):
        return False
    if np.count_nonzero(np.abs(angular - normal[:, None] * normal.dot(angular)) > PARALLEL_AXES):
        return False
    along = cuts.rows.force - normal[:, None] * normal.dot(cuts.rows.force)
    acts = np.maximum.reduce(np.abs(along)) > PARALLEL_AXES
    acts |= np.abs(normal.dot(cuts.rows.moment)) > PARALLEL_AXES
    return all(np.count_nonzero(acts.take(group.rows)) == group.rank for group in groups)


def phi_nearby(
    topology: Topology, coordinates: Twists, cuts: Cuts, reduction: Reduction, position: Array,
    crossing: list[tuple[int, Array, Array]], rods: list[Rod],
) -> Array:  # fmt: skip
    """Return the constraints Phi (..., locked rows, n) of the loops in a neighbouring pose, which the mechanism reaches
    to first order.

    ``position`` (..., bodies, 3): centres of mass [m], world axes. ``crossing``, ``rods``: results of
    ``crossing_axes``, with axes (3,) or (3, variants), and of ``rods_in_loops``.
    """
    matrix = reduction.matrix
    assert matrix is not None
    # a direction without any symmetry of the mechanism
    direction = matrix @ np.cos(1.0 + np.arange(matrix.shape[-1]))
    length = min(group.length for group in reduction.groups if group.surplus)
    largest = (np.abs(direction) / np.where(coordinates.turns, 1.0, length)).max(axis=-1, keepdims=True, initial=1e-300)
    motion = body_motion(coordinates, position) @ (NEIGHBOUR_STEP / largest * direction)[..., None, :, None]
    displacement = np.concatenate((motion[..., 0], np.zeros((*motion.shape[:-3], 1, 6))), axis=-2)
    centre = np.concatenate((position, np.zeros((*position.shape[:-2], 1, 3))), axis=-2)
    small = SmallMotion(*(np.moveaxis(array, -1, 0) for array in (
        displacement[..., :3], displacement[..., 3:], centre)))  # fmt: skip
    twist = coordinates.linear, coordinates.angular, coordinates.point
    (linear, angular, point), cuts = small.applied(topology, twist, cuts, crossing, rods)
    twists = replace(coordinates, linear=linear, angular=angular, point=point)
    phi = relative_motion(twists, cuts.rows).dense(0, len(cuts.rows.first))
    if cuts.couplings is None:
        return phi
    coupled = cuts.couplings.dense(twists)
    lead = max(phi.shape[:-2], coupled.shape[:-2], key=len)
    return np.concatenate([np.broadcast_to(part, (*lead, *part.shape[-2:])) for part in (phi, coupled)], axis=-2)


@dataclass(frozen=True, slots=True)
class SmallMotion:
    """A motion of bodies to first order: ``translation`` and ``rotation`` of bodies and ground with the centres of mass
    ``centre`` [m], arrays (3, bodies + 1) or (3, variants, bodies + 1).
    """

    translation: Array
    rotation: Array
    centre: Array

    def turn(self, body: Index, vector: Array) -> Array:
        """Return vectors that turn with bodies."""
        return added(vector, crossed_product(self.rotation[..., body], vector))

    def shift(self, body: Index, point: Array) -> Array:
        """Return points that move with bodies."""
        arm = added(point, -self.centre[..., body])
        return added(added(point, self.translation[..., body]), crossed_product(self.rotation[..., body], arm))

    def applied(
        self, topology: Topology, twist: tuple[Array, Array, Array], cuts: Cuts,
        crossing: list[tuple[int, Array, Array]], rods: list[Rod],
    ) -> tuple[tuple[Array, Array, Array], Cuts]:  # fmt: skip
        """Return twists (linear, angular, point) of the joint coordinates and the rows of cut joints after the motion.

        ``crossing``, ``rods``: as in ``phi_nearby``.
        """
        (carrier, second_carrier, holder), rows = _carriers(topology), cuts.rows
        linear, force = self.turn(carrier, twist[0]), self.turn(rows.first, rows.force)
        # components of a rotation vector turn with the mean of both bodies; for a single axis this makes no difference
        angular, moment = (0.5 * (self.turn(a, axes) + self.turn(b, axes)) for a, b, axes in (
            (carrier, second_carrier, twist[1]), (rows.first, rows.second, rows.moment)))  # fmt: skip
        for rod in rods:
            line = added(self.shift(rod.second, rod.end), -self.shift(rod.first, rod.start))
            line = line / np.sqrt((line * line).sum(axis=0))
            force[..., rod.row] = line
            across = linear[..., rod.column]
            linear[..., rod.column] = added(across, -(added(0.0 * line, across) * line).sum(axis=0) * line)
        for row, first, second in crossing:
            at = slice(row, row + 1)
            axes = self.turn(rows.first[at], first[..., None]), self.turn(rows.second[at], second[..., None])
            moment[..., at] = crossed_product(*axes)
        moved = replace(rows, point=self.shift(rows.second, rows.point), force=force, moment=moment)
        couplings = None if cuts.couplings is None else cuts.couplings.nearby(self.turn, self.shift)
        return (linear, angular, self.shift(holder, twist[2])), replace(cuts, rows=moved, couplings=couplings)


def added(a: Array, b: Array) -> Array:
    """Return the sum of vectors (3, n), either of them with an axis of variants (3, variants, n)."""
    if a.ndim == b.ndim:
        return a + b
    return a[:, None] + b if a.ndim < b.ndim else a + b[:, None]


def crossed_product(a: Array, b: Array) -> Array:
    """Return a x b of vectors (3, n), either of them with an axis of variants (3, variants, n)."""
    if a.ndim != b.ndim:
        a, b = (a[:, None], b) if a.ndim < b.ndim else (a, b[:, None])
    a, b = a.take(CYCLE, axis=0), b.take(CYCLE, axis=0)
    result: Array = a[1:4] * b[2:]
    result -= a[2:] * b[1:4]
    return result


def _carriers(topology: Topology) -> tuple[Index, Index, Index]:
    """The bodies of each twist: the one in which it is fixed, the one with which its axis turns halfway, and the one
    that carries its point.

    A twist is fixed in the joint's first body, the second of two successive rotations in its second one. The point
    moves with the second body, which turns about it after any sliding.
    """
    number = topology.body_numbers
    carriers: list[int] = []
    second_carrier: list[int] = []
    holder: list[int] = []
    for branch in sorted((b for b in topology.branches if b.joint != FLOATS), key=lambda b: b.joint):
        joint = topology.joints[branch.joint]
        for name, _ in joint.freedom:
            second = joint.successive and name == joint.freedom[-1][0]
            carriers.append(number[joint.second if second else joint.first])
            second_carrier.append(carriers[-1] if joint.successive else number[joint.second])
            holder.append(number[joint.second])
    ground = [number["ground"]] * (6 * len(topology.floating))
    carrier, other, point = (np.array(bodies + ground, dtype=np.intp) for bodies in (carriers, second_carrier, holder))
    return carrier, other, point


def rods_in_loops(topology: Topology, coordinates: Any, cuts: Cuts) -> list[Rod]:
    """Return the rods of distance joints, in the tree or cut; ``coordinates`` have the ``names`` of those of joints.
    """
    if not any(joint.is_rod for joint in topology.joints):
        return []
    number, column_of = topology.body_numbers, {name: k for k, name in enumerate(coordinates.names)}
    cut = {k: count for count, k in enumerate(topology.cut)}
    result = []
    for k, joint in enumerate(topology.joints):
        if joint.is_rod:
            row, column = slice(0), slice(0)
            if k in cut:
                row = slice(*cuts.joint.searchsorted((cut[k], cut[k] + 1)).tolist())
            else:
                start_of = column_of[f"{joint.name}.x"]
                column = slice(start_of, start_of + 2)
            start, end = (np.array(value)[:, None] for value in (joint.position, joint.end))
            result.append(Rod(np.array([number[joint.first]]), np.array([number[joint.second]]), start, end, row,
                              column))  # fmt: skip
    return result


def crossing_axes(topology: Topology, cuts: Cuts) -> list[tuple[int, Array, Array]]:
    """Return the locked rotations that are normal to an axis of each body: (row, axis in first, axis in second)."""
    result = []
    for count, k in enumerate(topology.cut):
        if topology.joints[k].successive:
            rows = np.arange(*cuts.joint.searchsorted((count, count + 1)).tolist())
            row = int(rows[_turns(cuts, rows)][0])
            (_, first), (_, second) = topology.joints[k].freedom[-2:]
            result.append((row, np.array(first[3:]), np.array(second[3:])))
    return result


def _turns(cuts: Cuts, rows: Index) -> NDArray[np.bool_]:
    moment = cuts.rows.moment[..., rows]
    return np.asarray(moment.any(axis=tuple(range(moment.ndim - 1))))
