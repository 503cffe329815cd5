"""What parameters change of the forces at the pose, and how they follow the bodies as the pose moves."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from scipy.sparse import csr_array

from mbsvib.parts import Bushing, Load, Spring
from mbsvib.parts.load import Gravity
from mbsvib.sensitivities.vectors import cross, wide

if TYPE_CHECKING:
    from collections.abc import Sequence

    from mbsvib.kinematics import Array, Index
    from mbsvib.parameters import Parameter
    from mbsvib.parts._part import Part
    from mbsvib.sensitivities.forces import Forces
    from mbsvib.sensitivities.network import Network


@dataclass(frozen=True, slots=True)
class Extras:
    """Where derivatives to what is no parameter stand in one long row: to the ``point`` of each force, the ``start`` of
    each line, the ``wrench`` of each applied force, a ``turn`` of each joint with two free rotations, and a ``twist`` of
    the second body of each bushing.
    """

    point: slice
    start: slice
    wrench: slice
    turn: slice
    twist: slice

    @property
    def size(self) -> int:
        """Length of the row."""
        return int(self.twist.stop)


@dataclass(frozen=True)
class Links:
    """How p parameters act on what is no parameter, which stands ``at`` its place in a row of e numbers.

    ``matrix`` (p, e) leads from parameters to it. As the pose moves along a coordinate, parameters change by ``carried``
    (p, m) and the rest by ``shifted`` (e, m) beyond what these parameters do. ``fields`` are the numbers of the
    parameters of each field of each kind of part.
    """

    count: int
    at: Extras
    matrix: csr_array
    carried: Array
    shifted: Array
    fields: tuple[Index, ...]


class _Places:
    """Places of parameters and of what is none, and the terms that join them."""

    def __init__(self, entries: Sequence[Parameter], forces: Forces) -> None:
        self.row = {(entry.part, entry.field, entry.index): k for k, entry in enumerate(entries)}
        joints = forces.counts[0]
        sizes = (3 * len(forces.first), 3 * len(forces.lines), 6 * (len(forces.first) - joints),
                 3 * len(forces.twice), 3 * len(forces.bushings))  # fmt: skip
        ends = np.cumsum(sizes).tolist()
        self.at = Extras(*(slice(end - size, end) for size, end in zip(sizes, ends, strict=True)))
        self._joints, self._line = joints, {k: i for i, k in enumerate(forces.lines.tolist())}
        self._terms: list[tuple[int, int, float]] = []

    def point(self, force: int) -> int:
        return int(self.at.point.start) + 3 * force

    def start(self, force: int) -> int:
        return int(self.at.start.start) + 3 * self._line[force]

    def wrench(self, force: int) -> int:
        return int(self.at.wrench.start) + 6 * (force - self._joints)

    def put(self, row: int, place: int, vector: Sequence[float] | Array) -> None:
        """Let a parameter change the numbers from a place on."""
        self._terms += [(row, place + i, float(value)) for i, value in enumerate(vector) if value != 0.0]

    def along(self, part: str, field: str, place: int) -> None:
        """Let the three entries of a field change the three numbers from a place on."""
        for i in range(3):
            self.put(self.row[part, field, (i,)], place + i, (1.0,))

    def matrix(self) -> csr_array:
        row, column, value = zip(*self._terms, strict=True) if self._terms else ((), (), ())
        return csr_array((value, (row, column)), shape=(len(self.row), self.at.size))


def links(network: Network, forces: Forces, entries: Sequence[Parameter]) -> Links:
    """Return what parameters change of the forces at the pose, and how they follow it.

    Parameters
    ----------
    network : Network
        Bodies and connections.
    forces : Forces
        The forces.
    entries : sequence of Parameter
        All parameters.

    Returns
    -------
    Links
        Both as matrices.
    """
    places = _Places(entries, forces)
    parts: dict[str, Part] = {part.name: part for part in network.parts}
    number = {body.name: k for k, body in enumerate(network.bodies)}
    joints, springs, bodies, _ = forces.counts
    weight = joints + springs
    for k, joint in enumerate(network.joints):
        if joint.end is not None:
            places.along(joint.name, "position", places.start(k))
            places.along(joint.name, "end", places.point(k))
        elif joint.position is not None:
            places.along(joint.name, "position", places.point(k))
    for i, k in enumerate(forces.twice.tolist()):
        places.along(network.joints[k].name, "orientation", int(places.at.turn.start) + 3 * i)
    for k, spring in enumerate(network.springs, joints):
        (_bushing if isinstance(spring, Bushing) else _spring)(places, spring, k)  # type: ignore[operator]
    for k, body in enumerate(network.bodies):
        places.along(body.name, "position", places.point(weight + k))
        places.put(places.row[body.name, "mass", ()], places.wrench(weight + k), forces.gravity)
        for i in range(3 if any(isinstance(part, Gravity) for part in network.parts) else 0):
            places.put(places.row["gravity", "", (i,)], places.wrench(weight + k) + i, (body.mass,))
    loads = [part for part in network.parts if isinstance(part, Load)]
    for k, load in enumerate(loads, weight + bodies):
        places.along(load.name, "force", places.wrench(k))
        places.along(load.name, "torque", places.wrench(k) + 3)
        owner = (load.body, "position") if load.position is None else (load.name, "position")
        places.along(*owner, places.point(k))
    groups: dict[tuple[type, str], list[int]] = {}
    for row, entry in enumerate(entries):
        groups.setdefault((type(parts[entry.part]), entry.field), []).append(row)
    motion = network.displacements.reshape(bodies, 6, -1)
    seen = forces.seen(motion)
    return Links(
        len(entries), places.at, places.matrix(), _carried(network, forces, places, motion, seen, number, loads),
        _shifted(network, forces, places, seen, loads),
        tuple(np.array(rows, dtype=np.intp) for rows in groups.values()),
    )  # fmt: skip


def _spring(places: _Places, spring: Spring, k: int) -> None:
    """Its force is -T e on the second body, with T as given, or k (L - L0)."""
    places.along(spring.name, "start", places.start(k))
    places.along(spring.name, "end", places.point(k))
    line, place = np.array(spring.line), places.wrench(k)
    if spring.free_length is None:
        if spring.preload is not None:
            places.put(places.row[spring.name, "preload", ()], place, -line)
        return
    places.put(places.row[spring.name, "stiffness", ()], place, (spring.free_length - spring.length) * line)
    places.put(places.row[spring.name, "free_length", ()], place, spring.stiffness * line)
    for i in range(3):
        for field, sign in (("start", 1.0), ("end", -1.0)):
            places.put(places.row[spring.name, field, (i,)], place, sign * spring.stiffness * line[i] * line)


def _bushing(places: _Places, bushing: Bushing, k: int) -> None:
    """Its wrench is its preload, in axes that turn with its orientation."""
    places.along(bushing.name, "position", places.point(k))
    if bushing.preload is None:
        return
    axes, place = np.array(bushing.orientation), places.wrench(k)
    wrench = np.array(bushing.preload).reshape(2, 3) @ axes.T
    for i in range(6):
        places.put(places.row[bushing.name, "preload", (i,)], place + 3 * (i // 3), axes[:, i % 3])
    for i, unit in enumerate(np.eye(3)):
        places.put(places.row[bushing.name, "orientation", (i,)], place, np.cross(unit, wrench).reshape(6))


def _carried(
    network: Network, forces: Forces, places: _Places, motion: Array, seen: tuple[Array, Array],
    number: dict[str, int], loads: Sequence[Load],
) -> Array:  # fmt: skip
    """How parameters change as the pose moves: points and axes go with the bodies that carry them."""
    result = np.zeros((len(places.row), motion.shape[2]))
    first, relative = seen
    second = first + relative
    start = first[:, :3] - cross(first[:, 3:], wide(forces.span, first))
    axes = first[:, 3:].copy()
    axes[forces.twice] += forces.picked(relative)
    joints = forces.counts[0]

    def put(part: str, field: str, value: Array) -> None:
        for i in range(3):
            result[places.row[part, field, (i,)]] = value[i]

    for body, k in number.items():
        put(body, "position", motion[k, :3])
        put(body, "orientation", motion[k, 3:])
    for k, joint in enumerate(network.joints):
        if joint.end is not None:
            put(joint.name, "position", start[k])
            put(joint.name, "end", second[k, :3])
            continue
        if joint.position is not None:
            put(joint.name, "position", second[k, :3])
        put(joint.name, "orientation", axes[k])
    for k, spring in enumerate(network.springs, joints):
        if isinstance(spring, Bushing):
            put(spring.name, "position", second[k, :3])
            put(spring.name, "orientation", axes[k])
        else:
            put(spring.name, "start", start[k])
            put(spring.name, "end", second[k, :3])
    for k, load in enumerate(loads, len(first) - len(loads)):
        if load.position is not None:
            put(load.name, "position", second[k, :3])
    return result


def _shifted(
    network: Network, forces: Forces, places: _Places, seen: tuple[Array, Array], loads: Sequence[Load]
) -> Array:
    """How forces change as the pose moves, beyond what parameters say of it: springs by their stiffness, bushings by
    the turn between their bodies, followers with their bodies.
    """
    relative, joints = seen[1], forces.counts[0]
    result = np.zeros((places.at.size, relative.shape[2]))
    for k, spring in enumerate(network.springs, joints):
        own, place = relative[k], slice(places.wrench(k), places.wrench(k) + 6)
        if isinstance(spring, Bushing):
            result[place] = -network.stiffness[k - joints] @ own
            moment = forces.wrench[k, 3:]
            result[place.start + 3 : place.stop] += 0.5 * np.cross(own[3:], moment, axisa=0).T
        elif spring.free_length is None:
            line = np.array(spring.line)
            result[place.start : place.start + 3] = -spring.stiffness * np.multiply.outer(line, line @ own[:3])
    result[places.at.twist] = relative[forces.bushings, 3:].reshape(-1, relative.shape[2])
    for k, load in enumerate(loads, len(relative) - len(loads)):
        if load.follower:
            turned = np.cross(relative[k, 3:], forces.wrench[k].reshape(2, 1, 3), axisa=0)
            result[places.wrench(k) : places.wrench(k) + 6] = turned.transpose(0, 2, 1).reshape(6, -1)
    return result
