"""Relative displacements with second-order terms in the work of forces, as rows."""

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
    from mbsvib.equations.wrenches import AppliedWrenches

ORIGIN = (0.0, 0.0, 0.0)
_AXES = np.eye(3)


@dataclass(frozen=True, slots=True)
class SecondOrderRows:
    """Relative displacements with second-order terms in the work of all wrench pairs: the applied ones, then joints.

    The first ``rows`` are those along free directions of joints and all six of preloaded bushings: ``owner`` (n,) is
    the number of the wrench pair, ``carrier`` (n,) its first body and ``twist`` (6, n) the displacement at a unit value
    of the row. ``successive`` (3, k) lists joints with two successive rotations, as owner and rows of both; ``cross``
    (3, k) are the products e x e' of their axes. Two rows across each line spring and rod follow: ``line_owner`` (l,),
    ``line`` (3, l), ``length`` (l,), and ``swing`` (3, l), the rotation of ``line_carrier`` (l,) that also moves the
    end across the line.
    """

    rows: Rows
    owner: Index
    carrier: Index
    twist: Array
    successive: Index
    cross: Array
    line_owner: Index
    line_carrier: Index
    line: Array
    length: Array
    swing: Array


def second_order_rows(
    applied: AppliedWrenches, joints: Sequence[Joint], number: Mapping[str, int], coupled: Set[str] = frozenset()
) -> SecondOrderRows:
    """Return the rows of relative displacement that second-order terms need.

    ``coupled``: joints on which couplers act, so that free directions transmit forces too.
    """
    ground = number["ground"]
    tuples, twists, owner = _of_bushings(applied, ground)
    successive: list[tuple[int, int, int]] = []
    cross: list[tuple[float, ...]] = []
    for k, joint in enumerate(joints, len(applied.names)):
        if joint.is_rod or not joint.freedom:
            continue
        translations = [twist for name, twist in joint.freedom if name[0] != "r"]
        rotations = [twist for name, twist in joint.freedom if name[0] == "r"]
        a, b, limit = number[joint.first], number[joint.second], 4 if joint.name in coupled else 3
        # joints without a point have no rotations
        ends = (a, b, *(joint.point or ORIGIN))
        if 0 < len(translations) < limit and a != ground:
            tuples += [(*ends, *twist) for twist in translations]
            twists += translations
            owner += [k] * len(translations)
        if joint.successive or (0 < len(rotations) < limit and a != ground):
            axes = [twist[3:] for twist in rotations]
            tuples += [(*ends, *ORIGIN, *vector) for vector in (_dual_vectors(*axes) if joint.successive else axes)]
            twists += rotations
            owner += [k] * len(rotations)
        if joint.successive:
            (ax, ay, az), (bx, by, bz) = rotations[0][3:], rotations[1][3:]
            successive.append((k, len(tuples) - 2, len(tuples) - 1))
            cross.append((ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx))
    rows, line_owner, line, length, swing = _lines(applied, joints, number)
    other = Rows.stack(tuples)
    return SecondOrderRows(
        Rows.join([other, rows]), np.array(owner, dtype=np.intp), other.first, columns(twists, 6),
        np.array(successive, dtype=np.intp).reshape(-1, 3).T, columns(cross, 3),
        line_owner, rows.first, line, length, swing,
    )  # fmt: skip


def _of_bushings(
    applied: AppliedWrenches, ground: int
) -> tuple[list[tuple[float, ...]], list[tuple[float, ...]], list[int]]:
    """Six rows for each preloaded bushing whose first body is not ground, with their twists and owners."""
    pairs = applied.pairs
    on_bodies = [k for k in applied.bushings.tolist() if pairs.first[k] != ground]
    ends = [(int(pairs.first[k]), int(pairs.second[k]), *pairs.end[:, k].tolist()) for k in on_bodies]
    return ([(*end, *twist) for end in ends for twist in UNIT6], list(UNIT6) * len(on_bodies),
            [k for k in on_bodies for _ in UNIT6])  # fmt: skip


def _lines(
    applied: AppliedWrenches, joints: Sequence[Joint], number: Mapping[str, int]
) -> tuple[Rows, Index, Array, Array, Array]:
    """Two rows across each line spring with tension and each rod; their owners, lines, lengths and swings."""
    pairs, owner = applied.pairs, applied.tension
    first, second, start, end = pairs.first[owner], pairs.second[owner], pairs.start[:, owner], pairs.end[:, owner]
    rods = [(k, joint) for k, joint in enumerate(joints, len(applied.names)) if joint.is_rod]
    if rods:
        owner, first, second = (np.concatenate((array, np.array(of_rods, dtype=np.intp))) for array, of_rods in (
            (owner, [k for k, _ in rods]), (first, [number[rod.first] for _, rod in rods]),
            (second, [number[rod.second] for _, rod in rods])))  # fmt: skip
        start = np.concatenate((start, np.array([rod.position for _, rod in rods]).T), axis=1)
        end = np.concatenate((end, np.array([rod.end for _, rod in rods]).T), axis=1)
    if not len(owner):
        empty = np.empty((3, 0))
        return Rows(owner, owner, empty, empty, empty), owner, empty, np.empty(0), empty
    along = end - start
    length = np.sqrt(np.square(along).sum(axis=0))
    across = np.array(normals(along / length)).transpose(1, 2, 0).reshape(3, -1)
    pair_index = np.arange(len(owner)).repeat(2)
    end, along, length = end[:, pair_index], along[:, pair_index], length[pair_index]
    rows = Rows(first[pair_index], second[pair_index], end, across, np.zeros(end.shape))
    return rows, owner[pair_index], along / length, length, crossed_product(along, across)


def normals(line: Array) -> tuple[Array, Array]:
    """Return two unit vectors across lines (3, ...): (first, second, line) is a right-handed frame."""
    first = crossed_product(_AXES[:, np.abs(line).argmin(axis=0)], line)
    first /= np.sqrt(np.square(first).sum(axis=0))
    return first, crossed_product(line, first)


def _dual_vectors(a: tuple[float, ...], b: tuple[float, ...]) -> list[tuple[float, ...]]:
    """Dual basis of two unit vectors in their plane, which gives the components of a sum along them."""
    (ax, ay, az), (bx, by, bz) = a, b
    cosine = ax * bx + ay * by + az * bz
    share = 1.0 / ((1.0 - cosine) * (1.0 + cosine))
    return [((ax - cosine * bx) * share, (ay - cosine * by) * share, (az - cosine * bz) * share),
            ((bx - cosine * ax) * share, (by - cosine * ay) * share, (bz - cosine * az) * share)]  # fmt: skip
