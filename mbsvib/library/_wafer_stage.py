"""A wafer stage: long stroke, short stroke and metrology frame on isolators."""

from __future__ import annotations

from math import pi, sqrt
from typing import TYPE_CHECKING

from mbsvib.api.model import Model
from mbsvib.common.arguments import DIRECTIONS
from mbsvib.library._stewart import LOADS, box

if TYPE_CHECKING:
    from mbsvib.common.arguments import Vector

# name, mass [kg], edges [m], centre of mass [m]: chosen, of the size of a machine for 300 mm wafers
BASE = ("base", 3000.0, (2.0, 1.8, 0.4), (0.0, 0.0, 0.0))
METROLOGY = ("metrology", 900.0, (1.4, 1.4, 0.3), (0.0, 0.0, 0.9))
LONG = ("long_stroke", 60.0, (0.6, 0.5, 0.1), (0.0, 0.0, 0.3))
SHORT = ("short_stroke", 20.0, (0.4, 0.4, 0.08), (0.0, 0.0, 0.42))


def wafer_stage(
    *, floor_frequency: float = 18.0, isolator_frequency: float = 1.0, servo_frequency: float = 25.0,
    compensator_frequency: float = 0.5,
) -> Model:  # fmt: skip
    """Build a wafer stage on a base frame, with a metrology frame on soft isolators: 21 degrees of freedom.

    The base frame stands on four stiff feet. On it slides the long stroke, held by its own servo control as by springs;
    it carries the short stroke, which floats on magnets that take its weight with little stiffness. What counts is
    where the short stroke is against the metrology frame, whatever the floor does. All data are chosen.

    Parameters
    ----------
    floor_frequency : float
        Of base frame, long stroke and what they carry on the feet, along z [Hz].
    isolator_frequency : float
        Of the metrology frame on its isolators, along z [Hz].
    servo_frequency : float
        Of the long stroke and what it carries under its control, along x and y [Hz].
    compensator_frequency : float
        Of the short stroke on its magnets, in all six directions [Hz].

    Returns
    -------
    Model
        Bodies ``base``, ``metrology``, ``long_stroke`` and ``short_stroke``; bushings ``foot1`` ..., ``isolator1`` ...,
        ``servo`` and ``magnets``; inputs ``Fx`` ... ``Mz`` of the short stroke's actuators, which react on the long
        stroke, and ``floor.x``, ``floor.y`` and ``floor.z``; outputs ``x`` ... ``rz`` of the short stroke against the
        metrology frame, ``stroke.x``, ``stroke.y`` and ``stroke.z`` against the long stroke, and the acceleration
        ``metrology.az``.

    Raises
    ------
    ModelError
        If a value is refused by the part it is for.
    """
    model = Model("wafer_stage")
    for name, mass, edges, centre in (BASE, METROLOGY, LONG, SHORT):
        model.add_body(name, mass, box(mass, *edges), centre)
    frequencies = (floor_frequency, isolator_frequency, servo_frequency, compensator_frequency)
    floor, soft, stiff, light = ((2.0 * pi * f) ** 2 for f in frequencies)
    total_mass = BASE[1] + LONG[1] + SHORT[1] + METROLOGY[1]
    _add_corners(model, "foot", "ground", BASE, 0.25 * total_mass * floor, 0.05, -0.2)
    _add_corners(model, "isolator", "base", METROLOGY, 0.25 * METROLOGY[1] * soft, 0.3, 0.0)
    model.add_joint("granite", "planar", "base", "long_stroke", (0.0, 0.0, 0.25))
    sled = LONG[1] + SHORT[1]
    spring = [sled * stiff, sled * stiff, 0.0, 0.0, 0.0, 0.05 * sled * stiff]
    damper = [1.4 * sled * sqrt(stiff)] * 2 + [0.0] * 3 + [0.05 * 1.4 * sled * sqrt(stiff)]
    model.add_bushing("servo", "base", "long_stroke", LONG[3], spring, damper)
    size = (*(SHORT[1],) * 3, *box(SHORT[1], *SHORT[2]))
    model.add_bushing("magnets", "long_stroke", "short_stroke", SHORT[3], [m * light for m in size],
                      [0.02 * m * sqrt(light) for m in size])  # fmt: skip
    for force, direction in zip(LOADS, DIRECTIONS, strict=True):
        model.add_input(force, "short_stroke", direction, relative_to="long_stroke")
        model.add_output(direction, "short_stroke", direction, relative_to="metrology")
    for direction in DIRECTIONS[:3]:
        model.add_base_motion(f"floor.{direction}", direction)
        model.add_output(f"stroke.{direction}", "short_stroke", direction, relative_to="long_stroke")
    model.add_output("metrology.az", "metrology", "z", quantity="acceleration")
    return model


def _add_corners(
    model: Model, name: str, below: str, frame: tuple[str, float, Vector, Vector], stiffness: float, ratio: float,
    height: float,
) -> None:  # fmt: skip
    """Put a frame on four equal springs below its corners; sideways they are half as stiff."""
    body, mass, (long, wide, _), (_, _, z) = frame
    damping = ratio * sqrt(stiffness * mass)
    for k, (sx, sy) in enumerate(((1, 1), (-1, 1), (-1, -1), (1, -1)), start=1):
        model.add_bushing(f"{name}{k}", below, body, (0.45 * sx * long, 0.45 * sy * wide, z + height),
                          (0.5 * stiffness, 0.5 * stiffness, stiffness, 0.0, 0.0, 0.0),
                          (0.5 * damping, 0.5 * damping, damping, 0.0, 0.0, 0.0))  # fmt: skip
