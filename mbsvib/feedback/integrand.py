"""Responses for norms: accurate in the norm, not in each entry."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from mbsvib.modes.damped import Damped
from mbsvib.responses.frequency_response import trusted

if TYPE_CHECKING:
    from collections.abc import Sequence

    from mbsvib.common.arrays import Array, Complex


DENSE = 60  # degrees of freedom up to which the dense equations are solved at every frequency


def response(system: Any, w: Array, outputs: Sequence[str], inputs: Sequence[str]) -> Complex:
    """Return G(i w) (outputs, inputs, n) for norms: accurate in its norm, not in entries that are zero by symmetry."""
    o, i = [system.outputs.index(name) for name in outputs], [system.inputs.index(name) for name in inputs]
    entries = np.ix_(o, i)
    modal = system.basis.modal
    if (
        isinstance(modal, Damped)
        and system.basis.strong_dampers is None
        and (modal.vectors is None or trusted(modal, modal.shapes.T @ system.B, w))
    ):
        result = system.basis.modal_sum.at(np.asarray(1j * w, dtype=complex))[entries]
        if np.isfinite(result).all():
            return np.asarray(result)
    if system.dof > DENSE:
        return np.asarray(system.frequency_response(w)[entries])
    return solved(system, w, o, i)[0]


def solved(system: Any, w: Array, o: list[int], i: list[int]) -> tuple[Complex, Complex, Complex]:
    """Return G = H R + D (outputs, inputs, n), R = Z^-1 B (n, m, inputs) and L = H Z^-1 (n, outputs, m).

    Z = K + i w C - w^2 M,  H = Cq + i w Cv - w^2 Ca

    ``system``: equations of few degrees of freedom. ``w`` (n,): angular frequencies [rad/s].
    """
    s = np.asarray(1j * w[:, None, None], dtype=complex)
    z = system.K + s * system.C + s * s * system.M
    h = system.Cq[o] + s * system.Cv[o] + s * s * system.Ca[o]
    try:
        right = np.linalg.solve(z, np.broadcast_to(system.B[:, i], (len(w), system.dof, len(i))))
    except np.linalg.LinAlgError:  # at a pole: raises an error with the mode
        system.frequency_response(w)
        raise
    left = np.linalg.solve(z.transpose(0, 2, 1), h.transpose(0, 2, 1)).transpose(0, 2, 1)
    value = h @ right + system.D[np.ix_(o, i)]
    return np.asarray(value.transpose(1, 2, 0)), right, left
