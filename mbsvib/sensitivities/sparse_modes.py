"""Sensitivities of some modes of a large mechanism, at a cost in proportion to modes times parameters.

A mode moves by d lambda = -y^T (lambda^2 dM + lambda dC + dK) x / y^T (2 lambda M + C) x, of which each parameter needs
what its own part sees of x and y, and the forces that joints hand on. M and C are those of the small system in which
the modes were found.

Displacements of bodies and joint coordinates of the modes are known; what connections see of them follows row by row.
The forces mu that close loops are those that the generalized forces f of all coordinates leave: Phi^T mu = f has a
solution, as Phi^T mu is all that is left of the equations of a mode, and [1 Phi^T; Phi 0] [0; mu] = [f; 0] has the
sparsity of the loops.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from math import prod
from typing import Any, cast

import numpy as np
from scipy.sparse import csc_matrix, csr_array, csr_matrix, vstack
from scipy.sparse.linalg import splu

from mbsvib.common.arrays import Array, Complex, Index
from mbsvib.elements.beam import Beam
from mbsvib.equations.equations import Equations
from mbsvib.equations.matrices import MATRICES
from mbsvib.errors import ModelError
from mbsvib.linalg.rank import SAME_EIGENVALUE
from mbsvib.linalg.vectors import Field
from mbsvib.responses.basis import Basis
from mbsvib.sensitivities.basis import SensitivityBasis
from mbsvib.sensitivities.eigenvalues import eigenvalue_sensitivities
from mbsvib.sensitivities.network_assembly import assembled, is_complete
from mbsvib.sensitivities.network_kinematics import Constraints, Kinematics, closing_terms
from mbsvib.sensitivities.shapes import ModeSensitivities
from mbsvib.sensitivities.variables import Direction, Requested
from mbsvib.sparse.equations import SparseEquations
from mbsvib.sparse.layout import relative_rows
from mbsvib.sparse.modes import SomeModes, modes

# Combinations of redundant rows that stand for all of them: a change that works on none of these works on none.
PROBES = 3


def modal_coordinates(system: SparseEquations, small: Equations) -> Kinematics:
    """Return the amplitudes of some modes of a sparse system, which a small system of it has as its coordinates."""
    layout = system.layout
    unknowns = np.zeros((layout.size, small.dof))
    body, direction = layout.moving
    unknowns[layout.displacement[body, direction]] = small.body_motion[body, direction]
    unknowns[layout.coordinate] = small.provenance.reduction.matrix
    return Kinematics(None, None, lambda rows: np.asarray(relative_rows(system.structure, layout, rows) @ unknowns),
                      lambda _, __, origin: _constraints(system, origin))  # fmt: skip


def _constraints(system: SparseEquations, origin: Array) -> Constraints | None:
    """What closes the loops of a sparse system and couples its coordinates."""
    closure, tree, topology = system.constraints, system.structure, system.topology
    if not len(closure.names):
        return None
    joint, coupled = np.array(topology.cut, dtype=np.intp)[closure.loop[: len(closure.rows.first)]], None
    if (couplings := closure.cuts.couplings) is not None:
        coupled = couplings.measured, couplings.owner, *couplings.of_measured
    row, column, entry = closure.independent_entries(tree)
    forces = LoopForces(system, csr_matrix((entry, (row, column)), shape=(row.max(initial=-1) + 1, len(tree.names))))
    wrench, closing, share = closing_terms(topology, len(closure.names), (closure.rows, joint), coupled)
    return Constraints(
        wrench, csr_array(closing), csr_array(share), np.arange(len(tree.names)), tree.coordinate_body,
        origin - tree.point.T, np.concatenate((tree.linear, tree.angular)).T * tree.sign[:, None], forces,
        forces.stress,
    )  # fmt: skip


@dataclass(frozen=True)
class LoopForces:
    """The way from generalized forces of all joint coordinates to forces in the rows that close loops, those of
    redundant rows 0: a matrix (rows, coordinates) that is only multiplied with. ``independent`` are those that are not
    redundant.
    """

    system: SparseEquations
    independent: csr_matrix

    @property
    def shape(self) -> tuple[int, int]:
        """Rows that close loops, and joint coordinates."""
        return len(self.system.constraints.names), self.independent.shape[1]

    @cached_property
    def _factor(self) -> Any:
        rows, columns = self.independent.shape
        entries = self.independent.tocoo()
        matrix = vstack((
            csr_matrix((np.concatenate((np.ones(columns), entries.data)),
                        (np.concatenate((np.arange(columns), entries.col)),
                         np.concatenate((np.arange(columns), columns + entries.row)))),
                       shape=(columns, columns + rows)),
            csr_matrix((entries.data, (entries.row, entries.col)), shape=(rows, columns + rows)),
        ))  # fmt: skip
        return splu(csc_matrix(matrix))

    def __matmul__(self, forces: Field) -> Field:
        """Return the forces (rows, ...) that generalized forces (coordinates, ...) ask for."""
        rows, columns = self.independent.shape
        flat = forces.reshape(columns, prod(forces.shape[1:]))
        result = np.zeros((self.shape[0], flat.shape[1]))
        result[self.system.constraints.is_independent] = self._factor.solve(
            np.concatenate((flat, np.zeros((rows, flat.shape[1])))))[columns:]
        return result.reshape(self.shape[0], *forces.shape[1:])

    @property
    def stress(self) -> Array:
        """States of self-stress (rows, probes): forces in redundant rows, and those in the others that balance them."""
        closure, tree = self.system.constraints, self.system.structure
        redundant = np.flatnonzero(~closure.is_independent)
        if not len(redundant):
            return np.zeros((self.shape[0], 0))
        entries = closure.entries(tree)
        every = csr_matrix((entries.value, (entries.row, entries.column)), shape=self.shape)
        result = np.zeros((self.shape[0], min(PROBES, len(redundant))))
        result[redundant] = np.random.default_rng(0).normal(size=(len(redundant), result.shape[1]))
        return np.asarray(result - self @ (every.T @ result))


# Modes beyond those asked for, so that those that coincide are there together.
GUARDS = 2


def sparse_mode_sensitivities(
    system: SparseEquations, parameters: Requested, count: int, near: float, dense: type[Equations],
    form: type[SomeModes],
) -> ModeSensitivities:
    """Return the derivatives of some modes of a large mechanism, see ``SparseSystem.mode_sensitivities``.

    ``count`` modes nearest to the frequency ``near`` [Hz], 0 for the lowest. ``dense``, ``form``: the classes of the
    small dense equations and of the modes.
    """
    requested = modes(system, count, near, dense, form)
    extra, known = GUARDS, requested
    while True:
        known = modes(system, min(system.dof, count + extra), near, dense, form)
        requested = cast("SomeModes", known.nearest(count, near))
        if len(known) == system.dof or not _cut(requested, known, near):
            break
        extra *= 2
    basis = _basis(system, known.reduced)
    values = eigenvalue_sensitivities(basis, parameters)
    order = nearest_indices(requested.eigenvalues, basis.modes.eigenvalues)
    groups = basis.groups(parameters)
    return ModeSensitivities(tuple(groups.variables.names), requested, values[:, order], basis, groups)


def _cut(requested: SomeModes, known: SomeModes, near: float) -> bool:
    """Whether the mode farthest from the frequency coincides with a wanted one, so that more of them may be missing."""
    last = known.pairs[np.argmax(np.abs(known.natural - 2.0 * np.pi * near))]
    return bool((np.abs(requested.pairs - last) <= SAME_EIGENVALUE * np.abs(last)).any() and np.abs(last).max() > 0.0)


def nearest_indices(values: Complex, known: Complex) -> Index:
    """Return the numbers (n,) of some eigenvalues among all, both in ascending order, of those that coincide the first.

    ``values`` (n,): some of them, as others have computed them; ``known`` (m,): all of them.
    """
    free, result = np.ones(len(known), dtype=bool), []
    for value in values:
        distance = np.where(free, np.abs(known - value), np.inf)
        nearest = int(np.flatnonzero(distance <= distance.min() + SAME_EIGENVALUE * abs(value))[0])
        free[nearest] = False
        result.append(nearest)
    return np.sort(np.array(result, dtype=np.intp))


def _basis(system: SparseEquations, small: Equations) -> SparseSensitivityBasis:
    """The basis of a small system that knows the model, with the network of all of its parts."""
    parts = system.model.declared_parts
    provenance = replace(small.provenance, parts=parts, origin=system.model, springs=system.springs)
    kinematics = modal_coordinates(system, small)
    small = replace(small, provenance=provenance)
    network = assembled(small, kinematics)
    if not is_complete(small, network):
        raise ModelError(f"mode_sensitivities: the forces of the parts of '{system.name}' are not all that its "
                         f"equations have; use linearize(method='dense').", element=system.name)  # fmt: skip
    return SparseSensitivityBasis(Basis(small), network)


class SparseSensitivityBasis(SensitivityBasis):
    """What the sensitivities of some modes share: parameters that act on more than the modes see are refused."""

    def matrix_slopes(self, directions: Sequence[Direction], every: bool = False) -> Mapping[str, Array]:
        """Refuse parameters that have no rule by name, or return that they are not a number where all are asked for."""
        if not every:
            name = directions[0].name
            parts = self.equations.provenance.parts
            beam = any(isinstance(part, Beam) and name.startswith(part.name + ".") for part in parts)
            why = "the axes of an upright beam" if beam else "its equilibrium or its spin"
            raise ModelError(
                f"mode_sensitivities: what '{name}' does to {why} is known of dense equations only; use "
                f"linearize(method='dense'), or name other parameters.", element=name,
            )  # fmt: skip
        equations = self.equations
        return {key: np.full((len(directions), *getattr(equations, key).shape), np.nan) for key in MATRICES}
