"""Superelements: matrices of reduced finite element models on interface nodes and internal coordinates."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from mbsvib.common import arguments as check
from mbsvib.common.arguments import Matrix3, Vector
from mbsvib.common.arrays import Array
from mbsvib.common.expected import reals
from mbsvib.elements.elastic_part import bent_nodes, is_unmoved, refuse_other_root
from mbsvib.elements.part import Composed, derived
from mbsvib.elements.placement import Placement
from mbsvib.elements.pose import Pose
from mbsvib.errors import ModelError, counted
from mbsvib.linalg.products import eigenrows
from mbsvib.linalg.rotations import rigid_transport

Matrix = tuple[tuple[float, ...], ...]
# Finite element programs print seven to sixteen digits. Limits relative to the size of terms:
# of forces under a rigid-body motion of all nodes,
RIGID = 1e-6
# of differences between entries across the diagonal,
SYMMETRIC = 1e-6
# and of negative eigenvalues of matrices scaled to a unit diagonal.
NEGATIVE = 1e-6


@dataclass(frozen=True, slots=True)
class Superelement(Composed):
    """A reduced model: M, C, K (n, n) on the six displacements of each node, then on internal coordinates.

    ``nodes`` are pairs of name and point [m, world axes], ``bodies`` pairs of a node and the body that holds it. The
    displacements of nodes are in the axes ``orientation``. ``factors`` are pairs of values and rows of M, K and C;
    ``rank`` has the ranks of M and K. ``displacements`` (n,), in these axes, are those relative to the model without
    forces, in the frame of its ``root``.
    """

    M: Matrix
    K: Matrix
    nodes: tuple[tuple[str, Vector], ...]
    C: Matrix | None = None
    bodies: tuple[tuple[str, str], ...] = ()
    orientation: Matrix3 = check.IDENTITY
    grounded: bool = False
    """Whether the ground holds it within, so that K is not zero for rigid motions."""
    displacements: tuple[float, ...] | None = None
    factors: Any = derived()
    rank: tuple[int, int] = derived((0, 0))

    def constructor_kwargs(self) -> dict[str, Any]:
        """Return the arguments of ``add_superelement`` that make this part, except those at their default."""
        result: dict[str, Any] = {"name": self.name, "M": self.M, "C": self.C, "K": self.K, "nodes": dict(self.nodes)}
        if self.bodies:
            result["bodies"] = dict(self.bodies)
        if self.orientation is not check.IDENTITY:
            result["orientation"] = self.orientation
        if self.displacements is not None:
            result["displacements"] = self.displacements
        return result | ({"grounded": True} if self.grounded else {})

    @property
    def points(self) -> tuple[Vector, ...]:
        """Points of its nodes [m], world axes."""
        return tuple([point for _, point in self.nodes])

    @property
    def root(self) -> str:
        """Body in whose frame it is linear: that of the root node, or ground."""
        return "ground" if self.root_node is None else self.body_of(self.root_node)

    @property
    def root_node(self) -> int | None:
        """Number of the node in whose frame it is linear: one on the ground, else one on a body, else the first.

        None if it is ``grounded``: it is then linear in the frame of the ground.
        """
        return None if self.grounded else _root([name for name, _ in self.nodes], dict(self.bodies))

    def without_forces(self) -> Superelement:
        """Return the superelement without forces, in the frame of its root in this pose."""
        if self.displacements is None:
            return self
        points = _without_forces(self.nodes, self.orientation, self.displacements)
        return replace(self, nodes=tuple(zip(dict(self.nodes), points, strict=True)), displacements=None)

    def node_weights(self) -> tuple[Array, Array]:
        """Return masses (nodes,) at which gravity acts on its nodes, none, as it acts along all coordinates, and the
        points of the nodes (nodes, 3) [m].
        """
        return np.zeros(len(self.nodes)), np.array(self.points)

    @property
    def internal(self) -> int:
        """Number of internal coordinates."""
        return len(self.M) - 6 * len(self.nodes)

    @property
    def carriers(self) -> tuple[str, ...]:
        """Names of the bodies whose displacements are internal coordinates, three each."""
        return tuple([f"{self.name}.internal{i + 1}" for i in range((self.internal + 2) // 3)])

    @property
    def node_names(self) -> dict[str, Vector]:
        """Names and points of the nodes that are bodies of their own."""
        on_bodies = dict(self.bodies)
        return {f"{self.name}.{name}": point for name, point in self.nodes if name not in on_bodies}

    @property
    def outlines(self) -> tuple[tuple[int, ...], ...]:
        """Lines from the first node to all others."""
        return tuple([(0, i) for i in range(1, len(self.nodes))])

    @property
    def element_names(self) -> tuple[str, ...]:
        """No elements: forces within a superelement are not available."""
        return ()

    @property
    def generated_names(self) -> tuple[str, ...]:
        """Names of the bodies, joints and springs that replace it in the equations."""
        links = [f"{self.name}.{name}" for name, _ in self.nodes]
        return (*dict.fromkeys((*self.node_names, *links)), *self.carriers)

    @property
    def summary(self) -> str:
        """Its name, the numbers of nodes and internal coordinates, and the ranks of its matrices."""
        size = len(self.M)
        free = size - self.rank[1]
        nodes = counted(len(self.nodes), "node")
        return (f"superelement '{self.name}': {nodes}, {self.internal} internal coordinates; "
                f"rank of M {self.rank[0]} and of K {self.rank[1]} of {size} ({free} motions without stiffness)")

    def body_of(self, i: int) -> str:
        name = self.nodes[i][0]
        return dict(self.bodies).get(name, f"{self.name}.{name}")

    def placed(self, to: Placement) -> dict[str, Any]:
        if self.grounded and to.ground != "ground":
            raise ModelError(f"superelement '{self.name}': the ground holds it within (grounded=True), and the copy is "
                             f"on body '{to.ground}'; give it with nodes on the ground.",
                             element=self.name, field="grounded")  # fmt: skip
        refuse_other_root(self, to)
        signs = np.concatenate((np.tile(to.signs(), len(self.nodes)), np.ones(self.internal)))
        kwargs: dict[str, Any] = {
            "nodes": {name: to.point(point) for name, point in self.nodes},
            "bodies": {node: to.body(body) for node, body in self.bodies}, "orientation": to.axes(self.orientation),
        }  # fmt: skip
        if self.displacements is not None:
            kwargs["displacements"] = signs * np.array(self.displacements)
        if not to.mirrored:
            return kwargs
        return kwargs | {key: None if value is None else signs[:, None] * np.array(value) * signs
                         for key, value in (("M", self.M), ("C", self.C), ("K", self.K))}  # fmt: skip

    def in_pose(self, pose: Pose, relaxed: bool) -> Superelement:
        if is_unmoved(self, pose):
            return self
        axes, root, count = np.array(self.orientation), self.root, len(self.nodes)
        before = np.zeros(len(self.M)) if self.displacements is None else np.array(self.displacements)
        world = (before[: 6 * count].reshape(-1, 3) @ axes.T).reshape(-1, 6)
        points, after, bends = bent_nodes(self, world, pose)
        turned = pose.rotated(root, self.orientation)
        internal = before[6 * count :].copy()
        for i, name in enumerate(self.carriers):
            k = pose.number.get(name)
            if k is not None:  # otherwise the part moves as a rigid body
                displacement = internal[3 * i : 3 * i + 3]
                displacement += (pose.centre[k] - pose.origin[k])[: len(displacement)]
        state = np.concatenate(((after.reshape(-1, 3) @ turned).reshape(-1), internal))
        bends = bends or self.displacements is not None or bool((internal != before[6 * count :]).any())
        names = [name for name, _ in self.nodes]
        return replace(
            self, nodes=tuple(zip(names, [(x, y, z) for x, y, z in points.tolist()], strict=True)),
            orientation=check.orientation(turned, self.name), displacements=tuple(state.tolist()) if bends else None,
        )  # fmt: skip


def make(
    name: str, mass: Any, damping: Any, stiffness: Any, nodes: Any, bodies: Mapping[str, str], orientation: Any,
    grounded: Any, displacements: Any = None,
) -> Superelement:  # fmt: skip
    """Check the values of a superelement and build it."""
    who = f"superelement '{name}'"
    points = _nodes(who, nodes)
    for node in bodies:
        if node not in dict(points):
            raise check.refuse(who, "bodies", bodies, f"names of its nodes ({', '.join(dict(points))})")
    if type(grounded) is not bool:
        raise check.refuse(who, "grounded", grounded, "True or False")
    m = _matrix(who, "M", mass, None)
    if len(m) < 6 * len(points):
        raise ModelError(f"{who}: M has {len(m)} rows; expected 6 for each of the {len(points)} nodes, then one for "
                         f"each internal coordinate.", element=who, field="M")  # fmt: skip
    k = _matrix(who, "K", stiffness, len(m))
    c = None if damping is None else _matrix(who, "C", damping, len(m))
    axes = check.orientation(orientation, who)
    expected = f"{len(m)} numbers, one for each coordinate of M"
    if displacements is not None:
        displacements = check.numbers(displacements, (len(m),), who, "displacements", expected)
    rigid = rigid_motions(np.array(_without_forces(points, axes, displacements)), np.array(axes), len(m))
    if not grounded:
        _check_rigid(who, k, rigid)
    root = None if grounded else _root(list(dict(points)), bodies)
    relative = np.setdiff1d(np.arange(len(m)), [] if root is None else np.arange(6 * root, 6 * root + 6))
    c_is_relative = c is not None and not (grounded or _rigid_body_forces(c, rigid).max() > RIGID)
    rows_m, rows_k = factor(who, "M", m), factor(who, "K", k[np.ix_(relative, relative)])
    rows_c = None if c is None else factor(who, "C", c[np.ix_(relative, relative)] if c_is_relative else c)
    return Superelement(name, _entries(m), _entries(k), points, None if c is None else _entries(c),
                        tuple(bodies.items()), axes, grounded, displacements, (rows_m, rows_k, rows_c),
                        (len(rows_m[0]), len(rows_k[0])))  # fmt: skip


def _without_forces(
    nodes: tuple[tuple[str, Vector], ...], axes: Matrix3, displacements: tuple[float, ...] | None
) -> list[Vector]:  # fmt: skip
    points = np.array([point for _, point in nodes])
    if displacements is not None:
        points -= np.array(displacements[: 6 * len(nodes)]).reshape(-1, 6)[:, :3] @ np.array(axes).T
    return [(x, y, z) for x, y, z in points.tolist()]


def _root(nodes: list[str], bodies: Mapping[str, str]) -> int:
    ground = [i for i, name in enumerate(nodes) if bodies.get(name) == "ground"]
    return next(iter([*ground, *[i for i, name in enumerate(nodes) if name in bodies]]), 0)


def _entries(matrix: Array) -> Matrix:
    return tuple([tuple(row) for row in matrix.tolist()])


def factor(who: str, field: str, matrix: Array) -> tuple[Array, Array]:
    """Return positive values (r,) and rows (r, n) with matrix = rows^T diag(values) rows."""
    if not matrix.any():
        return np.zeros(0), np.zeros((0, len(matrix)))
    values, rows = eigenrows(matrix)
    if float(values.min()) < -NEGATIVE * float(values.max()):
        raise ModelError(
            f"{who}: {field} is not positive semidefinite: its smallest eigenvalue is {float(values.min()):.3g}, its "
            f"largest {float(values.max()):.3g} (on a unit diagonal). Check order and sign of its entries.",
            element=who, field=field,
        )  # fmt: skip
    positive = values > 0.0
    return values[positive], rows[positive]


def rigid_motions(points: Array, axes: Array, size: int) -> Array:
    """Return the rigid-body motions (size, 6) of nodes about the first of them, in the given axes."""
    result = np.zeros((size, 6))
    result[: 6 * len(points)] = rigid_transport((points - points[0]) @ axes).reshape(-1, 6)
    return result


def _rigid_body_forces(matrix: Array, rigid: Array) -> Array:
    """Largest force of each rigid-body motion, relative to the terms of which it is the sum."""
    scale = np.sqrt(np.abs(matrix.diagonal()))
    scale[scale == 0.0] = 1.0
    size = np.abs(matrix) @ np.abs(rigid)
    largest = (size / scale[:, None]).max(axis=0)
    largest[largest == 0.0] = 1.0
    return np.asarray((np.abs(matrix @ rigid) / scale[:, None]).max(axis=0) / largest)


def _check_rigid(who: str, stiffness: Array, rigid: Array) -> None:
    forces = _rigid_body_forces(stiffness, rigid)
    worst = int(forces.argmax())
    if forces[worst] > RIGID:
        raise ModelError(
            f"{who}: K resists a motion of all nodes as one rigid body along '{check.DIRECTIONS[worst]}' (forces are "
            f"{forces[worst]:.2g} of the sum of their terms). Check the nodes' positions, order and axes "
            f"(x y z rx ry rz each); if the model itself is fixed to the ground, give grounded=True.",
            element=who, field="K",
        )  # fmt: skip


def _nodes(who: str, nodes: Any) -> tuple[tuple[str, Vector], ...]:
    if not hasattr(nodes, "items") or not nodes:
        raise check.refuse(who, "nodes", nodes, "positions of its nodes by name, such as {'left': (0, 0, 0), ...}")
    return tuple([(check.name(key, f"{who}: node"), check.vector(point, who, "nodes")) for key, point in nodes.items()])


def _matrix(who: str, field: str, value: Any, size: int | None) -> Array:
    expected = f"a symmetric {'square' if size is None else f'{size} x {size}'} matrix"
    matrix = reals(value.toarray() if hasattr(value, "toarray") else value, who, field, expected, ModelError)
    if matrix.ndim != 2 or matrix.shape[0] != matrix.shape[1] or (size is not None and len(matrix) != size):
        raise ModelError(f"{who}: {field} has shape {matrix.shape}; expected {expected}.", element=who, field=field)
    if not np.isfinite(matrix).all():
        raise ModelError(f"{who}: {field} has entries that are not finite.", element=who, field=field)
    scale = np.sqrt(np.abs(matrix.diagonal()))
    scale[scale == 0.0] = np.abs(matrix).max(initial=0.0) ** 0.5 or 1.0
    asymmetry = np.triu(np.abs(matrix - matrix.T) / scale[:, None] / scale)
    if float(asymmetry.max()) > SYMMETRIC:
        i, j = np.unravel_index(int(asymmetry.argmax()), asymmetry.shape)
        raise ModelError(f"{who}: {field} is not symmetric: entries [{i}, {j}] = {matrix[i, j]:.6g} and [{j}, {i}] = "
                         f"{matrix[j, i]:.6g}.", element=who, field=field)  # fmt: skip
    return np.asarray(0.5 * (matrix + matrix.T))
