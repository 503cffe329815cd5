"""Reduction: the small dense system in the amplitudes of some shapes of a large one, with its factors and names."""

from __future__ import annotations

import numpy as np
from scipy.sparse import csr_matrix

from mbsvib.common.arrays import Array
from mbsvib.equations.equations import Equations, Provenance
from mbsvib.kinematics.loops import Reduction
from mbsvib.linalg.products import weighted_gram
from mbsvib.linalg.rank import EPS, ZERO_SUM
from mbsvib.modes.undamped import WELL_CLOSED
from mbsvib.sparse.equations import SparseEquations
from mbsvib.sparse.from_matrices import projected
from mbsvib.sparse.subspace import strains

# Displacements are sums along the path from ground with random rounding errors. Calibrated in the tests.
ACCUMULATE = 0.25
# Required relative accuracy of the modes of the small dense problem; at its size the extra steps cost little.
RTOL = 1e-13


def reduced(
    system: SparseEquations, z: Array, rigid: int, form: type[Equations] = Equations, massless: int = 0
) -> Equations:
    """Return the system in the amplitudes of the shapes ``z`` (size, n), coordinates mode1, mode2, ...

    The first ``rigid`` shapes deform no spring, the last ``massless`` ones have damping but no mass.
    """
    if system.matrices is not None:
        return projected(system, z, rigid, form)
    n = z.shape[1]
    elastic, _ = strains(system, z, rigid)
    nonzero = elastic.any(axis=1)
    elastic, stiffness, damping = elastic[nonzero], system.row_stiffness[nonzero], system.row_damping[nonzero]
    factor = np.asarray(system.inertia_factor @ z)
    factor[:, n - massless :] = 0.0
    motion = np.zeros((len(system.bodies), 6, n))
    body, direction = system.layout.moving
    motion[body, direction] = z[system.layout.displacement[body, direction]]
    cq, cv, ca = (np.asarray(rows @ z) for rows in system.output_rows)
    gyroscopic, circulatory = (_antisymmetric(matrix, z) for matrix in (system.gyroscopic, system.circulatory))
    damping_matrix, stiffness_matrix = weighted_gram(elastic, damping), weighted_gram(elastic, stiffness)
    names = tuple(f"mode{i + 1}" for i in range(n))
    return form(
        name=system.name, coordinates=names, coordinate_units=("modal",) * n, inputs=system.inputs,
        input_units=system.input_units, outputs=system.outputs, output_units=system.output_units, bodies=system.bodies,
        M=factor.T @ factor, C=damping_matrix if gyroscopic is None else damping_matrix + gyroscopic,
        K=stiffness_matrix if circulatory is None else stiffness_matrix + circulatory,
        B=np.asarray(system.input_rows @ z).T.copy(), Cq=cq, Cv=cv, Ca=ca, D=system.D.copy(), inertia_factor=factor,
        elastic_rows=elastic, row_stiffness=stiffness, row_damping=damping, row_owner=system.row_owner[nonzero],
        body_motion=motion, gyroscopic=gyroscopic, circulatory=circulatory, massless=massless,
        null_inertia=np.eye(n)[:, n - massless :] if massless else None,
        provenance=Provenance(
            system.topology, Reduction(np.arange(n), z[system.layout.coordinate], ()), names,
            system.springs + system.loading,
        ),
    )  # fmt: skip


def rounding(system: SparseEquations) -> float:
    """Return the relative error of a frequency by sums along the longest path and by nearly singular loops."""
    smallest_pivot = min((group.retained for group in system.constraints.groups), default=1.0)
    path = ACCUMULATE * float(np.sqrt(system.structure.depth.max(initial=1)))
    return EPS * (1.0 + path + (1.0 / smallest_pivot if smallest_pivot < WELL_CLOSED else 0.0))


def _antisymmetric(matrix: csr_matrix | None, z: Array) -> Array | None:
    """Z^T A Z of an antisymmetric matrix, with exact zeros where terms cancel to rounding."""
    if matrix is None:
        return None
    force, terms = np.asarray(matrix @ z), np.asarray(abs(matrix) @ np.abs(z))
    force[np.abs(force) <= ZERO_SUM * terms] = 0.0
    result: Array = z.T @ force
    result[np.abs(result) <= ZERO_SUM * (np.abs(z).T @ np.abs(force))] = 0.0
    return 0.5 * (result - result.T)
