"""The scene: arrays of geometry, inertia, stiffness and ports of a mechanism, from which its matrices are computed."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any, TypeVar

import numpy as np

from mbsvib.common.arrays import Array
from mbsvib.common.fast_init import fast_init
from mbsvib.elements import Body, Bushing, Joint, Spring
from mbsvib.elements.coupler import Coupling
from mbsvib.elements.families import NODES, connection_rows
from mbsvib.elements.rows import ElementRows, Rows, table
from mbsvib.equations.inertia import SpatialInertia, spatial_inertia
from mbsvib.equations.ports import Ports, ports
from mbsvib.equations.wrenches import AppliedWrenches, applied_wrenches, is_loaded
from mbsvib.kinematics.couplers import with_couplers, with_rows
from mbsvib.kinematics.loops import Cuts, Reduction, reduce
from mbsvib.kinematics.relative_motion import Triplets, Twists, arm, relative_motion, twists
from mbsvib.kinematics.shared_rows import Shared, shared_rows
from mbsvib.mechanism.mechanism import Mechanism
from mbsvib.mechanism.topology import Topology, span

M = TypeVar("M", bound=Mechanism)


@fast_init
@dataclass(frozen=True, slots=True)
class Scene:
    """The arrays of a mechanism from which its matrices are computed.

    ``position`` (..., bodies, 3) are the centres of mass; arrays may have an axis of variants, see ``kinematics``.
    ``loads`` are the applied wrenches, and a cache for ``applied_forces``.
    """

    topology: Topology
    bodies: tuple[Body, ...]
    elements: tuple[Bushing | Spring, ...]
    position: Array
    coordinates: Twists
    cuts: Cuts | None
    springs: ElementRows
    port: Ports
    inertia: SpatialInertia
    shared: Shared | None = None
    loads: tuple[AppliedWrenches, dict[str, Any]] | None = None
    couplers: tuple[Coupling, ...] = ()

    @property
    def locked(self) -> int:
        """Number of locked rows of cut joints, which come first among the rows."""
        return len(self.cuts.rows.first) if self.cuts else 0

    @property
    def centres(self) -> Array:
        """Centres of mass (..., bodies + 1, 3) [m], the origin for ground."""
        return np.concatenate((self.position, np.zeros((*self.position.shape[:-2], 1, 3))), axis=-2)

    @property
    def measured(self) -> list[tuple[Joint, str]]:
        """Joint and direction of each coordinate of a cut joint that couplers measure, in their order."""
        known, joints = set(self.coordinates.names), {joint.name: joint for joint in self.topology.joints}
        names = [name.rpartition(".") for part in self.couplers for name, _ in part.terms if name not in known]
        return [(joints[owner], direction) for owner, _, direction in names]

    @property
    def owners(self) -> tuple[str, ...]:
        """Names of the elements with elastic rows, in the order of their numbers."""
        names = tuple([part.name for part in self.elements])
        return names if self.shared is None else names + self.shared.names

    def relative(self) -> Triplets:
        """Return the relative displacements of cut joints, springs and ports, in this order."""
        return self.relative_of(self.springs.rows, self.port.rows, *(() if self.shared is None else self.shared.base))

    def relative_of(self, *rows: Rows) -> Triplets:
        """Return the relative displacements of cut joints and of some rows, in this order."""
        return relative_motion(self.coordinates, Rows.join([*([self.cuts.rows] if self.cuts else []), *rows]))

    def reduced(self, phi: Array, independent: Sequence[str] | None = None) -> Reduction:
        """Return the minimal coordinates for the locked rows ``phi``; those named ``independent`` are among them."""
        arms = partial(arm, self.topology, self.position)
        return reduce(self.coordinates, self.cuts, phi, independent, arms)

    def closure(self, relative: Triplets) -> Array:
        """Return Phi (..., locked rows, n): the locked rows of ``relative()``, then the rows of couplers."""
        if self.cuts is None:
            return np.empty((*relative.value.shape[:-1], 0, relative.shape[1]))
        return with_rows(relative.dense(0, self.locked), self.coordinates, self.cuts)


def scene(model: Mechanism, cut: Sequence[str] | None = None) -> Scene:
    """Return the arrays of an expanded mechanism; ``cut`` names joints at which loops are to be cut."""
    topology = span(model, cut)
    bodies = list(model.bodies.values())
    number = topology.body_numbers
    elements, couplers = tuple(model.springs.values()), tuple(model.couplers.values())
    coordinates, cuts = twists_and_cuts(topology, bodies, couplers)
    return Scene(
        topology, tuple(bodies), elements, table([body.position for body in bodies], 3), coordinates, cuts,
        connection_rows(elements, number), ports(model, bodies, number),
        spatial_inertia(bodies),
        None if model.expansion is None else shared_rows(model.expansion, number, len(elements)),
        model.derived(_loading) if is_loaded(model) else None, couplers,
    )  # fmt: skip


def twists_and_cuts(
    topology: Topology, bodies: list[Body], couplers: Sequence[Coupling] = ()
) -> tuple[Twists, Cuts | None]:
    """Return the joint coordinates, and the locked rows of cut joints and couplers, None without any."""
    number = topology.body_numbers
    coordinates, cuts = twists(topology, bodies), cut_rows(topology, bodies, number)
    if couplers:
        cuts = with_couplers(cuts, couplers, topology, bodies, number, coordinates)
    return coordinates, cuts


def _loading(model: Mechanism) -> tuple[AppliedWrenches, dict[str, Any]]:
    """Applied wrenches, and an empty cache."""
    return applied_wrenches(model, {name: i for i, name in enumerate((*model.bodies, "ground"))}), {}


def cut_rows(topology: Topology, bodies: Sequence[Body], number: Mapping[str, int]) -> Cuts | None:
    """Return the locked rows of the cut joints, or None where nothing is cut."""
    if not topology.cut:
        return None
    tuples: list[tuple[float, ...]] = []
    names: list[str] = []
    joint_of: list[int] = []
    start: list[int] = []
    for count, k in enumerate(topology.cut):
        joint = topology.joints[k]
        a, b = number[joint.first], number[joint.second]
        point = joint.point or bodies[min(a, b)].position
        if joint.locked:
            start.append(len(names))
        for direction, wrench in joint.locked:
            tuples.append((a, b, *point, *wrench))
            names.append(f"{joint.name}.{direction}")
            joint_of.append(count)
    rows = Rows.stack(tuples)
    return Cuts(rows, tuple(names), np.array(joint_of, dtype=np.intp), topology.cut_joints,
                np.array(start, dtype=np.intp), np.asarray(rows.force.any(axis=0)))  # fmt: skip


def with_maxwell_nodes(model: M) -> M:
    """Return a mechanism with the nodes of its connections as bodies, and the joints in which they slide.

    Without such connections it is the same mechanism.
    """
    added = [NODES[type(part)](part) for part in model.springs.values() if type(part) in NODES]
    if not added:
        return model
    bodies, joints = dict(model.bodies), dict(model.joints)
    for part in added:
        bodies.update(part.bodies)
        joints.update(part.joints)
    return model.with_parts(bodies=bodies, joints=joints)
