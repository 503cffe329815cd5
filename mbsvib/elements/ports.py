"""Inputs and outputs: forces, base motion, motions and internal forces."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import Any, ClassVar

import numpy as np

from mbsvib.common import arguments as check
from mbsvib.common.arguments import Vector
from mbsvib.common.fast_init import fast_init
from mbsvib.elements.deformations import Law
from mbsvib.elements.part import Part, derived
from mbsvib.elements.placement import GROUND, Placement
from mbsvib.elements.placement import direction as place_direction
from mbsvib.elements.pose import Pose
from mbsvib.elements.roles import BODY, point, stated
from mbsvib.errors import ModelError, nearest

Six = tuple[float, ...]
QUANTITIES = ("displacement", "velocity", "acceleration")
# Units of forces and moments, and those along and about a direction by the number of time derivatives
_FORCE = ("N", "N m")
MOTION_UNITS = (("m", "rad"), ("m/s", "rad/s"), ("m/s^2", "rad/s^2"))


class Signal(Part):
    """An input or output.

    ``element`` is the name of the element in which an output is measured or whose end an input moves, else None.
    ``moves_ground`` is True for inputs that are accelerations of the ground. An output with a ``law`` is the change of
    its one deformation between the bodies ``first`` and ``second``.
    """

    __slots__ = ()
    element: Any = None
    moves_ground = False
    law: ClassVar[Law | None] = None

    @property
    def unit(self) -> str:
        """Its unit."""
        raise NotImplementedError


@dataclass(frozen=True, slots=True)
class Port(Signal):
    """An input or output at the point ``position`` [m] of ``body`` along ``direction`` (``wrench``: its six-vector).

    ``position`` None is the body's centre of mass. ``relative_to`` is the body on which the reaction of an input acts,
    or relative to which an output is measured; the direction turns with it.
    """

    roles = stated(body=BODY, position=replace(point("body"), unit=None), relative_to=BODY)

    body: str
    direction: str | Six
    position: Vector | None = None
    relative_to: str = "ground"

    def in_pose(self, pose: Pose, relaxed: bool) -> Any:
        there: Any = super(Port, self).in_pose(pose, relaxed)
        if pose.is_unmoved(self.relative_to):
            return there
        force, moment = (pose.rotated_vector(self.relative_to, part) for part in (there.wrench[:3], there.wrench[3:]))
        return replace(there, direction=place_direction(self.direction, (*force, *moment)), wrench=(*force, *moment))

    def placed(self, to: Placement) -> dict[str, Any]:
        six = to.six(with_wrench(self.direction, self.name)[1])
        there: dict[str, Any] = super(Port, self).placed(to)
        return there | {"direction": place_direction(self.direction, six)}


@fast_init
@dataclass(frozen=True, slots=True)
class Input(Port):
    """A force [N] or torque [N m] on ``body`` (and its reaction on ``relative_to``), ``per`` the unit of a signal."""

    symbol = "arrow"

    wrench: Six = derived(())
    per: str | None = None

    @property
    def unit(self) -> str:
        """Its unit."""
        return self.per or unit_along(self.wrench, _FORCE)


@fast_init
@dataclass(frozen=True, slots=True)
class Output(Port):
    """A displacement, velocity or acceleration of ``body`` relative to ``relative_to``.

    With base motion, ``inertial`` outputs are relative to inertial space, others relative to the moving ground;
    ``absolute`` is the user's choice or None.
    """

    quantity: str = "displacement"
    absolute: bool | None = None
    inertial: bool = derived(False)
    wrench: Six = derived(())
    unit: str = derived("")

    def placed(self, to: Placement) -> dict[str, Any]:
        # what is measured against inertial space stays so
        return super(Output, self).placed(to) | ({"relative_to": self.relative_to} if self.absolute else {})

    @property
    def order(self) -> int:
        """Number of its time derivatives."""
        return QUANTITIES.index(self.quantity)


@dataclass(frozen=True, slots=True)
class BaseMotion(Signal):
    """Acceleration of the ground along (m/s^2) or about (rad/s^2, axes through ``position``) a direction."""

    moves_ground = True

    direction: str | Six
    position: Vector = (0.0, 0.0, 0.0)
    wrench: Six = derived(())

    @property
    def unit(self) -> str:
        """Its unit."""
        return unit_along(self.wrench, MOTION_UNITS[-1])

    def placed(self, to: Placement) -> dict[str, Any]:
        if to.ground != GROUND:
            raise ModelError(f"base motion '{self.name}': it moves the ground, and the copy is on body '{to.ground}'; "
                             f"leave it out of the model that is added.", element=self.name)  # fmt: skip
        return {"direction": place_direction(self.direction, to.six(self.wrench)),
                "position": to.point(self.position)}  # fmt: skip


@dataclass(frozen=True, slots=True)
class ForceOutput(Signal):
    """Force [N] or moment [N m] in a bushing or spring, positive where it pulls the first body to the second."""

    element: str = field()
    direction: str | Six = field()
    wrench: Six = derived(())

    @property
    def unit(self) -> str:
        """Its unit."""
        return unit_along(self.wrench, _FORCE)

    def placed(self, to: Placement) -> dict[str, Any]:
        if self.element == GROUND:
            return {"direction": self._on_ground(to)}
        return placed_in_axes(self, to)

    def _on_ground(self, to: Placement) -> str | Six:
        """The direction of a sum of forces on the ground, whose moments are about the origin of the copy."""
        if to.ground != GROUND:
            raise ModelError(f"force output '{self.name}': it is the sum of all forces on the ground, and the copy is "
                             f"on body '{to.ground}'; leave it out of the model that is added.",
                             element=self.name, field="element")  # fmt: skip
        six = to.six(self.wrench)
        force = np.array(six[:3]) - np.cross(six[3:], to.offset)
        return place_direction(self.direction, (*force.tolist(), *six[3:]))


def placed_in_axes(part: Any, to: Placement) -> dict[str, Any]:
    """The element and the direction, in the axes of this element, of a copied signal."""
    reverse = to.parts[part.element].reversed_axis
    six = to.six(part.wrench) if reverse is None else to.local(part.wrench, reverse)
    return {"element": to.name(part.element), "direction": place_direction(part.direction, six)}


def _checked(who: str, body: str, direction: Any, position: Any, relative_to: str) -> tuple[Any, ...]:
    """Body, direction, position, relative_to and wrench."""
    if body == relative_to:
        raise ModelError(f"{who}: body and relative_to are both '{body}', so it is always zero; "
                         f"name two different bodies.", element=who, field="relative_to")  # fmt: skip
    direction, wrench = with_wrench(direction, who)
    if position is not None:
        position = check.vector(position, who, "position")
    return body, direction, position, relative_to, wrench


def unit_along(wrench: Six, units: tuple[str, str]) -> str:
    """The unit of a direction with translations, rotations or both."""
    translates, rotates = any(wrench[:3]), any(wrench[3:])
    return units[0] if not rotates else units[1] if not translates else " + ".join(units)


def with_wrench(direction: Any, who: str) -> tuple[str | Six, Six]:
    """A direction by its name, if it has one, and as a six-vector."""
    wrench = check.direction(direction, who)
    return direction if isinstance(direction, str) else wrench, wrench


def make_input(
    name: str, body: str, direction: Any, position: Any, relative_to: str, per: str | None = None
) -> Input:
    """Check the values of a force input and build it."""
    who = f"input '{name}'"
    if per is not None and not (isinstance(per, str) and per.strip()):
        raise check.refuse(who, "per", per, "the unit of the signal as a text, such as 'V'")
    return Input(name, *(*_checked(who, body, direction, position, relative_to), per))


def make_output(
    name: str, body: str, direction: Any, position: Any, relative_to: str, quantity: Any, absolute: Any,
    unit: str | None = None,
) -> Output:  # fmt: skip
    """Check the values of an output and build it."""
    who = f"output '{name}'"
    if not isinstance(quantity, str) or quantity not in QUANTITIES:
        raise check.refuse(who, "quantity", quantity, "displacement, velocity or acceleration",
                           nearest(str(quantity), QUANTITIES).strip())  # fmt: skip
    body, direction, position, relative_to, wrench = _checked(who, body, direction, position, relative_to)
    if absolute is not None and str(absolute) not in ("True", "False"):
        raise check.refuse(who, "absolute", absolute, "True, False or None")
    if absolute and relative_to != "ground":
        raise ModelError(f"{who}: absolute=True, yet measured relative to body '{relative_to}'; leave one out.",
                         element=who, field="absolute")  # fmt: skip
    inertial = quantity == "acceleration" and relative_to == "ground" if absolute is None else bool(absolute)
    unit = unit or unit_along(wrench, MOTION_UNITS[QUANTITIES.index(quantity)])
    return Output(name, body, direction, position, relative_to, quantity, absolute, inertial, wrench, unit)


def make_base_motion(name: str, direction: Any, position: Any) -> BaseMotion:
    """Check the values of a base motion and build it."""
    who = f"base motion '{name}'"
    direction, wrench = with_wrench(direction, who)
    return BaseMotion(name, direction, check.vector(position, who, "position"), wrench)


def make_force_output(name: str, element: str, direction: Any) -> ForceOutput:
    """Check the values of a force output and build it."""
    return ForceOutput(name, element, *with_wrench(direction, f"force output '{name}'"))
