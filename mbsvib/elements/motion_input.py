"""Motion inputs: the ground's end of a spring, bushing or Maxwell element, or a joint, moves as the input prescribes.

M q'' + C q' + K q = B0 u + B1 u',  B0 = sum k d^T,  B1 = sum c d^T

with the rows d of relative displacement, positive where the body moves off from its end on ground. So the displacement
and the velocity of that end act as two forces, each of which the equations take as an input of its own; what the
given quantity makes of them is in ``responses.driven``. The coordinate of a joint acts by its acceleration as well,
see ``equations.driven_coordinates``.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any

from mbsvib.common import arguments as check
from mbsvib.elements.bushing import Bushing
from mbsvib.elements.dynamic_bushing import DynamicBushing
from mbsvib.elements.dynamic_spring import DynamicSpring
from mbsvib.elements.joint import Joint
from mbsvib.elements.maxwell import Maxwell
from mbsvib.elements.part import derived
from mbsvib.elements.placement import Placement
from mbsvib.elements.ports import MOTION_UNITS, QUANTITIES, Signal, Six, placed_in_axes, unit_along, with_wrench
from mbsvib.elements.shared_rows import ExpandedPart
from mbsvib.elements.spring import Spring
from mbsvib.errors import ModelError, nearest

GROUND = "ground"


@dataclass(frozen=True, slots=True)
class MotionInput(Signal):
    """The ``quantity`` of the ground's end of ``element`` along its line, or along a ``direction`` in a bushing's axes.

    Positive where this end moves towards the other one; of a bushing, along its axis. ``element`` is the coordinate
    (``"hinge.rz"``) of a driven joint, whose ``direction`` is that of its freedom.
    """

    element: str = field()
    quantity: str = "displacement"
    direction: str | Six = "z"
    wrench: Six = derived(())

    @property
    def order(self) -> int:
        """Number of time derivatives of the displacement."""
        return QUANTITIES.index(self.quantity)

    @property
    def unit(self) -> str:
        """Its unit."""
        return self.units[self.order]

    @property
    def units(self) -> tuple[str, ...]:
        """Units of the displacement, the velocity and the acceleration of this end."""
        return tuple([unit_along(self.wrench, units) for units in MOTION_UNITS])

    def placed(self, to: Placement) -> dict[str, Any]:
        if self.element not in to.parts:  # the coordinate of a joint, whose axes turn along
            return {"element": to.name(self.element)}
        if to.ground != GROUND:
            raise ModelError(f"motion input '{self.name}': it moves the end of '{self.element}' on ground, which is on "
                             f"body '{to.ground}' in the copy; leave it out of the model that is added.",
                             element=self.name, field="element")  # fmt: skip
        return placed_in_axes(self, to)

    def column_names(self, element: Any) -> tuple[str, ...]:
        """Return the names of the one to three inputs that the equations have for it: displacement and, of elements
        whose damper acts at that end, velocity; of a driven joint also acceleration. It is its own name where the
        displacement is the input and nothing else acts.

        ``element``: None for a driven joint.
        """
        if element is None:
            return tuple([f"{self.name}.{quantity}" for quantity in QUANTITIES])
        if isinstance(element, Maxwell):
            return (self.name,) if self.order == 0 else (f"{self.name}.displacement",)
        return f"{self.name}.displacement", f"{self.name}.velocity"


@dataclass(frozen=True, slots=True)
class MotionForce(Signal):
    """Force of a moved end per displacement (``order`` 0) or velocity (1), along ``wrench`` in the element's axes."""

    element: str = field()
    order: int = 0
    wrench: Six = ()
    unit: str = ""


@dataclass(frozen=True, slots=True)
class DrivenCoordinate(Signal):
    """The displacement (``order`` 0), velocity or acceleration of the coordinate ``element`` of a driven joint."""

    element: str = field()
    order: int = 0
    unit: str = ""

    @property
    def source(self) -> str:
        """Name of the motion input."""
        return self.name.rpartition(".")[0]


def make(name: str, element: str, quantity: Any = "displacement", direction: Any = "z") -> MotionInput:
    """Check the values of a motion input and build it."""
    who = f"motion input '{name}'"
    if not isinstance(quantity, str) or quantity not in QUANTITIES:
        raise check.refuse(who, "quantity", quantity, "displacement, velocity or acceleration",
                           nearest(str(quantity), QUANTITIES).strip())  # fmt: skip
    direction, wrench = with_wrench(direction, who)
    return MotionInput(name, element, quantity, direction, wrench)


def of_coordinate(part: MotionInput, joints: Mapping[str, Joint]) -> MotionInput | None:
    """Return the motion of a joint's coordinate where ``element`` is a joint or ``"JOINT.COORDINATE"``, else None.

    It has the full name of the coordinate and its direction. Raises an error if the joint has no such coordinate, or
    several of which none is named.
    """
    name, _, word = part.element.rpartition(".")
    if part.element in joints:
        name, word = part.element, part.direction if isinstance(part.direction, str) else ""
    joint = joints.get(name)
    if joint is None:
        return None
    known = [direction for direction, _ in joint.freedom]
    if name == part.element and len(known) == 1:
        word = known[0]
    if word not in known:
        words = [f"'{name}.{direction}'" for direction in known] or ["that of another joint, as this one has none"]
        raise check.refuse(f"motion input '{part.name}'", "element", part.element,
                           f"a coordinate of joint '{name}': {', '.join(words)}")  # fmt: skip
    direction, wrench = with_wrench(word, part.name)
    return replace(part, element=f"{name}.{word}", direction=direction, wrench=wrench)


def check_element(part: MotionInput, element: Any) -> None:
    """Refuse an ``element`` whose end cannot be moved by an input: what is no spring, bushing or Maxwell element with
    one end on ground, or a direction that is not its own.
    """
    who = f"motion input '{part.name}'"
    if not isinstance(element, (Spring, Bushing, Maxwell, DynamicBushing, DynamicSpring)):
        what = "no element of this model" if element is None else f"a {element.family}"
        raise ModelError(f"{who}: element '{part.element}' is {what}; expected a joint, or a spring, bushing or "
                         f"Maxwell element with one end on ground.", element=part.name, field="element")  # fmt: skip
    if GROUND not in (element.first, element.second):
        raise ModelError(f"{who}: both ends of '{part.element}' are on bodies ('{element.first}' and "
                         f"'{element.second}'); expected an element with one end on ground. A body between them can "
                         f"be moved by a force input.", element=part.name, field="element")  # fmt: skip
    if element.acts_along_line and any(w for i, w in enumerate(part.wrench) if i != 2):
        raise check.refuse(who, "direction", part.direction, "'z', the line of a spring")
    if element.cross_coupling is not None:
        raise ModelError(f"{who}: the matrices of bushing '{part.element}' are not symmetric; its end cannot be moved "
                         f"by an input. Give it symmetric ones.", element=part.name, field="element")  # fmt: skip


def acting_inputs(inputs: Mapping[str, Any], springs: Mapping[str, Any]) -> dict[str, Any]:
    """Return the inputs of the equations by name: those of a model, with the forces of moved ends in place of their
    motions.
    """
    result: dict[str, Any] = {}
    for name, part in inputs.items():
        result |= expand(part, springs).inputs if isinstance(part, MotionInput) else {name: part}
    return result


def expand(part: MotionInput, others: Mapping[str, Any]) -> ExpandedPart:
    """Return the inputs of the equations by which the moved end acts."""
    element = others.get(part.element)
    if element is None:
        return ExpandedPart(inputs={name: DrivenCoordinate(name, part.element, order, unit) for order, (name, unit)
                                    in enumerate(zip(part.column_names(None), part.units, strict=True))})
    check_element(part, element)
    # the rows of a bushing are the displacement of its second body less that of the first one
    sign = 1.0 if element.acts_along_line or element.first == GROUND else -1.0
    wrench = tuple([sign * value for value in part.wrench])
    return ExpandedPart(inputs={name: MotionForce(name, part.element, order, wrench, part.units[order])
                                for order, name in enumerate(part.column_names(element))})
