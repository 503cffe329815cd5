"""Expansion of superelements to bodies, free joints and shared rows.

Nodes are bodies with free joints to the first node. Each group of three internal coordinates is the displacement of a
body. Mass, stiffness and damping are rows that all of them share. The rows of stiffness have displacements relative to
one node, so that rigid-body motions are exactly free.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from mbsvib.common.arguments import Vector
from mbsvib.common.arrays import Array
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
from mbsvib.elements.superelement import RIGID, Superelement, rigid_motions
from mbsvib.errors import ModelError
from mbsvib.linalg.rotations import axial, skew


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
    return [Layout(part, None).shared(rows * np.sqrt(values)[:, None])]


def elastic(part: Superelement) -> list[SharedRows]:
    """Return the rows of K and, if there is a C, those of C."""
    _, (k, _), damping = part.factors
    result = [stiffness_rows(elastic_part(part))] if len(k) else []
    if damping is not None and len(damping[0]):
        c, rows = damping
        result.append(Layout(part, None if rows.shape[1] == len(part.M) else part.root_node).shared(rows, damping=c))
    return result


@dataclass(frozen=True, slots=True)
class Layout:
    """Coordinates of a superelement: all, or relative to the node ``root`` and without its coordinates."""

    part: Superelement
    root: int | None

    @property
    def nodes(self) -> list[int]:
        """Numbers of its nodes."""
        return [i for i in range(len(self.part.nodes)) if i != self.root]

    @property
    def coordinates(self) -> list[int]:
        """Numbers of its coordinates, internal ones last."""
        internal = range(6 * len(self.part.nodes), len(self.part.M))
        return [*(6 * i + j for i in self.nodes for j in range(6)), *internal]

    def world(self, rows: Array) -> Array:
        """Return rows (..., n) on coordinates in the axes of the part as rows on coordinates in world axes."""
        end = rows.shape[-1] - self.part.internal
        in_world = rows[..., :end].reshape(-1, 3) @ np.array(self.part.orientation).T
        return np.concatenate((in_world.reshape(*rows.shape[:-1], end), rows[..., end:]), axis=-1)

    def shared(self, rows: Array, damping: Array | None = None) -> SharedRows:
        """Return rows on coordinates as rows on six displacements in world axes of each node and carrier."""
        part, relative_to = self.part, "ground" if self.root is None else self.part.body_of(self.root)
        bodies = part.node_bodies
        nodes = [Node(*bodies[i], relative_to=relative_to) for i in self.nodes]
        carriers = [Node(name, part.points[0], moves_with_ground=False) for name in part.carriers]
        return SharedRows(part.name, (*nodes, *carriers), on_carriers(self.world(rows), part.internal), damping=damping)


def elastic_part(part: Superelement, gravity: Vector | None = None) -> ElasticPart:
    """Return a superelement as a linear elastic part in the frame of its root, with its weight."""
    layout, (values, rows), bodies = Layout(part, part.root_node), part.factors[1], part.node_bodies
    state = np.zeros(len(part.M)) if part.displacements is None else np.array(part.displacements)
    result = ElasticPart(
        part.name, part.root, tuple([f"{part.name}.{part.nodes[i][0]}" for i in layout.nodes]),
        tuple([bodies[i] for i in layout.nodes]), part.carriers, part.points[0], layout.world(rows), values,
        layout.world(state[layout.coordinates]),
    )  # fmt: skip
    return result if gravity is None or not any(gravity) else _with_weight(part, result, layout, gravity)


def _moments(part: Superelement) -> tuple[Array, Array]:
    """Rigid-body motions R (n, 6) without forces, and R_t^T M (3, n) of the translations R_t, in the part's axes."""
    points = np.array(part.without_forces().points)
    motions = rigid_motions(points, np.array(part.orientation), len(part.M))
    return motions, motions[:, :3].T @ np.array(part.M)


def _with_weight(part: Superelement, elastic: ElasticPart, layout: Layout, gravity: Vector) -> ElasticPart:
    """The elastic part under gravity g with the potential V = -g . (m p + A (s0 + G x)).

    A are the axes and p the point of its frame, x its coordinates, s0 the first moments of mass without displacements
    and G = R^T M, where R are translations of the entire model.
    """
    if part.grounded:
        raise ModelError(
            f"superelement '{part.name}': its mass matrix does not determine how gravity acts on a model that itself "
            f"is fixed to the ground (grounded=True); leave gravity out, or give the model with nodes on the ground.",
            element=part.name, field="grounded",
        )  # fmt: skip
    (motions, moments), axes, g = _moments(part), np.array(part.orientation), np.array(gravity)
    total, first = moments @ motions[:, :3], moments @ motions[:, 3:]
    mass = float(total.trace()) / 3.0
    size = np.abs(first).max(initial=0.0)
    if np.abs(total - mass * np.eye(3)).max() > RIGID * abs(mass) or np.abs(first + first.T).max() > RIGID * size:
        raise ModelError(
            f"superelement '{part.name}': its mass for translations along its axes is {total.diagonal().tolist()} kg, "
            f"so M does not determine how gravity acts; expected the same along all three and none across. Reduce the "
            f"model with nodes that move it as a rigid body, or leave gravity out.", element=part.name, field="M",
        )  # fmt: skip
    moments = moments[:, layout.coordinates]
    force = layout.world(moments.T @ axes.T @ g)
    if elastic.root == "ground":
        return replace(elastic, force=force)
    point = part.points[part.root_node or 0]
    # first moment of mass about the root: u = theta x r, so that M_tr = -[s]x
    first_moment = axes @ axial(-first) - mass * (np.array(point) - np.array(part.without_forces().points[0]))
    if part.displacements is not None:
        first_moment += axes @ moments @ np.array(part.displacements)[layout.coordinates]
    centre = np.array(point) + first_moment / mass if mass else np.array(point)
    load = Load(f"{part.name}.weight", elastic.root, tuple((mass * g).tolist()), NONE, tuple(centre.tolist()))
    coupling = skew(g) @ layout.world(axes @ moments)
    return replace(elastic, force=force, loads=(load,) if mass else (),
                   weight_stiffness=root_rotation_rows(elastic, point, coupling))  # fmt: skip
