"""Inputs and outputs: forces that act, base motion, and what is measured."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

from mbsvib.common import arguments as check
from mbsvib.common.arguments import Vector
from mbsvib.elements.part import Part, derived
from mbsvib.errors import ModelError, nearest

if TYPE_CHECKING:
    from mbsvib.elements.placement import Placement

Six = tuple[float, ...]
QUANTITIES = ("displacement", "velocity", "acceleration")


@dataclass(frozen=True, slots=True)
class Port(Part):
    """A body, a direction (``wrench``: the same as a six-vector) and a point [m].

    ``position`` None is the body's centre of mass; ``relative_to`` is the body on which an input reacts, or against
    which an output is measured.
    """

    body: str
    direction: str | Six
    position: Vector | None = None
    relative_to: str = "ground"

    def in_pose(self, pose: Placement, relaxed: bool) -> Part | dict[str, Any]:
        # its direction is fixed in the world
        if self.position is None or pose.stays(self.body):
            return self
        return replace(self, position=pose.point(self.body, self.position))


@dataclass(frozen=True, slots=True)
class Input(Port):
    """A force [N] or torque [N m] on ``body`` (and its reaction on ``relative_to``)."""

    wrench: Six = derived(())


@dataclass(frozen=True, slots=True)
class Output(Port):
    """A displacement, velocity or acceleration of ``body`` relative to ``relative_to``.

    ``inertial`` matters only where the ground itself moves (base motion): True measures against inertial space,
    False against the moving ground; ``absolute`` is what the user said of it. ``unit`` is None where the direction and
    the quantity tell it.
    """

    quantity: str = "displacement"
    absolute: bool | None = None
    inertial: bool = derived(False)
    wrench: Six = derived(())
    unit: str | None = derived()


@dataclass(frozen=True, slots=True)
class BaseMotion(Part):
    """Acceleration of the ground along (m/s^2) or about (rad/s^2, axes through ``position``) a direction."""

    direction: str | Six
    position: Vector = (0.0, 0.0, 0.0)
    wrench: Six = derived(())


@dataclass(frozen=True, slots=True)
class ForceOutput(Part):
    """Force [N] or moment [N m] in a bushing or spring, positive where it pulls the first body to the second."""

    element: str
    direction: str | Six
    wrench: Six = derived(())


def _port(who: str, body: str, direction: Any, position: Any, relative_to: str) -> tuple[Any, ...]:
    if body == relative_to:
        raise ModelError(f"{who}: body and relative_to are both '{body}', so it is always zero; "
                         f"name two different bodies.", element=who, field="relative_to")  # fmt: skip
    wrench = check.direction(direction, who)
    said = direction if isinstance(direction, str) else wrench
    if position is not None:
        position = check.vector(position, who, "position")
    return body, said, position, relative_to, wrench


def make_input(name: str, body: str, direction: Any, position: Any, relative_to: str) -> Input:
    """Check the values of a force input and build it."""
    body, said, position, relative_to, wrench = _port(f"input '{name}'", body, direction, position, relative_to)
    return Input(name, body, said, position, relative_to, wrench)


def make_output(
    name: str, body: str, direction: Any, position: Any, relative_to: str, quantity: Any, absolute: Any,
    unit: str | None = None,
) -> Output:  # fmt: skip
    """Check the values of an output and build it."""
    who = f"output '{name}'"
    if not isinstance(quantity, str) or quantity not in QUANTITIES:
        raise check.refuse(who, "quantity", quantity, "displacement, velocity or acceleration",
                           nearest(str(quantity), QUANTITIES).strip())  # fmt: skip
    body, said, position, relative_to, wrench = _port(who, body, direction, position, relative_to)
    if absolute is not None and str(absolute) not in ("True", "False"):
        raise check.refuse(who, "absolute", absolute, "True, False or None")
    if absolute and relative_to != "ground":
        raise ModelError(f"{who}: absolute=True, yet measured relative to body '{relative_to}'; leave one out.",
                         element=who, field="absolute")  # fmt: skip
    inertial = quantity == "acceleration" and relative_to == "ground" if absolute is None else bool(absolute)
    return Output(name, body, said, position, relative_to, quantity, absolute, inertial, wrench, unit)


def make_base_motion(name: str, direction: Any, position: Any) -> BaseMotion:
    """Check the values of a base motion and build it."""
    who = f"base motion '{name}'"
    wrench = check.direction(direction, who)
    said = direction if isinstance(direction, str) else wrench
    return BaseMotion(name, said, check.vector(position, who, "position"), wrench)


def make_force_output(name: str, element: str, direction: Any) -> ForceOutput:
    """Check the values of a force output and build it."""
    who = f"force output '{name}'"
    wrench = check.direction(direction, who)
    return ForceOutput(name, element, direction if isinstance(direction, str) else wrench, wrench)
