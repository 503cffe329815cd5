"""The mechanism as a network: bodies, connections between them, and the joints of the tree that carry both.

A connection (joint or spring-damper) has a point and relates two bodies; its relative motion there is a six-vector.
Everything that a parameter can change is local to a body or to a connection.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from scipy.sparse import csr_array

from mbsvib.assembly import cut_rows
from mbsvib.kinematics import Rows, relative_motion, twists
from mbsvib.parts import Body, Bushing, Joint, Spring
from mbsvib.topology import FLOATS

if TYPE_CHECKING:
    from collections.abc import Sequence

    from mbsvib.kinematics import Array, Index, Twists
    from mbsvib.system import System

_TENSOR = [0, 3, 4, 3, 1, 5, 4, 5, 2]  # xx xy xz, xy yy yz, xz yz zz out of xx yy zz xy xz yz
_SIX = np.eye(6)


@dataclass(frozen=True, slots=True)
class Constraints:
    """The locked rows of the cut joints, (rows,) each: ``wrench`` (rows, 6) at their joint's point, world axes, and
    ``joint``, its number; ``dependent`` (d,) coordinates and Q, R of the rows in them; ``stress`` (rows, r) are the
    combinations of redundant rows that load nothing.
    """

    wrench: Array
    joint: Index
    dependent: Index
    q: Array
    r: Array
    stress: Array


@dataclass(frozen=True, slots=True)
class Network:
    """Bodies (b), joints (j), bushings and line springs (s) of a system in numbers, world axes.

    ``relative`` (6 (j + s), n) leads from joint coordinates to the motion of each connection's second body against its
    first at ``point`` (j + s, 3). ``branch`` (j,) is the row of a joint in ``carried`` (t, s + b), which holds +-1
    where a joint of the tree carries what acts in a spring-damper or on a body, -1 for joints that are cut or fixed;
    ``column`` (n,) gives the row of each coordinate.
    """

    bodies: tuple[Body, ...]
    joints: tuple[Joint, ...]
    springs: tuple[Bushing | Spring, ...]
    coordinates: Twists
    reduction: Array | None
    mass: Array
    inertia: Array
    position: Array
    axes: Array
    point: Array
    relative: csr_array
    stiffness: Array
    damping: Array
    branch: Index
    column: Index
    carried: Array
    constraints: Constraints | None


def network(system: System) -> Network:
    """Return the network of a system.

    Parameters
    ----------
    system : System
        The equations of motion.

    Returns
    -------
    Network
        Its bodies and connections in numbers.
    """
    topology, reduction = system.provenance.topology, system.provenance.reduction
    parts = system.provenance.parts
    bodies = tuple(part for part in parts if isinstance(part, Body))
    joints = tuple(part for part in parts if isinstance(part, Joint))
    springs = tuple(part for part in parts if isinstance(part, (Bushing, Spring)))
    number = {body.name: i for i, body in enumerate(bodies)} | {"ground": len(bodies)}
    coordinates = twists(topology, list(bodies))
    point = np.array([*(_point(joint, bodies, number) for joint in joints),
                      *(s.start if isinstance(s, Spring) else s.position for s in springs)]).reshape(-1, 3)  # fmt: skip
    first, second = (np.array([number[getattr(part, end)] for part in (*joints, *springs)], dtype=np.intp)
                     for end in ("first", "second"))  # fmt: skip
    branch, column = _branches(system, coordinates)
    leads = np.unique(column, return_index=True)[1] if len(column) else column
    path = coordinates.path[:, leads].T.astype(float)
    at = slice(len(joints), None)
    axes = np.array([body.orientation for body in bodies])
    tensors = np.array([body.inertia for body in bodies])[:, _TENSOR].reshape(-1, 3, 3)
    return Network(
        bodies, joints, springs, coordinates, reduction.matrix, np.array([body.mass for body in bodies]),
        axes @ tensors @ axes.transpose(0, 2, 1), np.array([body.position for body in bodies]), axes, point,
        _relative(coordinates, first, second, point), _world(springs, "stiffness"), _world(springs, "damping"),
        branch, column, np.concatenate((path[:, second[at]] - path[:, first[at]], path[:, :-1]), axis=1),
        _constraints(system, coordinates, bodies, number),
    )  # fmt: skip


def _point(joint: Joint, bodies: Sequence[Body], number: dict[str, int]) -> tuple[float, float, float]:
    return joint.point or bodies[min(number[joint.first], number[joint.second])].position


def _relative(coordinates: Twists, first: Index, second: Index, point: Array) -> csr_array:
    """Relative motions at the points of the connections, six rows each, by the path rule."""
    n = len(first)
    six = np.tile(_SIX, (n, 1)).T
    rows = Rows(np.repeat(first, 6), np.repeat(second, 6), np.repeat(point, 6, axis=0).T, six[:3], six[3:])
    found = relative_motion(coordinates, rows)
    return csr_array((found.value, (found.row, found.column)), shape=found.shape)


def _branches(system: System, coordinates: Twists) -> tuple[Index, Index]:
    """Row of each joint among the joints of the tree that move, and of each coordinate; floating bodies come last."""
    topology = system.provenance.topology
    branch = np.full(len(topology.joints), -1, dtype=np.intp)
    column: list[int] = []
    row = 0
    for k in sorted(b.joint for b in topology.branches if b.joint != FLOATS):
        freedom = len(topology.joints[k].freedom)
        if freedom:
            branch[k] = row
            column += [row] * freedom
            row += 1
    for _ in topology.floating:
        column += [row] * 6
        row += 1
    return branch, np.array(column, dtype=np.intp)


def _world(springs: Sequence[Bushing | Spring], field: str) -> Array:
    """Coefficients as 6x6 matrices in world axes, of line springs on the motion at their start."""
    result = np.zeros((len(springs), 6, 6))
    for i, part in enumerate(springs):
        if isinstance(part, Spring):
            result[i, :3, :3] = getattr(part, field) * np.outer(part.line, part.line)
            continue
        value = np.array(getattr(part, field))
        turn = np.kron(np.eye(2), np.array(part.orientation))
        result[i] = turn @ (np.diag(value) if value.ndim == 1 else value) @ turn.T
    return result


def _constraints(
    system: System, coordinates: Twists, bodies: Sequence[Body], number: dict[str, int]
) -> Constraints | None:
    topology, reduction = system.provenance.topology, system.provenance.reduction
    cuts = cut_rows(topology, bodies, number)
    if cuts is None or not cuts.names:
        return None
    free = np.zeros(len(coordinates.names), dtype=bool)
    free[reduction.independent] = True
    dependent = np.flatnonzero(~free)
    phi = relative_motion(coordinates, cuts.rows).dense(0, len(cuts.names))[:, dependent]
    q, r = np.linalg.qr(phi, mode="complete")
    d = len(dependent)
    return Constraints(
        np.concatenate((cuts.rows.force, cuts.rows.moment)).T, np.array(topology.cut, dtype=np.intp)[cuts.joint],
        dependent, q[:, :d], r[:d], q[:, d:],
    )  # fmt: skip

