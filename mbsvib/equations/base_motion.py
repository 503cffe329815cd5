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

    ``twist`` (..., 6): translation of the origin and rotation of the ground. ``origin`` (..., 3): a point of the ground
    [m]. ``points`` (..., 3): the points [m]. Returns (..., 6): translations and rotations.
    """
    linear, angular = np.split(np.array(twist), 2, axis=-1)
    translation = np.cross(angular, points - np.array(origin)) + linear
    return np.concatenate((translation, np.broadcast_to(angular, translation.shape)), axis=-1)


def inertia_of_ground_motion(
    twist: ArrayLike, origin: ArrayLike, position: Array, inertia: SpatialInertia, shared: Shared | None
) -> Array:
    """Return W u of the motion u of all bodies with the ground, with W of M = W^T W.

    ``twist`` (6,): translation of the origin and rotation of the ground. ``origin`` (3,): a point of the ground [m].
    ``position`` (..., bodies, 3): centres of mass [m]. Returns (..., rows): rows of bodies, then shared rows.
    """
    rows = inertia.factor(ground_motion(twist, origin, position)[..., None])
    if shared is not None:
        linear, angular = np.array(twist).reshape(2, 3)
        rows = shared.of_ground_motion(rows, linear, angular, np.array(origin))
    return np.asarray(rows[..., 0])


def check_rotation(model: Mechanism, source: BaseMotion) -> None:
    """Refuse a rotation of the ground that changes the direction of gravity, loads or rotors relative to it."""
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
