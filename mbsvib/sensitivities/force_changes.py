"""What parameters change of the forces at the pose that is no parameter itself: their points and wrenches."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from scipy.sparse import csr_array

from mbsvib.elements import Bushing, Load, Spring
from mbsvib.elements.load import Gravity
from mbsvib.sensitivities.network import maxwell_lines

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

    from mbsvib.mechanism.parameters import Parameter
    from mbsvib.sensitivities.forces import Forces
    from mbsvib.sensitivities.network import Network


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
        """Number of parameters."""
        return len(self.row)


class RowTerms:
    """RowTerms of a matrix with a row for each parameter, collected one by one.

    Parameters
    ----------
    row : dict
        Number of each parameter, by part, field and index.
    at : ForceLayout
        Places of what is no parameter.
    """

    def __init__(self, row: dict[tuple[str, str, tuple[int, ...]], int], at: ForceLayout) -> None:
        self.row, self.at = row, at
        self._terms: list[tuple[int, int, float]] = []

    def put(self, own: tuple[str, str, tuple[int, ...]], place: int, vector: Iterable[float]) -> None:
        """Let a parameter change the numbers from a place on; parts that the user did not give have none."""
        if own in self.row:
            row = self.row[own]
            self._terms += [(row, place + i, float(value)) for i, value in enumerate(vector) if value != 0.0]

    def along(self, part: str, field: str, place: int) -> None:
        """Let the three entries of a field change the three numbers from a place on."""
        for i in range(3):
            self.put((part, field, (i,)), place + i, (1.0,))

    def matrix(self, width: int) -> csr_array:
        """Return the matrix, (parameters, width)."""
        row, column, value = zip(*self._terms, strict=True) if self._terms else ((), (), ())
        return csr_array((value, (row, column)), shape=(len(self.row), width))


def force_changes(network: Network, forces: Forces, entries: Sequence[Parameter]) -> ForceChanges:
    """Return what parameters change of the forces at the pose."""
    at = ForceLayout.of(forces)
    terms = RowTerms({(entry.part, entry.field, entry.index): k for k, entry in enumerate(entries)}, at)
    joints, springs, bodies, _ = forces.counts
    weight = joints + springs
    for k, joint in enumerate(network.joints):
        if joint.end is not None:
            terms.along(joint.name, "position", at.start_of(k))
            terms.along(joint.name, "end", at.point_of(k))
        elif joint.position is not None:
            terms.along(joint.name, "position", at.point_of(k))
    for i, k in enumerate(forces.twice.tolist()):
        terms.along(network.joints[k].name, "orientation", int(at.turn.start) + 3 * i)
    for k, spring in enumerate(network.springs, joints):
        if isinstance(spring, Bushing):
            _bushing(terms, spring, k)
        else:
            _spring(terms, spring, k)
    for maxwell, k in maxwell_lines(network):
        terms.along(maxwell, "start", at.start_of(joints + k))
        terms.along(maxwell, "end", at.point_of(joints + k))
    for k, body in enumerate(network.bodies):
        terms.along(body.name, "position", at.point_of(weight + k))
        terms.put((body.name, "mass", ()), at.wrench_of(weight + k), forces.gravity)
        for i in range(3 if any(isinstance(part, Gravity) for part in network.parts) else 0):
            terms.put(("gravity", "", (i,)), at.wrench_of(weight + k) + i, (body.mass,))
    loads = [part for part in network.parts if isinstance(part, Load)]
    for k, load in enumerate(loads, weight + bodies):
        terms.along(load.name, "force", at.wrench_of(k))
        terms.along(load.name, "torque", at.wrench_of(k) + 3)
        owner = (load.body, "position") if load.position is None else (load.name, "position")
        terms.along(*owner, at.point_of(k))
    return ForceChanges(terms.row, at, terms.matrix(at.size))


def _spring(terms: RowTerms, spring: Spring, k: int) -> None:
    """Its force is -T e on the second body, with T as given, or k (L - L0)."""
    terms.along(spring.name, "start", terms.at.start_of(k))
    terms.along(spring.name, "end", terms.at.point_of(k))
    line, place = np.array(spring.line), terms.at.wrench_of(k)
    if spring.free_length is None:
        if spring.preload is not None:
            terms.put((spring.name, "preload", ()), place, -line)
        return
    terms.put((spring.name, "stiffness", ()), place, (spring.free_length - spring.length) * line)
    terms.put((spring.name, "free_length", ()), place, spring.stiffness * line)
    for i in range(3):
        for field, sign in (("start", 1.0), ("end", -1.0)):
            terms.put((spring.name, field, (i,)), place, sign * spring.stiffness * line[i] * line)


def _bushing(terms: RowTerms, bushing: Bushing, k: int) -> None:
    """Its wrench is its preload, in axes that turn with its orientation."""
    terms.along(bushing.name, "position", terms.at.point_of(k))
    if bushing.preload is None:
        return
    axes, place = np.array(bushing.orientation), terms.at.wrench_of(k)
    wrench = np.array(bushing.preload).reshape(2, 3) @ axes.T
    for i in range(6):
        terms.put((bushing.name, "preload", (i,)), place + 3 * (i // 3), axes[:, i % 3])
    for i, unit in enumerate(np.eye(3)):
        terms.put((bushing.name, "orientation", (i,)), place, np.cross(unit, wrench).reshape(6))
