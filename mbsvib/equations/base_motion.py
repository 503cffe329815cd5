"""Base motion: rigid motion of all bodies with the ground, and refusal of what does not rotate with the ground.

The equations are in coordinates relative to the moving ground. Relative to a rotating ground, the directions of
gravity, of forces fixed in the world and of the axes of rotors change by the integral of the angular acceleration,
which is no linear function of this input. They do not change if the ground rotates about the direction itself.
"""

from __future__ import annotations

from math import hypot
from typing import TYPE_CHECKING, Any

import numpy as np

from mbsvib.errors import ModelError
from mbsvib.linalg.rank import PARALLEL_DIRECTIONS

if TYPE_CHECKING:
    from collections.abc import Iterator

    from numpy.typing import ArrayLike

    from mbsvib.common.arguments import Vector
    from mbsvib.common.arrays import Array
    from mbsvib.elements import BaseMotion
    from mbsvib.equations.inertia import SpatialInertia
    from mbsvib.kinematics.shared_rows import Shared
    from mbsvib.mechanism.mechanism import Mechanism


def ground_motion(twist: ArrayLike, origin: ArrayLike, points: Array) -> Array:
    """Return the motions of points (..., 3) that move rigidly with the ground, (..., 6), world axes.

    Parameters
    ----------
    twist : array, shape (6,)
        Translation of the origin and rotation of the ground.
    origin : array, shape (3,)
        A point of the ground [m].
    points : array, shape (..., 3)
        The points [m].

    Returns
    -------
    array, shape (..., 6)
        Translations and rotations.
    """
    linear, angular = np.array(twist).reshape(2, 3)
    translation = np.cross(angular, points - np.array(origin)) + linear
    return np.concatenate((translation, np.broadcast_to(angular, translation.shape)), axis=-1)


def inertia_of_ground_motion(
    twist: ArrayLike, origin: ArrayLike, position: Array, inertia: SpatialInertia, shared: Shared | None
) -> Array:
    """Return W u of the motion u of all bodies with the ground, with W of M = W^T W.

    Parameters
    ----------
    twist : array, shape (6,)
        Translation of the origin and rotation of the ground.
    origin : array, shape (3,)
        A point of the ground [m].
    position : array, shape (..., bodies, 3)
        Centres of mass [m].
    inertia : SpatialInertia
        Square roots of the bodies' inertia.
    shared : Shared or None
        Mass that more than one body shares.

    Returns
    -------
    array, shape (..., rows)
        Rows of bodies, then shared rows.
    """
    rows = inertia.factor(ground_motion(twist, origin, position)[..., None])
    if shared is not None:
        linear, angular = np.array(twist).reshape(2, 3)
        rows = shared.of_ground_motion(rows, linear, angular, np.array(origin))
    return np.asarray(rows[..., 0])


def check_rotation(model: Mechanism, source: BaseMotion) -> None:
    """Refuse a rotation of the ground that changes the direction of gravity, loads or rotors relative to it.

    Parameters
    ----------
    model : Mechanism
        The mechanism.
    source : BaseMotion
        One of its base motions.

    Raises
    ------
    ModelError
        If the ground rotates, and gravity, a load or a rotor has another direction than the axis.
    """
    axis = source.wrench[3:]
    if not any(axis):
        return
    for name, direction, hint in fixed_in_world(model):
        cross = (axis[1] * direction[2] - axis[2] * direction[1], axis[2] * direction[0] - axis[0] * direction[2],
                 axis[0] * direction[1] - axis[1] * direction[0])  # fmt: skip
        if hypot(*cross) > PARALLEL_DIRECTIONS * hypot(*axis) * hypot(*direction):
            raise ModelError(
                f"base motion '{source.name}': turns the ground about {tuple(axis)}, but {name}, which does not turn "
                f"with it; its effect depends on the angle, which is no linear function of the acceleration. "
                f"{hint}, or carry the mechanism on a body that a torque turns.",
                element=source.name, field="direction",
            )  # fmt: skip


def fixed_in_world(model: Mechanism) -> Iterator[tuple[str, Vector, str]]:
    """Yield description, direction and advice for gravity, loads and rotors with directions fixed in the world."""
    if model.gravity is not None and any(model.gravity):
        yield f"gravity acts along {model.gravity}", model.gravity, "Turn about that direction only, leave gravity out"
    for load in model.loads.values():
        for field in ("force", "torque"):
            vector: Any = getattr(load, field)
            if any(vector) and not load.follower:
                yield f"load '{load.name}' has the {field} {vector}", vector, "Give the load as follower=True"
    for rotor in model.rotors.values():
        if rotor.speed:
            yield f"rotor '{rotor.name}' spins about {rotor.axis}", rotor.axis, "Turn about the rotor's axis only"
