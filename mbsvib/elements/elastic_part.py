"""Parts that are linear in the frame of the body that carries them: beams and superelements in finite motion.

The frame of the body ``root`` moves finitely; coordinates x in it are small: of each node the displacement d [m] of its
point and its rotation vector rho [rad] since the part was without forces, then internal ones. The potential is
V = x^T K x / 2 - f . x with K = D^T diag(k) D and weights f. So with F = f - K x a node feels the wrench
(F_d, J(rho)^T F_rho), J = d(rho) / d(rotation), whose reaction acts on ``root`` at the same point, and the second
derivative of V at the pose is J^T K J less F_rho . d^2(rho), besides what wrenches do that turn with the frame.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from mbsvib.elements.bushing import ZERO, Bushing
from mbsvib.elements.load import Load
from mbsvib.elements.shared_rows import Node, Piece
from mbsvib.linalg.products import eigenrows
from mbsvib.linalg.rotations import inverse_jacobian, second_order

if TYPE_CHECKING:
    from mbsvib.common.arguments import Vector
    from mbsvib.common.arrays import Array


@dataclass(frozen=True, slots=True)
class ElasticPart:
    """A part that is linear in the frame of body ``root``, world axes.

    ``nodes`` (n), called ``names``, pair bodies with their points [m] in this pose, ``carriers`` are the bodies of
    internal coordinates, three each, at ``origin``. ``rows`` D (r, 6 n + internal) and ``values`` k (r,) are its
    stiffness, ``state`` x (6 n + internal,) its displacements and ``force`` f its weight along them, if it has one.
    ``loads`` are the weight on the root, ``extra`` is the stiffness of a weight that does not turn with the frame.
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
    loads: tuple[Load, ...] = ()
    extra: tuple[Piece, ...] = ()

    def forces(self, rows: Array | None = None) -> Array:
        """Return the forces f - K x (6 n + internal,) along its coordinates, or those of other forces in its rows."""
        result: Array = (self.row_forces if rows is None else rows) @ self.rows
        return result if self.force is None else result + self.force

    @property
    def row_forces(self) -> Array:
        """Forces -k D x (r,) in its rows."""
        return np.asarray(-self.values * (self.rows @ self.state))

    @property
    def seen(self) -> tuple[Node, ...]:
        """What its rows see: nodes against the root, and carriers."""
        return (*[Node(body, point, against=self.root) for body, point in self.nodes],
                *[Node(name, self.origin, rides=False) for name in self.carriers])  # fmt: skip

    def rotations(self) -> Array:
        """Return rho (n, 3) of the nodes."""
        return self.state[: 6 * len(self.nodes)].reshape(-1, 6)[:, 3:]

    def per_rotation(self, rows: Array) -> Array:
        """Return rows (r, 6 n + internal) on coordinates as rows on displacements and small rotations of the nodes."""
        result = rows
        for i, rho in enumerate(self.rotations()):
            if rho.any():
                result = result.copy() if result is rows else result
                result[:, 6 * i + 3 : 6 * i + 6] = rows[:, 6 * i + 3 : 6 * i + 6] @ inverse_jacobian(rho)
        return result


def on_carriers(rows: Array, internal: int) -> Array:
    """Return rows with six columns for each carrier in place of one for each of the last, internal coordinates."""
    count = (internal + 2) // 3
    nodes = rows.shape[1] - internal
    carried = np.zeros((len(rows), count, 6))
    for j in range(internal):
        carried[:, j // 3, j % 3] = rows[:, nodes + j]
    return np.concatenate((rows[:, :nodes], carried.reshape(len(rows), 6 * count)), axis=1)


def stiffness_rows(part: ElasticPart) -> Piece:
    """Return the rows of K."""
    internal = part.rows.shape[1] - 6 * len(part.nodes)
    return Piece(part.owner, part.seen, on_carriers(part.per_rotation(part.rows), internal), stiffness=part.values)


def turning_rows(part: ElasticPart, point: Vector, across: Array) -> tuple[Piece, ...]:
    """Return the stiffness of a potential theta . Q x, theta being the root's rotation, as rows with signed values.

    Parameters
    ----------
    part : ElasticPart
        The part.
    point : tuple of 3 floats
        A point of the root [m].
    across : array, shape (3, 6 n + internal)
        Q.

    Returns
    -------
    tuple of Piece
        At most one.
    """
    across = part.per_rotation(across)
    if not across.any():
        return ()
    # theta . Q x = (|a + b|^2 - |a - b|^2) / 4 with a = theta / s, b = s Q x
    lengths = np.sqrt(np.square(across).sum(axis=1))
    used = lengths > 0.0
    count = int(used.sum())
    turns = np.zeros((count, 6))
    turns[:, 3:] = np.eye(3)[used] * np.sqrt(lengths[used])[:, None]
    scaled = on_carriers(across[used] / np.sqrt(lengths[used])[:, None], part.rows.shape[1] - 6 * len(part.nodes))
    rows = np.concatenate((np.concatenate((turns, scaled), axis=1), np.concatenate((turns, -scaled), axis=1)))
    nodes = (Node(part.root, point), *part.seen)
    return (Piece(part.owner, nodes, rows, stiffness=np.repeat((0.5, -0.5), count)),)


def rotation_rows(part: ElasticPart, forces: Array) -> list[Piece]:
    """Return what forces along rotation vectors do to second order, -f_rho . d^2 rho, as rows with signed values."""
    result = []
    for i, (rho, (body, point)) in enumerate(zip(part.rotations(), part.nodes, strict=True)):
        moment = forces[6 * i + 3 : 6 * i + 6]
        if rho.any() and moment.any():
            values, rows = eigenrows(-second_order(rho, moment))
            used = values != 0.0
            matrix = np.concatenate((np.zeros((int(used.sum()), 3)), rows[used]), axis=1)
            if len(matrix):
                result.append(Piece(part.owner, (Node(body, point, against=part.root),), matrix,
                                    stiffness=values[used]))  # fmt: skip
    return result


def wrenches(part: ElasticPart, rows: Array | None = None) -> tuple[list[Bushing], list[Load]]:
    """Return the forces of a part as preloads between root and nodes, and as loads on carriers.

    Parameters
    ----------
    part : ElasticPart
        The part.
    rows : array, shape (r,), optional
        Forces in its rows; default: those of its state.

    Returns
    -------
    list of Bushing
        Preloads without stiffness.
    list of Load
        Elastic forces on internal coordinates, and the weight of these.
    """
    bushings, loads = [], []
    at_nodes, end = part.per_rotation(part.forces(rows)[None])[0], 6 * len(part.nodes)
    for i, (body, point) in enumerate(part.nodes):
        six = tuple(at_nodes[6 * i : 6 * i + 6].tolist())
        if any(six):
            bushings.append(Bushing(part.names[i], part.root, body, point, ZERO, ZERO, preload=six))
    elastic = (part.row_forces if rows is None else rows) @ part.rows
    for what, forces in (("force", elastic), ("weight", part.force)):
        if forces is not None:
            along = on_carriers(forces[None, end:], len(forces) - end)[0]
            loads += [Load(f"{name}.{what}", name, tuple(six[:3]))
                      for name, six in zip(part.carriers, along.reshape(-1, 6).tolist(), strict=True) if any(six)]
    return bushings, loads
