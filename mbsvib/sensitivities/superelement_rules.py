"""Superelements that keep their shape under loads: how turns and shifts of them enter the equations.

Mass, stiffness and damping are forms d^T F d of the displacements of the nodes, which turn with the part: about w,
d F = [w]x F - F [w]x. A weight that does not turn with the frame adds theta . Q d + d . Q^T theta of the rotation theta
of the node that carries the part, Q = [g]x L with the first moments L.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from mbsvib.elements.superelement import Superelement
from mbsvib.elements.superelement_expansion import elastic, elastic_part, masses, weight_rows
from mbsvib.linalg.rotations import skew
from mbsvib.linalg.vectors import moved

if TYPE_CHECKING:
    from mbsvib.common.arrays import Array
    from mbsvib.elements.shared_rows import Node
    from mbsvib.linalg.vectors import Field
    from mbsvib.sensitivities.adjoint_fields import Fields
    from mbsvib.sensitivities.network import Network
    from mbsvib.sensitivities.part_rules import Rule, Terms

_POWERS = ("square", "stiff", "rate")


def superelement_motion(
    network: Network, part: Superelement, direction: int
) -> tuple[Rule, tuple[Array, ...]]:  # fmt: skip
    """Return the rule of a shift of a superelement along x, y or z (0 to 2), or a turn about these at its first node.

    Its data are the bodies (1, n) that nodes of the part are, and how their centres of mass move (1, n, 3).
    """
    number = {body.name: i for i, body in enumerate(network.bodies)} | {"ground": -1}
    floats = {int(body): k for k, body in enumerate(network.floating)}
    axis = np.eye(3)[direction % 3]
    points = np.array([point for _, point in part.nodes])
    shifts = np.tile(axis, (len(points), 1)) if direction < 3 else np.cross(axis, points - points[0])
    turn = axis if direction >= 3 else np.zeros(3)
    shift_of = {part.body_of(i): shift for i, shift in enumerate(shifts)}
    forms = [(power, *_form(terms[0], turn, part)) for power, terms in zip(_POWERS, _terms(part), strict=True)
             if terms]  # fmt: skip
    part_of_root, weighed = elastic_part(part), weight_rows(part)
    root, nodes = part_of_root.root, part_of_root.row_nodes
    links = {joint.name: k for k, joint in enumerate(network.joints)}
    linked = [(links[f"{part.name}.{name}"], i) for i, (name, _) in enumerate(part.nodes)
              if f"{part.name}.{name}" in links]  # fmt: skip
    free_nodes = [i for i in range(len(points)) if part.body_of(i) in part.node_names]
    lever, across = (skew(network.gravity) @ rows for rows in (weighed, _turned_rows(weighed, turn, part)))

    def rule(fields: Fields, _: Any, __: tuple[Array, ...]) -> list[Terms]:
        result: Terms = []
        for power, of_motion, form, change in forms:
            d, weight = _displacements(network, number, fields.body, of_motion), getattr(fields, power)
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
            d, theta = _displacements(network, number, fields.body, nodes), fields.body[number[root], 3:] * fields.stiff
            result += _products(theta, np.tensordot(across, d, axes=1))
            result += _products(theta, np.tensordot(lever, _shifted(d, nodes, shift_of), axes=1))
        return [result]

    return rule, (np.array([[number[part.body_of(i)] for i in free_nodes]], dtype=np.intp), shifts[None, free_nodes])


def gravity_rule(network: Network) -> Rule:
    """Return the rule by which gravity turns superelements whose weight does not go with their frames."""
    number = {body.name: i for i, body in enumerate(network.bodies)} | {"ground": -1}
    parts = [(elastic_part(part), weight_rows(part)) for part in network.parts
             if isinstance(part, Superelement)]  # fmt: skip

    def rule(fields: Fields, _: Any, __: tuple[Array, ...]) -> list[Terms]:
        entries: list[Terms] = [[], [], []]
        for part, weighed in parts:
            if number[part.root] >= 0:
                d = _displacements(network, number, fields.body, part.row_nodes)
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


def _displacements(network: Network, number: dict[str, int], body: Field, nodes: tuple[Node, ...]) -> Field:
    """Displacements (6 n, ...) of nodes, against their bodies where they are measured from these."""
    parts = []
    for node in nodes:
        d = np.zeros((6, *body.shape[2:]), dtype=body.dtype)
        for name, sign in ((node.body, 1.0), (node.relative_to, -1.0)):
            if (k := number[name]) >= 0:
                d = d + sign * moved(body[k][None], (np.array(node.point) - network.position[k])[None])[0]
        parts.append(d)
    return np.concatenate(parts)


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
