"""The forces at the pose of a loaded scene, collected from its equations."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from mbsvib.elements import Bushing, Load
from mbsvib.elements.load import Gravity
from mbsvib.linalg.rotations import logarithm
from mbsvib.sensitivities.displaced_bodies import Displaced
from mbsvib.sensitivities.forces import Forces

if TYPE_CHECKING:
    from collections.abc import Sequence

    from mbsvib.common.arrays import Array
    from mbsvib.elements import Body, Joint, Spring
    from mbsvib.equations.equations import Equations


def forces_at_rest(
    system: Equations, bodies: Sequence[Body], joints: Sequence[Joint], springs: Sequence[Bushing | Spring],
    number: dict[str, int], point: Array,
) -> Forces:  # fmt: skip
    """Return the forces at the pose of a system.

    Parameters
    ----------
    system : Equations
        The equations of motion of a loaded scene.
    bodies, joints, springs : sequence
        Its network.
    number : dict
        Number of each body, ground included.
    point : array, shape (joints + springs, 3)
        Points of the connections.

    Returns
    -------
    Forces
        In joints, springs, of gravity and loads.
    """
    statics, parts = system.provenance.statics, system.provenance.parts
    assert statics is not None
    gravity = next((np.array(part.acceleration) for part in parts if isinstance(part, Gravity)), np.zeros(3))
    loads = [part for part in parts if isinstance(part, Load)]
    ground, j = len(bodies), len(joints)
    connections = (*joints, *springs)
    n = len(connections) + len(bodies) + len(loads)
    wrench, place, span, axes = np.zeros((n, 6)), np.zeros((n, 3)), np.zeros((n, 3)), np.zeros((n, 2, 3))
    first, second = np.full(n, ground), np.empty(n, dtype=np.intp)
    first[: len(connections)] = [number[part.first] for part in connections]
    second[:] = [*(number[part.second] for part in connections), *range(ground), *(number[p.body] for p in loads)]
    place[: len(connections)] = point
    halves = np.array([k for k, joint in enumerate(joints) if joint.kind == "homokinetic"], dtype=np.intp)
    for k, joint in enumerate(joints):
        at = statics.pairs.end[:, len(statics.applied.names) + k]
        wrench[k] = statics.joints[:, k]
        wrench[k, 3:] += np.cross(at - place[k], wrench[k, :3])
        if joint.end is not None:
            span[k] = np.subtract(joint.end, joint.position or np.zeros(3))
        if joint.successive:
            axes[k] = [six[3:] for _, six in joint.freedom[-2:]]
    for k, spring in enumerate(springs, j):
        if isinstance(spring, Bushing):
            own = np.array(spring.preload or np.zeros(6)).reshape(2, 3)
            wrench[k] = (own @ np.array(spring.orientation).T).reshape(6)
        else:
            place[k], span[k] = spring.end, np.subtract(spring.end, spring.start)
            wrench[k, :3] = -spring.tension * np.array(spring.line)
    for k, body in enumerate(bodies, len(connections)):
        place[k], wrench[k, :3] = body.position, body.mass * gravity
    for k, load in enumerate(loads, len(connections) + len(bodies)):
        place[k] = bodies[number[load.body]].position if load.position is None else load.position
        wrench[k] = *load.force, *load.torque
    follows = np.array([load.follower for load in loads], dtype=bool)
    every = np.arange(n - len(loads), n)
    angle = _angles(system, bodies, [joints[k] for k in halves])
    return Forces(first, second, place, wrench, span, axes, halves, angle, np.array([body.position for body in bodies]),
                  (j, len(springs), ground, len(loads)), gravity, every[~follows], every[follows])  # fmt: skip


def _angles(system: Equations, bodies: Sequence[Body], joints: Sequence[Joint]) -> Array:
    """The rotation vectors (joints, 3) by which joints turned on the way to the equilibrium, world axes there."""
    came, angle = system.provenance, np.zeros((len(joints), 3))
    if came.settled and came.origin is not None:
        pose = Displaced(came.origin, {body.name: body for body in bodies})
        for k, joint in enumerate(joints):
            angle[k] = logarithm(pose.turn(joint.second) @ pose.turn(joint.first).T)
    return angle
