"""What is no parameter, but changes of the forces at the pose, in one long row; and matrices that lead there."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from scipy.sparse import csr_array

if TYPE_CHECKING:
    from collections.abc import Iterable

    from mbsvib.sensitivities.forces import Forces


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
