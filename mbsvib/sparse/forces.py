"""Forces in joints, and sums of all forces on a body or the ground, as outputs of many bodies.

A force in a joint is the virtual work of all other forces, inertia included, in a unit virtual displacement that
releases the joint in its direction. All bodies behind the joint move as one rigid body. In loops other coordinates
change too, so that no other constraint is violated. With redundant constraints a single joint cannot be released; then
the other joints of the loops are released too, so that the forces have least norm. The rows of all forces are those of
the equations over unknowns with virtual motions (``virtual``). The sum of all forces on a body is its rate of change of
momentum.
"""

from __future__ import annotations

from dataclasses import replace
from functools import cached_property
from typing import Any

import numpy as np
from scipy.sparse import csc_matrix, csr_matrix, eye
from scipy.sparse.linalg import splu

from mbsvib.common.arrays import Array, Index
from mbsvib.common.tables import listed
from mbsvib.elements.rows import Rows
from mbsvib.equations.ports import ground_motion, inertia_of_ground_motion
from mbsvib.equations.self_stress import Undetermined, moment_weight_rows
from mbsvib.equations.spin_terms import momenta
from mbsvib.equations.virtual_motions import carries_nothing, joint_ends
from mbsvib.errors import ModelError
from mbsvib.linalg.rank import ZERO_SUM
from mbsvib.sparse.draft import SparseDraft, of_rotors, placed, with_inerters, with_ports, with_shared, with_spin
from mbsvib.sparse.geometric_stiffness import JointForms, Products
from mbsvib.sparse.layout import relative_rows, virtual_unknowns
from mbsvib.sparse.self_stress import Region
from mbsvib.sparse.tableau import FINE, SINGULAR, Factor


def with_joint_forces(draft: SparseDraft) -> SparseDraft:
    """Return a draft with the rows of outputs that are forces in joints or sums of forces."""
    work = VirtualWork(draft)
    through, outputs = draft.D.copy(), list(draft.outputs)
    for row, kind, number, wrench in draft.port.wrench_outputs:
        rows, through[row] = (work.on_body if kind == "body" else work.in_joint)(number, wrench)
        for derivative, values in enumerate(rows):
            outputs[derivative] = outputs[derivative] + placed(csr_matrix(values), [row], len(through))
    return replace(draft, outputs=(outputs[0], outputs[1], outputs[2]), D=through,
                   undetermined=work.undetermined_outputs(tuple(draft.model.outputs)))  # fmt: skip


class VirtualWork:
    """The work of all forces of a ``draft`` along virtual motions."""

    def __init__(self, draft: SparseDraft) -> None:
        self._draft, self._n = draft, len(draft.structure.parent)
        self._centre = np.concatenate((draft.structure.position, np.zeros((1, 3))))
        *_, point, self._carrier = joint_ends(draft.topology, self._centre.T)
        asked = {number for _, kind, number, _ in draft.port.wrench_outputs if kind == "joint"}
        asked.update(*(region.joints.tolist() for region in draft.regions.values()))
        self._unknowns = virtual_unknowns(draft.topology, draft.structure, draft.layout, sorted(asked), point)
        forces = draft.over(self._unknowns.tree, self._unknowns.layout)
        for step in (with_shared, with_inerters, with_spin, with_ports):
            forces = step(forces)
        self._forces = forces

    def in_joint(self, number: int, wrench: Array) -> tuple[Array, Array]:
        """Return rows (3, size) of the force or moment in a joint along a wrench, by derivative, and its feedthrough.
        """
        draft = self._draft
        joint, direction = draft.topology.joints[number], self._direction(number, wrench)
        if carries_nothing(joint, direction, draft.model, loaded=draft.loading is not None):
            return np.zeros((3, draft.layout.size)), np.zeros(len(draft.port.input_units))
        region = draft.regions.get(number)
        if region is None:
            return self._work(self._releasing(np.array([number]), direction[:, None]))
        step = self._step(number, wrench)
        stress = region.stress(step)
        rows, through = self._work(self._in_region(region, step))
        if draft.loading is not None and not region.determines(step, stress):
            rows[0] += self._least_norm_change(region, stress)
        return rows, through

    def on_body(self, body: int, wrench: Array) -> tuple[Array, Array]:
        """Return rows (3, size) of the sum of all forces on a body, its rate of change of momentum, and its
        feedthrough; on the ground, minus the sum of the others.
        """
        forces, size = self._forces, self._draft.layout.size
        result, z = np.zeros((3, size)), np.zeros(self._unknowns.layout.size)
        at = self._unknowns.layout.displacement
        if body < self._n:
            z[at[body]] = -wrench
            inertia = forces.body_factor @ z
            if forces.shared is not None and forces.shared.mass is not None:
                # the body moves alone, along none of its joints
                mass, tree = forces.shared.mass, self._unknowns.tree
                every = np.ones(len(mass.rows.first), dtype=bool)
                rows = relative_rows(tree, self._unknowns.layout, mass.rows, every)
                inertia[len(inertia) - mass.count :] = mass.of_sparse(rows) @ z
        else:
            z[at] = ground_motion(wrench, np.zeros(3), self._centre[:-1])
            inertia = self._rigid_inertia(wrench, np.zeros(3))
            loading = self._draft.loading
            if loading is not None:
                result[0] = self._sum(loading.applied.on_ground(self._centre[:-1].T, wrench))
        result[2] = -(forces.body_factor.T @ inertia)[:size]
        rotors = of_rotors(self._unknowns.layout, momenta(self._draft.model, self._draft.bodies))
        if rotors is not None:
            result[1] = -(rotors.T @ z)[:size]
        through = np.zeros(len(self._draft.port.input_units))
        for column, source in self._draft.port.base_motions:
            through[column] = -(inertia @ self._rigid_inertia(source.wrench, source.position))
        return result, through

    def undetermined_outputs(self, names: tuple[str, ...]) -> tuple[Undetermined, ...]:
        """Return the outputs, by ``names``, that redundant constraints do not determine."""
        regions = self._draft.regions
        outputs: dict[Region, list[str]] = {region: [] for region in regions.values()}
        for row, kind, number, wrench in self._draft.port.wrench_outputs:
            if kind == "joint" and number in regions:
                region, step = regions[number], self._step(number, wrench)
                if not region.determines(step, region.stress(step)):
                    outputs[region].append(names[row])
        return tuple([region.undetermined(tuple(which)) for region, which in outputs.items() if which])

    def _work(self, z: Array) -> tuple[Array, Array]:
        """Minus the work along a motion z: rows (3, size) by derivative, and per unit of the inputs."""
        forces = self._forces
        strain = _product(forces.rows, z)
        result = np.stack((forces.rows.T @ (forces.k * strain), forces.rows.T @ (forces.c * strain),
                           forces.factor.T @ _product(forces.factor, z)))  # fmt: skip
        products, circulatory = self._of_loads
        for derivative, matrix in ((0, forces.circulatory), (0, circulatory), (1, forces.gyroscopic)):
            if matrix is not None:
                result[derivative] += matrix.T @ z
        if products is not None:
            result[0] += products.times(z)
        return -result[:, : self._draft.layout.size], _product(forces.inputs, z)

    @cached_property
    def _of_loads(self) -> tuple[Products | None, csr_matrix | None]:
        """Geometric stiffness over unknowns with virtual motions, with forces of least norm in joints."""
        loading = self._draft.loading
        return (None, None) if loading is None else loading.products(self._forms, loading.joints)

    @cached_property
    def _forms(self) -> JointForms:
        assert self._draft.loading is not None
        return self._draft.loading.forms(self._unknowns)

    def _direction(self, number: int, wrench: Array) -> Array:
        axes = np.array(self._draft.topology.joints[number].axes)
        return np.concatenate((axes @ wrench[:3], axes @ wrench[3:]))

    def _step(self, number: int, wrench: Array) -> Array:
        """A unit displacement (6, j) in one joint along its axes, among the joints of its region."""
        region = self._draft.regions[number]
        result = np.zeros((6, len(region.joints)))
        result[:, region.joints.searchsorted(number)] = self._direction(number, wrench)
        return result

    def _releasing(self, joints: Index, steps: Array) -> Array:
        """The motion that releases joints (j,) by displacements (6, j), over the unknowns with virtual motions."""
        layout, unknowns = self._unknowns.layout, self._unknowns
        z = np.zeros(layout.size)
        z[unknowns.column[joints][:, None] + np.arange(6)] = steps.T
        # what the bodies move, about a common point, is the sum on their ways from ground
        body, sign = self._draft.topology.outer
        used = np.flatnonzero(body[joints] >= 0)
        at, points = joints[used], unknowns.point.T
        common, own = points[joints].mean(axis=0), np.zeros((self._n, 6))
        own[body[at]] = sign[at, None] * ground_motion(steps.T[used], points[at], common)
        own[self._draft.structure.outward] = self._ways.solve(own[self._draft.structure.outward])
        z[layout.displacement] = ground_motion(own, common, self._centre[:-1])
        opening = _product(self._locked, z)
        if opening.any():
            z[: self._draft.layout.size] -= self._closing(opening)
        return z

    def _closing(self, opening: Array) -> Array:
        """The smallest motion (size,) of the tree with some displacements (multipliers,) of the independent rows."""
        layout = self._draft.layout
        right = np.zeros((layout.size, 1))
        right[layout.multiplier, 0] = opening
        motion, change = self._kinematics.solve_closely(right, FINE)
        if change > SINGULAR:
            loops = listed([name for group in self._draft.closure.groups for name in group.joints])
            raise ModelError(
                f"forces in joints of the loops closed by {loops} are not determined to many digits: the constraints "
                f"nearly depend on each other. Leave these outputs out, or use method='dense'.", field="method",
            )  # fmt: skip
        return np.asarray(motion[:, 0])

    @cached_property
    def _kinematics(self) -> Factor:
        return self._draft.tableau.with_equal_springs(self._draft.layout)

    @cached_property
    def _locked(self) -> csr_matrix:
        """Independent locked rows over the unknowns with virtual motions."""
        draft = self._draft
        return draft.closure.over_unknowns(draft.structure, draft.layout, self._unknowns)

    def _in_region(self, region: Region, step: Array) -> Array:
        """The motion that releases the joints of a region by the compatible part of displacements (6, j)."""
        return self._releasing(region.joints, step - region.scale**2 * region.stress(step))

    def _least_norm_change(self, region: Region, stress: Array) -> Array:
        """Change of the forces of least norm by the change of a state of self-stress with the pose; a row (size,)."""
        loading = self._draft.loading
        assert loading is not None
        wrenches, state = loading.joints[:, region.joints], np.zeros_like(loading.joints)
        state[:, region.joints] = stress
        z = self._in_region(region, region.scale**2 * wrenches)
        row = loading.products(self._forms, state, applied=False)[0].times(z)
        work = float((wrenches[3:] * stress[3:]).sum())
        joints = region.force_joints
        weight = self._sum(moment_weight_rows(region.point[:, joints], self._carrier[region.joints[joints]], self._n,
                                              region.length))  # fmt: skip
        return np.asarray(weight * work + row[: self._draft.layout.size])

    def _sum(self, rows: Rows) -> Array:
        """The sum of relative displacements, a row (size,)."""
        return np.asarray(relative_rows(self._draft.structure, self._draft.layout, rows).sum(axis=0)).reshape(-1)

    def _rigid_inertia(self, six: Any, origin: Any) -> Array:
        """Square roots of inertia times a rigid motion (6,) of all bodies with the ground, about an origin."""
        return inertia_of_ground_motion(six, origin, self._centre[:-1], self._draft.inertia, self._draft.shared)

    @cached_property
    def _ways(self) -> Any:
        """The factor that adds up what is given for each body on its way from ground, parents before children."""
        structure, n = self._draft.structure, self._n
        place = np.empty(n, dtype=np.intp)
        place[structure.outward] = np.arange(n)
        child = np.flatnonzero(structure.parent < n)
        step = csc_matrix((np.ones(len(child)), (place[child], place[structure.parent[child]])), shape=(n, n))
        return splu((eye(n) - step).tocsc(), permc_spec="NATURAL", diag_pivot_thresh=0.0)


def _product(rows: csr_matrix, z: Array) -> Array:
    """Return R z, with zeros where terms cancel to rounding."""
    result = np.asarray(rows @ z)
    result[np.abs(result) <= ZERO_SUM * (abs(rows) @ np.abs(z))] = 0.0
    return result
