"""What forces feel to second order: relative displacements of the bodies between which they act, as rows."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from mbsvib._checks import UNIT6
from mbsvib.kinematics import Rows
from mbsvib.mobility import crossed_product

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence, Set

    from mbsvib.kinematics import Array, Index
    from mbsvib.loads.wrenches import Applied
    from mbsvib.parts import Joint

ORIGIN = (0.0, 0.0, 0.0)


@dataclass(frozen=True, slots=True)
class Felt:
    """Relative displacements that the forces of ``pairs`` feel: the applied ones, then those in joints.

    ``rows`` are first those along free directions of joints and all six of preloaded bushings: ``owner`` (n,) is the
    pair whose force it is, ``carrier`` (n,) its first body and ``twist`` (6, n) the displacement of which the row is
    the size. ``two`` (3, k) lists joints with two free rotations, as owner and rows of both, with ``cross`` (3, k) the
    product e x e' of their axes. Two rows for each line spring and rod come behind: ``line_owner`` (l,), ``line``
    (3, l) and ``length`` (l,), the rotation ``swing`` (3, l) of ``line_carrier`` (l,) that moves its end across too.
    """

    rows: Rows
    owner: Index
    carrier: Index
    twist: Array
    two: Index
    cross: Array
    line_owner: Index
    line_carrier: Index
    line: Array
    length: Array
    swing: Array


def felt(
    applied: Applied, joints: Sequence[Joint], number: Mapping[str, int], coupled: Set[str] = frozenset()
) -> Felt:
    """Return the rows of relative displacement that second-order terms need.

    Parameters
    ----------
    applied : Applied
        What loads the mechanism.
    joints : sequence of Joint
        All joints.
    number : mapping
        Number of each body, ground included.
    coupled : set of str, optional
        Joints on which couplers act, so that free directions transmit forces too.

    Returns
    -------
    Felt
        Rows, to be put into minimal coordinates.
    """
    tuples: list[tuple[float, ...]] = []
    twist: list[tuple[float, ...]] = []
    owner: list[int] = []
    two: list[tuple[int, int, int]] = []
    cross: list[Array] = []
    pairs, ground = applied.pairs, number["ground"]

    def add(who: int, a: int, b: int, at: Sequence[float], moved: Sequence[float], picks: Sequence[float]) -> None:
        tuples.append((a, b, *at, *picks))
        twist.append(tuple(moved))
        owner.append(who)

    for k in applied.bushings.tolist():
        if pairs.first[k] != ground:
            for six in UNIT6:
                add(k, int(pairs.first[k]), int(pairs.second[k]), pairs.end[:, k].tolist(), six, six)
    for k, joint in enumerate(joints, len(applied.names)):
        if joint.kind == "distance":
            continue
        a, b = number[joint.first], number[joint.second]
        at = joint.point or ORIGIN  # where a joint has no point, nothing turns
        moves = [six for name, six in joint.freedom if name[0] != "r"]
        turns = [six for name, six in joint.freedom if name[0] == "r"]
        if 0 < len(moves) < (4 if joint.name in coupled else 3) and a != ground:
            for six in moves:
                add(k, a, b, at, six, six)
        if len(turns) == 2 or (0 < len(turns) < (4 if joint.name in coupled else 3) and a != ground):
            for six, picks in zip(turns, _picks([six[3:] for six in turns]), strict=True):
                add(k, a, b, at, six, (*ORIGIN, *picks))
        if len(turns) == 2:
            two.append((k, len(tuples) - 2, len(tuples) - 1))
            cross.append(crossed_product(np.array(turns[0][3:]), np.array(turns[1][3:])))
    across = _Lines(applied, joints, number)
    return Felt(
        Rows.stack(tuples + across.rows), np.array(owner, dtype=np.intp),
        np.array([int(row[0]) for row in tuples], dtype=np.intp), np.array(twist).reshape(-1, 6).T,
        np.array(two, dtype=np.intp).reshape(-1, 3).T, np.array(cross).reshape(-1, 3).T,
        np.array(across.owner, dtype=np.intp), np.array([int(row[0]) for row in across.rows], dtype=np.intp),
        np.array(across.line).reshape(-1, 3).T, np.array(across.length), np.array(across.swing).reshape(-1, 3).T,
    )  # fmt: skip


class _Lines:
    """Line springs with tension and rods: two rows across each."""

    def __init__(self, applied: Applied, joints: Sequence[Joint], number: Mapping[str, int]) -> None:
        self.rows: list[tuple[float, ...]] = []
        self.owner: list[int] = []
        self.line: list[Array] = []
        self.length: list[float] = []
        self.swing: list[Array] = []
        pairs = applied.pairs
        for k in applied.tension.tolist():
            self._add(k, int(pairs.first[k]), int(pairs.second[k]), pairs.start[:, k], pairs.end[:, k])
        for k, joint in enumerate(joints, len(applied.names)):
            if joint.kind == "distance":
                self._add(k, number[joint.first], number[joint.second], np.array(joint.position), np.array(joint.end))

    def _add(self, who: int, a: int, b: int, start: Array, end: Array) -> None:
        length = float(np.linalg.norm(end - start))
        line = (end - start) / length
        for direction in normals(line):
            self.rows.append((a, b, *end.tolist(), *direction.tolist(), *ORIGIN))
            self.owner.append(who)
            self.line.append(line)
            self.length.append(length)
            self.swing.append(crossed_product(end - start, direction))


def normals(line: Array) -> tuple[Array, Array]:
    """Return two unit vectors across a line: (first, second, line) is a right-handed frame."""
    least = np.zeros(3)
    least[int(np.argmin(np.abs(line)))] = 1.0
    one = crossed_product(least, line)
    one /= np.linalg.norm(one)
    return one, crossed_product(line, one)


def _picks(axes: list[tuple[float, ...]]) -> list[tuple[float, ...]]:
    """Vectors that pick the part along each of some unit vectors out of a sum of all."""
    if len(axes) != 2:
        return axes
    (ax, ay, az), (bx, by, bz) = axes
    cosine = ax * bx + ay * by + az * bz
    share = 1.0 / ((1.0 - cosine) * (1.0 + cosine))
    return [((ax - cosine * bx) * share, (ay - cosine * by) * share, (az - cosine * bz) * share),
            ((bx - cosine * ax) * share, (by - cosine * ay) * share, (bz - cosine * az) * share)]  # fmt: skip
