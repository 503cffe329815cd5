"""Beams and superelements: how their numbers, and motions of them as wholes, enter the equations by what they are made
of.

Numbers act by the motions of connections and by forms of the displacements of nodes; where points and axes move, the
wrenches there do work as on any other connection that is moved.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import chain
from typing import Any

import numpy as np

from mbsvib.common.arrays import Array
from mbsvib.elements.beam import Beam
from mbsvib.elements.families import ELASTIC
from mbsvib.elements.superelement import Superelement
from mbsvib.equations.beam_prestress import per_tension
from mbsvib.linalg.rotations import skew
from mbsvib.linalg.vectors import Field, moved, transformed
from mbsvib.sensitivities.adjoint_fields import Fields
from mbsvib.sensitivities.families.elastic_numbers import (
    Entry,
    Made,
    beam_slopes,
    element_names,
    loaded_forms,
    moved_as_rigid,
    weights_of,
)
from mbsvib.sensitivities.families.pose_changes import PoseRates, RowTerms
from mbsvib.sensitivities.families.rules import (
    InternalRule,
    LoadRules,
    PartRules,
    Rule,
    RuleAndData,
    Terms,
    factors,
    form_terms,
)
from mbsvib.sensitivities.forces import Forces
from mbsvib.sensitivities.network import Network

# The field of the place and orientation of a part that keeps its shape, which are no parameters.
MOTION = "motion"


def _at_rest(network: Network, part: Any) -> tuple[tuple[tuple[float, ...], ...], tuple[float, ...]]:
    """The forces (elements, 3) in the elements of a part at the pose, and gravity there; zero without loads."""
    none, number, names = (0.0, 0.0, 0.0), network.spring_number, element_names(part)
    if network.forces is None:
        return (none,) * len(names), none
    wrench = network.forces.wrench[len(network.joints) :]
    return (tuple([tuple(wrench[number[name], :3].tolist()) if name in number else none for name in names]),
            tuple(network.gravity.tolist()))  # fmt: skip


def _changed(beam: Beam, rest: tuple[Any, Any], entry: Entry) -> tuple[Made, dict[Any, Array]]:
    """What a beam is made of under forces at rest, and the slopes of these numbers to one of its own."""
    made, slopes = beam_slopes(beam, *rest)
    return made, slopes[entry]


def _rule(network: Network, made: Made, change: Mapping[Any, Array]) -> RuleAndData:
    """The rule of a change of a part.

    Its data are the bodies (1, n) that nodes of the part are, and how their centres of mass move (1, n, 3).
    """
    first, floats = len(network.joints), network.floating_number
    which = [network.spring_number[name] for name in made.springs]
    joints = np.array([network.joint_number[name] for name in made.joints], dtype=np.intp)
    connections = np.concatenate((joints, first + np.array(which, dtype=np.intp)))
    sign = np.repeat((-1.0, 1.0), (len(joints), len(which)))
    ways = np.concatenate((change["joints"], change["elements"][: len(which)]))
    moving = np.zeros((len(ways), 6, 6))
    moving[:, :3, :3] = moving[:, 3:, 3:] = -sign[:, None, None] * skew(change["turns"])
    moving[:, :3, 3:] = -sign[:, None, None] * skew(ways)
    acting, axis = np.nonzero(moving.any(axis=2))
    axes = np.zeros((len(which), 6, 6))
    axes[:, :3, :3] = axes[:, 3:, 3:] = made.numbers["axes"][len(joints) :]
    coefficients = [(power, factors(axes @ change[key] @ axes.swapaxes(1, 2))) for power, key in (
        ("stiff", "stiffness"), ("rate", "damping")) if change[key].any()]  # fmt: skip
    forms = []
    for key, (form, points) in made.forms.items():
        nodes = [(network.body_number[body], network.body_number[other], point)
                 for (body, other, _), point in zip(key[1], points, strict=True)]
        shift = np.zeros(form.shape)
        for i, (way, (*_, goes)) in enumerate(zip(change[key, 1], key[1], strict=True)):
            shift[6 * i : 6 * i + 3, 6 * i + 3 : 6 * i + 6] = -skew(way) * goes
        rows = shift.any(axis=1)
        forms.append((key[0], nodes, factors(change[key, 0][None])[0], shift[rows], form[rows]))
    numbers = [network.body_number[name] for name in made.bodies[: len(change["nodes"])]]
    hanging = [(floats[body], body, -skew(way)) for body, way in zip(numbers, change["nodes"], strict=True)
               if body in floats]  # fmt: skip

    def rule(fields: Fields, _: Any, __: tuple[Array, ...]) -> list[Terms]:
        result: Terms = []
        for power, of_springs in coefficients:
            for k, form in zip(which, of_springs, strict=True):
                result += form_terms(form, fields.strain[k], 0.5 * getattr(fields, power))
        if len(acting):
            taken, wrench = transformed(moving, fields.relative[connections]), fields.wrench[connections]
            result += _products(wrench[acting, axis], taken[acting, axis])
        for power, nodes, changed, shift, acts in forms:
            if not (len(changed[0]) or len(shift)):
                continue
            d, weight = _displacements(network, fields.body, nodes), getattr(fields, power)
            result += form_terms(changed, d, 0.5 * weight)
            result += _products(np.tensordot(shift, d, axes=1), np.tensordot(acts, d, axes=1) * weight)
        for k, body, across in hanging:
            result += _products(-np.tensordot(across, fields.body[body, 3:], axes=1), fields.support[k, :3])
        return [result]

    return rule, (np.array([numbers], dtype=np.intp), change["nodes"][None])


def _displacements(network: Network, body: Field, nodes: Sequence[tuple[int, int, Array]]) -> Field:
    """Displacements (6 n, ...) of nodes against others at their points; -1 is the ground."""
    return np.concatenate([_displacement(network, body, number, point) - (
        0.0 if other < 0 else _displacement(network, body, other, point)) for number, other, point in nodes])


def _displacement(network: Network, body: Field, number: int, point: Array) -> Field:
    """The displacement (6, ...) of a point of a body."""
    if number < 0:
        return np.zeros((6, *body.shape[2:]), dtype=body.dtype)
    return np.asarray(moved(body[number][None], (point - network.position[number])[None])[0])


def _products(left: Field, right: Field) -> Terms:
    """Terms of the sum of products of entries."""
    return [(p[None], q[None]) for p, q in zip(left, right, strict=True)]


def _single(network: Network, beam: Beam, field: str, index: tuple[int, ...]) -> RuleAndData:
    return _rule(network, *_changed(beam, _at_rest(network, beam), (field, index)))


def _internal_rules(network: Network, part: Any) -> list[InternalRule]:
    """It goes with its first node."""
    ruled = [_rule(network, *moved_as_rigid(part, *_at_rest(network, part), i)) for i in range(6)]
    return [InternalRule(rule, 1, np.zeros(1, dtype=np.intp), data) for rule, data in ruled]


def _gravity_rule(network: Network, parts: Sequence[Any]) -> Rule:
    """The rule by which gravity changes the stiffness of parts under their weight."""
    of_ways: list[Any] = []
    for unit in np.eye(3):
        forms = chain.from_iterable(loaded_forms(part, np.zeros((len(element_names(part)), 3)), unit) for part in parts)
        of_ways.append([([(network.body_number[body], network.body_number[other], point)
                          for (body, other, _), point in zip(key[1], points, strict=True)], factors(form[None])[0])
                        for key, form, points in forms])  # fmt: skip

    def rule(fields: Fields, _: Any, __: tuple[Array, ...]) -> list[Terms]:
        return [list(chain.from_iterable(
            form_terms(form, _displacements(network, fields.body, nodes), 0.5 * fields.stiff)
            for nodes, form in forms)) for forms in of_ways]  # fmt: skip

    return rule


def _add_force_terms(terms: RowTerms, network: Network, forces: Forces, part: Any, _: int) -> None:
    """It carries forces in its elements, and at its nodes its weight and loads without points of their own."""
    at, joints, rest = terms.at, len(network.joints), _at_rest(network, part)
    loads = list(zip(network.loads, forces.loads.tolist(), strict=True))
    load_of = {load.name: k for load, k in loads}
    for key in [key for key in terms.row if key[0] == part.name]:
        made, change = moved_as_rigid(part, *rest, key[2][0]) if key[1] == MOTION else _changed(part, rest, key[1:])
        for name, way in zip(made.elements, change["elements"], strict=True):
            if name in network.spring_number:
                terms.put(key, at.point_of(joints + network.spring_number[name]), way)
        node_of = dict(zip(made.bodies, change["nodes"], strict=False))
        for load, k in loads:
            if load.position is None and load.body in node_of:
                terms.put(key, at.point_of(k), node_of[load.body])
        for name, centre, weight in zip(made.weights, change["centres"], change["weight"], strict=True):
            terms.put(key, at.point_of(load_of[name]), centre)
            terms.put(key, at.wrench_of(load_of[name]), weight)
    for i, unit in enumerate(np.eye(3) if network.gravity.any() else ()):
        for weight in weights_of(part, unit):
            terms.put(("gravity", "", (i,)), at.wrench_of(load_of[weight.name]), weight.force)


def _follow(rates: PoseRates, part: Any, _: int) -> None:
    """It shifts and turns with its first node."""
    body, point = part.node_bodies[0]
    number = rates.network.body_number[body]
    if number >= 0:
        arm = np.array(point) - rates.network.position[number]
        rates.put(part.name, MOTION, moved(rates.motion[number][None], arm[None])[0])


def _has_rule(beam: Beam, field: str) -> bool:
    """Whether a beam changes smoothly with a number."""
    return field in beam.batched_fields


def _reactions(part: Superelement) -> tuple[tuple[str, ...], tuple[str, ...], int] | None:
    """Statics does not determine the forces of one that some motion does not strain."""
    stiff = ELASTIC[type(part)](part)
    return None if len(stiff.values) < stiff.rows.shape[1] else (stiff.names, part.carriers, part.internal)


_COMMON: dict[str, Any] = {"add_force_terms": _add_force_terms, "follow": _follow, "internal": (MOTION, 6),
                           "internal_rules": _internal_rules, "gravity_rule": _gravity_rule}  # fmt: skip
BEAM = PartRules(
    "composed", single=_single, has_rule=_has_rule,
    loaded=LoadRules(
        lambda beam, *_: beam.displacements is not None or not beam.turns_smoothly,
        bent_lines=lambda beam: (beam.element_names, np.array([axes for _, axes in beam.frames()]),
                                 per_tension(beam.parts())[..., None] * np.eye(6)),
        reactions=lambda beam: (beam.element_names, (), 0), **_COMMON),
)  # fmt: skip
SUPERELEMENT = PartRules("composed", loaded=LoadRules(
    lambda part, *_: part.displacements is not None, reactions=_reactions, **_COMMON))  # fmt: skip
