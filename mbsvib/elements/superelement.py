"""Superelements: reduced finite element models by their matrices, on interface nodes and internal coordinates."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from mbsvib.common import arguments as check
from mbsvib.common.arguments import Matrix3, Vector
from mbsvib.elements.part import Composed, derived
from mbsvib.errors import ModelError, counted
from mbsvib.linalg.products import eigenrows

Array = NDArray[np.float64]
Matrix = tuple[tuple[float, ...], ...]
# A motion of the nodes as a rigid body leaves forces that are this small beside the terms they are the sum of; finite
# element programs print seven to sixteen digits.
RIGID = 1e-6
# The same of entries across the diagonal.
SYMMETRIC = 1e-6
# Negative eigenvalues (of matrices scaled to a unit diagonal) beyond this are no rounding.
NEGATIVE = 1e-6


@dataclass(frozen=True, slots=True)
class Superelement(Composed):
    """A reduced model: M, C, K (n, n) on the six displacements of each node, in this order, then on internal ones.

    ``nodes`` pairs names with points [m, world axes], ``bodies`` those nodes that a body holds with this body. Nodes
    move in the axes ``orientation``. ``factors`` pairs values and rows of M, K and C; ``rank`` counts the first two.
    ``displacements`` (n,) are how far its coordinates are, in these axes, from where the model without forces has them
    in the frame of the node ``root`` that carries it, or of the ground within.
    """

    M: Matrix
    K: Matrix
    nodes: tuple[tuple[str, Vector], ...]
    C: Matrix | None = None
    bodies: tuple[tuple[str, str], ...] = ()
    orientation: Matrix3 = check.IDENTITY
    grounded: bool = False
    displacements: tuple[float, ...] | None = None
    factors: Any = derived()
    rank: tuple[int, int] = derived((0, 0))

    def words(self) -> dict[str, Any]:
        """Return the arguments of ``add_superelement`` that make this part, without those at their default."""
        said: dict[str, Any] = {"name": self.name, "M": self.M, "C": self.C, "K": self.K, "nodes": dict(self.nodes)}
        if self.bodies:
            said["bodies"] = dict(self.bodies)
        if self.orientation is not check.IDENTITY:
            said["orientation"] = self.orientation
        if self.displacements is not None:
            said["displacements"] = self.displacements
        return said | ({"grounded": True} if self.grounded else {})

    @property
    def root(self) -> int | None:
        """Number of the node that carries it: one on the ground, else one that a body holds, else the first one.

        None if the ground within carries it.
        """
        return None if self.grounded else _root([name for name, _ in self.nodes], dict(self.bodies))

    @property
    def points_without_forces(self) -> list[Vector]:
        """Where its nodes are without forces [m], in the frame that carries it in this pose."""
        return _without_forces(self.nodes, self.orientation, self.displacements)

    @property
    def internal(self) -> int:
        """Number of internal coordinates."""
        return len(self.M) - 6 * len(self.nodes)

    @property
    def carriers(self) -> tuple[str, ...]:
        """Names of the bodies that stand for three internal coordinates each."""
        return tuple([f"{self.name}.internal{i + 1}" for i in range((self.internal + 2) // 3)])

    @property
    def node_names(self) -> dict[str, Vector]:
        """Names and points of the nodes that are bodies of their own."""
        held = dict(self.bodies)
        return {f"{self.name}.{name}": point for name, point in self.nodes if name not in held}

    @property
    def element_names(self) -> tuple[str, ...]:
        """No elements: forces within a superelement are not told apart."""
        return ()

    @property
    def made(self) -> tuple[str, ...]:
        """Names of the bodies, joints and springs that it becomes."""
        links = [f"{self.name}.{name}" for name, _ in self.nodes]
        return (*dict.fromkeys((*self.node_names, *links)), *self.carriers)

    @property
    def account(self) -> str:
        """What it is made of, in a few words."""
        size = len(self.M)
        free = size - self.rank[1]
        nodes = counted(len(self.nodes), "node")
        return (f"superelement '{self.name}': {nodes}, {self.internal} internal coordinates; "
                f"rank of M {self.rank[0]} and of K {self.rank[1]} of {size} ({free} motions without stiffness)")

    def body_of(self, i: int) -> str:
        """Return the name of the body that node i is, or that holds it.

        Parameters
        ----------
        i : int
            Number of the node, from 0.

        Returns
        -------
        str
            Name of a body or ground.
        """
        name = self.nodes[i][0]
        return dict(self.bodies).get(name, f"{self.name}.{name}")


def make(
    name: str, mass: Any, damping: Any, stiffness: Any, nodes: Any, bodies: Mapping[str, str], orientation: Any,
    grounded: Any, displacements: Any = None,
) -> Superelement:  # fmt: skip
    """Check the values of a superelement and build it."""
    who = f"superelement '{name}'"
    places = _nodes(who, nodes)
    for node in bodies:
        if node not in dict(places):
            raise check.refuse(who, "bodies", bodies, f"names of its nodes ({', '.join(dict(places))})")
    if type(grounded) is not bool:
        raise check.refuse(who, "grounded", grounded, "True or False")
    m = _matrix(who, "M", mass, None)
    if len(m) < 6 * len(places):
        raise ModelError(f"{who}: M has {len(m)} rows; expected 6 for each of the {len(places)} nodes, then one for "
                         f"each internal coordinate.", element=who, field="M")  # fmt: skip
    k = _matrix(who, "K", stiffness, len(m))
    c = None if damping is None else _matrix(who, "C", damping, len(m))
    axes = check.orientation(orientation, who)
    expected = f"{len(m)} numbers, one for each coordinate of M"
    bent = None if displacements is None else check.numbers(displacements, (len(m),), who, "displacements", expected)
    rigid = rigid_motions(np.array(_without_forces(places, axes, bent)), np.array(axes), len(m))
    if not grounded:
        _check_rigid(who, k, rigid)
    root = None if grounded else _root(list(dict(places)), bodies)
    relative = np.setdiff1d(np.arange(len(m)), [] if root is None else np.arange(6 * root, 6 * root + 6))
    loose = c is not None and not (grounded or _strained(c, rigid).max() > RIGID)
    rows_m, rows_k = factor(who, "M", m), factor(who, "K", k[np.ix_(relative, relative)])
    rows_c = None if c is None else factor(who, "C", c[np.ix_(relative, relative)] if loose else c)
    return Superelement(name, _entries(m), _entries(k), places, None if c is None else _entries(c),
                        tuple(bodies.items()), axes, grounded, bent, (rows_m, rows_k, rows_c),
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
    """Return values (r,) and rows (r, n) with matrix = rows^T diag(values) rows, zero ones left out.

    Raises
    ------
    ModelError
        If the matrix has a negative eigenvalue beyond rounding.
    """
    if not matrix.any():
        return np.zeros(0), np.zeros((0, len(matrix)))
    values, rows = eigenrows(matrix)
    if float(values.min()) < -NEGATIVE * float(values.max()):
        raise ModelError(
            f"{who}: {field} is not positive semidefinite: its smallest eigenvalue is {float(values.min()):.3g}, its "
            f"largest {float(values.max()):.3g} (on a unit diagonal). Check order and sign of its entries.",
            element=who, field=field,
        )  # fmt: skip
    keep = values > 0.0
    return values[keep], rows[keep]


def rigid_motions(points: Array, axes: Array, size: int) -> Array:
    """Return the motions (size, 6) of nodes that move as one rigid body about the first, in their own axes."""
    result = np.zeros((size, 6))
    local = (points - points[0]) @ axes
    for i, (x, y, z) in enumerate(local):
        result[6 * i : 6 * i + 6] = np.eye(6)
        result[6 * i : 6 * i + 3, 3:] = [[0.0, z, -y], [-z, 0.0, x], [y, -x, 0.0]]
    return result


def _strained(matrix: Array, rigid: Array) -> Array:
    """Return the largest force of each rigid-body motion over the terms that it is the sum of."""
    scale = np.sqrt(np.abs(matrix.diagonal()))
    scale[scale == 0.0] = 1.0
    size = np.abs(matrix) @ np.abs(rigid)
    largest = (size / scale[:, None]).max(axis=0)
    largest[largest == 0.0] = 1.0
    return np.asarray((np.abs(matrix @ rigid) / scale[:, None]).max(axis=0) / largest)


def _check_rigid(who: str, stiffness: Array, rigid: Array) -> None:
    left = _strained(stiffness, rigid)
    worst = int(left.argmax())
    if left[worst] > RIGID:
        raise ModelError(
            f"{who}: K resists a motion of all nodes as one rigid body along '{check.DIRECTIONS[worst]}' (forces are "
            f"{left[worst]:.2g} of the terms they sum up). Check the nodes' positions, order and axes "
            f"(x y z rx ry rz each); if the model stands on the ground within, say grounded=True.",
            element=who, field="K",
        )  # fmt: skip


def _nodes(who: str, nodes: Any) -> tuple[tuple[str, Vector], ...]:
    if not hasattr(nodes, "items") or not nodes:
        raise check.refuse(who, "nodes", nodes, "positions of its nodes by name, such as {'left': (0, 0, 0), ...}")
    return tuple([(check.name(key, f"{who}: node"), check.vector(point, who, "nodes")) for key, point in nodes.items()])


def _matrix(who: str, field: str, value: Any, size: int | None) -> Array:
    expected = f"a symmetric {'square' if size is None else f'{size} x {size}'} matrix"
    try:
        dense = value.toarray() if hasattr(value, "toarray") else value
        matrix = np.array(dense, dtype=float)
    except (TypeError, ValueError) as error:
        raise check.refuse(who, field, value, expected) from error
    if matrix.ndim != 2 or matrix.shape[0] != matrix.shape[1] or (size is not None and len(matrix) != size):
        raise ModelError(f"{who}: {field} has shape {matrix.shape}; expected {expected}.", element=who, field=field)
    if not np.isfinite(matrix).all():
        raise ModelError(f"{who}: {field} has entries that are not finite.", element=who, field=field)
    scale = np.sqrt(np.abs(matrix.diagonal()))
    scale[scale == 0.0] = np.abs(matrix).max(initial=0.0) ** 0.5 or 1.0
    off = np.triu(np.abs(matrix - matrix.T) / scale[:, None] / scale)
    if float(off.max()) > SYMMETRIC:
        i, j = np.unravel_index(int(off.argmax()), off.shape)
        raise ModelError(f"{who}: {field} is not symmetric: entries [{i}, {j}] = {matrix[i, j]:.6g} and [{j}, {i}] = "
                         f"{matrix[j, i]:.6g}.", element=who, field=field)  # fmt: skip
    return np.asarray(0.5 * (matrix + matrix.T))
