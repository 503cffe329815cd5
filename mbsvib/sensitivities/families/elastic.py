"""Beams and superelements: how their numbers, and motions of them as wholes, enter the equations by what they are made
of.

Numbers act by the motions of connections and by forms of the displacements of nodes; where points and axes move, the
wrenches there do work as on any other connection that is moved.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from mbsvib.common.arrays import Array, Index
from mbsvib.elements.beam import Beam
from mbsvib.elements.families import ELASTIC
from mbsvib.elements.superelement import Superelement
from mbsvib.equations.beam_prestress import per_tension
from mbsvib.linalg.rotations import rigid_transport, skew
from mbsvib.linalg.vectors import moved
from mbsvib.sensitivities.families.elastic_numbers import (
    Entry,
    Made,
    Nodes,
    beam_slopes,
    element_names,
    loaded_forms,
    moved_as_rigid,
    weights_of,
)
from mbsvib.sensitivities.families.pose_changes import PoseRates, RowTerms
from mbsvib.sensitivities.families.rules import LoadRules, PartRules
from mbsvib.sensitivities.forces import Forces
from mbsvib.sensitivities.local_forms import (
    NONE,
    Local,
    LocalForm,
    Shift,
    displaced,
    entries,
    factored,
    moved_connection,
    six_axes,
    square,
)
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


def _forms(network: Network, made: Made, change: Mapping[Any, Array]) -> list[LocalForm | Shift]:
    """The forms of a change of a part: connections move and change, rows of nodes too, and nodes that float shift."""
    first = len(network.joints)
    springs = np.array([network.spring_number[name] for name in made.springs], dtype=np.intp)
    joints = np.array([network.joint_number[name] for name in made.joints], dtype=np.intp)
    sign = np.repeat((-1.0, 1.0), (len(joints), len(springs)))[:, None]
    ways = np.concatenate((change["joints"], change["elements"][: len(springs)]))
    forms = [moved_connection(np.concatenate((joints, first + springs)), entries(displaced(
        (sign * ways)[:, None], (sign * change["turns"])[:, None])))]  # fmt: skip
    axes = six_axes(made.numbers["axes"][len(joints) :])
    forms += [square("strain", springs, power, entries(change[key][:, None]), axes)
              for power, key in (("stiff", "stiffness"), ("rate", "damping")) if change[key].any()]  # fmt: skip
    for key, (form, points) in made.forms.items():
        shift = np.zeros(form.shape)
        for i, (way, (*_, goes)) in enumerate(zip(change[key, 1], key[1], strict=True)):
            shift[6 * i : 6 * i + 3, 6 * i + 3 : 6 * i + 6] = -skew(way) * goes
        bodies, moves = _displacements(network, key, points)
        forms.append(_node_form(network, key, points, change[key, 0]))
        if (rows := shift.any(axis=1)).any():  # half of the weight twice
            forms.append(LocalForm(
                Local("body", bodies, key[0], (2.0 * form[rows] @ moves)[None]),
                Local("body", bodies, "", (shift[rows] @ moves)[None]), *entries(np.eye(int(rows.sum()))[None, None]),
            ))  # fmt: skip
    floats, ways = network.floating_number, change["nodes"][:, None]
    nodes = np.array([network.body_number[name] for name in made.bodies[: len(ways)]], dtype=np.intp)
    hanging = [k for k, body in enumerate(nodes.tolist()) if body in floats]
    if hanging:
        support = np.array([floats[body] for body in nodes[hanging].tolist()])
        forms.append(LocalForm(Local("support", support), Local("body", nodes[hanging]),
                               *entries(displaced(-ways[hanging], NONE))))  # fmt: skip
    return [Shift(nodes, ways), *forms]


def _node_form(network: Network, key: Nodes, points: Array, matrix: Array) -> LocalForm:
    """The form of a symmetric matrix on the displacements of nodes."""
    bodies, moves = _displacements(network, key, points)
    sizes, axes = factored(matrix[None])
    return square("body", bodies, key[0], sizes, axes @ moves)


def _displacements(network: Network, key: Nodes, points: Array) -> tuple[Index, Array]:
    """The bodies (1, b) that move some nodes, and the displacements (6 n, 6 b) of these against others at their points.
    """
    numbers = [(network.body_number[body], network.body_number[other]) for body, other, _ in key[1]]
    bodies = sorted({number for pair in numbers for number in pair} - {-1})
    moves = np.zeros((6 * len(numbers), 6 * len(bodies)))
    for i, (pair, point) in enumerate(zip(numbers, points, strict=True)):
        for number, side in zip(pair, (1.0, -1.0), strict=True):
            if number >= 0:
                k = 6 * bodies.index(number)
                moves[6 * i : 6 * i + 6, k : k + 6] += side * rigid_transport(point - network.position[number])
    return np.array([bodies], dtype=np.intp), moves


def _single(network: Network, beam: Beam, field: str, index: tuple[int, ...]) -> list[LocalForm | Shift]:
    return _forms(network, *_changed(beam, _at_rest(network, beam), (field, index)))


def _internal_forms(network: Network, part: Any) -> list[list[LocalForm | Shift]]:
    """It goes with its first node."""
    return [_forms(network, *moved_as_rigid(part, *_at_rest(network, part), i)) for i in range(6)]


def _gravity_forms(network: Network, part: Any) -> list[list[LocalForm]]:
    """How gravity changes the stiffness of a part under its weight."""
    none = np.zeros((len(element_names(part)), 3))
    return [[_node_form(network, key, points, form) for key, form, points in loaded_forms(part, none, unit)]
            for unit in np.eye(3)]  # fmt: skip


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
                           "internal_forms": _internal_forms, "gravity_forms": _gravity_forms}  # fmt: skip
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
