"""Base motion: what does not turn with the ground when the ground turns.

The equations hold for coordinates relative to the moving ground. Gravity, forces fixed in the world and the axes of
rotors as seen from there turn as the ground does, by the angle or rate that its angular acceleration adds up to: no
linear function of the acceleration, unless the ground turns about their own direction.
"""

from __future__ import annotations

from math import hypot
from typing import TYPE_CHECKING, Any

from mbsvib.errors import ModelError
from mbsvib.linalg.rank import PARALLEL_DIRECTIONS

if TYPE_CHECKING:
    from collections.abc import Iterator

    from mbsvib.common.arguments import Vector
    from mbsvib.elements import BaseMotion
    from mbsvib.mechanism.mechanism import Mechanism



def check_turning(model: Mechanism, source: BaseMotion) -> None:
    """Refuse a ground that turns under what does not turn with it.

    Parameters
    ----------
    model : Mechanism
        The mechanism.
    source : BaseMotion
        One of its base motions.

    Raises
    ------
    ModelError
        If the ground turns, and gravity, a load or a rotor has another direction than the axis.
    """
    axis = source.wrench[3:]
    if not any(axis):
        return
    for what, direction, hint in fixed_in_world(model):
        cross = (axis[1] * direction[2] - axis[2] * direction[1], axis[2] * direction[0] - axis[0] * direction[2],
                 axis[0] * direction[1] - axis[1] * direction[0])  # fmt: skip
        if hypot(*cross) > PARALLEL_DIRECTIONS * hypot(*axis) * hypot(*direction):
            raise ModelError(
                f"base motion '{source.name}': turns the ground about {tuple(axis)}, but {what}, which does not turn "
                f"with it; its effect grows with the angle, which the angular acceleration as an input does not give. "
                f"{hint}, or carry the mechanism on a body that a torque turns.",
                element=source.name, field="direction",
            )  # fmt: skip


def fixed_in_world(model: Mechanism) -> Iterator[tuple[str, Vector, str]]:
    """Return what does not turn with the ground: what it is, its direction, and what to do without it."""
    if model.gravity is not None and any(model.gravity):
        yield f"gravity acts along {model.gravity}", model.gravity, "Turn about that direction only, leave gravity out"
    for load in model.loads.values():
        for word in ("force", "torque"):
            vector: Any = getattr(load, word)
            if any(vector) and not load.follower:
                yield f"load '{load.name}' has the {word} {vector}", vector, "Give the load as follower=True"
    for rotor in model.rotors.values():
        if rotor.speed:
            yield f"rotor '{rotor.name}' spins about {rotor.axis}", rotor.axis, "Turn about the rotor's axis only"
