"""Beams: how their numbers enter the equations, by way of what a beam is made of.

An element is a spring at its midpoint and a mass on its two ends, which mass-proportional dampers follow; modal damping
is a form of all midpoints. All of these are closed formulas of the beam's numbers. Their slopes are differences of the
formulas, extrapolated to rounding (12 digits): nothing of the mechanism is differenced. Where an end moves, so do
nodes, midpoints and axes, on which the wrenches do work as on any other connection that is moved.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from mbsvib.elements.beam import Beam
from mbsvib.elements.beam_expansion import elements, masses, modal_damper
from mbsvib.equations.beam_prestress import bent_forms, element_masses, weight_forms
from mbsvib.errors import ModelError
from mbsvib.linalg.differences import slope
from mbsvib.linalg.rotations import skew
from mbsvib.linalg.vectors import transformed
from mbsvib.sensitivities.part_rules import cross_terms

if TYPE_CHECKING:
    from mbsvib.common.arrays import Array
    from mbsvib.linalg.vectors import Field
    from mbsvib.sensitivities.adjoint_fields import Fields
    from mbsvib.sensitivities.network import Network
    from mbsvib.sensitivities.part_rules import Rule, Terms

# The first step of differences, against the value or the length of an element; the next one is smaller.
STEP, SMALLER = 2.0**-7, 0.125
# Sine of the angle to the vertical below which a beam without a y axis stands upright.
UPRIGHT = 0.05
# Differences that agree no better than this, against the largest of their kind, are those of what jumps.
WORST = 1e-8
# Slopes below this share of the largest are rounding.
ACTS = 1e-11


def beam_rule(network: Network, beam: Beam, field: str, index: tuple[int, ...] = ()) -> tuple[Rule, tuple[Array, ...]]:
    """Return the rule by which a number of a beam enters the equations.

    Its data are the bodies (1, n) that nodes of the beam are, and how their centres of mass move (1, n, 3). Raises an
    error if the beam does not change smoothly with the number.
    """
    return changed_beam(network, beam, slopes(beam, field, index))


def changed_beam(network: Network, beam: Beam, change: dict[str, Array]) -> tuple[Rule, tuple[Array, ...]]:
    """Return the rule of a change of a beam, given by its ``slopes``; see ``beam_rule``."""
    number = {body.name: i for i, body in enumerate(network.bodies)}
    springs = {spring.name: i for i, spring in enumerate(network.springs)}
    joints = {joint.name: i for i, joint in enumerate(network.joints)}
    which = np.array([springs[name] for name in beam.element_names])
    element_joints = np.array([joints[name] for name in beam.element_names])
    ends = [(number.get(beam.body_of(i), -1), np.array(point)) for i, point in enumerate(beam.points)]
    present = numbers(beam)
    axes = present["axes"].swapaxes(1, 2)
    stiff, rate = change["stiffness"], change["damping"]
    mass, by_mass, (modal,) = (_factors(change[key]) for key in ("mass", "by_mass", "modal"))
    nodes, middles, turns = change["points"], middle_rates(change), change["turns"]
    first = len(network.joints)
    bent, bends = _bent_lines(network, first + which, present, change)
    bends_as = _factors(bends)
    floats = {int(body): k for k, body in enumerate(network.floating)}

    def rule(fields: Fields, _: Any, __: tuple[Array, ...]) -> list[Terms]:
        strain, result = fields.strain[which], _terms(modal, _flat(fields.relative[first + which]), 0.5 * fields.rate)
        local = np.concatenate((transformed(axes, strain[:, :3]), transformed(axes, strain[:, 3:])), axis=1)
        for e in range(len(which)):
            for i in range(6):
                weight = 0.5 * (stiff[e, i] * fields.stiff + rate[e, i] * fields.rate)
                result.append((weight * local[e : e + 1, i], local[e : e + 1, i]))
            moved = _ends(network, fields.body, ends[e : e + 2])
            result += _terms(mass[e], moved, 0.5 * fields.square) + _terms(by_mass[e], moved, 0.5 * fields.rate)
            result += _terms(bends_as[e], fields.relative[first + which[e]], 0.5 * fields.stiff)
        return [result + (_moved(fields) if nodes.any() else [])]

    def _moved(fields: Fields) -> Terms:
        """Nodes, midpoints and axes move."""
        result: Terms = []
        in_joint, in_spring = fields.wrench[element_joints], fields.wrench[first + which]
        opened, strained = -fields.relative[element_joints], fields.relative[first + which]
        for wrench, moves in ((in_joint, opened), (in_spring, strained)):
            result += _along(wrench[:, :3], moves[:, 3:], middles)
            result += _along(wrench[:, :3], moves[:, :3], turns) + _along(wrench[:, 3:], moves[:, 3:], turns)
        if present["modal"].any():
            braked = (np.tensordot(present["modal"], _flat(strained), axes=1) * fields.rate).reshape(strained.shape)
            result += _along(braked[:, :3], strained[:, 3:], middles)
        if bent.any():
            result += _along((transformed(bent, strained) * fields.stiff)[:, :3], strained[:, 3:], middles)
        for e in range(len(which)):
            moved = _ends(network, fields.body, ends[e : e + 2])
            force = np.tensordot(present["mass"][e], moved, axes=1) * (fields.square + beam.alpha * fields.rate)
            for side, (body, _) in enumerate(ends[e : e + 2]):
                if body >= 0:
                    result += _along(force[None, 6 * side : 6 * side + 3], fields.body[body : body + 1, 3:],
                                     nodes[e + side : e + side + 1])  # fmt: skip
        for i, (body, _) in enumerate(ends):
            if body in floats and beam.body_of(i) in beam.node_names:
                k = floats[body]
                result += _along(fields.support[k : k + 1, :3], -fields.body[body : body + 1, 3:], nodes[i : i + 1])
        return result

    own_nodes = [i for i in range(len(ends)) if beam.body_of(i) in beam.node_names]
    return rule, (np.array([[ends[i][0] for i in own_nodes]]), nodes[None, own_nodes])


def _bent_lines(
    network: Network, which: Array, present: dict[str, Array], change: dict[str, Array]
) -> tuple[Array, Array]:  # fmt: skip
    """Stiffness T B + W B' (e, 6, 6) of the bent lines of elements under tension T and weight W along them, world axes,
    and how it changes while their forces (connections ``which``) stay as they are: T = -f . a and W = m g . a change as
    the axis a turns.
    """
    axes, turns = present["axes"], change["turns"]
    if network.forces is None:
        return np.zeros((len(axes), 6, 6)), np.zeros((len(axes), 6, 6))
    force, along = network.forces.wrench[which, :3], axes[:, :, 0]
    tension, less = (-(force * way).sum(axis=1)[:, None, None] for way in (along, np.cross(turns, along)))
    local = np.zeros((len(axes), 6, 6))
    local[:, :3, :3] = local[:, 3:, 3:] = axes
    spin = np.zeros((len(axes), 6, 6))
    spin[:, :3, :3] = spin[:, 3:, 3:] = skew(turns)
    weight, heavier = (masses[:, None, None] * (way @ network.gravity)[:, None, None] for masses, way in (
        (present["masses"], along), (change["masses"], along)))  # fmt: skip
    heavier = heavier + (present["masses"] * (np.cross(turns, along) @ network.gravity))[:, None, None]
    bent, bent_change = np.zeros((2, len(axes), 6, 6))
    for key, size, more in (("bent", tension, less), ("weighed", weight, heavier)):
        form, other = (local @ forms[key] @ local.swapaxes(1, 2) for forms in (present, change))
        bent = bent + size * form
        bent_change = bent_change + size * (other + spin @ form - form @ spin) + more * form
    return bent, bent_change


def gravity_rule(network: Network) -> Rule:
    """Return the rule by which gravity along elements of beams changes the stiffness of their bent lines."""
    springs = {spring.name: len(network.joints) + i for i, spring in enumerate(network.springs)}
    elements = []
    for beam in (part for part in network.parts if isinstance(part, Beam)):
        for name, (_, axes), mass, form in zip(beam.element_names, beam.frames(), element_masses(beam),
                                               weight_forms(beam), strict=True):  # fmt: skip
            local = np.kron(np.eye(2), np.array(axes))
            elements.append((springs[name], mass * np.array(axes)[:, 0], _factors((local @ form @ local.T)[None])[0]))

    def rule(fields: Fields, _: Any, __: tuple[Array, ...]) -> list[Terms]:
        return [[(rate[i] * p, q) for k, rate, factors in elements
                 for p, q in _terms(factors, fields.relative[k], 0.5 * fields.stiff)] for i in range(3)]  # fmt: skip

    return rule


def motion_slopes(beam: Beam, direction: int) -> dict[str, Array]:
    """Return how ``numbers`` change as a beam shifts along x, y, z (0 to 2), or turns about these at its first node."""
    present = numbers(beam)
    count, axis = len(present["axes"]), np.eye(3)[direction % 3]
    fixed = ("stiffness", "damping", "mass", "by_mass", "bent", "weighed", "masses", "weight")
    result = {key: np.zeros_like(present[key]) for key in fixed}
    result |= {"modal": np.zeros_like(present["modal"])[None], "turns": np.zeros((count, 3)),
               "points": np.tile(axis, (count + 1, 1)), "centres": np.tile(axis, (count + 1, 1))}  # fmt: skip
    if direction < 3:
        return result
    for key, copies in (("mass", 4), ("by_mass", 4), ("modal", 2 * count)):
        spin = np.kron(np.eye(copies), skew(axis))
        result[key] = spin @ present[key] - present[key] @ spin
    result["modal"] = result["modal"][None]
    arms = {key: present[key] - present["points"][0] for key in ("points", "centres")}
    return result | {"turns": np.tile(axis, (count, 1))} | {key: np.cross(axis, arm) for key, arm in arms.items()}


def middle_rates(change: dict[str, Array]) -> Array:
    """Return how the midpoints of elements move (e, 3)."""
    return np.asarray(0.5 * (change["points"][1:] + change["points"][:-1]))


def has_rule(beam: Beam, field: str) -> bool:
    """Tell whether a beam changes smoothly with a number: the axes of one that stands upright jump as it is tilted."""
    upright = any(np.hypot(axes[0][0], axes[1][0]) < UPRIGHT for _, axes in beam.frames())
    return field not in ("start", "end", "length") or beam.y_axis is not None or not upright


def numbers(beam: Beam) -> dict[str, Array]:
    """Return what a beam is made of.

    They are ``stiffness`` and ``damping`` (e, 6) of the elements' springs in their axes; ``mass`` (e, 12, 12) on their
    ends, the damping ``by_mass`` and ``modal`` damping (6 e, 6 e) at their midpoints, world axes; ``points`` (e + 1, 3)
    and ``axes`` (e, 3, 3); ``bent`` and ``weighed`` (e, 6, 6), what unit tension and unit weight along an element add
    to the stiffness, in axes of the elements; ``masses`` (e,) of the elements, and
    ``weight`` (e + 1,), the mass by which gravity acts on each node, with its ``centres`` (e + 1, 3).
    """
    springs = [spring for _, spring in elements(beam)]
    axes = np.array([spring.orientation for spring in springs])
    stiffness = np.array([spring.stiffness for spring in springs])
    mass = np.array([piece.matrix.T @ piece.matrix for piece in masses(beam)])
    modal = np.zeros((6 * len(springs), 6 * len(springs)))
    weight, centres = beam.node_weights()
    if beam.damping_ratio:
        damper = modal_damper(beam)
        assert damper.damping is not None
        modal = damper.matrix.T @ (damper.damping[:, None] * damper.matrix)
    return {"stiffness": stiffness, "damping": beam.beta * stiffness, "mass": mass, "by_mass": beam.alpha * mass,
            "modal": modal, "points": np.array(beam.points), "axes": axes, "bent": bent_forms(beam),
            "weight": weight, "centres": centres, "weighed": weight_forms(beam),
            "masses": element_masses(beam)}  # fmt: skip


def slopes(beam: Beam, field: str, index: tuple[int, ...] = ()) -> dict[str, Array]:
    """Return how ``numbers`` change, with ``turns`` (e, 3) of the axes in place of these.

    ``field``: one of its fields. Raises an error if the beam does not change smoothly with the number.
    """
    present = numbers(beam)
    value = next(item.value for item in beam.parameter_fields() if item.name == field)
    start = value[index[0]] if index else value
    shapes = {key: part.shape for key, part in present.items()}
    ends = np.cumsum([part.size for part in present.values()])[:-1]
    if field in ("alpha", "beta", "damping_ratio"):  # linear, and not to be negative
        twice = numbers(beam.with_values({field: 2.0 * start or 1.0}))
        result = {key: (twice[key] - present[key]) / (start or 1.0) for key in present}
    else:
        length = min(size for size, _ in beam.frames())
        scale = length if index or field == "length" else abs(start) or 1.0

        def at(change: float) -> Array:
            moved = start + change
            entry = tuple(moved if i == index[0] else v for i, v in enumerate(value)) if index else moved
            return np.concatenate([part.reshape(-1) for part in numbers(beam.with_values({field: entry})).values()])

        sizes = np.concatenate([np.full(part.size, np.abs(part).max(initial=0.0)) for part in present.values()])
        for step in (STEP, STEP * SMALLER):
            flat, error = slope(at, step * scale)
            if not (scale * error > WORST * (sizes + scale * np.abs(flat))).any():
                break
        else:
            raise ModelError(
                f"sensitivities: beam '{beam.name}' does not change smoothly with its '{field}' (differences agree to "
                f"{error.max():.1e} only). Compare variants by model.with_values.", element=beam.name, field=field,
            )  # fmt: skip
        result = {key: part.reshape(shape) for (key, shape), part in zip(shapes.items(), np.split(flat, ends),
                                                                        strict=True)}  # fmt: skip
    spin = result.pop("axes") @ present["axes"].swapaxes(1, 2)
    result["modal"] = result["modal"][None]
    result["turns"] = 0.5 * np.stack((spin[:, 2, 1] - spin[:, 1, 2], spin[:, 0, 2] - spin[:, 2, 0],
                                     spin[:, 1, 0] - spin[:, 0, 1]), axis=1)  # fmt: skip
    return result


def _factors(matrices: Array) -> list[tuple[Array, Array]]:
    """Symmetric matrices (k, n, n) as sizes (r,) and rows (r, n) each."""
    result, largest = [], np.abs(matrices).max(initial=0.0)
    for matrix in matrices:
        sizes, vectors = np.linalg.eigh(0.5 * (matrix + matrix.T))
        acts = np.abs(sizes) > ACTS * largest
        result.append((sizes[acts], np.ascontiguousarray(vectors.T[acts])))
    return result


def _flat(parts: Field) -> Field:
    return parts.reshape(6 * len(parts), *parts.shape[2:])


def _terms(factors: tuple[Array, Array], motion: Field, weight: Field) -> Terms:
    """Terms of a symmetric matrix on a motion (n, ...)."""
    sizes, rows = factors
    moved = np.tensordot(rows, motion, axes=1)
    return [(size * weight * row[None], row[None]) for size, row in zip(sizes, moved, strict=True)]


def _along(force: Field, theta: Field, way: Array) -> Terms:
    """Terms of the sum over k of force . (theta x way), each (k, 3, ...)."""
    result: Terms = []
    for k, vector in enumerate(way):
        for value, entry in zip(vector.tolist(), cross_terms(force[k : k + 1], theta[k : k + 1]), strict=True):
            if value:
                result += [(value * p, q) for p, q in entry]
    return result


def _ends(network: Network, body: Field, ends: list[tuple[int, Array]]) -> Field:
    """Displacements (12, ...) of the two ends of an element, which may be points of rigid bodies."""
    parts = []
    for number, point in ends:
        if number < 0:
            parts.append(np.zeros((6, *body.shape[2:]), dtype=body.dtype))
            continue
        moved, (x, y, z) = np.array(body[number]), point - network.position[number]
        rx, ry, rz = body[number, 3:]
        moved[0] += ry * z - rz * y
        moved[1] += rz * x - rx * z
        moved[2] += rx * y - ry * x
        parts.append(moved)
    return np.concatenate(parts)
