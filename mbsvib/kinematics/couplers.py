"""Couplers as rows of Phi: linear relations over the joint coordinates of the tree.

The coordinate of a joint in the tree is a column. That of a cut joint is a relative displacement of its two bodies, a
row by the path rule.

Source: Haug, Computer Aided Kinematics and Dynamics of Mechanical Systems (1989), section 3.4, for gears and racks.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from mbsvib.common.arrays import Array
from mbsvib.elements import Body, Joint
from mbsvib.elements.coupler import Coupling
from mbsvib.elements.rows import Rows
from mbsvib.kinematics.couplings import Couplings
from mbsvib.kinematics.loops import Cuts
from mbsvib.kinematics.relative_motion import Twists, relative_motion
from mbsvib.linalg.products import concatenated
from mbsvib.mechanism.topology import Topology


def measure(joint: Joint, direction: str) -> tuple[Array, Array]:
    """Return force and moment (3,) of the row whose relative displacement is a coordinate of a joint."""
    six = np.array(dict(joint.freedom)[direction])
    if joint.successive and direction[0] == "r":
        turns = joint.freedom[-2:]
        which = [name for name, _ in turns].index(direction)
        first, second = (np.array(twist[3:]) for _, twist in turns)
        return np.zeros(3), _dual(first, second, which)
    return (np.zeros(3), six[3:]) if direction[0] == "r" else (six[:3], np.zeros(3))


def _dual(a: Array, b: Array, which: int) -> Array:
    """The covector of q_a (0) or q_b (1) in theta = q_a a + q_b b."""
    n = np.cross(a, b)
    return np.asarray(np.cross(*((b, n) if which == 0 else (n, a))) / (n * n).sum())


def couplings(
    parts: Sequence[Coupling], topology: Topology, bodies: Sequence[Body], number: Mapping[str, int],
    coordinates: Twists,
) -> Couplings:  # fmt: skip
    """Return the terms of all couplers; ``number`` has the numbers of bodies by name, ground included."""
    rows_of_terms = terms(parts, coordinates.names, topology, bodies, number)
    touched = np.zeros((len(parts), len(coordinates.names)), dtype=bool)
    known = rows_of_terms.column >= 0
    touched[rows_of_terms.row[known], rows_of_terms.column[known]] = True
    measured, owners = rows_of_terms.measured, rows_of_terms.row[~known]
    for i, a, b in zip(owners.tolist(), measured.first.tolist(), measured.second.tolist(), strict=True):
        touched[i] |= coordinates.path[a] != coordinates.path[b]
    return replace(rows_of_terms, touched=touched)


def terms(
    parts: Sequence[Coupling], names: Sequence[str], topology: Topology, bodies: Sequence[Body],
    number: Mapping[str, int],
) -> Couplings:  # fmt: skip
    """Return the terms of all couplers.

    Each coupler is one row; ``touched`` (couplers, 0) is still empty. ``names`` are those of the joint coordinates of
    the tree, ``bodies`` are in order, ``number`` is that of each body by name, ground included.
    """
    index_of = {name: i for i, name in enumerate(names)}
    joints = {joint.name: (k, joint) for k, joint in enumerate(topology.joints)}
    row: list[int] = []
    value: list[float] = []
    turns: list[bool] = []
    column: list[int] = []
    measured: list[tuple[float, ...]] = []
    of_joint: list[int] = []
    for i, part in enumerate(parts):
        for name, coefficient in part.terms:
            owner, _, direction = name.rpartition(".")
            row.append(i)
            value.append(coefficient)
            turns.append(direction[0] == "r")
            column.append(index_of.get(name, -1))
            if name in index_of:
                continue
            k, joint = joints[owner]
            a, b = number[joint.first], number[joint.second]
            force, moment = measure(joint, direction)
            measured.append((a, b, *(joint.point or bodies[min(a, b)].position), *force, *moment))
            of_joint.append(k)
    return Couplings(np.array(row, dtype=np.intp), np.array(value, dtype=float), np.array(turns, dtype=bool),
                     np.array(column, dtype=np.intp), Rows.stack(measured), np.array(of_joint, dtype=np.intp),
                     np.zeros((len(parts), 0), dtype=bool))  # fmt: skip


def with_couplers(cuts: Cuts | None, parts: Sequence[Coupling], *scene: Any) -> Cuts:
    """Return the locked rows of cut joints, followed by those of the couplers, each a loop of its own.

    The arguments behind ``parts`` are those of ``couplings``.
    """
    return appended(cuts, tuple(part.name for part in parts), couplings(parts, *scene))


def appended(cuts: Cuts | None, names: tuple[str, ...], rows: Couplings | None) -> Cuts:
    """Return the locked rows of cut joints, followed by ``rows`` of the couplers ``names``."""
    if cuts is None:
        none = np.zeros(0, dtype=np.intp)
        cuts = Cuts(Rows.stack([]), (), none, (), none, np.zeros(0, dtype=bool))
    count = len(cuts.joints)
    return replace(
        cuts, names=cuts.names + names, joints=cuts.joints + names, couplings=rows,
        joint=np.concatenate((cuts.joint, np.arange(count, count + len(names)))),
        translates=np.concatenate((cuts.translates, np.zeros(len(names), dtype=bool))),
    )  # fmt: skip


def locked(coordinates: Twists, cuts: Cuts) -> Array:
    """Return the relative displacements [m, rad] (..., locked rows, n) that cut joints and couplers lock."""
    return with_rows(relative_motion(coordinates, cuts.rows).dense(0, len(cuts.rows.first)), coordinates, cuts)


def with_rows(phi: Array, coordinates: Twists, cuts: Cuts) -> Array:
    """Return the rows (..., rows, n) of cut joints with those of couplers behind."""
    return phi if cuts.couplings is None else np.asarray(concatenated((phi, cuts.couplings.dense(coordinates)), -2))
