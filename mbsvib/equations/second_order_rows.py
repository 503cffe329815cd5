"""What forces feel to second order: relative displacements of the bodies between which they act, as rows."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from mbsvib.common.arguments import UNIT6
from mbsvib.elements.rows import Rows, columns
from mbsvib.kinematics.mobility import crossed_product

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence, Set

    from mbsvib.common.arrays import Array, Index
    from mbsvib.elements import Joint
    from mbsvib.equations.wrenches import Applied

ORIGIN = (0.0, 0.0, 0.0)
_AXES = np.eye(3)


@dataclass(frozen=True, slots=True)
class Felt:
    """Relative displacements that the forces of ``pairs`` feel: the applied ones, then those in joints.

    ``rows`` are first those along free directions of joints and all six of preloaded bushings: ``owner`` (n,) is the
    pair whose force it is, ``carrier`` (n,) its first body and ``twist`` (6, n) the displacement of which the row is
    the size. ``two`` (3, k) lists joints with two successive rotations, as owner and rows of both; ``cross`` (3, k) are
    the products e x e' of their axes. Two rows for each line spring and rod come behind: ``line_owner`` (l,), ``line``
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
    ground = number["ground"]
    tuples, twist, owner = _of_bushings(applied, ground)
    two: list[tuple[int, int, int]] = []
    cross: list[tuple[float, ...]] = []
    for k, joint in enumerate(joints, len(applied.names)):
        if joint.kind == "distance" or not joint.freedom:
            continue
        moves = [six for name, six in joint.freedom if name[0] != "r"]
        turns = [six for name, six in joint.freedom if name[0] == "r"]
        a, b, most = number[joint.first], number[joint.second], 4 if joint.name in coupled else 3
        # where a joint has no point, nothing turns
        head = (a, b, *(joint.point or ORIGIN))
        if 0 < len(moves) < most and a != ground:
            tuples += [(*head, *six) for six in moves]
            twist += moves
            owner += [k] * len(moves)
        if joint.successive or (0 < len(turns) < most and a != ground):
            axes = [six[3:] for six in turns]
            tuples += [(*head, *ORIGIN, *picks) for picks in (_picks(*axes) if joint.successive else axes)]
            twist += turns
            owner += [k] * len(turns)
        if joint.successive:
            (ax, ay, az), (bx, by, bz) = turns[0][3:], turns[1][3:]
            two.append((k, len(tuples) - 2, len(tuples) - 1))
            cross.append((ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx))
    rows, line_owner, line, length, swing = _lines(applied, joints, number)
    other = Rows.stack(tuples)
    return Felt(
        Rows.join([other, rows]), np.array(owner, dtype=np.intp), other.first, columns(twist, 6),
        np.array(two, dtype=np.intp).reshape(-1, 3).T, columns(cross, 3),
        line_owner, rows.first, line, length, swing,
    )  # fmt: skip


def _of_bushings(applied: Applied, ground: int) -> tuple[list[tuple[float, ...]], list[tuple[float, ...]], list[int]]:
    """Six rows for each preloaded bushing that a body carries, with their twists and owners."""
    pairs = applied.pairs
    carried = [k for k in applied.bushings.tolist() if pairs.first[k] != ground]
    heads = [(int(pairs.first[k]), int(pairs.second[k]), *pairs.end[:, k].tolist()) for k in carried]
    return ([(*head, *six) for head in heads for six in UNIT6], list(UNIT6) * len(carried),
            [k for k in carried for _ in UNIT6])  # fmt: skip


def _lines(
    applied: Applied, joints: Sequence[Joint], number: Mapping[str, int]
) -> tuple[Rows, Index, Array, Array, Array]:
    """Two rows across each line spring with tension and each rod; their owners, lines, lengths and swings."""
    pairs, k = applied.pairs, applied.tension
    first, second, start, end = pairs.first[k], pairs.second[k], pairs.start[:, k], pairs.end[:, k]
    rods = [(i, joint) for i, joint in enumerate(joints, len(applied.names)) if joint.kind == "distance"]
    if rods:
        k, first, second = (np.concatenate((given, np.array(more, dtype=np.intp))) for given, more in (
            (k, [i for i, _ in rods]), (first, [number[rod.first] for _, rod in rods]),
            (second, [number[rod.second] for _, rod in rods])))  # fmt: skip
        start = np.concatenate((start, np.array([rod.position for _, rod in rods]).T), axis=1)
        end = np.concatenate((end, np.array([rod.end for _, rod in rods]).T), axis=1)
    if not len(k):
        none = np.empty((3, 0))
        return Rows(k, k, none, none, none), k, none, np.empty(0), none
    along = end - start
    length = np.sqrt(np.square(along).sum(axis=0))
    across = np.array(normals(along / length)).transpose(1, 2, 0).reshape(3, -1)
    twice = np.arange(len(k)).repeat(2)
    end, along, length = end[:, twice], along[:, twice], length[twice]
    rows = Rows(first[twice], second[twice], end, across, np.zeros(end.shape))
    return rows, k[twice], along / length, length, crossed_product(along, across)


def normals(line: Array) -> tuple[Array, Array]:
    """Return two unit vectors across lines (3, ...): (first, second, line) is a right-handed frame."""
    one = crossed_product(_AXES[:, np.abs(line).argmin(axis=0)], line)
    one /= np.sqrt(np.square(one).sum(axis=0))
    return one, crossed_product(line, one)


def _picks(a: tuple[float, ...], b: tuple[float, ...]) -> list[tuple[float, ...]]:
    """Vectors that pick the part along each of two unit vectors, which need not be perpendicular, out of a sum."""
    (ax, ay, az), (bx, by, bz) = a, b
    cosine = ax * bx + ay * by + az * bz
    share = 1.0 / ((1.0 - cosine) * (1.0 + cosine))
    return [((ax - cosine * bx) * share, (ay - cosine * by) * share, (az - cosine * bz) * share),
            ((bx - cosine * ax) * share, (by - cosine * ay) * share, (bz - cosine * az) * share)]  # fmt: skip
