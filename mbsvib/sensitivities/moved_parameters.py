"""How parameters and forces follow the bodies as these move: points and axes go with the bodies that carry them."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from mbsvib.elements import Bushing, Load
from mbsvib.equilibrium.joints import ALONG_AXIS
from mbsvib.linalg.vectors import cross, wide
from mbsvib.sensitivities.network import maxwell_lines
from mbsvib.sensitivities.rule_terms import line_turn_rates

if TYPE_CHECKING:
    from mbsvib.common.arrays import Array
    from mbsvib.elements import Joint
    from mbsvib.sensitivities.force_changes import ForceChanges
    from mbsvib.sensitivities.forces import Forces
    from mbsvib.sensitivities.network import Network


def parameter_rates(network: Network, forces: Forces, changes: ForceChanges, motion: Array) -> Array:
    """Return how parameters change as bodies move, as those of a model do that is described in the new pose.

    ``motion`` (bodies, 6, c): motions at the centres of mass. Returns (parameters, c): changes of the parameters.
    """
    result = np.zeros((changes.count, motion.shape[2]))
    first, relative = forces.seen(motion)
    second = first + relative
    start = first[:, :3] - cross(first[:, 3:], wide(forces.span, first))
    axes = first[:, 3:] + forces.turned_axes(relative)
    joints = forces.counts[0]

    def put(part: str, field: str, value: Array) -> None:
        for i in range(3 if (part, field, (0,)) in changes.row else 0):  # nodes of Maxwell elements have no parameters
            result[changes.row[part, field, (i,)]] = value[i]

    for k, body in enumerate(network.bodies):
        put(body.name, "position", motion[k, :3])
        put(body.name, "orientation", motion[k, 3:])
    for k, joint in enumerate(network.joints):
        if joint.end is not None:
            put(joint.name, "position", start[k])
            put(joint.name, "end", second[k, :3])
            continue
        put(joint.name, "position", second[k, :3])
        put(joint.name, "orientation", _by_axis(joint, axes[k]))
    for k, spring in enumerate(network.springs, joints):
        if isinstance(spring, Bushing):
            put(spring.name, "position", second[k, :3])
            put(spring.name, "orientation", axes[k])
        else:
            put(spring.name, "start", start[k])
            put(spring.name, "end", second[k, :3])
    for maxwell, k in maxwell_lines(network):
        put(maxwell, "start", start[joints + k])
        put(maxwell, "end", second[joints + k, :3])
    for k, load in zip(forces.loads, (part for part in network.parts if isinstance(part, Load)), strict=True):
        if load.position is not None:
            put(load.name, "position", second[k, :3])
    return result


def _by_axis(joint: Joint, turn: Array) -> Array:
    """How the axes of a joint turn with its first body (3, c): where it is given by its axis, they are those that the
    axis gives in each pose.
    """
    if joint.axis is None or joint.kind not in ALONG_AXIS:
        return turn
    line = np.array(joint.axes)[:, 2]
    return np.asarray(line_turn_rates(line[None])[0].T @ np.cross(turn, line, axisa=0).T)


def force_rates(network: Network, forces: Forces, changes: ForceChanges, motion: Array) -> Array:
    """Return how forces change as bodies move, beyond what parameters say of it: springs by their stiffness, bushings
    by the turn between their bodies, followers with theirs.

    ``motion`` (bodies, 6, c): motions at the centres of mass. Returns (e, c): changes of the forces.
    """
    relative, joints, at = forces.seen(motion)[1], forces.counts[0], changes.at
    result = np.zeros((at.size, motion.shape[2]))
    for k, spring in enumerate(network.springs, joints):
        own, place = relative[k], slice(at.wrench_of(k), at.wrench_of(k) + 6)
        if isinstance(spring, Bushing):
            result[place] = -network.stiffness[k - joints] @ own
            moment = forces.wrench[k, 3:]
            result[place.start + 3 : place.stop] += 0.5 * np.cross(own[3:], moment, axisa=0).T
        elif spring.free_length is None:
            line = np.array(spring.line)
            result[place.start : place.start + 3] = -spring.stiffness * np.multiply.outer(line, line @ own[:3])
    result[at.twist] = relative[forces.bushings, 3:].reshape(3 * len(forces.bushings), relative.shape[2])
    for k in forces.follower.tolist():
        turned = np.cross(relative[k, 3:], forces.wrench[k].reshape(2, 1, 3), axisa=0)
        result[at.wrench_of(k) : at.wrench_of(k) + 6] = turned.transpose(0, 2, 1).reshape(6, -1)
    return result
