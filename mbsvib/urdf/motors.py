"""Motors of a URDF file: transmissions of one actuator to one joint, with their ratio and the inertia of the rotor."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from mbsvib.common.number_text import real
from mbsvib.errors import ModelError

if TYPE_CHECKING:
    from collections.abc import Callable
    from os import PathLike
    from xml.etree.ElementTree import Element

    from mbsvib.common.arrays import Array

    Numbers = Callable[[Element | None, str, str | None, int, str, str], Array]

RATIO, ROTOR = "mechanicalreduction", "rotor_inertia"
# Names of elements for these, in small letters.
WORDS = {RATIO: RATIO, "gear_ratio": RATIO} | dict.fromkeys(
    (ROTOR, "rotorinertia", "motor_inertia", "motorinertia"), ROTOR)


@dataclass(frozen=True, slots=True)
class Motor:
    """A motor that turns ``ratio`` times as fast as its ``joint``, with a rotor of ``inertia`` [kg m^2, kg]."""

    name: str
    joint: str
    ratio: float
    inertia: float


def motors_of(top: Element, path: str | PathLike[str], numbers: Numbers) -> tuple[tuple[Motor, ...], set[int]]:
    """Return the motors of one joint each, and the identities of the actuators whose rotors are taken by them.

    Transmissions between several joints or actuators have no single ratio.
    """
    motors, taken = [], set()
    for element in top.findall("transmission"):
        joints, actuators = element.findall("joint"), element.findall("actuator")
        if len(joints) != 1 or len(actuators) != 1:
            continue
        name, joint = actuators[0].get("name", ""), joints[0].get("name", "")
        who, values = f"{path}: transmission of '{name}'", {RATIO: 1.0, ROTOR: 0.0}
        for part in (*joints[0], *actuators[0], *element):
            tag = part.tag.rpartition(":")[2].lower()
            if tag in WORDS:
                key = WORDS[tag]
                if part.get("value") is not None:
                    values[key] = float(numbers(part, "value", None, 1, who, name)[0])
                else:
                    try:
                        values[key] = real(part.text or "")
                    except ValueError as error:
                        raise ModelError(f"{who}: <{part.tag}> {part.text!r}; expected a number.", element=name,
                                         field=part.tag) from error  # fmt: skip
        if values[RATIO] == 0.0 or values[ROTOR] < 0.0:
            raise ModelError(f"{who}: ratio {values[RATIO]:g}, rotor {values[ROTOR]:g} kg m^2; expected a ratio other "
                             f"than 0 and an inertia that is not negative.", element=name)  # fmt: skip
        taken.add(id(actuators[0]))
        motors.append(Motor(name, joint, values[RATIO], values[ROTOR]))
    return tuple(motors), taken
