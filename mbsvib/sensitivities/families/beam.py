"""Beams: how their numbers enter the equations, by way of what a beam is made of.

An element is a spring at its midpoint and a mass on its two ends, which mass-proportional dampers follow; modal damping
is a form of all midpoints. All of these are closed formulas of the beam's numbers. Their slopes are differences of the
formulas, extrapolated to rounding (12 digits): nothing of the mechanism is differenced. Where an end moves, so do
nodes, midpoints and axes, on which the wrenches do work as on any other connection that is moved.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from mbsvib.elements.beam_expansion import elements, masses, modal_damper
from mbsvib.equations.beam_prestress import bent_forms, element_masses, weight_forms
from mbsvib.linalg.rotations import skew
from mbsvib.linalg.vectors import moved, transformed
from mbsvib.sensitivities.families.part_slopes import part_slopes
from mbsvib.sensitivities.families.rules import InternalRule, PartRules
from mbsvib.sensitivities.families.terms import cross_terms, factors, form_terms

if TYPE_CHECKING:
    from collections.abc import Sequence

    from mbsvib.common.arrays import Array
    from mbsvib.elements.beam import Beam
    from mbsvib.linalg.vectors import Field
    from mbsvib.sensitivities.adjoint_fields import Fields
    from mbsvib.sensitivities.families.pose_changes import PoseRates
    from mbsvib.sensitivities.families.rules import RuleAndData
    from mbsvib.sensitivities.families.terms import Rule, Terms
    from mbsvib.sensitivities.force_layout import RowTerms
    from mbsvib.sensitivities.forces import Forces
    from mbsvib.sensitivities.network import Network

# The field of the place and orientation of a part that keeps its shape, which are no parameters.
MOTION = "motion"
# Sine of the angle to the vertical below which a beam without a y axis stands upright.
UPRIGHT = 0.05


def _single(network: Network, beam: Beam, field: str, index: tuple[int, ...]) -> RuleAndData:
    return _changed_beam(network, beam, slopes(beam, field, index))


def _changed_beam(network: Network, beam: Beam, change: dict[str, Array]) -> RuleAndData:
    """The rule of a change of a beam, given by its ``slopes``.

    Its data are the bodies (1, n) that nodes of the beam are, and how their centres of mass move (1, n, 3). Raises an
    error if the beam does not change smoothly with the number.
    """
    which = np.array([network.spring_number[name] for name in beam.element_names])
    element_joints = np.array([network.joint_number[name] for name in beam.element_names])
    ends = [(network.body_number[body], np.array(point)) for body, point in beam.node_bodies]
    present = numbers(beam)
    axes = present["axes"].swapaxes(1, 2)
    stiff, rate = change["stiffness"], change["damping"]
    mass, by_mass, (modal,) = (factors(change[key]) for key in ("mass", "by_mass", "modal"))
    nodes, middles, turns = change["points"], middle_rates(change), change["turns"]
    first = len(network.joints)
    bent, bends = _bent_stiffness(network, first + which, present, change)
    bends_as = factors(bends)
    floats = network.floating_number

    def rule(fields: Fields, _: Any, __: tuple[Array, ...]) -> list[Terms]:
        strain = fields.strain[which]
        result = form_terms(modal, _flat(fields.relative[first + which]), 0.5 * fields.rate)
        local = np.concatenate((transformed(axes, strain[:, :3]), transformed(axes, strain[:, 3:])), axis=1)
        for e in range(len(which)):
            for i in range(6):
                weight = 0.5 * (stiff[e, i] * fields.stiff + rate[e, i] * fields.rate)
                result.append((weight * local[e : e + 1, i], local[e : e + 1, i]))
            both = _ends(network, fields.body, ends[e : e + 2])
            result += form_terms(mass[e], both, 0.5 * fields.square) + form_terms(by_mass[e], both, 0.5 * fields.rate)
            result += form_terms(bends_as[e], fields.relative[first + which[e]], 0.5 * fields.stiff)
        return [result + (_moved(fields) if nodes.any() or turns.any() else [])]

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
            both = _ends(network, fields.body, ends[e : e + 2])
            force = np.tensordot(present["mass"][e], both, axes=1) * (fields.square + beam.alpha * fields.rate)
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


def _bent_stiffness(
    network: Network, which: Array, present: dict[str, Array], change: dict[str, Array]
) -> tuple[Array, Array]:  # fmt: skip
    """Stiffness T B + W B' (e, 6, 6) of the bent lines of elements under tension T and weight W along them, with that
    of f . (r x d) / 2, world axes, and how it changes while their forces f (connections ``which``) stay as they are:
    T = -f . a and W = m g . a change as the axis a turns.
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
    half = 0.5 * skew(force)
    bent[:, :3, 3:] += half
    bent[:, 3:, :3] -= half
    return bent, bent_change


def _gravity_rule(network: Network, beams: Sequence[Beam]) -> Rule:
    """The rule by which gravity along elements of beams changes the stiffness of their bent lines."""
    joints, elements = len(network.joints), []
    for beam in beams:
        for name, (_, axes), mass, form in zip(beam.element_names, beam.frames(), element_masses(beam),
                                               weight_forms(beam), strict=True):  # fmt: skip
            local = np.kron(np.eye(2), np.array(axes))
            elements.append((joints + network.spring_number[name], mass * np.array(axes)[:, 0],
                             factors((local @ form @ local.T)[None])[0]))  # fmt: skip

    def rule(fields: Fields, _: Any, __: tuple[Array, ...]) -> list[Terms]:
        return [[(rate[i] * p, q) for k, rate, form in elements
                 for p, q in form_terms(form, fields.relative[k], 0.5 * fields.stiff)] for i in range(3)]  # fmt: skip

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
    if field not in ("start", "end", "length") or beam.y_axis is not None:
        return True
    return not any(np.hypot(axes[0][0], axes[1][0]) < UPRIGHT for _, axes in beam.frames())


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
    if field in ("alpha", "beta", "damping_ratio"):  # linear, and not to be negative
        value = getattr(beam, field)
        twice = numbers(beam.with_values({field: 2.0 * value or 1.0}))
        result = {key: (twice[key] - present[key]) / (value or 1.0) for key in present}
    else:
        length = min(size for size, _ in beam.frames())
        result = part_slopes(beam, field, index, numbers, length if index or field == "length" else None)
    spin = result.pop("axes") @ present["axes"].swapaxes(1, 2)
    result["modal"] = result["modal"][None]
    result["turns"] = 0.5 * np.stack((spin[:, 2, 1] - spin[:, 1, 2], spin[:, 0, 2] - spin[:, 2, 0],
                                     spin[:, 1, 0] - spin[:, 0, 1]), axis=1)  # fmt: skip
    return result


def _flat(parts: Field) -> Field:
    return parts.reshape(6 * len(parts), *parts.shape[2:])


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
    return np.concatenate([displacement(network, body, number, point) for number, point in ends])


def displacement(network: Network, body: Field, number: int, point: Array) -> Field:
    """Return the displacement (6, ...) of a point of a body, whose number is -1 for ground."""
    if number < 0:
        return np.zeros((6, *body.shape[2:]), dtype=body.dtype)
    return np.asarray(moved(body[number][None], (point - network.position[number])[None])[0])


def _add_force_terms(terms: RowTerms, network: Network, forces: Forces, beam: Beam, _: int) -> None:
    """Its elements carry forces at their midpoints, its nodes the weight and loads without points of their own."""
    at, joints, points = terms.at, len(network.joints), range(len(beam.points))
    elements = [at.point_of(joints + network.spring_number[name]) for name in beam.element_names]
    weight_of = {f"{beam.name}.weight{i}": i for i in points}
    node_of = {beam.body_of(i): i for i in points if beam.body_of(i) in beam.node_names}
    loads = list(zip(network.loads, forces.loads.tolist(), strict=True))
    weights = [(weight_of[load.name], k) for load, k in loads if load.name in weight_of]
    at_nodes = [(node_of[load.body], k) for load, k in loads if load.position is None and load.body in node_of]
    for key in [key for key in terms.row if key[0] == beam.name]:
        change = motion_slopes(beam, key[2][0]) if key[1] == MOTION else slopes(beam, *key[1:])
        for point, middle in zip(elements, middle_rates(change), strict=True):
            terms.put(key, point, middle)
        for i, k in at_nodes:
            terms.put(key, at.point_of(k), change["points"][i])
        for i, k in weights:
            terms.put(key, at.point_of(k), change["centres"][i])
            terms.put(key, at.wrench_of(k), change["weight"][i] * forces.gravity)
    for i, k in weights:
        for j in range(3):
            terms.put(("gravity", "", (j,)), at.wrench_of(k) + j, (numbers(beam)["weight"][i],))


def _internal_rules(network: Network, beam: Beam) -> list[InternalRule]:
    """It goes with its first node."""
    ruled = [_changed_beam(network, beam, motion_slopes(beam, i)) for i in range(6)]
    return [InternalRule(rule, 1, np.zeros(1, dtype=np.intp), data) for rule, data in ruled]


def follow_first_node(rates: PoseRates, part: Any, _: int) -> None:
    """Let a part that keeps its shape shift and turn with its first node."""
    body, point = part.node_bodies[0]
    number = rates.network.body_number[body]
    if number >= 0:
        arm = np.array(point) - rates.network.position[number]
        rates.put(part.name, MOTION, moved(rates.motion[number][None], arm[None])[0])


def _bent_lines(beam: Beam) -> tuple[tuple[str, ...], Array, Array]:
    return beam.element_names, np.array([axes for _, axes in beam.frames()]), bent_forms(beam)


RULES = PartRules(
    "composed", single=_single, has_rule=has_rule, add_force_terms=_add_force_terms, follow=follow_first_node,
    is_exception=lambda beam, *_: beam.displacements is not None or not has_rule(beam, "start"),
    internal=(MOTION, 6), internal_rules=_internal_rules, gravity_rule=_gravity_rule, bent_lines=_bent_lines,
    reactions=lambda beam: (beam.element_names, (), 0),
)  # fmt: skip
