"""Joints of a file and their finite motion: the frame of the child at any position, and the rates of that motion."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from mbsvib.common import arguments as check
from mbsvib.common.arrays import Array
from mbsvib.linalg.rotations import exponential, jacobian

# Coordinates of each kind: translations [m] before rotations [rad], which make one rotation vector or, of a universal
# joint, follow each other.
FREEDOMS = {"revolute": 1, "continuous": 1, "prismatic": 1, "fixed": 0, "floating": 6, "planar": 3, "spherical": 3,
            "universal": 2}  # fmt: skip
SLIDES = {"prismatic": 1, "planar": 2, "floating": 3}


@dataclass(frozen=True, slots=True, eq=False)
class Mimic:
    """A joint that follows another one: q = factor q_joint + offset."""

    joint: str
    factor: float
    offset: float


@dataclass(frozen=True, slots=True, eq=False)
class Hinge:
    """A joint of any kind: ``origin`` (3,) [m], ``axes`` (3, 3) of its frame in the parent's, ``axis`` in its own.

    ``limits`` [rad, m] of its position; ``armature`` [kg m^2, kg]: inertia of its coordinate alone; ``axis2`` is the
    second axis of a universal joint, which the child carries.
    """

    name: str
    kind: str
    parent: str
    child: str
    origin: Array
    axes: Array
    axis: Array
    damping: float
    friction: float
    mimic: Mimic | None
    limits: tuple[float, float] | None = None
    armature: float = 0.0
    axis2: Array = field(default_factory=lambda: np.array((1.0, 0.0, 0.0)))


def _axes(joint: Hinge) -> tuple[Array, Array]:
    """Directions (3, slides) and axes of rotation (3, turns) of the coordinates, in the frame of the joint."""
    none, one = np.zeros((3, 0)), joint.axis[:, None]
    if joint.kind == "planar":
        return np.array(check.frame_along(tuple(joint.axis.tolist())))[:, :2], one
    if joint.kind == "universal":
        return none, np.column_stack((joint.axis, joint.axis2))
    if joint.kind in ("spherical", "floating"):
        return (np.eye(3) if joint.kind == "floating" else none), np.eye(3)
    return (one, none) if joint.kind == "prismatic" else (none, none if joint.kind == "fixed" else one)


def moved(joint: Hinge, q: Array) -> tuple[Array, Array]:
    """Position and axes of the child's frame in the parent's, at the position ``q`` (freedoms,) [m, rad] of a joint."""
    slides, turns = _axes(joint)
    count = slides.shape[1]
    angles = q[count:]
    if joint.kind == "universal":
        turn = exponential(turns[:, 0] * angles[0]) @ exponential(turns[:, 1] * angles[1])
    else:
        turn = exponential(turns @ angles) if len(angles) else np.eye(3)
    return joint.origin + joint.axes @ slides @ q[:count], joint.axes @ turn


def rates(joint: Hinge, q: Array) -> tuple[Array, Array]:
    """Velocities of the child's origin and angular velocities (3, freedoms) per unit rate of q, in the joint's frame.

    A rotation vector w turns by J(w) w' (``linalg.rotations.jacobian``); the second of two successive rotations is
    about its axis turned by the first.
    """
    slides, turns = _axes(joint)
    count, total = slides.shape[1], slides.shape[1] + turns.shape[1]
    linear, angular = np.zeros((3, total)), np.zeros((3, total))
    linear[:, :count] = slides
    if joint.kind == "universal":
        turns = np.column_stack((turns[:, 0], exponential(turns[:, 0] * q[0]) @ turns[:, 1]))
    elif turns.shape[1] == 3:
        turns = jacobian(q[count:]) @ turns
    angular[:, count:] = turns
    return linear, angular
