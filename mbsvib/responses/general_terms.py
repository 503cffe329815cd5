"""Terms of sums over modes of unsymmetric systems, and the limit of the sums far above all eigenvalues."""

from __future__ import annotations

from functools import reduce
from typing import TYPE_CHECKING

import numpy as np

from mbsvib.common.arrays import Array, Complex, Index
from mbsvib.linalg.rank import EPS

if TYPE_CHECKING:
    from mbsvib.modes.energy_state import EnergyState
    from mbsvib.modes.general import General

# Sums that must cancel (two bodies share no inertia, a point rests in space) do so to a few roundings of their terms; a
# sum smaller than this many roundings is zero.
CANCELLED = 32.0


def asymptotic_terms(state: EnergyState) -> tuple[Array, Array]:
    """Return E1 and E2 of E1 / s + E2 / s^2, high above all eigenvalues, in the basis (m, m).

    Without massless motions they are 0 and 1.
    """
    m = len(state.basis)
    if not state.massless:
        return np.zeros((m, m)), np.eye(m)
    p = len(state.scale)
    e1, e2 = np.zeros((m, m)), np.zeros((m, m))
    e1[p:, p:] = np.linalg.inv(state.damping[p:, p:])
    e2[:p, :p] = np.eye(p)
    e2[:p, p:] = -state.damping[:p, p:] @ e1[p:, p:]
    e2[p:, p:] = -e1[p:, p:] @ state.coupling[p:, p:] @ e1[p:, p:]
    return e1, e2


def cleaned(*factors: Array, direct: Array | float = 0.0) -> Array:
    """Return the product of matrices plus a ``direct`` term, 0 where terms cancel to rounding."""
    result = reduce(np.matmul, factors) + direct
    size = reduce(np.matmul, map(np.abs, factors)) + np.abs(direct)
    result[np.abs(result) <= CANCELLED * EPS * size] = 0.0
    return np.asarray(result)


def terms(modal: General, c: Array, b: Array) -> tuple[Complex, Array, Array, Array, Array, Index]:
    """Return the parts of a sum over modes from inputs ``b`` (m, inputs) to ``c`` (rows, m).

    Pairs (p, 2) and real eigenvalues (q,); sums of lambda R and of R of the pairs (rows inputs, p), R of the real ones
    (rows inputs, q); numbers of the modes (p + q,).
    """
    spectrum, state = modal.spectrum, modal.state
    turns = spectrum.turns
    size = len(c) * b.shape[1]
    value = spectrum.values
    residue = np.einsum("rk,ki->rik", c @ spectrum.right, (spectrum.left.T @ b) / spectrum.slopes[:, None])
    residue = residue.reshape(size, len(value))
    gamma, alpha = 2.0 * (residue * value)[:, turns].real, 2.0 * residue[:, turns].real
    pairs = np.stack((value[turns], value[turns].conj()), axis=1)
    number = np.concatenate((modal.mode[turns], modal.mode[~turns]))
    if state.right.shape[1]:
        outputs, inputs = c @ state.show @ state.right, state.left.T @ state.force @ b
        constant = (outputs @ inputs).reshape(size, 1)
        drift = (outputs @ state.nilpotent @ inputs).reshape(size, 1)
        pairs = np.concatenate((np.zeros((1, 2)), pairs))
        alpha, gamma = np.concatenate((constant, alpha), axis=1), np.concatenate((drift, gamma), axis=1)
        number = np.concatenate(([0], number))
    return pairs, value[~turns].real, gamma, alpha, residue[:, ~turns].real, number
