"""What families say of forces as parameters and the pose change.

Numbers that change and are no parameters have places in one long row, to which matrices lead from parameters. Rates of
parameters tell how these go with the bodies; reference terms what parameters as described do in a pose of equilibrium
that was found elsewhere.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from scipy.sparse import csr_array

from mbsvib.common.arrays import Array
from mbsvib.elements import Bushing
from mbsvib.elements.part import Part
from mbsvib.elements.pose import IDENTITY, Pose
from mbsvib.kinematics.pose import start
from mbsvib.linalg.rank import ZERO_TURN
from mbsvib.linalg.vectors import cross, wide
from mbsvib.mechanism.mechanism import Mechanism
from mbsvib.sensitivities.forces import Forces
from mbsvib.sensitivities.network import Network


def displaced(origin: Mechanism, parts: Iterable[Part]) -> Pose:
    """Return the pose in which bodies among some parts are, against where a mechanism describes them."""
    known: dict[str, Any] = {part.name: part for part in parts if part.name in origin.bodies}
    bodies = [known.get(name, body) for name, body in origin.bodies.items()]
    described, there = (np.array([body.orientation for body in group] + [IDENTITY])
                        for group in (origin.bodies.values(), bodies))  # fmt: skip
    return replace(start(origin), centre=np.array([*(body.position for body in bodies), (0.0, 0.0, 0.0)]),
                   rotations=there @ described.swapaxes(1, 2))  # fmt: skip


def turned(origin: Mechanism, parts: Iterable[Part]) -> frozenset[str]:
    """Return the bushings whose bodies turned against each other: what they do about axes changes in ways of its own.
    """
    known = {part.name: part for part in parts}
    pose = displaced(origin, known.values())
    return frozenset(part.name for part in known.values() if isinstance(part, Bushing)
                     and np.abs(pose.rotations[pose.number[part.first]] - pose.rotations[pose.number[part.second]]
                                ).max() > ZERO_TURN)  # fmt: skip


def holds_turns(bushing: Bushing) -> bool:
    """Tell whether a bushing carries moments, or forces by rotations."""
    blocks = [np.array(value) for value in (bushing.stiffness, bushing.damping, bushing.preload or np.zeros(6))]
    return any(value[3:].any() or (value.ndim == 2 and value[:, 3:].any()) for value in blocks)


@dataclass(frozen=True, slots=True)
class ForceLayout:
    """Where what is no parameter stands in one long row: points (n, 3) of forces, starts (lines, 3) of lines, wrenches
    (applied, 6) of applied forces, turns (k, 3) of joints with two successive rotations, and twists (bushings, 3) of
    the second bodies of bushings. ``joints`` come before the applied forces, ``lines`` gives the number of each line.
    """

    point: slice
    start: slice
    wrench: slice
    turn: slice
    twist: slice
    joints: int
    lines: dict[int, int]

    @staticmethod
    def of(forces: Forces) -> ForceLayout:
        """Return the places for some forces."""
        joints, count = forces.counts[0], len(forces.first)
        sizes = (3 * count, 3 * len(forces.lines), 6 * (count - joints), 3 * len(forces.twice),
                 3 * len(forces.bushings))  # fmt: skip
        ends = np.cumsum(sizes).tolist()
        point, start, wrench, turn, twist = (slice(end - size, end) for size, end in zip(sizes, ends, strict=True))
        lines = {k: i for i, k in enumerate(forces.lines.tolist())}
        return ForceLayout(point, start, wrench, turn, twist, joints, lines)

    @property
    def size(self) -> int:
        """Length of the row."""
        return int(self.twist.stop)

    def point_of(self, force: int) -> int:
        """Return where the point of a force begins."""
        return int(self.point.start) + 3 * force

    def start_of(self, force: int) -> int:
        """Return where the start of a line begins."""
        return int(self.start.start) + 3 * self.lines[force]

    def wrench_of(self, force: int) -> int:
        """Return where the wrench of an applied force begins."""
        return int(self.wrench.start) + 6 * (force - self.joints)


@dataclass(frozen=True)
class ForceChanges:
    """How parameters, by part, field and index in ``row``, act on what is no parameter: by ``matrix`` (p, e) on a long
    row, in which each has its place ``at``.
    """

    row: dict[tuple[str, str, tuple[int, ...]], int]
    at: ForceLayout
    matrix: csr_array

    @property
    def count(self) -> int:
        """Number of parameters, internal ones included."""
        return len(self.row)


class RowTerms:
    """Terms of a matrix with a row for each parameter, collected one by one.

    ``row`` numbers the parameters by part, field and index; ``at`` has the places of what is no parameter.
    """

    def __init__(self, row: dict[tuple[str, str, tuple[int, ...]], int], at: ForceLayout) -> None:
        self.row, self.at = row, at
        self._terms: list[tuple[int, int, float]] = []

    def put(self, parameter: tuple[str, str, tuple[int, ...]], column: int, vector: Iterable[float]) -> None:
        """Let a parameter change the numbers from a column on; parts that the user did not give have none."""
        if parameter in self.row:
            row = self.row[parameter]
            self._terms += [(row, column + i, float(value)) for i, value in enumerate(vector) if value != 0.0]

    def along(self, part: str, field: str, column: int) -> None:
        """Let the three entries of a field change the three numbers from a column on."""
        for i in range(3):
            self.put((part, field, (i,)), column + i, (1.0,))

    def matrix(self, width: int) -> csr_array:
        """Return the matrix, (parameters, width)."""
        row, column, value = zip(*self._terms, strict=True) if self._terms else ((), (), ())
        return csr_array((value, (row, column)), shape=(len(self.row), width))


class PoseRates:
    """How parameters change as bodies move, as those of a model do that is described in the new pose.

    ``table`` (parameters, c) has the changes for c motions of the bodies: ``motion`` (bodies, 6, c) at their centres of
    mass, ``second`` (n, 6, c) of second bodies at the points of forces; ``axes`` (n, 3, c) are the turns of axes.
    Points of ``forces`` go with the bodies.
    """

    def __init__(self, network: Network, forces: Forces, changes: ForceChanges, motion: Array) -> None:
        self.network, self._row, self.motion = network, changes.row, motion
        self.table = np.zeros((changes.count, motion.shape[2]))
        first, relative = forces.relative_motions(motion)
        self.second, self.axes = first + relative, first[:, 3:] + forces.turned_axes(relative)

    def carry(self, parts: Iterable[Part]) -> None:
        """Let points and axes of parts go with the bodies on which they are, as their roles say."""
        number, found = self.network.body_number, []
        for part in parts:
            for field, role in part.roles.items():
                point = (np.nan,) * 3 if role.turn else getattr(part, field) if role.moved == "point" else None
                if role.on and point is not None and (part.name, field, (0,)) in self._row:
                    found.append((self._row[part.name, field, (0,)], number[getattr(part, role.on)], point))
        if not found:
            return
        row, body, point = (np.array(column) for column in zip(*found, strict=True))
        motion = np.concatenate((self.motion, np.zeros((1, *self.motion.shape[1:]))))[body]
        arm = point - np.concatenate((self.network.position, np.zeros((1, 3))))[body]
        shift = motion[:, :3] + cross(motion[:, 3:], wide(arm, motion))
        turns = np.isnan(point[:, :1, None])
        self.table[row[:, None] + np.arange(3)] = np.where(turns, motion[:, 3:], shift)

    def put(self, part: str, field: str, rates: Array) -> None:
        """Set the rates (entries, c) of a field; parts that the user did not give have none."""
        for i, rate in enumerate(rates if (part, field, (0,)) in self._row else ()):
            self.table[self._row[part, field, (i,)]] = rate


class ReferenceTerms:
    """What parameters as described in ``origin`` do in a pose of equilibrium that was found elsewhere.

    Families add terms of ``parameters``, of ``forces`` and of ``openings``, by how far joints come apart. The network,
    its forces and their changes are those of the pose there.
    """

    def __init__(self, network: Network, forces: Forces, changes: ForceChanges, origin: Mechanism) -> None:
        self.network, self.origin, self.at, self._row = network, origin, changes.at, changes.row
        self.pose = displaced(origin, network.bodies)
        self.parameters, self.forces, self.openings = (RowTerms(changes.row, changes.at) for _ in range(3))
        self._turns: dict[tuple[str, str], Array] = {}
        away = np.zeros((len(forces.first), 6, 3))
        for k, joint in enumerate(network.joints):
            away[k, 3:] = self.turn(joint.second) - self.turn(joint.first)
        self.turned_axes = forces.turned_axes(away)

    def turn(self, body: str) -> Array:
        """Return the rotation matrix (3, 3) of a body since it was described."""
        return np.asarray(self.pose.rotations[self.pose.number[body]])

    def carry(self, part: Part) -> None:
        """Let the fields of a part go with the turns of the bodies on which they are, as their roles say."""
        for field, role in part.roles.items():
            if role.on and role.moved and (not role.follows or getattr(part, role.follows)):
                self.turns(part.name, field, self.turn(getattr(part, role.on)))

    def turns(self, part: str, field: str, turn: Array) -> None:
        """Let the three entries of a field go with a turn (3, 3) of what carries them."""
        self._turns[part, field] = turn

    def close(self) -> None:
        """Add the turns, and let all other parameters be what they are as described."""
        for (part, field, index), row in self._row.items():
            turn = self._turns.get((part, field))
            if turn is None:
                self.parameters.put((part, field, index), row, (1.0,))
            else:
                self.parameters.put((part, field, index), row - index[0], turn[:, index[0]])
