"""Reduction to fewer coordinates, q = T z, with all factors: modal truncation and Craig-Bampton."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import TypeVar

import numpy as np
from scipy.linalg import eigh, lapack

from mbsvib.common.arrays import Array
from mbsvib.equations.equations import Equations
from mbsvib.errors import ResponseError
from mbsvib.kinematics.loops import Reduction
from mbsvib.linalg.products import weighted_gram
from mbsvib.linalg.qr import extended
from mbsvib.linalg.rank import FREE_PIVOT, SAME_ROW, ZERO_PRODUCT
from mbsvib.modes.undamped import Undamped, undamped

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


# Accuracy of the frequencies: that of rounding, as reduced models are compared with the whole one.
RTOL = 1e-12


class ModalTruncation:
    """Undamped modes in the order of their contributions, of which the first ones make a reduced model.

    ``corrected``: whether the static response of the modes left out goes into D.
    """

    def __init__(self, system: Equations, corrected: bool) -> None:
        self.system, self.corrected = system, corrected
        self.modes: Undamped = undamped(system, RTOL)
        self.ranked = np.argsort(-peaks(system, self.modes, corrected), kind="stable")

    @property
    def least(self) -> int:
        """Number of free motions, which every reduced model has."""
        return self.modes.rigid

    @property
    def most(self) -> int:
        """Number of modes."""
        return self.system.dof

    def model(self, order: int) -> Equations:
        """Return the reduced model of some number of modes."""
        retained = np.sort(self.ranked[:order])
        names = [f"mode{k + 1}" for k in retained.tolist()]
        small = projected(self.system, self.modes.shapes[:, retained], names, ["modal"] * order)
        return replace(small, D=small.D + self.static(np.sort(self.ranked[order:]))) if self.corrected else small

    def static(self, truncated: Array) -> Array:
        """Return the static response of some modes, (outputs, inputs)."""
        shapes = self.modes.shapes[:, truncated]
        return np.asarray((self.system.Cq @ shapes / self.modes.square[truncated]) @ (shapes.T @ self.system.B))


def peaks(system: Equations, modes: Undamped, corrected: bool) -> Array:
    """Return how large the contribution of each mode to the frequency response becomes, (m,), in SI units.

    max over w of |c(i w) / (w0^2 + 2 i zeta w0 w - w^2)| |b|, about |c(i w0)| |b| / (2 zeta w0^2), infinite for free
    motions; damping that couples modes does not count, nor the static part if responses are ``corrected`` by it.
    """
    omega, shapes = modes.omega, modes.shapes
    damping = np.einsum("ik,ij,jk->k", shapes, system.C, shapes)
    observed = np.linalg.norm(
        system.Cq @ shapes + 1j * omega * (system.Cv @ shapes) - omega**2 * (system.Ca @ shapes), axis=0)  # fmt: skip
    static = np.linalg.norm(system.Cq @ shapes, axis=0)
    free = np.arange(len(omega)) < modes.rigid
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):  # a mode without damping has no bound
        height = np.where(observed > 0.0, observed / (damping * omega), 0.0)
        height = height if corrected else np.maximum(height, static / omega**2)
    reached = np.linalg.norm(shapes.T @ system.B, axis=1)
    result = np.zeros(len(omega))
    np.multiply(height, reached, out=result, where=reached > 0.0)  # an undamped mode counts if an input reaches it
    result[free] = np.inf
    return result


class CraigBampton:
    """q = P u + N Phi z: static shapes P of the interface displacements u = R q, and modes Phi in the motions N that
    hold the interface, R N = 0.

    The rows R are displacement outputs, and the directions in which inputs act. An interface that leaves the mechanism
    free to move is refused.

    Source: Craig & Bampton, Coupling of substructures for dynamic analyses, AIAA Journal 6 (1968).
    """

    def __init__(self, system: Equations) -> None:
        self.system = system
        rows, self.names, self.units = _interface(system)
        self.least, self.most = len(rows), system.dof
        q, t = np.linalg.qr(rows.T, mode="complete")
        self.interior = q[:, len(rows) :]
        into = np.linalg.solve(t[: len(rows)], q[:, : len(rows)].T).T  # R into = 1
        stiffness = self.interior.T @ system.K @ self.interior
        if not _regular(stiffness):
            raise ResponseError(
                f"reduced: method = 'craig-bampton': '{system.name}' can still move when its outputs and the points of "
                f"its inputs are held ({', '.join(self.names)}). Add displacement outputs, or take method='modal'."
            )
        self.static = into - self.interior @ np.linalg.solve(stiffness, self.interior.T @ (system.K @ into))
        self.shapes = self.interior @ eigh(stiffness, self.interior.T @ system.M @ self.interior)[1]

    def model(self, order: int) -> Equations:
        """Return the reduced model of some number of coordinates: the interface and the lowest modes."""
        count = order - self.least
        names = [*self.names, *[f"fixed_mode{k + 1}" for k in range(count)]]
        shapes = np.hstack((self.static, self.shapes[:, :count]))
        return projected(self.system, shapes, names, [*self.units, *["modal"] * count])


def _regular(stiffness: Array) -> bool:
    """Tell whether each motion is stiff, in coordinates of the same stiffness."""
    size = np.sqrt(np.maximum(stiffness.diagonal(), 0.0))
    if size.min(initial=1.0) == 0.0:
        return False
    factor, failed = lapack.dpotrf(stiffness / size[:, None] / size)
    return not failed and float(np.square(factor.diagonal()).min(initial=1.0)) > FREE_PIVOT


def _interface(system: Equations) -> tuple[Array, list[str], list[str]]:
    """Independent rows of displacement outputs and of inputs, with their names and units."""
    outputs = [k for k in range(len(system.outputs)) if system.Cq[k].any() and system.output_units[k] in ("m", "rad")]
    rows = np.vstack((system.Cq[outputs], system.B.T))
    names = [*[system.outputs[k] for k in outputs], *[f"at {name}" for name in system.inputs]]
    units = [*[system.output_units[k] for k in outputs],
             *["rad" if unit.startswith("N m") else "m" for unit in system.input_units]]  # fmt: skip
    retained = independent_rows(rows)
    return rows[retained], [names[k] for k in retained], [units[k] for k in retained]


def independent_rows(rows: Array) -> list[int]:
    """Return the numbers of rows (n, m) that do not depend on those before them, so that outputs come before inputs at
    the same points.
    """
    retained, basis = [], np.zeros((rows.shape[1], 0))
    for k, row in enumerate(rows):
        wider = extended(basis, row[:, None], SAME_ROW)
        if wider is not basis:
            retained.append(k)
            basis = wider
    return retained
