"""Expansion of superelements to bodies, free joints and shared rows.

Nodes are bodies with free joints to the first node. Each group of three internal coordinates is the displacement of a
body. Mass, stiffness and damping are rows that all of them share. The rows of stiffness have displacements relative to
one node, so that rigid-body motions are exactly free.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from mbsvib.elements import joint as _joint
from mbsvib.elements.elastic_part import (
    ElasticPart,
    carrier_joints,
    massless_bodies,
    on_carriers,
    root_rotation_rows,
    stiffness_rows,
)
from mbsvib.elements.load import NONE, Load
from mbsvib.elements.shared_rows import ExpandedPart, Node, SharedRows
from mbsvib.elements.superelement import RIGID, rigid_motions
from mbsvib.errors import ModelError
from mbsvib.linalg.rotations import axial, skew

if TYPE_CHECKING:
    from mbsvib.common.arguments import Vector
    from mbsvib.common.arrays import Array, Index
    from mbsvib.elements.superelement import Superelement


def expand(part: Superelement, *_: Any) -> ExpandedPart:
    """Return nodes, joints and shared rows of a superelement."""
    joints = {}
    for i, (name, point) in enumerate(part.nodes[1:], 1):
        key, first, second = f"{part.name}.{name}", part.body_of(0), part.body_of(i)
        if first != second:
            joints[key] = _joint.make(key, "free", first, second, point, part.orientation, None, None, None, None)
    joints |= carrier_joints(part.name, part.carriers, part.points[0], part.internal)
    return ExpandedPart(massless_bodies(part.body_positions), joints, mass=tuple(masses(part)),
                        elastic=tuple(elastic(part)))  # fmt: skip


def masses(part: Superelement) -> list[SharedRows]:
    """Return the rows W of M = W^T W."""
    values, rows = part.factors[0]
    layout = Layout.of(part, None)
    return [SharedRows(part.name, layout.row_nodes(part), layout.rows(rows * np.sqrt(values)[:, None]))]


def elastic(part: Superelement) -> list[SharedRows]:
    """Return the rows of K and, if there is a C, those of C."""
    result = []
    _, (k, _), damping = part.factors
    if len(k):
        result.append(stiffness_rows(elastic_part(part)))
    if damping is not None and len(damping[0]):
        c, rows = damping
        layout = Layout.of(part, None if rows.shape[1] == len(part.M) else part.root_node)
        result.append(SharedRows(part.name, layout.row_nodes(part), layout.rows(rows), damping=c))
    return result


@dataclass(frozen=True, slots=True)
class Layout:
    """Coordinates of a superelement: all, or relative to the node ``root`` and without its coordinates.

    ``nodes`` are numbers of nodes, ``coordinates`` are numbers of coordinates, of which the last ``internal`` are
    those.
    """

    nodes: tuple[int, ...]
    coordinates: Index
    internal: int
    axes: Array
    root: int | None

    @classmethod
    def of(cls, part: Superelement, root: int | None) -> Layout:
        """Return the layout relative to a node, None: of all coordinates."""
        count = len(part.nodes)
        nodes = tuple([i for i in range(count) if i != root])
        interface = [6 * i + j for i in nodes for j in range(6)]
        coordinates = np.array([*interface, *range(6 * count, len(part.M))], dtype=np.intp)
        return cls(nodes, coordinates, part.internal, np.array(part.orientation), root)

    def world(self, rows: Array) -> Array:
        """Return rows (..., n) on coordinates in the axes of the part as rows on coordinates in world axes."""
        end = 6 * len(self.nodes)
        in_world = (rows[..., :end].reshape(-1, 3) @ self.axes.T).reshape(*rows.shape[:-1], end)
        return np.concatenate((in_world, rows[..., end:]), axis=-1)

    def row_nodes(self, part: Superelement) -> tuple[Node, ...]:
        """Return the nodes of rows, and the bodies of internal coordinates."""
        relative_to = "ground" if self.root is None else part.body_of(self.root)
        origin = part.nodes[0][1]
        bodies = part.node_bodies
        return (*[Node(*bodies[i], relative_to=relative_to) for i in self.nodes],
                *[Node(name, origin, moves_with_ground=False) for name in part.carriers])  # fmt: skip

    def rows(self, rows: Array) -> Array:
        """Return rows on coordinates as rows on six displacements in world axes of each node and carrier."""
        return on_carriers(self.world(rows), self.internal)


def elastic_part(part: Superelement, gravity: Vector | None = None) -> ElasticPart:
    """Return a superelement as a linear elastic part in the frame of its root, with its weight."""
    layout = Layout.of(part, part.root_node)
    values, rows = part.factors[1]
    nodes = layout.row_nodes(part)[: len(layout.nodes)]
    point = part.points[part.root_node or 0]
    state = np.zeros(len(part.M)) if part.displacements is None else np.array(part.displacements)
    result = ElasticPart(
        part.name, part.root, tuple([f"{part.name}.{part.nodes[i][0]}" for i in layout.nodes]),
        tuple([(node.body, node.point) for node in nodes]), part.carriers, part.nodes[0][1],
        layout.world(rows), values, layout.world(state[layout.coordinates]),
    )  # fmt: skip
    return result if gravity is None or not any(gravity) else _with_weight(part, result, layout, point, gravity)


def weight_rows(part: Superelement) -> Array:
    """Return the first moments L of the potential -g . L d of weight, on the displacements d of the rows of K.

    Returns (3, 6 nodes): the mass that moves along world axes per displacement of each node except the root, and of
    each body of internal coordinates [kg, kg m].
    """
    layout = Layout.of(part, part.root_node)
    translations = rigid_motions(np.array(part.points_without_forces), layout.axes, len(part.M))[:, :3]
    moments = translations.T @ np.array(part.M)
    return layout.rows(layout.axes @ moments[:, layout.coordinates])


def _with_weight(
    part: Superelement, elastic: ElasticPart, layout: Layout, point: Vector, gravity: Vector
) -> ElasticPart:
    """The elastic part under gravity g with the potential V = -g . (m p + A (s0 + G x)).

    A are the axes and p the point of its frame, x its coordinates, s0 the first moments of mass without displacements
    and G = R^T M, where R are translations of the entire model.
    """
    mass_matrix, points = np.array(part.M), np.array(part.points_without_forces)
    translations = rigid_motions(points, layout.axes, len(mass_matrix))
    if part.grounded:
        raise ModelError(
            f"superelement '{part.name}': its mass matrix does not determine how gravity acts on a model that itself "
            f"is fixed to the ground (grounded=True); leave gravity out, or give the model with nodes on the ground.",
            element=part.name, field="grounded",
        )  # fmt: skip
    moments = translations[:, :3].T @ mass_matrix
    total, first = moments @ translations[:, :3], moments @ translations[:, 3:]
    mass = float(total.trace()) / 3.0
    size = np.abs(first).max(initial=0.0)
    if np.abs(total - mass * np.eye(3)).max() > RIGID * abs(mass) or np.abs(first + first.T).max() > RIGID * size:
        raise ModelError(
            f"superelement '{part.name}': its mass for translations along its axes is {total.diagonal().tolist()} kg, "
            f"so M does not determine how gravity acts; expected the same along all three and none across. Reduce the "
            f"model with nodes that move it as a rigid body, or leave gravity out.", element=part.name, field="M",
        )  # fmt: skip
    g, world_moments = np.array(gravity), layout.axes @ moments[:, layout.coordinates]
    # first moment of mass about the root: u = theta x r, so that M_tr = -[s]x
    first_moment = layout.axes @ axial(-first) - mass * (np.array(point) - points[0])
    displacements = np.zeros(len(part.M)) if part.displacements is None else np.array(part.displacements)
    first_moment += world_moments @ displacements[layout.coordinates]
    force = layout.world(moments[:, layout.coordinates].T @ layout.axes.T @ g)
    if elastic.root == "ground":
        return replace(elastic, force=force)
    centre = np.array(point) + first_moment / mass if mass else np.array(point)
    load = Load(f"{part.name}.weight", elastic.root, tuple((mass * g).tolist()), NONE, tuple(centre.tolist()))
    coupling = skew(g) @ layout.world(world_moments)
    return replace(elastic, force=force, loads=(load,) if mass else (),
                   weight_stiffness=root_rotation_rows(elastic, point, coupling))  # fmt: skip
