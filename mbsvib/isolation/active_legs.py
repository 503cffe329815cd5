"""Legs for actuators: line springs, Maxwell elements, directions of bushings, and prismatic joints."""

from __future__ import annotations

from dataclasses import dataclass
from fnmatch import fnmatchcase
from typing import TYPE_CHECKING

import numpy as np

from mbsvib.common.expected import names
from mbsvib.elements import Bushing, Maxwell, Spring
from mbsvib.errors import ModelError, nearest
from mbsvib.mechanism.mechanism import GROUND

if TYPE_CHECKING:
    from collections.abc import Sequence

    from mbsvib.api.model import Model
    from mbsvib.common.arrays import Array
    from mbsvib.elements import Joint

AXES = "xyz"
SLIDES = ("prismatic", "cylindrical")  # kinds of joints that slide along their local z


@dataclass(frozen=True, slots=True, eq=False)
class ActiveLeg:
    """A line with an actuator between two bodies.

    The line goes through ``start`` and ``end`` [m] along the unit vector ``axis``; the stroke is the displacement of
    ``second`` against ``first`` along it. ``elements`` are the springs, dampers and joints between both bodies;
    ``forces`` are those whose tension is that of the leg: name, direction of its force output, and factor.
    """

    name: str
    first: str
    second: str
    start: Array
    end: Array
    axis: Array
    elements: tuple[str, ...]
    forces: tuple[tuple[str, str | Array, float], ...]


def line_springs(model: Model) -> list[str]:
    """Return the names of all line springs and Maxwell elements."""
    return [name for name, part in model.springs.items() if isinstance(part, (Spring, Maxwell))]


def active_legs(model: Model, legs: Sequence[str] | None) -> tuple[ActiveLeg, ...]:
    """Return the legs that are named.

    ``legs``: names or patterns of line springs, Maxwell elements and prismatic or cylindrical joints, and directions of
    bushings (``"mount1.z"``); default: all line springs and Maxwell elements, without any of these all prismatic
    joints.
    """
    lines = line_springs(model)
    slides = [name for name, joint in model.joints.items() if joint.kind in SLIDES]
    bushings = [name for name, part in model.springs.items() if isinstance(part, Bushing)]
    known = [*lines, *slides, *(f"{name}.{axis}" for name in bushings for axis in AXES)]
    if legs is None:
        requested = lines or [name for name in slides if model.joints[name].kind == "prismatic"]
    else:
        requested = [hit for name in names(legs, "actuated", "legs", ModelError) for hit in _hits(model, name, known)]
    if not requested and not (legs is not None and model.inputs and model.outputs):
        raise ModelError(f"actuated: model '{model.name}' has no line spring beside which an actuator could act, and "
                         f"no prismatic joint; add legs by add_spring, name directions of bushings (legs=['mount.z']), "
                         f"or give the model inputs and outputs of its own and say legs=[].", field="legs")  # fmt: skip
    return tuple([_leg(model, name) for name in dict.fromkeys(requested)])


def _hits(model: Model, name: str, known: list[str]) -> list[str]:
    hits = [name] if name in known else [leg for leg in known if fnmatchcase(leg, name)]
    if hits:
        return hits
    if isinstance(model.springs.get(name), Bushing):
        raise ModelError(f"actuated: leg '{name}' is a bushing, which has no line; say in which of its directions the "
                         f"actuator acts: {', '.join(f'{name}.{axis}' for axis in AXES)}.",
                         element=name, field="legs")  # fmt: skip
    raise ModelError(f"actuated: leg '{name}' is not a line spring, Maxwell element, prismatic joint or direction of a "
                     f"bushing of model '{model.name}'.{nearest(name, known)} It has {', '.join(known) or 'none'}.",
                     element=name, field="legs")  # fmt: skip


def _leg(model: Model, name: str) -> ActiveLeg:
    if name in model.joints:
        return _slide(model, model.joints[name])
    part = model.springs.get(name)
    if part is not None:
        return ActiveLeg(name, part.first, part.second, np.array(part.start), np.array(part.end), np.array(part.line),
                         (name,), ((name, "z", 1.0),))  # fmt: skip
    element, direction = name.rsplit(".", 1)
    bushing: Bushing = model.springs[element]
    axis, point = np.array(bushing.orientation)[:, AXES.index(direction)], np.array(bushing.position)
    return ActiveLeg(name, bushing.first, bushing.second, point, point, axis, (element,), ((element, direction, 1.0),))


def _slide(model: Model, joint: Joint) -> ActiveLeg:
    """A joint as a leg; springs and bushings between its bodies act in parallel with the actuator."""
    axis = np.array(joint.axes)[:, 2]
    bodies = {joint.first, joint.second}
    body = joint.first if joint.second == GROUND else joint.second
    point = np.array(model.bodies[body].position if joint.position is None else joint.position)
    elements, forces = [joint.name], []
    for part in model.springs.values():
        if {part.first, part.second} != bodies:
            continue
        elements.append(part.name)
        sign = 1.0 if part.second == joint.second else -1.0
        if isinstance(part, Bushing):
            local = np.array(part.orientation).T @ axis
            forces.append((part.name, sign * local, 1.0))
        elif part.acts_along_line:
            forces.append((part.name, "z", sign * float(np.dot(part.line, axis))))
    ties = [other.name for other in model.joints.values()
            if other.name != joint.name and {other.first, other.second} == bodies]  # fmt: skip
    return ActiveLeg(joint.name, joint.first, joint.second, point, point, axis, (*elements, *ties), tuple(forces))
