"""Equations of motion in fewer coordinates, q = T z, with all their factors."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, TypeVar

import numpy as np

from mbsvib.equations.equations import Equations
from mbsvib.kinematics.loops import Reduction
from mbsvib.linalg.products import weighted_gram
from mbsvib.linalg.rank import ZERO_PRODUCT

if TYPE_CHECKING:
    from collections.abc import Sequence

    from mbsvib.common.arrays import Array

E = TypeVar("E", bound=Equations)


def projected(system: E, shapes: Array, names: Sequence[str], units: Sequence[str]) -> E:
    """Return equations of motion in the amplitudes of shapes T (m, n), their factors projected before products are
    formed.

    T^T M T z'' + T^T C T z' + T^T K T z = T^T B u, y = Cq T z + Cv T z' + Ca T z'' + D u
    """
    factor, rows = system.inertia_factor @ shapes, system.elastic_rows @ shapes
    # a free motion deforms no spring, not even by rounding
    rows[np.abs(rows) <= ZERO_PRODUCT * len(shapes) * (np.abs(system.elastic_rows) @ np.abs(shapes))] = 0.0
    gyroscopic, circulatory = (None if matrix is None else _antisymmetric(shapes.T @ matrix @ shapes)
                               for matrix in (system.gyroscopic, system.circulatory))  # fmt: skip
    damping, stiffness = weighted_gram(rows, system.row_damping), weighted_gram(rows, system.row_stiffness)
    provenance = system.provenance
    return replace(
        system, coordinates=tuple(names), coordinate_units=tuple(units), M=factor.T @ factor,
        C=damping if gyroscopic is None else damping + gyroscopic,
        K=stiffness if circulatory is None else stiffness + circulatory,
        B=shapes.T @ system.B, Cq=system.Cq @ shapes, Cv=system.Cv @ shapes, Ca=system.Ca @ shapes, D=system.D.copy(),
        inertia_factor=factor, elastic_rows=rows, row_stiffness=system.row_stiffness.copy(),
        row_damping=system.row_damping.copy(),
        row_owner=system.row_owner.copy(), body_motion=system.body_motion @ shapes, gyroscopic=gyroscopic,
        circulatory=circulatory,
        provenance=replace(provenance, reduction=Reduction(np.arange(shapes.shape[1]), shapes, ()), parts=(),
                           origin=None, joint_coordinates=tuple(names), statics=None),
    )  # fmt: skip


def _antisymmetric(matrix: Array) -> Array:
    return np.asarray(0.5 * (matrix - matrix.T))
