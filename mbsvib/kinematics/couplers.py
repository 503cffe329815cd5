"""Couplers as rows of Phi: linear relations over the joint coordinates of the tree.

The coordinate of a joint in the tree is a column. That of a cut joint is what its two bodies do relative to each
other, a row by the path rule.

Source: Haug, Computer Aided Kinematics and Dynamics of Mechanical Systems (1989), section 3.4, for gears and racks.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

from mbsvib.elements.rows import Rows
from mbsvib.kinematics.couplings import Couplings, dual
from mbsvib.kinematics.loops import Cuts

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping, Sequence

    from numpy.typing import NDArray

    from mbsvib.common.arrays import Array, Index
    from mbsvib.elements import Body, Joint
    from mbsvib.elements.coupler import Coupling
    from mbsvib.kinematics.relative_motion import Twists
    from mbsvib.mechanism.topology import Topology

    Mask = NDArray[np.bool_]
    Moving = Callable[[Index, Array], Array]


def measure(joint: Joint, direction: str) -> tuple[Array, Array, tuple[Array, Array, int] | None]:
    """Return force and moment (3,) of the row that reads a joint's coordinate off a relative displacement; and of one
    of two successive angles both axes (3, 1) and which of them it is about.
    """
    six = np.array(dict(joint.freedom)[direction])
    if joint.successive and direction[0] == "r":
        turns = joint.freedom[-2:]
        axes = [np.array(twist[3:])[:, None] for _, twist in turns]
        which = [name for name, _ in turns].index(direction)
        return np.zeros(3), dual(axes[0], axes[1], which)[:, 0], (axes[0], axes[1], which)
    if direction[0] == "r":
        return np.zeros(3), six[3:], None
    return six[:3], np.zeros(3), None


def couplings(
    parts: Sequence[Coupling], topology: Topology, bodies: Sequence[Body], number: Mapping[str, int],
    coordinates: Twists,
) -> Couplings:  # fmt: skip
    """Return the terms of all couplers.

    Parameters
    ----------
    parts : sequence of Coupler, Gear, Worm or Rack
        The model's couplers.
    topology : Topology
        The spanning tree.
    bodies : sequence of Body
        The bodies in order.
    number : mapping
        Number of each body, ground included.
    coordinates : Twists
        The joint coordinates of the tree.

    Returns
    -------
    Couplings
        One row for each coupler.
    """
    found, _ = terms(parts, coordinates.names, topology, bodies, number)
    touched = np.zeros((len(parts), len(coordinates.names)), dtype=bool)
    known = found.column >= 0
    touched[found.row[known], found.column[known]] = True
    measured = found.measured
    for i, a, b in zip(found.row[~known].tolist(), measured.first.tolist(), measured.second.tolist(), strict=True):
        touched[i] |= coordinates.path[a] != coordinates.path[b]
    return replace(found, touched=touched)


def terms(
    parts: Sequence[Coupling], names: Sequence[str], topology: Topology, bodies: Sequence[Body],
    number: Mapping[str, int],
) -> tuple[Couplings, Index]:  # fmt: skip
    """Return the terms of all couplers, without what they touch, and the joints of those that have to be measured.

    Parameters
    ----------
    parts : sequence of Coupler, Gear, Worm or Rack
        The model's couplers.
    names : sequence of str
        Names of the joint coordinates of the tree.
    topology : Topology
        The spanning tree.
    bodies : sequence of Body
        The bodies in order.
    number : mapping
        Number of each body, ground included.

    Returns
    -------
    Couplings
        One row for each coupler, ``touched`` (couplers, 0).
    array, shape (measured terms,)
        Numbers of the cut joints in which terms are measured.
    """
    place = {name: i for i, name in enumerate(names)}
    joints = {joint.name: (k, joint) for k, joint in enumerate(topology.joints)}
    row: list[int] = []
    value: list[float] = []
    turns: list[bool] = []
    column: list[int] = []
    measured: list[tuple[float, ...]] = []
    skew, of_joint = [], []
    for i, part in enumerate(parts):
        for name, coefficient in part.terms:
            owner, _, direction = name.rpartition(".")
            row.append(i)
            value.append(coefficient)
            turns.append(direction[0] == "r")
            column.append(place.get(name, -1))
            if name in place:
                continue
            k, joint = joints[owner]
            a, b = number[joint.first], number[joint.second]
            force, moment, axes = measure(joint, direction)
            if axes is not None:
                skew.append((len(measured), *axes))
            measured.append((a, b, *(joint.point or bodies[min(a, b)].position), *force, *moment))
            of_joint.append(k)
    found = Couplings(np.array(row, dtype=np.intp), np.array(value, dtype=float), np.array(turns, dtype=bool),
                      np.array(column, dtype=np.intp), Rows.stack(measured), tuple(skew),
                      np.zeros((len(parts), 0), dtype=bool))  # fmt: skip
    return found, np.array(of_joint, dtype=np.intp)


def with_couplers(cuts: Cuts | None, parts: Sequence[Coupling], *scene: Any) -> Cuts:
    """Return the locked rows of cut joints and, behind them, those of the couplers, each a loop of its own.

    Parameters
    ----------
    cuts : Cuts or None
        Locked rows of the cut joints.
    parts : sequence of Coupler, Gear, Worm or Rack
        The couplers.
    *scene
        Topology, bodies, their numbers and the coordinates, as ``couplings`` takes them.

    Returns
    -------
    Cuts
        All rows of Phi.
    """
    names = tuple(part.name for part in parts)
    if cuts is None:
        none = np.zeros(0, dtype=np.intp)
        cuts = Cuts(Rows.stack([]), (), none, (), none, np.zeros(0, dtype=bool))
    count = len(cuts.joints)
    return replace(
        cuts, names=cuts.names + names, joints=cuts.joints + names, couplings=couplings(parts, *scene),
        joint=np.concatenate((cuts.joint, np.arange(count, count + len(names)))),
        translates=np.concatenate((cuts.translates, np.zeros(len(names), dtype=bool))),
    )  # fmt: skip
