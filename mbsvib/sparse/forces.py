"""Forces in joints, and sums of all forces on a body or the ground, as outputs of many bodies.

A force in a joint is the virtual work of all other forces, inertia included, in a unit virtual displacement that
releases the joint in its direction. All bodies behind the joint move as one rigid body. In loops other coordinates
change too, so that no other constraint is violated. With redundant constraints a single joint cannot be released; then
the other joints of the loops are released too, so that the forces have least norm. The sum of all forces on a body is
its rate of change of momentum.
"""

from __future__ import annotations

from dataclasses import dataclass, fields, replace
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np

from mbsvib.elements.rows import Rows
from mbsvib.equations.base_motion import inertia_of_ground_motion
from mbsvib.equations.force_paths import carrier_of, carries_nothing, point_of
from mbsvib.mechanism.topology import FLOATS
from mbsvib.sparse.draft import SparseDraft
from mbsvib.sparse.rotated_forces import RotatedForces
from mbsvib.sparse.rows import relative_rows
from mbsvib.sparse.virtual_displacements import Release
from mbsvib.sparse.virtual_motions import JointRelease, Motion, RegionRelease, all_rotations

if TYPE_CHECKING:
    from collections.abc import Iterator

    from scipy.sparse import csr_matrix

    from mbsvib.common.arrays import Array, Index
    from mbsvib.equations.self_stress import Undetermined
    from mbsvib.kinematics.shared_rows import Composite
    from mbsvib.sparse.self_stress import Region


@dataclass(frozen=True)
class ForceSums(SparseDraft):
    """A draft with all forces on its bodies, from which forces in joints and sums of forces are computed."""

    @staticmethod
    def of(draft: SparseDraft) -> ForceSums:
        """Return those of a draft."""
        return ForceSums(*[getattr(draft, entry.name) for entry in fields(draft)])

    @cached_property
    def virtual_displacements(self) -> Release:
        """Virtual displacements that release cut joints."""
        return Release(self.structure, self.layout, self.closure)

    def rows_of_outputs(self) -> tuple[tuple[csr_matrix, csr_matrix, csr_matrix], Array]:
        """Return rows of the outputs that are forces in joints or sums of forces, and zeros for the others.

        Rows (outputs, size) for displacement, velocity and acceleration, and D (outputs, inputs)
        """
        from scipy.sparse import csr_matrix

        shape = (len(self.port.output_units), self.layout.size)
        through = np.zeros((shape[0], len(self.port.input_units)))
        entries: tuple[list[Any], list[Any], list[Any]] = ([], [], [])
        for row, kind, number, wrench in self.port.wrench_outputs:
            rows, through[row] = (self._sum if kind == "body" else self._in_joint)(number, wrench)
            for derivative, values in rows.items():
                at = np.flatnonzero(values)
                entries[derivative].append((values[at], np.full(len(at), row), at))
        matrices = []
        for parts in entries:
            value, row_of, column = (np.concatenate([part[i] for part in parts] or [()]) for i in range(3))
            matrices.append(csr_matrix((value, (row_of.astype(int), column.astype(int))), shape=shape))
        return (matrices[0], matrices[1], matrices[2]), through

    def undetermined_outputs(self, names: tuple[str, ...]) -> tuple[Undetermined, ...]:
        """Return the outputs, by ``names``, that redundant constraints do not determine."""
        outputs: dict[Region, list[str]] = {region: [] for region in self.regions.values()}
        for row, kind, number, wrench in self.port.wrench_outputs:
            if kind == "joint" and number in self.regions:
                region, step = self.regions[number], self._step(number, wrench)
                if not region.determines(step, region.split(step)[0]):
                    outputs[region].append(names[row])
        return tuple([region.undetermined(tuple(which)) for region, which in outputs.items() if which])

    def _sum(self, body: int, wrench: Array) -> tuple[dict[int, Array], Array]:
        """Sum of all forces on a body, its rate of change of momentum; on the ground, minus the sum of the others."""
        n = len(self.structure.parent)
        if body < n:
            sign = np.zeros(n + 1)
            sign[body] = -1.0
            motion = JointRelease(sign, wrench[:3], wrench[3:], self.structure.position[body])
            inertia, base = self._of_inertia(motion)
            rotations = motion.rotations
        else:
            inertia, base = self._inertia_forces(self._rigid_inertia(wrench, np.zeros(3)))
            rotations = np.tile(wrench[3:], (n + 1, 1))
        rows = {2: inertia}
        if self.spins is not None:
            rows[1] = self.spins.of_rotors(rotations)
        if body == n and self._rotated is not None:
            rows[0] = self._rotated.on_ground(wrench)
        return rows, base

    def _in_joint(self, number: int, wrench: Array) -> tuple[dict[int, Array], Array]:
        """Rows of the force or moment in a joint along a wrench, by derivative, and its feedthrough."""
        joint, axes = self.topology.joints[number], np.array(self.topology.joints[number].axes)
        if carries_nothing(joint, np.concatenate((axes @ wrench[:3], axes @ wrench[3:])), self.model,
                           loaded=self.geometric is not None):  # fmt: skip
            return {}, np.zeros(len(self.port.input_units))
        result = dict(enumerate(np.zeros((3, self.layout.size))))
        region = self.regions.get(number)
        if region is None:
            motion: Motion = self._release(number, wrench)
        else:
            step = self._step(number, wrench)
            stress = region.split(step)[0]
            motion = self._region_release(region, step)
            if self._rotated is not None and not region.determines(step, stress):
                result[0] += self._least_norm_change(region, stress)
        for rows, along, weights in self._elastic(motion):
            for derivative, value in weights:
                result[derivative] -= rows.T @ (value * along)
        if self._rotated is not None:
            result[0] += self._rotated.of_joints(motion)
        if self.spins is not None:
            of_elements = self.spins.of_elements(motion)
            result[0] += of_elements[0]
            result[1] += of_elements[1] + self.spins.of_rotors(all_rotations(motion, self.layout))
        inertia, through = self._of_inertia(motion)
        result[2] += inertia
        inputs = self.port.force_inputs
        work = motion.along(self.port.rows)[: len(inputs)]
        through[inputs] += work
        if motion.tree_motion is not None:
            through[inputs] += self.port_rows[: len(inputs)] @ motion.tree_motion
        return result, through

    def _step(self, number: int, wrench: Array) -> Array:
        """A unit displacement (6, j) in one joint along its axes, among the joints of its region."""
        region, axes = self.regions[number], np.array(self.topology.joints[number].axes)
        result = np.zeros((6, len(region.joints)))
        result[:, region.joints.searchsorted(number)] = *(axes @ wrench[:3]), *(axes @ wrench[3:])
        return result

    def _region_release(self, region: Region, step: Array) -> RegionRelease:
        """The motion that releases the joints of a region by the compatible part of their displacements."""
        stress, motion = region.split(step)
        centre = np.concatenate((self.structure.position, np.zeros((1, 3))))
        compatible = step - region.scale**2 * stress
        return RegionRelease(region.displacements(motion, centre), centre, region.joints, compatible)

    def _least_norm_change(self, region: Region, stress: Array) -> Array:
        """Change of the forces of least norm by the change of a state of self-stress with the pose; a row (size,)."""
        assert self.geometric is not None
        wrenches = self.geometric.joints[:, region.joints]
        motion = self._region_release(region, region.scale**2 * wrenches)
        state = RotatedForces(self.structure, self.layout, self.geometric.of_joints(region.joints, stress))
        work = float((wrenches[3:] * stress[3:]).sum())
        return self._moment_weight_change(region) * work - state.of_joints(motion)

    def _release(self, number: int, wrench: Array) -> JointRelease:
        """The motion that releases a joint along its axes."""
        joint, rows = self.topology.joints[number], self.closure.rows
        centre = np.concatenate((self.structure.position, np.zeros((1, 3)))).T
        axes, point = np.array(joint.axes), np.array(point_of(joint, self.number, centre), dtype=float)
        motion = JointRelease(np.zeros(centre.shape[1]), axes @ wrench[:3], axes @ wrench[3:], point, number)
        couplers, target = self.closure.couplers, np.zeros(len(self.closure.names))
        locked = target[: len(rows.first)]
        in_tree = number in self._tree_joints
        if in_tree:
            body, sign = self._tree_joints[number]
            enter, leave = self._subtrees
            motion.sign[:-1][(enter >= enter[body]) & (enter < leave[body])] = sign
            locked -= motion.along(rows)
        else:
            rows_of_joint = np.flatnonzero(self.closure.loop[: len(locked)] == self.topology.cut.index(number))
            locked[rows_of_joint] = motion.of_twist(rows)[rows_of_joint]
        if couplers is not None:
            row, coefficient = couplers.measured
            measured = couplers.terms.measured
            step = -motion.along(measured) if in_tree else motion.of_twist(measured) * (couplers.joint == number)
            np.add.at(target, len(locked) + row, coefficient * step)
        return replace(motion, tree_motion=self.virtual_displacements.unknowns(target)) if target.any() else motion

    def _elastic(self, motion: Motion) -> Iterator[tuple[csr_matrix, Array, tuple[tuple[int, Array], ...]]]:
        """Elastic rows, the displacements of a motion along them, and their weights by derivative."""
        parts = [(self.elastic, motion.along(self.springs.rows), self.springs.weights)]
        if self._shared_rows is not None and self.shared is not None and self.shared.elastic is not None:
            elastic = self.shared.elastic
            parts.append((self._shared_rows, _along_composite(elastic.composite, motion),
                          ((0, elastic.stiffness), (1, elastic.damping))))  # fmt: skip
        for rows, along, weights in parts:
            yield rows, along if motion.tree_motion is None else along + rows @ motion.tree_motion, weights

    def _of_inertia(self, motion: Motion) -> tuple[Array, Array]:
        """Work of inertia forces in a motion, per unit of the unknowns' acceleration (size,) and of the inputs."""
        rows = self.inertia.factor(motion.of_bodies(self.structure.position)[:, :, None])[:, 0]
        if self.shared is not None and self.shared.mass is not None:
            rows = np.concatenate((rows, _along_composite(self.shared.mass, motion)))
        if motion.tree_motion is not None:
            rows = rows + self.body_factor @ motion.tree_motion
        return self._inertia_forces(rows)

    def _inertia_forces(self, rows: Array) -> tuple[Array, Array]:
        """Work of inertia forces in a motion from its inertia ``rows`` W u."""
        through = np.zeros(len(self.port.input_units))
        for column, base_motion in self._base:
            through[column] = -(rows @ base_motion)
        return -(self.body_factor.T @ rows), through

    def _moment_weight_change(self, region: Region) -> Array:
        """Derivative of the weight 1 / L^2 of moments in a region with respect to the pose, a row (size,)."""
        point = region.point[:, region.force_joints]
        from_centre = point - point.mean(axis=1, keepdims=True)
        carrier = np.array([carrier_of(self.topology.joints[k], self.number)
                            for k in region.joints[region.force_joints].tolist()])  # fmt: skip
        ground = np.full(len(carrier), len(self.structure.parent))
        directions = Rows(ground, carrier, point, from_centre, np.zeros_like(from_centre))
        rows = relative_rows(self.structure, self.layout, directions)
        return np.asarray(rows.sum(axis=0)).reshape(-1) * (-2.0 / (len(carrier) * region.length**4))

    @cached_property
    def _rotated(self) -> RotatedForces | None:
        return None if self.geometric is None else RotatedForces(self.structure, self.layout, self.geometric)

    @cached_property
    def _base(self) -> list[tuple[int, Array]]:
        """Square roots of inertia times the rigid-body acceleration of the base motions."""
        return [(column, self._rigid_inertia(np.array(source.wrench), np.array(source.position)))
                for column, source in self.port.base_motions]  # fmt: skip

    def _rigid_inertia(self, six: Array, origin: Array) -> Array:
        """Square roots of inertia times a rigid motion (6,) of all bodies with the ground, about an origin."""
        return inertia_of_ground_motion(six, origin, self.structure.position, self.inertia, self.shared)

    @cached_property
    def _shared_rows(self) -> csr_matrix | None:
        """Elastic rows that more than two bodies share."""
        if self.shared is None or self.shared.elastic is None:
            return None
        composite = self.shared.elastic.composite
        return composite.of_sparse(relative_rows(self.structure, self.layout, composite.rows))

    @cached_property
    def _tree_joints(self) -> dict[int, tuple[int, int]]:
        """The outer body of each joint of the tree, and its sign in this joint."""
        return {b.joint: (b.body, b.sign) for b in self.topology.branches if b.joint != FLOATS}

    @cached_property
    def _subtrees(self) -> tuple[Index, Index]:
        """Numbering of bodies in which each subtree is a range: begin and end of the ranges, (bodies,)."""
        n, parent, outward = len(self.structure.parent), self.structure.parent.tolist(), self.structure.outward.tolist()
        size, begin, free = [1] * (n + 1), [0] * (n + 1), [0] * (n + 1)
        for body in reversed(outward):
            size[parent[body]] += size[body]
        for body in outward:
            begin[body] = free[parent[body]]
            free[parent[body]] += size[body]
            free[body] = begin[body] + 1
        enter = np.array(begin[:n], dtype=np.intp)
        return enter, enter + np.array(size[:n], dtype=np.intp)


def _along_composite(composite: Composite, motion: Motion) -> Array:
    """Displacements of the rigid part of a motion along composite rows."""
    return composite.of((motion.along(composite.rows) * composite.moves_with_ground)[:, None])[:, 0]
