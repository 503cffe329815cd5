"""Derivatives of equations from which motions without mass were separated, by complex steps.

The condensed motions N move neither mass nor damper: M N = 0 and C N = 0 give dN, but for a part along N itself, which
does not matter. With N + i h dN the formulas of the condensation hold as they are,

T_d = -X_d^-1 X_r,  X = (N^T K N)^-1 N^T K,  S = N (N^T K N)^-1 N^T B

A direction in which motions without mass get one, or condensed ones a damper, has no derivative.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from mbsvib.equations.terms import MATRICES, Terms
from mbsvib.linalg.qr import pivoted_qr
from mbsvib.linalg.rank import ZERO_ALONG

if TYPE_CHECKING:
    from mbsvib.common.arrays import Array, Bools, Index
    from mbsvib.equations.draft import Draft


def condensed_along(terms: Terms, before: tuple[str, ...], base: Draft) -> tuple[dict[str, Array], Bools]:
    """Return the matrices (k, ...) of steps from one variant, and a mask (k,) of those without derivative.

    ``terms``: those of the steps with all coordinates, whose names are ``before``. ``base``: the variant with its
    separation.
    """
    separation = base.separation
    assert separation is not None
    arrays = {key: array for key in (*MATRICES, "gyroscopic", "circulatory")
              if (array := getattr(terms, key)) is not None}  # fmt: skip
    count = max(len(array) if array.ndim == 3 else 1 for array in arrays.values())
    lost = np.zeros(count, dtype=bool)
    if separation.motions is not None:
        dependent = np.array([before.index(name) for name in separation.condensed], dtype=np.intp)
        null, lost = _null_along(arrays["M"], arrays["C"], separation.motions, count)
        arrays = _condensed(arrays, null, dependent)
    massless = base.terms.null_inertia
    if massless is not None:
        lost = lost | _gains(arrays["M"], massless)
    return arrays, lost


def _condensed(arrays: dict[str, Array], null: Array, dependent: Index) -> dict[str, Array]:
    """The matrices for q = T z + S u."""
    m = null.shape[-2]
    remaining = np.setdiff1d(np.arange(m), dependent)
    stiffness, left = arrays["K"], null.swapaxes(-1, -2)
    held = left @ stiffness @ null
    amplitudes = np.linalg.solve(held, left @ stiffness)
    t = np.zeros((*amplitudes.shape[:-2], m, len(remaining)), amplitudes.dtype)
    t[..., remaining, np.arange(len(remaining))] = 1.0
    t[..., dependent, :] = -np.linalg.solve(amplitudes[..., dependent], amplitudes[..., remaining])
    s, back = null @ np.linalg.solve(held, left @ arrays["B"]), t.swapaxes(-1, -2)
    square = {"M", "C", "K", "gyroscopic", "circulatory"}
    result = {key: back @ array @ t for key, array in arrays.items() if key in square}
    result |= {key: arrays[key] @ t for key in ("Cq", "Cv", "Ca")}
    result["B"] = back @ arrays["B"]
    if "circulatory" in arrays:
        result["B"] = result["B"] - back @ stiffness @ s
    return result | {"D": arrays["D"] + arrays["Cq"] @ s}


def _null_along(mass: Array, damping: Array, motions: Array, count: int) -> tuple[Array, Bools]:
    """N + i h dN (k, m, n), each motion one in a coordinate in which the others are zero, and a mask of lost steps."""
    diagonal = np.einsum("...ii->...i", np.abs(mass) + np.abs(damping)).reshape(-1, len(motions))[0]
    unit = 1.0 / np.sqrt(np.where(diagonal > 0.0, diagonal, 1.0))
    n = motions.shape[1]
    own = np.sort(pivoted_qr((motions / unit[:, None]).T)[1][:n])
    others = np.setdiff1d(np.arange(len(motions)), own)
    null = motions @ np.linalg.inv(motions[own])
    both = [unit[:, None] * matrix for matrix in (mass, damping) if matrix.any()]
    both = [np.broadcast_to(matrix, (count, *matrix.shape[-2:])) / (np.abs(matrix * unit).max() or 1.0)
            for matrix in both]  # fmt: skip
    result = np.broadcast_to(null, (count, *null.shape)).astype(complex)
    rows = np.concatenate(both, axis=-2) if both else np.zeros((count, 0, len(motions)))
    if not np.iscomplexobj(rows):
        return result, np.zeros(count, dtype=bool)
    right, size = rows.imag @ null, np.abs(rows.imag) @ np.abs(null)
    matrix = rows.real[..., others] * unit[others]
    solution = np.linalg.pinv(matrix) @ right
    result.imag[:, others] = -unit[others][:, None] * solution
    left = np.abs(right - matrix @ solution)
    limit = ZERO_ALONG * size.max(axis=-2, keepdims=True, initial=0.0)
    return result, np.asarray((left > limit).any(axis=(1, 2)))


def _gains(mass: Array, massless: Array) -> Bools:
    """Whether motions without mass get one."""
    change = np.abs(massless.T @ mass.imag @ massless)
    size = np.abs(massless.T) @ np.abs(mass.imag) @ np.abs(massless)
    return np.asarray((change > ZERO_ALONG * size).any(axis=(-1, -2)))
