"""Derivatives of the eigenvalues by derivatives of whole matrices, repeated ones included.

Source: Jiang, Chen & Luo (2011), sensitivities of eigenvalues; Friswell, J. Vib. Acoust. 118 (1996) 390, for repeated
ones.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from mbsvib.linalg.rank import ZERO_MATRIX_SLOPE, ZERO_RIGID_FORM_BY_MATRICES
from mbsvib.sensitivities.branches import branches
from mbsvib.sensitivities.spectrum import put, spectrum

if TYPE_CHECKING:
    from collections.abc import Mapping

    from mbsvib.common.arrays import Array, Complex, Index
    from mbsvib.linalg.vectors import Field
    from mbsvib.modes.result import Modes


def eigenvalue_slopes(mass: Array, damping: Array, modes: Modes, slopes: Mapping[str, Array]) -> Complex:
    """Return the derivatives of all eigenvalues.

    d lambda / dp = -y^T (lambda^2 dM/dp + lambda dC/dp + dK/dp) x / y^T (2 lambda M + C) x

    Parameters
    ----------
    mass, damping : array, shape (m, m)
        M and C of one system.
    modes : Modes
        Its modes.
    slopes : mapping of str to array, shape (p, m, m)
        Derivatives of "M", "C" and "K".

    Returns
    -------
    array, shape (p, eigenvalues)
        Derivatives in the order of ``modes.eigenvalues``. Eigenvalues that coincide have the derivatives of their
        branches, in ascending order. An eigenvalue 0 has 0 where the motion stays free, infinity where it does not.
    """
    known = spectrum(modes)
    pairs = known.pairs()
    unsymmetric = np.abs(slopes["K"] - slopes["K"].swapaxes(1, 2)).max(initial=0.0) > (
        ZERO_MATRIX_SLOPE * np.abs(slopes["K"]).max(initial=0.0))  # fmt: skip
    if known.left is None and len(pairs.groups) and unsymmetric:
        known = replace(known, left=known.right)
    x, lead = known.right, known.lead
    y = x if known.left is None else known.left
    parts = [(slopes[key] @ x, power) for key, power in (("K", lead**0), ("C", lead), ("M", lead * lead))]

    def forms(first: Field, which: Index) -> Complex:
        result: Complex = np.sum([np.einsum("mh,pmh->ph", first, moved[:, :, which]) * power[which]
                                  for moved, power in parts], axis=0, dtype=complex)  # fmt: skip
        return result

    def norms(first: Field, which: Index) -> Complex:
        right = x[:, which]
        return np.asarray((first * (2.0 * lead[which] * (mass @ right) + damping @ right)).sum(axis=0))

    every = np.arange(len(lead))
    form, norm = forms(y, every), norms(y, every)
    result = np.empty((len(form), known.count), dtype=complex)
    with np.errstate(divide="ignore", invalid="ignore"):
        diagonal = -form / norm
    put(result, known, every, diagonal)
    resting = np.flatnonzero(lead == 0.0)
    if len(resting):
        size = np.abs(form).max(axis=1, keepdims=True)
        put(result, known, resting, np.where(
            np.abs(form[:, resting]) <= ZERO_RIGID_FORM_BY_MATRICES * size, 0.0, np.inf))  # fmt: skip
    if len(pairs.groups):
        first, second = pairs.first, pairs.second
        if known.left is not None:
            first, second = np.concatenate((first, second)), np.concatenate((second, first))
        cross = forms(y[:, first], second), norms(y[:, first], second)
        together = np.concatenate(pairs.groups)
        diagonal[:, together] = form[:, together]
        for which, values in branches(pairs, diagonal.T, cross[0].T, (norm, cross[1])):
            put(result, known, which, values.T)
    return result
