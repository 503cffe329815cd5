"""Scenes that found their equilibrium elsewhere: what parameters of the model as described do to it in the pose there.

There a part is described by what its body carried along, so that changes dp of points and axes arrive as R dp, R the
turn of the body. What joins two bodies is carried by both: where these turn differently, by R_a and R_b, joints come
apart by (R_a - R_b) dp, and their bodies have to follow. Springs keep their law, so that what changes their length as
described changes their tension there.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from scipy.sparse import csr_array

from mbsvib.elements import Bushing, Spring
from mbsvib.elements.torsion_spring import TorsionSpring
from mbsvib.linalg.rotations import quaternion
from mbsvib.sensitivities.displaced_bodies import Displaced, turned
from mbsvib.sensitivities.force_changes import RowTerms

if TYPE_CHECKING:
    from collections.abc import Callable

    from mbsvib.common.arrays import Array
    from mbsvib.elements import Joint
    from mbsvib.mechanism.mechanism import Mechanism
    from mbsvib.mechanism.parameters import Parameter
    from mbsvib.sensitivities.force_changes import ForceChanges
    from mbsvib.sensitivities.forces import Forces
    from mbsvib.sensitivities.network import Network

    Follows = Callable[[str, str, Array], None]

@dataclass(frozen=True)
class ReferencePose:
    """What p parameters as described change in the pose there: parameters by ``rates`` (p, p), forces by ``forces``
    (p, e) beside these, and joints come apart by ``openings`` (p, 6 joints) at their points. Bushings ``turned`` are
    those whose bodies turned against each other.
    """

    rates: csr_array
    forces: csr_array
    openings: csr_array
    turned: frozenset[str]

    def covers(self, entry: Parameter) -> bool:
        """Tell whether it is known what a parameter does: all but what ``turned`` bushings do about axes."""
        return entry.part not in self.turned or max(entry.index, default=0) < 3


def reference_pose(network: Network, forces: Forces, changes: ForceChanges, origin: Mechanism) -> ReferencePose:
    """Return what parameters as described do in the pose there."""
    pose = Displaced(origin, {body.name: body for body in network.bodies})
    parameter_terms, force_terms, openings = (RowTerms(changes.row, changes.at) for _ in range(3))
    known = set()

    def follows(part: str, field: str, turn: Array) -> None:
        for i in range(3):
            known.add((part, field, (i,)))
            for j in range(3):
                parameter_terms.put((part, field, (i,)), changes.row[part, field, (j,)], (turn[j, i],))

    for body in network.bodies:
        for field in ("position", "orientation"):
            follows(body.name, field, pose.turn(body.name))
    for k, joint in enumerate(network.joints):
        put = _joint if joint.end is None else _rod
        put(follows, openings, k, origin.joints[joint.name], joint, pose)
    away = np.zeros((len(forces.first), 6, 3))
    for k, joint in enumerate(network.joints):
        away[k, 3:] = pose.turn(joint.second) - pose.turn(joint.first)
    turned_axes = forces.turned_axes(away)
    for k in (*forces.twice.tolist(), *forces.halves.tolist()):
        for i in range(3):
            for j in range(3):
                name = network.joints[k].name
                row = changes.row[name, "orientation", (j,)]
                parameter_terms.put((name, "orientation", (i,)), row, (turned_axes[k, j, i],))
    for k, spring in enumerate(network.springs, len(network.joints)):
        turns, column = (pose.turn(spring.first), pose.turn(spring.second)), changes.at.wrench_of(k)
        described: Any = origin.springs[spring.name]
        if isinstance(described, TorsionSpring):
            force_terms.put((spring.name, "stiffness", ()), column + 3, _moment_rate(described, *turns))
        elif isinstance(spring, Bushing):
            follows(spring.name, "position", turns[1])
            follows(spring.name, "orientation", turns[0])
            gap = pose.point(spring.second, described.position) - pose.point(spring.first, described.position)
            _bushing(force_terms, spring, column, network.stiffness[k - len(network.joints)], turns, gap)
        else:
            follows(spring.name, "start", turns[0])
            follows(spring.name, "end", turns[1])
            if isinstance(spring, Spring) and spring.free_length is None:
                _spring(force_terms, spring, described, column, turns)
    for load in network.loads:
        turn = pose.turn(load.body)
        for field in ("force", "torque") if load.follower else ():
            follows(load.name, field, turn)
        if load.position is not None:
            follows(load.name, "position", turn)
    for key, row in changes.row.items():
        if key not in known:
            parameter_terms.put(key, row, (1.0,))
    return ReferencePose(parameter_terms.matrix(changes.count), force_terms.matrix(changes.at.size),
                         openings.matrix(6 * len(network.joints)), turned(origin, network.parts))  # fmt: skip


def _joint(follows: Follows, openings: RowTerms, k: int, described: Joint, joint: Joint, pose: Displaced) -> None:
    """Both bodies carry its point and axes; how far it has moved along its free directions turns with the first."""
    first, second = pose.turn(joint.first), pose.turn(joint.second)
    at = described.position or (0.0, 0.0, 0.0)  # joints without a point turn nothing: any will do
    gap = pose.point(joint.second, at) - pose.point(joint.first, at)
    follows(joint.name, "orientation", first)
    if described.position is not None:
        follows(joint.name, "position", second)
    for i in range(3):
        if described.position is not None:
            openings.put((joint.name, "position", (i,)), 6 * k, (first - second)[:, i])
        openings.put((joint.name, "orientation", (i,)), 6 * k, np.cross(first[:, i], gap))
        openings.put((joint.name, "orientation", (i,)), 6 * k + 3, (first - second)[:, i])
    if joint.pitch:
        axis = np.array(joint.axes)[:, 2]
        openings.put((joint.name, "pitch", ()), 6 * k, (axis @ gap) / joint.pitch * axis)


def _rod(follows: Follows, openings: RowTerms, k: int, described: Any, joint: Any, pose: Displaced) -> None:
    """It keeps its length as described."""
    before, after = (np.subtract(rod.end, rod.position) for rod in (described, joint))
    before, after = before / np.linalg.norm(before), after / np.linalg.norm(after)
    for field, body, sign in (("position", joint.first, -1.0), ("end", joint.second, 1.0)):
        turn = pose.turn(body)
        follows(joint.name, field, turn)
        for i in range(3):
            openings.put((joint.name, field, (i,)), 6 * k, sign * (before[i] - after @ turn[:, i]) * after)


def _spring(force_terms: RowTerms, spring: Spring, described: Spring, column: int, turns: tuple[Array, Array]) -> None:
    """Its tension there is T + k (L there - L as described)."""
    before, after = np.array(described.line), np.array(spring.line)
    force_terms.put((spring.name, "stiffness", ()), column, -(spring.length - described.length) * after)
    for field, turn, sign in (("start", turns[0], -1.0), ("end", turns[1], 1.0)):
        for i in range(3):
            change = sign * spring.stiffness * (after @ turn[:, i] - before[i])
            force_terms.put((spring.name, field, (i,)), column, -change * after)


def _moment_rate(described: TorsionSpring, first: Array, second: Array) -> Array:
    """Its moment there is its preload less stiffness times its angle, about the axis that its first body carries."""
    w, vector = quaternion(first.T @ second)
    return np.asarray(-2.0 * np.arctan2(np.dot(vector, described.axis), w) * (first @ described.axis))


def _bushing(
    force_terms: RowTerms, bushing: Bushing, column: int, stiffness: Array, turns: tuple[Array, Array], gap: Array
) -> None:
    """Its force there is its preload less stiffness times how far it has been moved, in axes of the first body."""
    axes = np.array(bushing.orientation)
    for i in range(3):
        moved = stiffness[:, :3] @ (turns[1] - turns[0])[:, i]
        force_terms.put((bushing.name, "position", (i,)), column, -moved)
        back = stiffness[:, :3] @ np.cross(turns[0][:, i], gap)
        force_terms.put((bushing.name, "orientation", (i,)), column, back)
    local = np.concatenate((axes.T @ gap, np.zeros(3)))
    full = isinstance(bushing.stiffness[0], tuple)
    for i in range(6):
        for j in range(i, 6) if full else (i,):
            force = np.zeros(6)
            force[i] = -local[j]
            force[j] = -local[i]
            in_world = (force.reshape(2, 3) @ axes.T).reshape(6)
            force_terms.put((bushing.name, "stiffness", (i, j) if full else (i,)), column, in_world)
