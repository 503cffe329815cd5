"""The forces at the pose of a loaded scene, collected from its equations."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from mbsvib.linalg.rotations import logarithm
from mbsvib.sensitivities.displaced_bodies import displaced
from mbsvib.sensitivities.forces import Forces

if TYPE_CHECKING:
    from collections.abc import Sequence

    from mbsvib.common.arrays import Array
    from mbsvib.elements import Body, Joint
    from mbsvib.equations.equations import Equations
    from mbsvib.sensitivities.network import Network


def forces_at_rest(system: Equations, network: Network) -> Forces:
    """Return the forces at the pose of a system: those in joints and springs, of gravity and of loads."""
    statics, loads, point, gravity = system.provenance.statics, network.loads, network.point, network.gravity
    bodies, joints, springs, number = network.bodies, network.joints, network.springs, network.body_number
    ground, j = len(bodies), len(joints)
    connections: tuple[Any, ...] = (*joints, *springs)
    n = len(connections) + len(bodies) + len(loads)
    wrench, points, span, axes = np.zeros((n, 6)), np.zeros((n, 3)), np.zeros((n, 3)), np.zeros((n, 2, 3))
    first, second = np.full(n, ground), np.empty(n, dtype=np.intp)
    first[: len(connections)] = [number[part.first] for part in connections]
    second[:] = [*(number[part.second] for part in connections), *range(ground), *(number[p.body] for p in loads)]
    first[first < 0], second[second < 0] = ground, ground
    points[: len(connections)] = point
    halves = np.array([k for k, joint in enumerate(joints) if joint.bisects], dtype=np.intp)
    for k, joint in enumerate(joints):
        if statics is not None:
            at = statics.pairs.end[:, len(statics.applied.names) + k]
            wrench[k] = statics.joints[:, k]
            wrench[k, 3:] += np.cross(at - points[k], wrench[k, :3])
        if joint.end is not None:
            span[k] = np.subtract(joint.end, joint.position or np.zeros(3))
        if joint.successive:
            axes[k] = [six[3:] for _, six in joint.freedom[-2:]]
    for k, spring in enumerate(springs, j):
        wrench[k] = spring.rest_wrench
        if spring.points:
            points[k] = spring.points[-1]
        if spring.acts_along_line:
            span[k] = np.subtract(spring.points[-1], spring.points[0])
    for k, body in enumerate(bodies, len(connections)):
        points[k], wrench[k, :3] = body.position, body.mass * gravity
    for k, load in enumerate(loads, len(connections) + len(bodies)):
        points[k] = bodies[number[load.body]].position if load.position is None else load.position
        wrench[k] = *load.force, *load.torque
    follows = np.array([load.follower for load in loads], dtype=bool)
    every = np.arange(n - len(loads), n)
    angle = _angles(system, bodies, [joints[k] for k in halves])
    centre = np.array([body.position for body in bodies])
    return Forces(first, second, points, wrench, span, axes, halves, angle, centre,
                  (j, len(springs), ground, len(loads)), gravity, every[~follows], every[follows])  # fmt: skip


def _angles(system: Equations, bodies: Sequence[Body], joints: Sequence[Joint]) -> Array:
    """The rotation vectors (joints, 3) by which joints turned on the way to the equilibrium, world axes there."""
    provenance, angle = system.provenance, np.zeros((len(joints), 3))
    if provenance.moved_to_equilibrium and provenance.origin is not None:
        pose = displaced(provenance.origin, bodies)
        for k, joint in enumerate(joints):
            first, second = (pose.rotations[pose.number[body]] for body in (joint.first, joint.second))
            angle[k] = logarithm(second @ first.T)
    return angle
