"""Modes that do not decay, and whether inputs drive them or outputs show them: not by rounding of shapes and ports.

In energy coordinates e = (Omega eta, eta') of the mass-normalised modes rounding of a vector is that of its length,
whatever the units: an entry of the inputs F = (0, Phi^T B) or of the outputs is known to eps |F| or eps |c_e|.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from mbsvib.linalg.rank import ZERO_SUM
from mbsvib.responses.energy_schur import energy_matrix

if TYPE_CHECKING:
    from mbsvib.common.arrays import Array, Bools, Complex
    from mbsvib.equations.equations import Equations
    from mbsvib.modes.damped import Damped


def zeros_of_lasting_states(
    system: Equations, modal: Damped, transform: Array, b: Array, c: Array
) -> tuple[Array, Array]:
    """Return B (2m, inputs) and C (outputs, 2m) of modal states with zeros for what is rounding in modes that last.

    ``transform`` (2m, 2m): q and q' by the states, two of each mode.
    """
    lasting = np.repeat(last(modal.pairs).any(axis=1), 2)
    if not lasting.any():
        return b, c
    m = len(modal.square)
    scale, a = energy_matrix(modal)
    into = modal.shapes.T @ system.M
    energy = np.concatenate((scale[:, None] * (into @ transform[:m]), into @ transform[m:]))
    left = np.linalg.norm(np.linalg.inv(energy)[lasting], axis=1)
    small = np.abs(b[lasting]) <= ZERO_SUM * np.outer(left, np.linalg.norm(modal.shapes.T @ system.B, axis=0))
    moving = energy[:, lasting]
    rates = [rows @ modal.shapes for rows in (system.Cq, system.Cv, system.Ca)]
    seen = sum((np.outer(np.linalg.norm(rows, axis=1), np.linalg.norm(part, axis=0)) for rows, part in
                ((rates[0] / scale, moving[:m]), (rates[1], moving[m:]), (rates[2], (a @ moving)[m:]))),
               np.zeros((len(c), moving.shape[1])))  # fmt: skip
    b, c = b.copy(), c.copy()
    b[lasting] = np.where(small, 0.0, b[lasting])
    c[:, lasting] = np.where(np.abs(c[:, lasting]) <= ZERO_SUM * seen, 0.0, c[:, lasting])
    return b, c


def last(poles: Complex) -> Bools:
    """Return which eigenvalues of a mechanism, known to rounding of their size, do not decay."""
    return np.asarray(poles.real >= -ZERO_SUM * np.abs(poles))
