"""Responses of many bodies: one sparse factorisation a frequency, with right sides and outputs as sparse rows."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from mbsvib.common.expected import angular
from mbsvib.errors import ResponseError
from mbsvib.sparse.quadratic import Quadratic

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray

    from mbsvib.common.arrays import Array, Complex
    from mbsvib.sparse.equations import SparseEquations

# If a step of refinement is larger than this share of the solution, the next residual has extended precision.
FINE = 1e-11
# If the step after that is still larger than this, the matrix is singular to rounding.
SINGULAR = 1e-3


def frequency_response(system: SparseEquations, omega: ArrayLike) -> Complex:
    """Return G(i w) = (Cq + i w Cv - w^2 Ca) (K + i w C - w^2 M)^-1 B + D, (outputs, inputs, n), at ``omega`` (n,)."""
    w = angular(omega)
    right = Quadratic(system).right(system.input_rows.toarray().T)
    damped = bool(system.row_damping.any()) or system.gyroscopic is not None
    displacement, velocity, acceleration = system.output_rows
    through = _through(system)
    result = np.zeros((len(system.outputs), len(system.inputs), len(w)), dtype=complex)
    for i, frequency in enumerate(w.tolist()):
        s = 1j * frequency
        answer = _answer(system, right, s, damped)
        if answer is None:
            kind = "a rigid-body mode" if frequency == 0.0 else "an undamped mode"
            raise ResponseError(
                f"frequency_response: omega[{i}] = {frequency:g} rad/s is a pole of the system ({kind}), where the "
                f"response is infinite; leave this frequency out, or give the mechanism damping."
            )
        result[:, :, i] = displacement @ answer + s * (velocity @ answer) + s * s * (acceleration @ answer) + through
    return result


def static_compliance(system: SparseEquations) -> Array:
    """Return Cq K^-1 B + D, (outputs, inputs)."""
    answer = _answer(system, Quadratic(system).right(system.input_rows.toarray().T), 0.0, False)
    if answer is None:
        raise ResponseError(
            f"static_compliance: the stiffness of '{system.name}' is singular, a motion of the mechanism has no "
            f"stiffness; modes(k) shows these rigid-body modes."
        )
    return np.asarray(system.output_rows[0] @ answer + _through(system), dtype=float)


def _through(system: SparseEquations) -> Array:
    """Feedthrough without the direct contribution of massless motions, which are among the unknowns."""
    return system.D if system.separation is None else system.D - system.separation.at_once


def _answer(system: SparseEquations, right: Array, s: complex, damped: bool) -> NDArray[Any] | None:
    """Displacements and coordinates for unit inputs; None where the matrix is singular to rounding."""
    try:
        factor = system.tableau.factor(s=s) if damped and s else system.tableau.factor(square=-(s * s).real)
    except np.linalg.LinAlgError:
        return None
    answer, change = factor.solve_closely(right, FINE)
    return answer if change <= SINGULAR else None
