"""The scene of an isolation study: a mechanism with base motion, loads on the payload and outputs of the legs."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from math import sqrt

import numpy as np
from numpy.typing import ArrayLike

from mbsvib.api.model import ADDERS, Model
from mbsvib.api.system import System
from mbsvib.common import arguments as check
from mbsvib.common.arguments import Vector
from mbsvib.common.arrays import Array
from mbsvib.common.expected import a_model, names
from mbsvib.elements import Body, Bushing, Spring
from mbsvib.elements.coupler import Coupling
from mbsvib.elements.superelement import Superelement
from mbsvib.equations.ports import fixed_in_world
from mbsvib.errors import ModelError, nearest
from mbsvib.mechanism.mechanism import GROUND

DIRECTIONS = check.DIRECTIONS
ACCELERATIONS = tuple(f"acceleration.{direction}" for direction in DIRECTIONS)
DISPLACEMENTS = tuple(f"displacement.{direction}" for direction in DIRECTIONS)
LOADS = tuple(f"load.{direction}" for direction in DIRECTIONS)
REFERENCES = ("first", "second", "body", "a", "b")


@dataclass(frozen=True, slots=True)
class Leg:
    """Outputs of a spring-damper: ``stroke`` [m] and ``force`` [N]. The stroke is measured along its line in the given
    pose; if that line moves, the stroke follows from the force by the ``law``, the parameters k and c in k + c s.
    """

    name: str
    stroke: str
    force: str
    law: tuple[str, str] | None = None


@dataclass(frozen=True, slots=True)
class StudyScene:
    """A mechanism ready to be studied: ``system`` has the inputs ``base.x`` ... ``base.rz`` (accelerations of the base)
    and ``load.x`` ... ``load.rz`` (wrench on the payload), the outputs ``acceleration.x`` ... ``acceleration.rz``
    (absolute) and ``displacement.x`` ... (against the base) of the payload, and those of ``legs``.

    All are taken at ``point`` [m]; ``length`` [m] makes rotations comparable; ``base_directions`` are the directions in
    which the base is shaken.
    """

    model: Model
    system: System
    body: str
    base: str
    point: Vector
    length: float
    base_directions: tuple[str, ...]
    legs: tuple[Leg, ...]
    notes: tuple[str, ...]

    @property
    def inputs(self) -> tuple[str, ...]:
        """Names of the base accelerations."""
        return tuple([f"base.{direction}" for direction in self.base_directions])

    def scale(self, directions: Sequence[str] = DIRECTIONS) -> Array:
        """Return the factors that make motions comparable: 1 for translations, the length for rotations."""
        return np.array([self.length if direction.startswith("r") else 1.0 for direction in directions])


def scene(
    model: Model, body: str, base: str = GROUND, point: ArrayLike | None = None, length: float | None = None,
    directions: Sequence[str] | None = None, *, keep_ports: bool = False, more: Callable[[Model], None] | None = None,
) -> StudyScene:  # fmt: skip
    """Return a mechanism with the ports of an isolation study without changing the model.

    ``base``: what is shaken: the ground, or a body whose motion is prescribed, so that it takes the ground's place.
    ``point`` (3,): reference point of all motions and wrenches [m]; default: the body's centre of mass. ``length``:
    length [m] that makes rotations comparable; default: the root mean square distance of the body's mass from its
    centre. ``directions``: in which the base is shaken; default: all six, or x y z where weight or other loads do not
    turn with the base. ``keep_ports``: whether inputs and outputs of the model are kept; they come first.
    ``more``: adds further ports to the copy.
    """
    who = "isolation"
    a_model(model, who)
    check_body(model, body, who, "body")
    check_body(model, base, who, "base")
    if body == base:
        raise ModelError(f"{who}: body and base are both '{body}', so that nothing is isolated; name another base.",
                         element=body, field="base")  # fmt: skip
    part = model.bodies[body]
    at = part.position if point is None else check.vector(point, who, "point")
    size = radius_of_gyration(part) if length is None else check.number(length, who, "length", "a positive length [m]")
    if size <= 0.0:
        hint = "A body of no extent has no length of its own: give one." if length is None else ""
        raise check.refuse(who, "length", length, "a positive length [m]", hint)
    copy = _with_base(model, base, keep_ports)
    base_directions, notes = _base_directions(copy, directions)
    try:
        for direction in base_directions:
            copy.add_base_motion(f"base.{direction}", direction, at)
        for direction in DIRECTIONS:
            copy.add_input(f"load.{direction}", body, direction, at)
        for quantity in ("acceleration", "displacement"):
            for direction in DIRECTIONS:
                copy.add_output(f"{quantity}.{direction}", body, direction, at, quantity=quantity)
        legs = _measured(copy)
        if more is not None:
            more(copy)
    except ModelError as error:
        if error.field == "name" and error.element in {*model.inputs, *model.outputs}:
            kind = "input" if error.element in model.inputs else "output"
            raise ModelError(f"isolation: {kind} '{error.element}' of model '{model.name}' has the name of a port that "
                             f"the study adds; rename it, or leave it out.", element=error.element,
                             field="name") from error  # fmt: skip
        raise
    system = copy.linearize(method="dense")
    return StudyScene(copy, system, body, base, at, float(size), base_directions, legs, notes)


def check_body(model: Model, name: str, who: str, field: str) -> None:
    """Refuse what is no body of a model; as a ``base`` the ground is one."""
    check.known(name, [*model.bodies, *([GROUND] if field == "base" else [])],
                f"{who}: {field} = {name!r}; expected a body of model '{model.name}'", field)  # fmt: skip


def radius_of_gyration(body: Body) -> float:
    """Return the root mean square distance [m] of a body's mass from its centre, 0 without mass."""
    return sqrt(0.5 * sum(body.inertia[:3]) / body.mass) if body.mass > 0.0 else 0.0


def _with_base(model: Model, base: str, keep_ports: bool) -> Model:
    """A copy of the model that stands on its base, with its own ports or without any."""
    if base == GROUND:
        return model.with_parts() if keep_ports else model.with_parts(inputs={}, outputs={})
    result = _welded(model, base)
    for part in [*model.inputs.values(), *model.outputs.values()] if keep_ports else ():
        kwargs = part.constructor_kwargs()
        for field in ("body", "relative_to", "element"):
            if kwargs.get(field) == base:
                kwargs[field] = GROUND
        try:
            getattr(result, ADDERS[type(part)])(**kwargs)
        except ModelError as error:
            raise ModelError(f"isolation: base = '{base}' takes the place of the ground, and '{part.name}' of model "
                             f"'{model.name}' cannot be kept: {error} Leave it out of the model, or take the ground as "
                             f"the base.", element=part.name, field="base") from error  # fmt: skip
    return result


def _welded(model: Model, base: str) -> Model:
    """The model with a body in place of the ground."""
    result = Model(model.name, model.gravity)
    groups = (model.bodies, model.composed, model.joints, model.springs, model.couplers, model.rotors, model.loads)
    removed = set()
    for part in [part for group in groups for part in group.values() if part.name != base]:
        kwargs = part.constructor_kwargs()
        named = {kwargs[field] for field in REFERENCES if field in kwargs}
        if isinstance(part, Coupling):
            references = [name for name, _ in part.terms if name.rsplit(".", 1)[0] in removed]
        elif isinstance(part, Superelement):
            references = [name for name in (base, GROUND) if name in dict(part.bodies).values()]
        elif named and named <= {base, GROUND}:
            removed.add(part.name)
            continue
        else:
            references = [GROUND] if GROUND in named else []
        if references:
            raise ModelError(f"isolation: base = '{base}' takes the place of the ground, but '{part.name}' is tied to "
                             f"'{references[0]}'; take the ground as the base, or leave '{part.name}' out.",
                             element=part.name, field="base")  # fmt: skip
        kwargs |= {field: GROUND for field in REFERENCES if kwargs.get(field) == base}
        getattr(result, ADDERS[type(part)])(**kwargs)
    return result


def _base_directions(model: Model, directions: Sequence[str] | None) -> tuple[tuple[str, ...], tuple[str, ...]]:
    if directions is not None:
        selected = tuple(names(directions, "isolation", "directions", ModelError))
        for direction in selected:
            if direction not in DIRECTIONS:
                raise check.refuse("isolation", "directions", direction, "some of x y z rx ry rz",
                                   nearest(str(direction), DIRECTIONS).strip())  # fmt: skip
        if not selected:
            raise check.refuse("isolation", "directions", directions, "some of x y z rx ry rz")
        return tuple([d for d in DIRECTIONS if d in selected]), ()
    fixed = next(fixed_in_world(model), None)
    if fixed is None:
        return DIRECTIONS, ()
    return DIRECTIONS[:3], (f"The base is shaken along x, y, z only: {fixed[0]} and does not turn with it.",)


def _measured(model: Model) -> tuple[Leg, ...]:
    legs = []
    for name, spring in model.springs.items():
        if isinstance(spring, Bushing):
            axes, coefficients = np.array(spring.orientation), np.abs(spring.stiffness) + np.abs(spring.damping)
            for i, direction in enumerate("xyz"):
                if coefficients[i].any():
                    alone = coefficients.ndim == 1 or not np.delete(coefficients[i], i).any()
                    law = (f"{name}.stiffness.{direction}", f"{name}.damping.{direction}") if alone else None
                    leg = f"{name}.{direction}"
                    legs.append(Leg(leg, f"{leg}.stroke", f"{leg}.force", law))
                    model.add_output(legs[-1].stroke, spring.second, axes[:, i], spring.position, spring.first)
                    model.add_force_output(legs[-1].force, name, direction)
        elif spring.acts_along_line:  # torsion springs have no stroke
            law = (f"{name}.stiffness", f"{name}.damping")
            uncoupled = isinstance(spring, Spring) and bool(spring.stiffness or spring.damping)
            legs.append(Leg(name, f"{name}.stroke", f"{name}.force", law if uncoupled else None))
            model.add_output(legs[-1].stroke, spring.second, spring.line, spring.start, spring.first)
            model.add_force_output(legs[-1].force, name)
    return tuple(legs)
