"""Couplers in finite motion: how far the joint coordinates that they couple have gone since the model's pose."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from mbsvib._checks import DIRECTIONS
from mbsvib.equilibrium.joints import rotations, two_axes
from mbsvib.equilibrium.rotations import logarithm
from mbsvib.kinematics import relative_motion

if TYPE_CHECKING:
    from mbsvib.couplers.rows import Couplings
    from mbsvib.equilibrium.pose import Pose
    from mbsvib.kinematics import Array, Twists
    from mbsvib.model import Model
    from mbsvib.parts import Joint


def point_of(joint: Joint, model: Model, pose: Pose) -> tuple[float, float, float]:
    """Return a joint's point as described, of one that has none the centre of mass of its first body in number."""
    inner = min(joint.first, joint.second, key=pose.number.__getitem__)
    return joint.point or model.bodies[inner].position


def terms(couplings: Couplings, coordinates: Twists) -> Array:
    """Return the coupled coordinates (terms, n) per unit joint coordinate."""
    moved = relative_motion(coordinates, couplings.measured).dense(0, len(couplings.measured.first))
    result = np.zeros((len(couplings.column), len(coordinates.names)))
    tree = couplings.column >= 0
    result[np.flatnonzero(tree), couplings.column[tree]] = 1.0
    result[~tree] = moved
    return result


def travelled(model: Model, pose: Pose, near: Array | None) -> Array:
    """Return how far coupled coordinates have gone in a pose, one for each term of each coupler.

    Parameters
    ----------
    model : Model
        The model as described.
    pose : Pose
        The pose.
    near : array, shape (terms,), optional
        About how far that is, to count whole turns.

    Returns
    -------
    array, shape (terms,)
        Distances [m] and angles [rad].
    """
    result = []
    for part in model._couplers.values():
        for name, _ in part.terms:
            owner, _, direction = name.rpartition(".")
            joint = model.joints[owner]
            result.append(gone(joint, direction, pose, point_of(joint, model, pose)))
    values = np.array(result)
    if near is None:
        return values
    turns = np.array([name.rpartition(".")[2][0] == "r" for part in model._couplers.values() for name, _ in part.terms])
    whole = 2.0 * np.pi * np.round((near - values) / (2.0 * np.pi))
    return np.where(turns, values + whole, values)


def gone(joint: Joint, direction: str, pose: Pose, at: tuple[float, float, float]) -> float:
    """Return how far one coordinate of a joint has gone, angles of a single turn within half a turn."""
    k = DIRECTIONS.index(direction)
    first, second = pose.turned(joint.first, joint.axes), pose.turned(joint.second, joint.axes)
    if k < 3:
        return float(first[:, k] @ (pose.point(joint.second, at) - pose.point(joint.first, at)))
    relative, free = first.T @ second, rotations(joint)
    if len(free) == 1:
        i, j = (k - 2) % 3, (k - 1) % 3
        return float(np.arctan2(relative[j, i] - relative[i, j], relative[i, i] + relative[j, j]))
    if joint.kind == "universal":
        one, two = (np.array(joint.axes).T @ axis for axis in two_axes(joint))
        # E = exp(a one) exp(b two): the first turns ``two`` about ``one``, the second ``one`` about ``two``
        axis, arm, where = (one, two, relative @ two) if direction == "rx" else (two, one, relative.T @ one)
        angle = np.arctan2(axis @ np.cross(arm, where), arm @ where - (axis @ arm) * (axis @ where))
        return float(angle if direction == "rx" else -angle)
    return float(logarithm(relative)[k - 3])
