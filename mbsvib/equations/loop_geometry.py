"""Groups of loops by themselves: their closure, their degrees of freedom, and joints turned into line."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from mbsvib.common.arrays import Array
from mbsvib.elements import Joint
from mbsvib.elements import joint as _joint
from mbsvib.equations.scene import twists_and_cuts
from mbsvib.kinematics.couplers import locked
from mbsvib.linalg.rank import ALIGNED, ALMOST_ALIGNED
from mbsvib.linalg.rotations import exponential
from mbsvib.mechanism.mechanism import Mechanism
from mbsvib.mechanism.topology import span

# Names of coordinates in a message.
LISTED = 6


@dataclass(frozen=True, slots=True)
class Loops:
    """A group of loops of a ``model`` without other parts; ``length`` [m] is its unit of length."""

    model: Mechanism
    length: float

    def with_joints(self, joints: Iterable[Joint]) -> Loops:
        """Return the same with other joints in place of those of the same name."""
        return replace(self, model=self.model.with_parts(
            joints=dict(self.model.joints) | {joint.name: joint for joint in joints}))  # fmt: skip

    def closure(self) -> tuple[Array, tuple[str, ...], int]:
        """Return the scaled Phi, the names of its coordinates, and how many of these are of floating bodies."""
        model, topology, bodies = self.model, span(self.model), list(self.model.bodies.values())
        coordinates, cuts = twists_and_cuts(topology, bodies, tuple(model.couplers.values()))
        floating, n = 6 * len(topology.floating), len(coordinates.names)
        if cuts is None:
            return np.zeros((0, n)), coordinates.names, floating
        scale = np.where(coordinates.turns, 1.0, self.length)
        return locked(coordinates, cuts) * cuts.row_scale(self.length)[:, None] * scale, coordinates.names, floating

    def freedom(self, limit: float) -> int:
        """Return the number of degrees of freedom, with singular values up to a limit as zero."""
        phi, names, floating = self.closure()
        return len(names) - floating - int(np.count_nonzero(np.linalg.svd(phi, compute_uv=False) > limit))

    def locked_motion(self, aligned: Loops, limit: float) -> list[str]:
        """Return the coordinates that move most in what the loops lock and others, in line, do not."""
        phi, names, _ = aligned.closure()
        _, values, rows = np.linalg.svd(phi)
        free = rows[int(np.count_nonzero(values > limit)) :]
        motion = np.abs(np.linalg.svd(self.closure()[0] @ free.T)[2][0] @ free)
        return [names[k] for k in np.argsort(-motion, kind="stable")[:LISTED] if motion[k] > ALMOST_ALIGNED]


def loops_of(model: Mechanism, closing: Iterable[str], names: Sequence[str], length: float) -> Loops:
    """Return a group of loops by itself.

    ``closing``: joints and couplers that close them; ``names``: their coordinates; ``length``: the unit of length [m].
    """
    closing = set(closing)
    couplers = {part.name: part for part in model.couplers.values() if part.name in closing}
    names = [*names, *(name for part in couplers.values() for name, _ in part.terms)]
    members = {*closing, *(name.rpartition(".")[0] for name in names)}
    joints = {joint.name: joint for joint in model.joints.values() if joint.name in members or not joint.freedom}
    bodies = {body for joint in joints.values() for body in (joint.first, joint.second)}
    part = model.with_parts(
        bodies={name: body for name, body in model.bodies.items() if name in bodies}, joints=joints, springs={},
        composed={}, loads={}, inputs={}, outputs={}, gravity=None, couplers=couplers, expansion=None,
    )
    return Loops(part, length)


def different(directions: list[Array]) -> list[Array]:
    """Directions of which no two are parallel."""
    result: list[Array] = []
    for direction in directions:
        if not any(np.linalg.norm(np.cross(direction, other)) < ALIGNED for other in result):
            result.append(direction)
    return result


def directions(joint: Joint) -> list[Array]:
    """The axes that matter for what a joint locks: of one rotation or translation, or normal to two."""
    if joint.is_rod:
        return []
    result: list[Array] = []
    turns = [np.array(axis) for axis in joint.rotation_axes]
    slides = [np.array(six[:3]) for name, six in joint.freedom if name[0] != "r"]
    for some, successive in ((turns, joint.successive), (slides, False)):
        if len(some) == 2:
            result += some if successive else [np.cross(some[0], some[1])]
        elif len(some) == 1:
            result += some
    return different(result)


def in_line(joint: Joint, reference: Array, tolerance: float = ALMOST_ALIGNED) -> tuple[Joint, float]:
    """The joint turned so that its axes are along or across a direction, where they nearly are; and the angle [rad]."""
    largest = 0.0
    for k in range(len(directions(joint))):
        direction = directions(joint)[k]
        along = float(direction @ reference)
        across = direction - along * reference
        off = float(np.linalg.norm(across))
        if off < tolerance:
            target = np.copysign(1.0, along) * reference
        elif abs(along) < tolerance:
            target, off = across / off, abs(along)
        else:
            continue
        normal = np.cross(direction, target)
        sine = float(np.linalg.norm(normal))
        if off > ALIGNED and sine > 0.0:
            joint = turned(joint, exponential(normal / sine * np.arcsin(min(1.0, sine))))
            largest = max(largest, float(np.arcsin(min(1.0, sine))))
    return joint, largest


def turned(joint: Joint, rotation: Array) -> Joint:
    """The joint with all its axes turned about its point."""
    if joint.successive and joint.free is None:
        first, second = (tuple((rotation @ np.array(axis)).tolist()) for axis in joint.rotation_axes)
        return _joint.moved_joint(joint, joint.position, axis=first, axis2=second)
    x, y, z = (rotation @ np.array(joint.axes)).tolist()
    return _joint.moved_joint(joint, joint.position, axes=(tuple(x), tuple(y), tuple(z)))
