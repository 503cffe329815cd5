"""Motions, and the wrenches that they put into bodies and connections.

A motion q e^(s t) strains springs, moves dampers and accelerates bodies, and joints transmit what these ask for.

Arrays are (parts, 6, ...): behind their first two axes come those of the motions, which broadcast against each other.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import prod
from typing import TYPE_CHECKING, Any

import numpy as np

from mbsvib.linalg.products import real_product
from mbsvib.linalg.vectors import transformed
from mbsvib.sensitivities.second_order_work import geometric_wrenches
from mbsvib.sensitivities.transmitted_wrenches import transmitted

if TYPE_CHECKING:
    from mbsvib.linalg.vectors import Field
    from mbsvib.sensitivities.network import Network


@dataclass(frozen=True, slots=True)
class Motions:
    """Motions ``vectors`` (m, ...) in minimal coordinates, of ``body`` (b, 6, ...) at their centres of mass and
    ``relative`` (j + s, 6, ...) of connections at their points, with what mass, stiffness and damping make of them:
    ``momentum`` (b, 6, ...), ``elastic`` and ``viscous`` (s, 6, ...), the latter None without dampers; ``nodes``
    (n, ...) are the displacements of nodes that more than two bodies share, None without any.
    """

    vectors: Field
    body: Field
    relative: Field
    momentum: Field
    elastic: Field
    viscous: Field | None
    nodes: Field | None = None

    def take(self, columns: Any) -> Motions:
        """Return some of the motions, numbered along the last axis."""
        return Motions(*(None if (array := getattr(self, key)) is None else array[..., columns]
                         for key in Motions.__slots__))  # type: ignore[arg-type]  # fmt: skip


@dataclass(frozen=True, slots=True)
class Fields:
    """Motions of bodies and connections, and the wrench in each, world axes.

    ``vectors`` (m, ...) in minimal coordinates, bodies (b, 6, ...) at their centres of mass, connections
    (j + s, 6, ...) at their points; ``strain`` (s, 6, ...) is what springs see, ``support`` (f, 6, ...) what ground
    would have to do to bodies that float and to all that hangs on them, ``tied`` (rows, ...) the forces in the rows
    that close loops. ``stiff``, ``rate`` and ``square`` are factors of stiffness, damping and inertia: 1, s and s^2.
    ``turned`` (j, 3, ...) is how far joints are turned open, whose moments at rest go with their first bodies,
    ``inertia_only`` (b, 6, ...) what part of the motions of bodies only their inertia does work on; ``side``
    tells the right (1) from the left (-1) of forms that need not be symmetric.
    """

    vectors: Field
    body: Field
    body_wrench: Field
    relative: Field
    strain: Field
    wrench: Field
    support: Field
    tied: Field
    stiff: Field
    rate: Field
    square: Field
    turned: Field | None = None
    inertia_only: Field | None = None
    side: int = 0

    @property
    def carrying(self) -> Field:
        """Motions of the bodies that forces at rest see."""
        return self.body if self.inertia_only is None else self.body - self.inertia_only

    def take(self, columns: Any) -> Fields:
        """Return some of the motions, numbered along the last axis."""
        return Fields(*(array if array is None or isinstance(array, int) else array[..., columns]
                        for array in (getattr(self, key) for key in Fields.__slots__)))  # type: ignore[arg-type]  # fmt: skip


def motions(network: Network, vectors: Field) -> Motions:
    """Return the motions of bodies and connections.

    ``vectors`` (m, ...) are motions in minimal coordinates; the momentum of bodies and the wrenches of springs and
    dampers come with those of bodies and connections.
    """
    tail = vectors.shape[1:]
    flat = vectors.reshape(len(vectors), prod(tail))
    of_joints = flat if network.reduction is None else real_product(network.reduction, flat)
    relative = real_product(network.relative, of_joints)
    body: Field = np.zeros((6 * len(network.bodies), flat.shape[1]), dtype=flat.dtype)
    moves = network.moves
    if len(moves) == len(body):
        body = real_product(network.displacements, flat)
    else:
        body[moves] = real_product(network.displacements[moves], flat)
    body, relative = body.reshape(len(network.bodies), 6, *tail), relative.reshape(len(network.point), 6, *tail)
    strained = relative[len(network.joints) :]
    nodes = None if network.shared is None else real_product(network.shared.base, of_joints)
    return Motions(vectors, body, relative, momentum(network, body), transformed(network.stiffness, strained),
                   transformed(network.damping, strained) if network.damped else None,
                   None if nodes is None else nodes.reshape(len(nodes), *tail))  # fmt: skip


def momentum(network: Network, body: Field) -> Field:
    """Return mass times translation and inertia times rotation of bodies (b, 6, ...)."""
    result: Field = np.empty_like(body)
    np.multiply(body[:, :3], network.mass.reshape(-1, *[1] * (body.ndim - 1)), out=result[:, :3])
    result[:, 3:] = transformed(network.inertia, body[:, 3:])
    return result


def fields(
    network: Network, motion: Motions, stiff: Field, rate: Field, square: Field, load: Field | None = None,
    strain: Field | None = None, side: int = 0, turned: Field | None = None, inertia_only: Field | None = None,
) -> Fields:  # fmt: skip
    """Return motions with the wrenches that go with them, in bodies and connections.

    ``stiff``, ``rate``, ``square``: factors of stiffness, damping and inertia: 1, s and s^2 for motions with e^(s t); 1
    or 0 to have the derivatives of one matrix only; ``load`` (b, 6, ...): further wrenches on bodies, at their centres
    of mass, counted as inertia is; ``strain`` (s, 6, ...): what springs see, where that is not their relative motion;
    ``side``: 1 for the right, -1 for the left side of forms between two motions, which need not be symmetric;
    ``turned`` (j, 3, ...): how far joints are turned open; ``inertia_only`` (b, 6, ...): the part of the motions of
    bodies that only inertia does work on.
    """
    body_wrench = motion.momentum * square
    joints = len(network.joints)
    tail = np.broadcast_shapes(body_wrench.shape[2:], motion.elastic.shape[2:], np.shape(rate))
    wrench: Field = np.empty((len(network.point), 6, *tail), dtype=np.result_type(motion.elastic, stiff, rate, square))
    spring_wrench = wrench[joints:]
    np.multiply(motion.elastic, stiff, out=spring_wrench)
    if motion.viscous is not None:
        spring_wrench += motion.viscous * rate
    if network.inertance is not None:
        spring_wrench += transformed(network.inertance, motion.relative[joints:]) * square
    on_bodies = body_wrench if load is None else body_wrench + load
    if network.shared is not None and motion.nodes is not None:
        on_bodies = on_bodies + network.shared.wrench(motion.nodes, (stiff, rate, square))
    if network.spin is not None and side:
        on_bodies = on_bodies + 0.0 * rate
        on_bodies[:, 3:] += network.spin.on_bodies(motion.body, rate, side)
        if network.spin.coupling is not None:
            spring_wrench += network.spin.in_springs(motion.relative[joints:], stiff, rate, side)
    if network.forces is not None:
        carrying = motion.body if inertia_only is None else motion.body - inertia_only
        on_bodies = on_bodies + geometric_wrenches(network.forces, carrying, side, turned) * stiff
    wrench[:joints], support, tied = transmitted(network, on_bodies, spring_wrench)
    spring_strain = motion.relative[joints:] if strain is None else strain
    return Fields(motion.vectors, motion.body, body_wrench, motion.relative, spring_strain, wrench, support, tied,
                  stiff, rate, square, turned, inertia_only, side)  # fmt: skip


