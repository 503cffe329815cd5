"""Superelements that keep their shape under loads: how turns and shifts of them enter the equations.

Mass, stiffness and damping are forms d^T F d of the displacements of the nodes, which turn with the part: about w,
d F = [w]x F - F [w]x. A weight that does not turn with the frame adds theta . Q d + d . Q^T theta of the rotation theta
of the node that carries the part, Q = [g]x L with the first moments L.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from mbsvib.elements.superelement_expansion import elastic, elastic_part, masses, weight_rows
from mbsvib.linalg.rotations import skew
from mbsvib.sensitivities.families.beam import MOTION, displacement, follow_first_node
from mbsvib.sensitivities.families.rules import InternalRule, PartRules

if TYPE_CHECKING:
    from collections.abc import Sequence

    from mbsvib.common.arrays import Array
    from mbsvib.elements.shared_rows import Node
    from mbsvib.elements.superelement import Superelement
    from mbsvib.linalg.vectors import Field
    from mbsvib.sensitivities.adjoint_fields import Fields
    from mbsvib.sensitivities.families.terms import Rule, Terms
    from mbsvib.sensitivities.force_layout import RowTerms
    from mbsvib.sensitivities.forces import Forces
    from mbsvib.sensitivities.network import Network

_POWERS = ("square", "stiff", "rate")


def _motion_rule(network: Network, part: Superelement, direction: int) -> InternalRule:
    """The rule of a shift of a superelement along x, y or z (0 to 2), or a turn about these at its first node.

    Its data are the bodies (1, n) that nodes of the part are, and how their centres of mass move (1, n, 3).
    """
    number, floats, links = network.body_number, network.floating_number, network.joint_number
    axis = np.eye(3)[direction % 3]
    points = np.array([point for _, point in part.nodes])
    shifts = np.tile(axis, (len(points), 1)) if direction < 3 else np.cross(axis, points - points[0])
    turn = axis if direction >= 3 else np.zeros(3)
    shift_of = {part.body_of(i): shift for i, shift in enumerate(shifts)}
    forms = [(power, *_form(terms[0], turn, part)) for power, terms in zip(_POWERS, _terms(part), strict=True)
             if terms]  # fmt: skip
    part_of_root, weighed = elastic_part(part), weight_rows(part)
    root, nodes = part_of_root.root, part_of_root.row_nodes
    linked = [(links[f"{part.name}.{name}"], i) for i, (name, _) in enumerate(part.nodes)
              if f"{part.name}.{name}" in links]  # fmt: skip
    free_nodes = [i for i in range(len(points)) if part.body_of(i) in part.node_names]
    lever, across = (skew(network.gravity) @ rows for rows in (weighed, _turned_rows(weighed, turn, part)))

    def rule(fields: Fields, _: Any, __: tuple[Array, ...]) -> list[Terms]:
        result: Terms = []
        for power, of_motion, form, change in forms:
            d, weight = _displacements(network, fields.body, of_motion), getattr(fields, power)
            result += _products(d, 0.5 * np.tensordot(change, d, axes=1) * weight)
            result += _products(_shifted(d, of_motion, shift_of), np.tensordot(form, d, axes=1) * weight)
        for k, i in linked:  # joints hand on what the nodes take
            wrench, opened = fields.wrench[k], -fields.relative[k]
            result += _products(np.cross(opened[3:], shifts[i], axisa=0, axisc=0), wrench[:3])
            result += _products(np.cross(turn, opened.reshape(2, 3, *opened.shape[1:]), axisb=1, axisc=1).reshape(
                opened.shape), -wrench)  # fmt: skip
        for i in free_nodes:
            body = number[part.body_of(i)]
            if body in floats:
                result += _products(-np.cross(fields.body[body, 3:], shifts[i], axisa=0, axisc=0),
                                    fields.support[floats[body], :3])  # fmt: skip
        if lever.any() and number[root] >= 0:
            d, theta = _displacements(network, fields.body, nodes), fields.body[number[root], 3:] * fields.stiff
            result += _products(theta, np.tensordot(across, d, axes=1))
            result += _products(theta, np.tensordot(lever, _shifted(d, nodes, shift_of), axes=1))
        return [result]

    bodies = np.array([[number[part.body_of(i)] for i in free_nodes]], dtype=np.intp)
    return InternalRule(rule, 1, np.zeros(1, dtype=np.intp), (bodies, shifts[None, free_nodes]))


def _gravity_rule(network: Network, superelements: Sequence[Superelement]) -> Rule:
    """The rule by which gravity turns superelements whose weight does not go with their frames."""
    number = network.body_number
    parts = [(elastic_part(part), weight_rows(part)) for part in superelements]

    def rule(fields: Fields, _: Any, __: tuple[Array, ...]) -> list[Terms]:
        entries: list[Terms] = [[], [], []]
        for part, weighed in parts:
            if number[part.root] >= 0:
                d = _displacements(network, fields.body, part.row_nodes)
                theta = fields.body[number[part.root], 3:] * fields.stiff
                for entry, unit in zip(entries, np.eye(3), strict=True):
                    entry += _products(theta, np.tensordot(skew(unit) @ weighed, d, axes=1))
        return entries

    return rule


def _terms(part: Superelement) -> tuple[list[Any], list[Any], list[Any]]:
    """The rows of mass, stiffness and damping."""
    every = elastic(part)
    return masses(part), [shared for shared in every if shared.stiffness is not None], [
        shared for shared in every if shared.damping is not None]  # fmt: skip


def _form(shared: Any, turn: Array, part: Superelement) -> tuple[tuple[Node, ...], Array, Array]:
    """Nodes of rows, their form F (6 n, 6 n), and how it changes as the part turns."""
    weights = shared.stiffness if shared.stiffness is not None else shared.damping
    form = shared.matrix.T @ (shared.matrix if weights is None else weights[:, None] * shared.matrix)
    spin = _spin(len(shared.nodes), turn, part)
    return shared.nodes, form, spin @ form - form @ spin


def _spin(nodes: int, turn: Array, part: Superelement) -> Array:
    """[w]x of displacements and rotations of nodes; internal coordinates, which come last, do not turn."""
    result = np.kron(np.eye(2 * nodes), skew(turn))
    end = 6 * (nodes - len(part.carriers))
    result[end:, end:] = 0.0
    return np.asarray(result, dtype=float)


def _turned_rows(weighed: Array, turn: Array, part: Superelement) -> Array:
    """How rows (3, 6 n) of first moments change as the part turns."""
    return np.asarray(skew(turn) @ weighed - weighed @ _spin(weighed.shape[1] // 6, turn, part))


def _displacements(network: Network, body: Field, nodes: tuple[Node, ...]) -> Field:
    """Displacements (6 n, ...) of nodes, against their bodies where they are measured from these."""
    first, second = ([displacement(network, body, network.body_number[name], np.array(node.point))
                      for node, name in zip(nodes, names, strict=True)]
                     for names in ([node.relative_to for node in nodes], [node.body for node in nodes]))  # fmt: skip
    return np.asarray(np.concatenate(second) - np.concatenate(first))


def _shifted(d: Field, nodes: tuple[Node, ...], shift_of: dict[str, Array]) -> Field:
    """What displacements (6 n, ...) gain as the nodes are shifted: theta x dp."""
    result = np.zeros_like(d)
    for i, node in enumerate(nodes):
        if node.moves_with_ground:
            result[6 * i : 6 * i + 3] = np.cross(d[6 * i + 3 : 6 * i + 6], shift_of[node.body], axisa=0, axisc=0)
    return result


def _products(left: Field, right: Field) -> Terms:
    """Terms of the sum of products of entries."""
    return [(p[None], q[None]) for p, q in zip(left, right, strict=True)]


def _add_force_terms(terms: RowTerms, network: Network, forces: Forces, part: Superelement, _: int) -> None:
    """It acts at its nodes; the body that carries it takes its weight."""
    points, joints = np.array([point for _, point in part.nodes]), len(network.joints)
    elements = [(i, joints + network.spring_number[name]) for i, (node, _) in enumerate(part.nodes)
                if (name := f"{part.name}.{node}") in network.spring_number]  # fmt: skip
    node_of = {part.body_of(i): i for i in range(len(points)) if part.body_of(i) in part.node_names}
    loads = list(zip(network.loads, forces.loads.tolist(), strict=True))
    weights = [(np.array(load.position), k) for load, k in loads if load.name == f"{part.name}.weight"]
    moving = [(points[i], k) for i, k in elements] + weights + [
        (points[node_of[load.body]], k) for load, k in loads if load.position is None and load.body in node_of]
    for i, way in enumerate(np.tile(np.eye(3), (2, 1))):
        for at, k in moving:
            terms.put((part.name, MOTION, (i,)), terms.at.point_of(k), way if i < 3 else np.cross(way, at - points[0]))
    for i, way in enumerate(np.eye(3) if weights else ()):
        for load in elastic_part(part, tuple(way.tolist())).loads:
            terms.put(("gravity", "", (i,)), terms.at.wrench_of(weights[0][1]), load.force)


def _reactions(part: Superelement) -> tuple[tuple[str, ...], tuple[str, ...], int] | None:
    """Statics does not determine the forces of one that some motion does not strain."""
    stiff = elastic_part(part)
    return None if len(stiff.values) < stiff.rows.shape[1] else (stiff.names, part.carriers, part.internal)


RULES = PartRules(
    "composed", add_force_terms=_add_force_terms, follow=follow_first_node, internal=(MOTION, 6),
    internal_rules=lambda network, part: [_motion_rule(network, part, i) for i in range(6)],
    gravity_rule=_gravity_rule, is_exception=lambda part, *_: part.displacements is not None, reactions=_reactions,
)  # fmt: skip
