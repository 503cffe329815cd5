"""Frequency response, from the undamped modes' coordinates.

Where damping is classical every mode answers alone and all frequencies are one matrix product; elsewhere
(Omega^2 - w^2 + i w Gamma) eta = Phi^T B is solved frequency by frequency, in batches.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from mbsvib.errors import ResponseError

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray

    from mbsvib.damped import Damped
    from mbsvib.system import System

    Array = NDArray[np.float64]
    Complex = NDArray[np.complex128]

BATCH_BYTES = 32 * 2**20  # a batch of matrices stays in this much memory


def frequency_response(system: System, omega: ArrayLike) -> Complex:
    """Return G(i w) = (Cq + i w Cv - w^2 Ca) (K + i w C - w^2 M)^-1 B + D.

    Parameters
    ----------
    system : System
        The equations of motion.
    omega : array-like, shape (n,)
        Angular frequencies [rad/s].

    Returns
    -------
    array, shape (outputs, inputs, n)
        Complex responses.

    Raises
    ------
    ResponseError
        If a frequency is not finite or is an undamped pole.
    """
    w = np.atleast_1d(np.asarray(omega, dtype=float))
    if w.ndim != 1 or not np.isfinite(w).all():
        raise ResponseError(f"frequency_response: omega has shape {np.shape(omega)}; expected a finite vector [rad/s].")
    modal = system._modal
    phi = modal.shapes
    b, cq, cv, ca = phi.T @ system.B, system.Cq @ phi, system.Cv @ phi, system.Ca @ phi
    s = 1j * w
    if modal.gamma.ndim == 1:
        eta = 1.0 / _denominator(modal, w)
        residue = [np.einsum("om,mi->oim", c, b).reshape(len(c) * b.shape[1], len(phi)) for c in (cq, cv, ca)]
        result: Complex = residue[0] @ eta
        if cv.any():
            result += (residue[1] @ eta) * s
        if ca.any():
            result += (residue[2] @ eta) * s**2
        result = result.reshape(len(cq), b.shape[1], len(w))
    else:
        result = _coupled(modal, b, (cq, cv, ca), w)
    result += system.D[:, :, None]
    return result


def _denominator(modal: Damped, w: Array) -> Complex:
    """Omega^2 - w^2 + i w gamma, shape (m, n), with (Omega - w)(Omega + w) so that resonances keep their digits."""
    square = modal.square[:, None]
    root = np.sqrt(np.abs(square))
    real = np.where(square >= 0.0, (root - w) * (root + w), square - w * w)
    result: Complex = real + 1j * (modal.gamma[:, None] * w)
    if not result.all():
        _refuse_pole(modal, w, np.argwhere(result == 0.0)[0])
    return result


def _coupled(modal: Damped, b: Array, outputs: tuple[Array, Array, Array], w: Array) -> Complex:
    m = len(b)
    result = np.empty((len(outputs[0]), b.shape[1], len(w)), dtype=complex)
    batch = max(1, BATCH_BYTES // (16 * m * m))
    diagonal = np.arange(m)
    root = np.sqrt(np.abs(modal.square))
    for start in range(0, len(w), batch):
        part = w[start : start + batch, None]
        matrix = 1j * part[:, :, None] * modal.gamma
        matrix[:, diagonal, diagonal] += np.where(
            modal.square >= 0.0, (root - part) * (root + part), modal.square - part * part
        )
        try:
            eta = np.linalg.solve(matrix, b)
        except np.linalg.LinAlgError:
            singular = [i for i, a in enumerate(matrix) if np.linalg.matrix_rank(a) < m]
            _refuse_pole(modal, w, (0, start + singular[0]))
        s = 1j * part[:, :, None]
        value = outputs[0] @ eta + s * (outputs[1] @ eta) + s**2 * (outputs[2] @ eta)
        result[:, :, start : start + batch] = value.transpose(1, 2, 0)
    return result


def _refuse_pole(modal: Damped, w: Array, at: ArrayLike) -> None:
    mode, i = np.asarray(at).tolist()
    what = "a rigid-body mode" if w[i] == 0.0 else f"undamped mode {mode + 1}"
    raise ResponseError(
        f"frequency_response: omega[{i}] = {w[i]:g} rad/s is a pole of the system ({what}), where the response is "
        f"infinite; leave this frequency out, or give the mechanism damping."
    )
