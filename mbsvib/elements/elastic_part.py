"""Beams and superelements in finite motion: elastic parts in the frame of one of their bodies.

The frame of the body ``root`` has a finite motion, the coordinates x in it are small: the displacement d [m] and the
rotation vector rho [rad] of each node relative to the part without forces, then internal coordinates. The potential is

V = sum k_r e_r^2 / 2 - f . x,  e_r = D_r x + sum w_j (S_j x)^2 / 2

with weights f. The squares, which only beams have, are what the slopes S_j of a bent line add to its strain: so tension
acts on bending, and bending shortens the beam. With G = de / dx and F = f - G^T diag(k) e the wrench on a node is
(F_d, J(rho)^T F_rho), J = d(rho) / d(rotation); its reaction acts on ``root`` at the same point. The second derivative
of V is J^T (G^T diag(k) G + sum k_r e_r w_j S_j^T S_j) J - F_rho . d^2(rho), to which the stiffness of wrenches that
rotate with the frame is added.

Source: von Karman (1910), Festigkeitsprobleme im Maschinenbau, for e.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from mbsvib.common.arguments import DIRECTIONS, UNIT6, Vector
from mbsvib.common.arrays import Array, Index
from mbsvib.elements.body import NO_INERTIA, Body
from mbsvib.elements.bushing import ZERO, Bushing
from mbsvib.elements.joint import Joint
from mbsvib.elements.load import Load
from mbsvib.elements.part import Composed
from mbsvib.elements.placement import GROUND, Placement
from mbsvib.elements.pose import Pose
from mbsvib.elements.shared_rows import Node, SharedRows
from mbsvib.errors import NoWordsError
from mbsvib.linalg.products import eigenrows
from mbsvib.linalg.rank import ZERO_SUM
from mbsvib.linalg.rotations import exponential, inverse_jacobian, logarithm, second_order


@dataclass(frozen=True, slots=True)
class Slopes:
    """Slopes S (m, 6 n + internal) of a bent line, weights w (m,) and the ``rows`` (m,) to whose strain they add."""

    matrix: Array
    weights: Array
    rows: Index

    def strain(self, state: Array, count: int) -> Array:
        """Return sum w_j (S_j x)^2 / 2 of ``count`` rows."""
        result = np.zeros(count)
        np.add.at(result, self.rows, 0.5 * self.weights * np.square(self.matrix @ state))
        return result

    def gradient(self, state: Array, count: int) -> Array:
        """Return the derivative (count, 6 n + internal) of this strain."""
        result = np.zeros((count, self.matrix.shape[1]))
        np.add.at(result, self.rows, (self.weights * (self.matrix @ state))[:, None] * self.matrix)
        return result


@dataclass(frozen=True, slots=True)
class ElasticPart:
    """A part that is elastic in the frame of the body ``root``, world axes.

    ``nodes`` (n) are pairs of a body and its point [m] in this pose, with the names ``names``. ``carriers`` are the
    bodies of internal coordinates, three each, at ``origin``. ``rows`` D (r, 6 n + internal) and ``values`` k (r,) are
    its stiffness, ``damping`` (r,) is that in the same rows, ``state`` x (6 n + internal,) its displacements and
    ``force`` f its weight along them or None; ``slopes`` are those of a beam. ``loads`` are its weight on bodies.
    ``weight_stiffness`` has the stiffness of the weight ``force``, whose direction is fixed in the world.
    """

    owner: str
    root: str
    names: tuple[str, ...]
    nodes: tuple[tuple[str, Vector], ...]
    carriers: tuple[str, ...]
    origin: Vector
    rows: Array
    values: Array
    state: Array
    force: Array | None = None
    slopes: Slopes | None = None
    loads: tuple[Load, ...] = ()
    weight_stiffness: tuple[SharedRows, ...] = ()
    damping: Array | None = None

    @property
    def internal(self) -> int:
        """Number of internal coordinates."""
        return int(self.rows.shape[1]) - 6 * len(self.nodes)

    def forces(self, rows: Array) -> Array:
        """Return the forces F = f + G^T p (6 n + internal,) along its coordinates, for forces p (r,) in its rows."""
        result: Array = rows @ self.gradient
        return result if self.force is None else result + self.force

    @property
    def row_forces(self) -> Array:
        """Forces -k e (r,) in its rows."""
        return np.asarray(-self.values * self.deformations)

    @property
    def deformations(self) -> Array:
        """The deformations e (r,)."""
        result: Array = self.rows @ self.state
        return result if self.slopes is None else result + self.slopes.strain(self.state, len(result))

    @property
    def gradient(self) -> Array:
        """Their derivative G (r, 6 n + internal)."""
        return self.rows if self.slopes is None else self.rows + self.slopes.gradient(self.state, len(self.rows))

    @property
    def row_nodes(self) -> tuple[Node, ...]:
        """The nodes of its rows: nodes relative to the root, and carriers."""
        return (*[Node(body, point, relative_to=self.root) for body, point in self.nodes],
                *[Node(name, self.origin, moves_with_ground=False) for name in self.carriers])  # fmt: skip

    def rotations(self) -> Array:
        """Return rho (n, 3) of the nodes."""
        return self.state[: 6 * len(self.nodes)].reshape(-1, 6)[:, 3:]

    def per_rotation(self, rows: Array) -> Array:
        """Return rows (r, 6 n + internal) on rotation vectors as rows on small rotations of the nodes."""
        result = rows
        for i, rho in enumerate(self.rotations()):
            if rho.any():
                result = result.copy() if result is rows else result
                result[:, 6 * i + 3 : 6 * i + 6] = rows[:, 6 * i + 3 : 6 * i + 6] @ inverse_jacobian(rho)
        return result


def massless_bodies(points: Mapping[str, Vector]) -> dict[str, Body]:
    """Return bodies without inertia at some points, by name."""
    return {name: Body(name, 0.0, NO_INERTIA, point) for name, point in points.items()}


def carrier_joints(owner: str, carriers: Sequence[str], origin: Vector, internal: int) -> dict[str, Joint]:
    """Return the joints of internal coordinates, three for each carrier, by the names of carriers."""
    result = {}
    for i, carrier in enumerate(carriers):
        count = min(3, internal - 3 * i)
        freedom = tuple([(f"mode{3 * i + j + 1}", UNIT6[j]) for j in range(count)])
        locked = tuple([(DIRECTIONS[j], UNIT6[j]) for j in range(count, 6)])
        result[carrier] = Joint(owner, "custom", "ground", carrier, origin, freedom=freedom, locked=locked,
                                point=origin, free=DIRECTIONS[:count])  # fmt: skip
    return result


def on_carriers(rows: Array, internal: int) -> Array:
    """Return rows in which the six columns of each carrier replace those of its three internal coordinates."""
    count = (internal + 2) // 3
    nodes = rows.shape[1] - internal
    columns = np.zeros((len(rows), count, 6))
    for j in range(internal):
        columns[:, j // 3, j % 3] = rows[:, nodes + j]
    return np.concatenate((rows[:, :nodes], columns.reshape(len(rows), 6 * count)), axis=1)


def stiffness_rows(part: ElasticPart) -> SharedRows:
    """Return the rows of the stiffness G^T diag(k) G + sum k_r e_r w_j S_j^T S_j, with signed values."""
    rows, values = part.gradient, part.values
    if part.slopes is not None:
        tension = -part.row_forces[part.slopes.rows] * part.slopes.weights
        used = tension.nonzero()[0]
        rows = np.concatenate((rows, part.slopes.matrix[used]))
        values = np.concatenate((values, tension[used]))
    return SharedRows(part.owner, part.row_nodes, on_carriers(part.per_rotation(rows), part.internal),
                      stiffness=values)  # fmt: skip


def root_rotation_rows(part: ElasticPart, point: Vector, coupling: Array) -> tuple[SharedRows, ...]:
    """Return the stiffness of a potential theta . Q x with the root's rotation theta, as rows with signed values.

    ``point``: a point of the root [m]. ``coupling`` (3, 6 n + internal): Q. At most one is returned.
    """
    coupling = part.per_rotation(coupling)
    if not coupling.any():
        return ()
    # theta . Q x = (|a + b|^2 - |a - b|^2) / 4 with a = theta / s, b = s Q x
    lengths = np.sqrt(np.square(coupling).sum(axis=1))
    used = lengths > 0.0
    count = int(used.sum())
    rotations = np.zeros((count, 6))
    rotations[:, 3:] = np.eye(3)[used] * np.sqrt(lengths[used])[:, None]
    scaled = on_carriers(coupling[used] / np.sqrt(lengths[used])[:, None], part.internal)
    rows = np.concatenate((np.concatenate((rotations, scaled), axis=1), np.concatenate((rotations, -scaled), axis=1)))
    nodes = (Node(part.root, point), *part.row_nodes)
    return (SharedRows(part.owner, nodes, rows, stiffness=np.repeat((0.5, -0.5), count)),)


def stiffness_of_forces(part: ElasticPart, row_forces: Array) -> list[SharedRows]:
    """Return the stiffness of the weight and of forces f along rotation vectors, -f_rho . d^2 rho, as signed rows.

    ``row_forces`` (r,) are the forces in the rows of the part.
    """
    result, forces = [*part.weight_stiffness], part.forces(row_forces)
    for i, (rho, (body, point)) in enumerate(zip(part.rotations(), part.nodes, strict=True)):
        moment = forces[6 * i + 3 : 6 * i + 6]
        if rho.any() and moment.any():
            values, rows = eigenrows(-second_order(rho, moment))
            used = values != 0.0
            matrix = np.concatenate((np.zeros((int(used.sum()), 3)), rows[used]), axis=1)
            if len(matrix):
                result.append(SharedRows(part.owner, (Node(body, point, relative_to=part.root),), matrix,
                                    stiffness=values[used]))  # fmt: skip
    return result


def wrenches(part: ElasticPart, row_forces: Array) -> tuple[list[Bushing], list[Load]]:
    """Return forces (r,) in the rows of a part as preloads between root and nodes, and loads on carriers.

    The preloads have no stiffness; the loads are elastic forces and weights on internal coordinates.
    """
    bushings, loads = [], []
    at_nodes, end = part.per_rotation(part.forces(row_forces)[None])[0], 6 * len(part.nodes)
    for i, (body, point) in enumerate(part.nodes):
        six = tuple(at_nodes[6 * i : 6 * i + 6].tolist())
        if any(six):
            bushings.append(Bushing(part.names[i], part.root, body, point, ZERO, ZERO, preload=six))
    for suffix, forces in (("force", row_forces @ part.rows), ("weight", part.force)):
        if forces is not None:
            on_bodies = on_carriers(forces[None, end:], len(forces) - end)[0]
            loads += [Load(f"{name}.{suffix}", name, tuple(six[:3]))
                      for name, six in zip(part.carriers, on_bodies.reshape(-1, 6).tolist(), strict=True) if any(six)]
    return bushings, loads


def is_unmoved(part: Composed, pose: Pose) -> bool:
    """Return whether all bodies of an elastic part are in the reference pose."""
    carriers = [name for name in part.carriers if name in pose.number]
    return all(map(pose.is_unmoved, (part.root, *(body for body, _ in part.node_bodies), *carriers)))


def refuse_other_root(part: Any, to: Placement) -> None:
    """Refuse a copy of a bent part that is linear in the frame of the ground, where a body takes the ground's place."""
    if part.displacements is not None and part.root == GROUND != to.ground:
        raise NoWordsError(f"{part.family} '{part.name}': its displacements are relative to the ground, and the copy "
                           f"is on body '{to.ground}'; describe it without forces.",
                           element=part.name, field="displacements")  # fmt: skip


def bent_nodes(part: Composed, before: Array, pose: Pose) -> tuple[Array, Array, bool]:
    """Return the nodes of an elastic part in another pose.

    ``before`` (n, 6): displacements of its nodes against its root in the reference pose [m, rad], world axes. Returns
    the points (n, 3) of the nodes [m], their displacements (n, 6) against the root, and whether these have changed by
    more than rounding.
    """
    points, root = np.array(part.points), pose.number[part.root]
    which, frame = np.array([pose.number[body] for body, _ in part.node_bodies]), np.full(len(points), root)
    moved_points, turn = pose.points(which, points), pose.rotations[root]
    change = moved_points - pose.points(frame, points)
    rotation = logarithm(turn.T @ pose.rotations[which] @ exponential(before[:, 3:]))
    after = np.concatenate((before[:, :3] @ turn.T + change, rotation @ turn.T), axis=1)
    extent = float(np.abs(np.concatenate((points, moved_points))).max())
    turned = np.abs(rotation - before[:, 3:]).max()
    return moved_points, after, bool(np.abs(change).max() > ZERO_SUM * extent or turned > ZERO_SUM)
