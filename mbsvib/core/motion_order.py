"""The order of joint coordinates on the way from ground: which motions carry others."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from typing import TYPE_CHECKING

import numpy as np

from mbsvib.common.arguments import DIRECTIONS
from mbsvib.elements.joint_motion import ROD, STRAIGHT, Motion
from mbsvib.kinematics.relative_motion import order_and_paths
from mbsvib.mechanism.topology import FLOATS

if TYPE_CHECKING:
    from mbsvib.common.arrays import Array, Index
    from mbsvib.mechanism.topology import Branch, Topology

Kinds = tuple[tuple[tuple[str, ...], bool, Motion], ...]


@dataclass(frozen=True, slots=True)
class MotionOrder:
    """Joint coordinates (n,) in the order of motions.

    ``before`` (n, n) is the sign of the coordinate k's joint along its path where k comes before l on the way from
    ground, else 0: in another joint, or in the same one, whose translations come before its rotations and whose
    successive rotations follow each other. ``joint`` (n,) is the number of each coordinate's joint, ``sign`` (n,)
    that of its joint along the path. ``rods`` are the coordinates of rods in the tree.
    """

    before: Array
    joint: Index
    sign: Array
    rods: tuple[tuple[int, Index], ...]


def motion_order(topology: Topology) -> MotionOrder:
    """Return the order of the joint coordinates of a tree."""
    kinds = tuple([(tuple([name for name, _ in joint.freedom]), joint.successive, joint.motion)
                   for joint in topology.joints])  # fmt: skip
    return _motion_order(topology.branches, kinds)


@lru_cache(maxsize=32)
def _motion_order(branches: tuple[Branch, ...], kinds: Kinds) -> MotionOrder:
    """``motion_order`` of a tree whose joints have these free directions, successive rotations and motions.

    It depends on nothing else, and is cached for mechanisms that are built again with other values.
    """
    order, path = order_and_paths(branches, tuple([len(free) for free, _, _ in kinds]))
    n = path.shape[1]
    before, number, sign = np.zeros((n, n)), np.zeros(n, dtype=np.intp), np.zeros(n)
    rods, start = [], 0
    for branch in order:
        free, successive, motion = (DIRECTIONS, False, STRAIGHT) if branch.joint == FLOATS else kinds[branch.joint]
        at = np.arange(start, start + len(free))
        start += len(free)
        number[at], sign[at] = branch.joint, branch.sign
        before[:, at] = path[branch.parent, :, None]
        if motion is ROD:
            rods.append((branch.joint, at))
        else:
            before[at[:, None], at] = _within(free, successive, branch.sign)
    for array in (before, number, sign):
        array.setflags(write=False)
    return MotionOrder(before, number, sign, tuple(rods))


def _within(free: tuple[str, ...], successive: bool, sign: int) -> Array:
    """The order of motions in a joint, a product of translations and rotations; the inverse of one that is reversed."""
    turns = np.array([name[0] == "r" for name in free], dtype=bool)
    number = np.arange(len(free))
    first = ~turns[:, None] & turns
    if successive:
        first |= turns[:, None] & turns & (number[:, None] < number)
    return sign * np.asarray(first if sign > 0 else first.T, dtype=float)
