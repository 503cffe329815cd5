"""Solutions of (K + s C + s^2 M) x = b for any right sides, all frequencies at once, by the roads of the responses."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from mbsvib.errors import ResponseError
from mbsvib.modes.damped import Damped
from mbsvib.responses import frequency_response as responses
from mbsvib.responses.modal_sum import sum_of_motions

if TYPE_CHECKING:
    from mbsvib.common.arrays import Array, Complex
    from mbsvib.equations.equations import Equations
    from mbsvib.responses.basis import Basis


def solutions(basis: Basis, b: Array, w: Array, *, adjoint: bool = False) -> Complex:
    """Return x = (K + i w C - w^2 M)^-1 b.

    Parameters
    ----------
    basis : Basis
        The equations of motion and their modes.
    b : array, shape (m, columns)
        Right sides.
    w : array, shape (n,)
        Angular frequencies [rad/s], none negative.
    adjoint : bool
        Whether to solve with the transposed matrix.

    Returns
    -------
    array, shape (m, columns, n)
        Solutions.

    Raises
    ------
    ResponseError
        If a frequency is an undamped pole.
    """
    system, modal = basis.equations, basis.modal
    if not isinstance(modal, Damped):
        result = _direct(system, b, w, adjoint)
    else:
        result = _modal(basis, modal, modal.shapes.T @ b, w)
    bad = np.flatnonzero(~np.isfinite(result).all(axis=(0, 1)))
    if len(bad):
        raise ResponseError(
            f"omega[{bad[0]}] = {w[bad[0]]:g} rad/s is a pole of '{system.name}', where responses and their "
            f"sensitivities are infinite; leave this frequency out, or give the mechanism damping."
        )
    return result


def _modal(basis: Basis, modal: Damped, b: Array, w: Array) -> Complex:
    s: Complex = (1j * w).astype(complex)
    if modal.vectors is None or (basis.strong_dampers is None and responses.trusted(modal, b, w)):
        eta = sum_of_motions(modal, b).at(s)
    elif basis.strong_dampers is not None:
        eta = responses.separated_solutions(modal, basis.strong_dampers, b, w, np.arange(len(w)))
    else:
        eta = responses.refined_solutions(basis, modal, b, s)
        bad = np.flatnonzero(~np.isfinite(eta).all(axis=(0, 1)))
        eta[:, :, bad] = responses.direct_solutions(modal, b, w, bad)
    flat = (modal.shapes @ eta.reshape(len(b), b.shape[1] * len(w)).view(float)).view(complex)
    return np.asarray(flat.reshape(len(modal.shapes), *eta.shape[1:]))


def _direct(system: Equations, b: Array, w: Array, adjoint: bool) -> Complex:
    result = np.empty((len(b), b.shape[1], len(w)), dtype=complex)
    for i, frequency in enumerate(w):
        matrix = system.K - frequency**2 * system.M + 1j * frequency * system.C
        try:
            result[:, :, i] = np.linalg.solve(matrix.T if adjoint else matrix, b)
        except np.linalg.LinAlgError:
            result[:, :, i] = np.nan
    return result
