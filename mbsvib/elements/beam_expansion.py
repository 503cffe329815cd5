"""Beams as plain parts: nodes are bodies, neighbours are joined freely at the middle of an element, where a bushing is
its elasticity; the mass of an element moves with both of its ends, and so do mass-proportional and modal damping.

The coordinates are then the deformations of the elements: each spring feels one of them and nothing cancels.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from mbsvib.elements import beam_element as element
from mbsvib.elements import bushing as _bushing
from mbsvib.elements import joint as _joint
from mbsvib.elements.beam import Beam, moved
from mbsvib.elements.body import Body
from mbsvib.elements.shared_rows import Node, Piece

if TYPE_CHECKING:
    from mbsvib.common.arguments import Matrix3, Vector
    from mbsvib.common.arrays import Array
    from mbsvib.elements import Bushing, Joint

_NO_INERTIA = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0)


def node_bodies(beam: Beam) -> list[Body]:
    """Return the bodies, without mass of their own, that the free nodes of a beam are."""
    return [Body(name, 0.0, _NO_INERTIA, point) for name, point in beam.node_names.items()]


def elements(beam: Beam) -> list[tuple[Joint, Bushing]]:
    """Return joint and bushing of each element, both in its axes at its midpoint."""
    result = []
    for i, (length, axes) in enumerate(beam.frames()):
        at = middle(beam, i)
        k = element.stiffness(length, beam.properties, beam.material, beam.shear)
        first, second = beam.node(i), beam.node(i + 1)
        name = beam.element_names[i]
        free = _joint.make(name, "free", first, second, at, axes, None, None, None, None)
        spring = _bushing.make(name, first, second, at, k, tuple([beam.beta * value for value in k]), axes)
        result.append((free, spring))
    return result


def masses(beam: Beam) -> list[Piece]:
    """Return the mass rows of all elements, in world axes."""
    rows: dict[float, Array] = {}
    result = []
    for i, (length, axes) in enumerate(beam.frames()):
        if length not in rows:
            rows[length] = element.mass_rows(length, beam.properties, beam.material, beam.shear)
        result.append(Piece(beam.name, (_node(beam, i), _node(beam, i + 1)), turned(rows[length], axes)))
    return result


def dampers(beam: Beam) -> list[Piece]:
    """Return the rows of mass-proportional and of modal damping, none where neither is asked for."""
    result = []
    if beam.alpha:
        result += [Piece(beam.name, piece.nodes, piece.matrix, damping=np.full(len(piece.matrix), beam.alpha))
                   for piece in masses(beam)]  # fmt: skip
    if beam.damping_ratio:
        result.append(modal_damper(beam))
    return result


def modal_damper(beam: Beam) -> Piece:
    """Return damping rows that give all modes of the beam, left to itself, the same damping ratio zeta.

    C = sum over its elastic modes of 2 zeta omega M phi phi^T M = 2 zeta / omega^3 K phi phi^T K

    K acts on deformations only, so that no rigid-body motion of the beam is damped.
    """
    from mbsvib.api.model import Model
    from mbsvib.modes.undamped import undamped

    alone = Model(beam.name)
    alone._composed[beam.name] = moved(beam, a=None, b=None, alpha=0.0, beta=0.0, damping_ratio=0.0)
    system = alone.linearize(method="dense")
    modes = undamped(system, 1e-10)
    frames = beam.frames()
    k = np.array([element.stiffness(length, beam.properties, beam.material, beam.shear) for length, _ in frames])
    forces = (modes.shapes[: k.size, modes.rigid :] * k.reshape(-1, 1)).T
    matrix = np.concatenate([turned(forces[:, 6 * i : 6 * i + 6], axes) for i, (_, axes) in enumerate(frames)], axis=1)
    nodes = tuple([
        Node(beam.node(i + 1), middle(beam, i), against=beam.node(i)) for i in range(len(frames))
    ])  # fmt: skip
    return Piece(beam.name, nodes, matrix, damping=2.0 * beam.damping_ratio / modes.omega[modes.rigid :] ** 3)


def turned(rows: Array, axes: Matrix3) -> Array:
    """Return rows on vectors in local axes as rows on the same vectors in world axes."""
    result: Array = (rows.reshape(-1, 3) @ np.array(axes).T).reshape(rows.shape)
    return result


def _node(beam: Beam, i: int) -> Node:
    return Node(beam.node(i), beam.points[i])


def middle(beam: Beam, i: int) -> Vector:
    """Return the midpoint of element i."""
    (a, b, c), (d, e, f) = beam.points[i : i + 2]
    return (0.5 * (a + d), 0.5 * (b + e), 0.5 * (c + f))
