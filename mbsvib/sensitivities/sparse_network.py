"""The network of a large mechanism in the amplitudes of some of its modes: nothing dense but a column for each mode.

Displacements of bodies and joint coordinates of the modes are known; what connections see of them follows row by row.
The forces mu that close loops are those that the generalized forces f of all coordinates leave: Phi^T mu = f has a
solution, as Phi^T mu is all that is left of the equations of a mode, and [1 Phi^T; Phi 0] [0; mu] = [f; 0] has the
sparsity of the loops.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from math import prod
from typing import TYPE_CHECKING, Any

import numpy as np
from scipy.sparse import csc_matrix, csr_array, csr_matrix, eye, vstack
from scipy.sparse.linalg import splu

from mbsvib.sensitivities.constraint_forces import Constraints
from mbsvib.sparse.rows import relative_rows

if TYPE_CHECKING:
    from collections.abc import Sequence

    from mbsvib.common.arrays import Array
    from mbsvib.elements import Body
    from mbsvib.elements.rows import Rows
    from mbsvib.equations.equations import Equations
    from mbsvib.linalg.vectors import Field
    from mbsvib.sparse.equations import SparseEquations

# Combinations of redundant rows that stand for all of them: a change that works on none of these works on none.
PROBES = 3


@dataclass(frozen=True)
class ModalCoordinates:
    """Amplitudes of some modes of a sparse ``system``: ``unknowns`` (size, n), their displacements and coordinates."""

    system: SparseEquations
    unknowns: Array

    coordinates = reduction = None

    @staticmethod
    def of(system: SparseEquations, small: Equations) -> ModalCoordinates:
        """Return the amplitudes that a small system of a sparse one has as its coordinates."""
        place = system.layout
        unknowns = np.zeros((place.size, small.dof))
        body, direction = place.moving
        unknowns[place.displacement[body, direction]] = small.body_motion[body, direction]
        unknowns[place.coordinate] = small.provenance.reduction.matrix
        return ModalCoordinates(system, unknowns)

    def relative(self, rows: Rows) -> Any:
        """Return relative displacements (rows, n) in the modes."""
        return np.asarray(relative_rows(self.system.structure, self.system.layout, rows) @ self.unknowns)

    def constraints(self, bodies: Sequence[Body], number: dict[str, int], origin: Array) -> Constraints | None:
        """Return what closes loops and couples coordinates."""
        closure, tree, topology = self.system.constraints, self.system.structure, self.system.topology
        if not len(closure.names):
            return None
        locked, rows = len(closure.rows.first), closure.rows
        wrench, share = np.concatenate((rows.force, rows.moment)).T, eye(locked, len(closure.names), format="csr")
        joint = np.array(topology.cut, dtype=np.intp)[closure.loop[:locked]]
        if closure.couplers is not None:
            measured = closure.couplers.terms.measured
            coupler, value = closure.couplers.measured
            wrench = np.concatenate((wrench, np.concatenate((measured.force, measured.moment)).T))
            joint = np.concatenate((joint, closure.couplers.joint))
            shape = len(value), len(closure.names)
            more = csr_matrix((value, (np.arange(len(value)), locked + coupler)), shape=shape)
            share = vstack((share, more)).tocsr()
        row, column, entry = closure.kept_entries(tree)
        forces = LoopForces(self.system, csr_matrix((entry, (row, column)), shape=(row.max(initial=-1) + 1,
                                                                                 len(tree.names))))  # fmt: skip
        return Constraints(
            wrench,
            csr_array((np.ones(len(joint)), (joint, np.arange(len(joint)))), shape=(len(topology.joints), len(joint))),
            csr_array(share), np.arange(len(tree.names)), tree.carried, origin - tree.point.T,
            np.concatenate((tree.linear, tree.angular)).T * tree.sign[:, None], forces, forces.stress,
        )  # fmt: skip


@dataclass(frozen=True)
class LoopForces:
    """The way from generalized forces of all joint coordinates to forces in the rows that close loops, those of
    redundant rows 0: a matrix (rows, coordinates) that is only multiplied with. ``kept`` are the independent rows.
    """

    system: SparseEquations
    kept: csr_matrix

    @property
    def shape(self) -> tuple[int, int]:
        """Rows that close loops, and joint coordinates."""
        return len(self.system.constraints.names), self.kept.shape[1]

    @cached_property
    def _factor(self) -> Any:
        rows, columns = self.kept.shape
        matrix = vstack((
            csr_matrix((np.concatenate((np.ones(columns), self.kept.data)),
                        (np.concatenate((np.arange(columns), self.kept.tocoo().col)),
                         np.concatenate((np.arange(columns), columns + self.kept.tocoo().row)))),
                       shape=(columns, columns + rows)),
            csr_matrix((self.kept.data, (self.kept.tocoo().row, self.kept.tocoo().col)), shape=(rows, columns + rows)),
        ))  # fmt: skip
        return splu(csc_matrix(matrix))

    def __matmul__(self, forces: Field) -> Field:
        """Return the forces (rows, ...) that generalized forces (coordinates, ...) ask for."""
        rows, columns = self.kept.shape
        flat = forces.reshape(columns, prod(forces.shape[1:]))
        parts = [flat.real, flat.imag] if flat.dtype.kind == "c" else [flat]
        right = np.concatenate([np.ascontiguousarray(part) for part in parts], axis=1)
        found = self._factor.solve(np.concatenate((right, np.zeros((rows, right.shape[1])))))[columns:]
        both = np.split(found, len(parts), axis=1)
        result = np.zeros((self.shape[0], flat.shape[1]), dtype=flat.dtype)
        result[self.system.constraints.kept] = both[0] if len(both) == 1 else both[0] + 1j * both[1]
        return result.reshape(self.shape[0], *forces.shape[1:])

    @property
    def stress(self) -> Array:
        """States of self-stress (rows, probes): forces in redundant rows, and those in the others that balance them."""
        closure, tree = self.system.constraints, self.system.structure
        redundant = np.flatnonzero(~closure.kept)
        if not len(redundant):
            return np.zeros((self.shape[0], 0))
        entries = closure.entries(tree)
        every = csr_matrix((entries.value, (entries.row, entries.column)), shape=self.shape)
        result = np.zeros((self.shape[0], min(PROBES, len(redundant))))
        result[redundant] = np.random.default_rng(0).normal(size=(len(redundant), result.shape[1]))
        return np.asarray(result - self @ (every.T @ result))
