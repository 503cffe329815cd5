"""Struts as ideal lines: stiffness J^T k J in closed form, rings of ends as variables; legs that may have actuators.

Relaxation legs as their parts, whose derivatives are known: springs, dampers and massless nodes between them.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from mbsvib.api.model import Model
from mbsvib.common import arguments as check
from mbsvib.common.arrays import Array
from mbsvib.common.columnar import Columnar
from mbsvib.common.display import Displayed
from mbsvib.common.expected import names, one_of, reals
from mbsvib.common.patterns import matching
from mbsvib.elements import Bushing, Joint, Maxwell, Spring
from mbsvib.errors import ModelError
from mbsvib.isolation.study_scene import check_body, radius_of_gyration
from mbsvib.mechanism.mechanism import GROUND

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
    hits = matching(name, known)
    if hits:
        return hits
    if isinstance(model.springs.get(name), Bushing):
        raise ModelError(f"actuated: leg '{name}' is a bushing, which has no line; say in which of its directions the "
                         f"actuator acts: {', '.join(f'{name}.{axis}' for axis in AXES)}.",
                         element=name, field="legs")  # fmt: skip
    raise check.unknown(name, known, f"actuated: leg '{name}' is not a line spring, Maxwell element, prismatic joint "
                        f"or direction of a bushing of model '{model.name}'", "legs")  # fmt: skip


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


ENDS = ("start", "end")


@dataclass(frozen=True, repr=False, eq=False)
class Struts(Columnar, Displayed):
    """Legs that push and pull along their lines and do nothing else: ``jacobian`` J (legs, 6) from the body's motion
    at the reference point to their elongations, ``stiffness`` J^T k J (6, 6), ``length`` [m] for rotations.
    """

    legs: tuple[str, ...]
    jacobian: Array
    stiffness: Array
    length: float

    def columns(self) -> dict[str, Any]:
        """Return a row of the Jacobian for each leg, as columns ``leg``, ``x`` [1] to ``rz`` [m]."""
        return {"leg": np.array(self.legs), **dict(zip(check.DIRECTIONS, self.jacobian.T, strict=True))}

    @property
    def coupling(self) -> float:
        """Largest off-diagonal entry over the geometric mean of its diagonal ones: 0 where all six motions decouple."""
        size = np.sqrt(np.abs(np.diagonal(self.stiffness)))
        relative = np.abs(self.stiffness) / np.maximum(np.outer(size, size), np.finfo(float).tiny)
        return float((relative - np.diag(np.diagonal(relative))).max())

    @property
    def dexterity(self) -> float:
        """Smallest over largest singular value of J, rotations at the length: 1 for equal stiffness of all motions."""
        scale = np.array([1.0, 1.0, 1.0, *[1.0 / self.length] * 3])
        values = np.linalg.svd(self.jacobian * scale, compute_uv=False)
        return float(values[-1] / values[0])

    def __repr__(self) -> str:
        return f"Struts({len(self.legs)} legs, coupling {self.coupling:.3g})"


def struts(model: Model, body: str, legs: Sequence[str] | None = None, point: ArrayLike | None = None) -> Struts:
    """Return the stiffness of ideal legs, K = J^T k J, with what joints, flexures and leg masses do left out.

    J_i = (u_i, r_i x u_i), u the leg's line, r from the reference point to its end

    Parameters
    ----------
    model : Model
        The mechanism.
    body : str
        The isolated body.
    legs : sequence of str, optional
        Line springs or Maxwell elements; default: all of them.
    point : array-like, shape (3,), optional
        Reference point [m]; default: the body's centre of mass.

    Returns
    -------
    Struts
        Jacobian and stiffness.

    Raises
    ------
    ModelError
        If a name is unknown.
    """
    check_body(model, body, "struts", "body")
    part = model.bodies[body]
    origin = np.array(part.position if point is None else check.vector(point, "struts", "point"))
    leg_names = _lines(model, legs)
    rows, k = [], []
    for name in leg_names:
        leg = model.springs[name]
        line = np.array(leg.line)
        rows.append(np.concatenate((line, np.cross(np.array(leg.end) - origin, line))))
        k.append(leg.static_stiffness if isinstance(leg, Maxwell) else leg.stiffness)
    jacobian = np.array(rows)
    stiffness = jacobian.T @ (np.array(k)[:, None] * jacobian)
    return Struts(leg_names, jacobian, stiffness, radius_of_gyration(part) or 1.0)


def ring(
    model: Model, end: str, legs: Sequence[str] | None = None, centre: ArrayLike = (0, 0)
) -> dict[str, dict[str, float]]:
    """Return variables that move the ends of legs on a ring, as ties for ``optimize``: radius, height and spread.

    The ``spread`` moves neighbours apart along the ring [m], every other end the other way: with the radius it gives
    the ends any angle that keeps the symmetry. Legs have to be line springs without bodies of their own; ``platform``
    takes others too.

    Parameters
    ----------
    model : Model
        The mechanism; the axis of the ring is along z.
    end : str
        "start" or "end" of the legs.
    legs : sequence of str, optional
        Line springs or Maxwell elements, in order of their angle; default: all of them, sorted so.
    centre : array-like, shape (2,)
        x and y of the axis [m].

    Returns
    -------
    dict of str to dict of str to float
        Rates of parameters with ``END.radius``, ``END.height``, ``END.spread`` [m/m].

    Raises
    ------
    ModelError
        If a leg is unknown or its end is on the axis.
    """
    one_of(end, ENDS, "ring", "end", ModelError)
    leg_names = list(_lines(model, legs))
    middle = reals(centre, "ring", "centre", "x and y of the axis [m]", ModelError)
    if middle.shape != (2,) or not np.isfinite(middle).all():
        raise check.refuse("ring", "centre", centre, "x and y of the axis [m]")
    away = {name: np.array(getattr(model.springs[name], end))[:2] - middle for name in leg_names}
    if legs is None:
        leg_names.sort(key=lambda name: float(np.arctan2(*away[name][::-1])))
    result: dict[str, dict[str, float]] = {f"{end}.{dimension}": {} for dimension in ("radius", "height", "spread")}
    for i, name in enumerate(leg_names):
        radius = float(np.linalg.norm(away[name]))
        if radius == 0.0:
            raise ModelError(f"ring: {end} of leg '{name}' is on the axis, and has no direction to move in; give "
                             f"another centre.", element=name, field="centre")  # fmt: skip
        out = away[name] / radius
        along = np.array([-out[1], out[0]]) * (1.0 if i % 2 else -1.0)
        for axis, outward, tangent in zip("xy", out.tolist(), along.tolist(), strict=True):
            result[f"{end}.radius"][f"{name}.{end}.{axis}"] = outward
            result[f"{end}.spread"][f"{name}.{end}.{axis}"] = tangent
        result[f"{end}.height"][f"{name}.{end}.z"] = 1.0
    return result


def _lines(model: Model, legs: Sequence[str] | None) -> tuple[str, ...]:
    lines = line_springs(model)
    selected = tuple(lines if legs is None else names(legs, "struts", "legs", ModelError))
    for name in selected:
        check.known(name, lines, f"struts: leg '{name}' is neither a line spring nor a Maxwell element of model "
                    f"'{model.name}'", "legs")  # fmt: skip
    if not selected:
        raise ModelError(f"struts: model '{model.name}' has no line springs.", field="legs")
    return selected


def unfolded(model: Model) -> Model:
    """Return a model whose Maxwell elements are springs and dampers with a massless node between them.

    Its motion is the same. A Maxwell element NAME becomes the springs ``NAME.static`` (if it has such a stiffness) and
    ``NAME.spring``, the damper ``NAME.damper``, and the body ``NAME.node`` that slides along the line on
    ``NAME.guide``; stiffness and damping of these are variables of a passive design.

    Parameters
    ----------
    model : Model
        The mechanism, which is not changed.

    Returns
    -------
    Model
        A copy.

    Raises
    ------
    ModelError
        If an input, output or other part names a Maxwell element.
    """
    springs: Mapping[str, Bushing | Spring | Maxwell] = model.springs
    result = model.with_parts(springs={name: part for name, part in springs.items() if not isinstance(part, Maxwell)})
    for part in [part for part in springs.values() if isinstance(part, Maxwell)]:
        ports = [port.name for port in (*model.inputs.values(), *model.outputs.values())
                 if part.name in port.constructor_kwargs().values()]  # fmt: skip
        if ports:
            raise ModelError(f"unfolded: '{ports[0]}' names the Maxwell element '{part.name}', which becomes several "
                             f"parts; leave this port out.", element=ports[0])  # fmt: skip
        start, end = np.array(part.start), np.array(part.end)
        middle = 0.5 * (start + end)
        node = f"{part.name}.node"
        if part.static_stiffness:
            result.add_spring(f"{part.name}.static", part.first, part.second, start, end, part.static_stiffness)
        result.add_body(node, 0.0, (0.0, 0.0, 0.0), middle)
        result.add_joint(f"{part.name}.guide", "prismatic", part.first, node, middle, axis=part.line)
        result.add_spring(f"{part.name}.spring", part.first, node, start, middle, part.stiffness)
        result.add_spring(f"{part.name}.damper", node, part.second, middle, end, damping=part.damping)
    return result
