"""Craig-Bampton reduction: displacements of an interface, and modes of the mechanism with the interface held."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from scipy.linalg import eigh, lapack

from mbsvib.errors import ResponseError
from mbsvib.linalg.gram_schmidt import extended
from mbsvib.linalg.rank import FREE_PIVOT, SAME_ROW
from mbsvib.reduction.projection import projected

if TYPE_CHECKING:
    from mbsvib.common.arrays import Array
    from mbsvib.equations.equations import Equations


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
