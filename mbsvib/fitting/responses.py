"""Frequency responses of matrices and their derivatives to some variables, for all lines at once.

With Z = K + s C + s^2 M, R = Z^-1 B and L = Z^-T H^T, H = Cq + s Cv + s^2 Ca, the response is G = H R + D, and
dG = dD + L^T dB + dH R - L^T dZ R. What a variable changes of Z has a small rank r, dZ = U A(s) V^T, found once for
all lines: then L^T dZ R costs r (outputs + inputs) products a line. One solution for the columns [B, H^T] is all that
a line needs, whatever the number of variables.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from mbsvib.errors import ResponseError
from mbsvib.linalg.rank import ZERO_SLOPE

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping

    from mbsvib.common.arrays import Array, Complex, Index

# Numbers that the derivatives of some lines may hold.
BLOCK = 400_000


class Factors(NamedTuple):
    """dK, dC, dM = U A V^T: ``left`` (m, r), ``right`` (m, r) and the three A (3, r, r)."""

    left: Array
    right: Array
    middle: Array


def blocks(
    matrices: Any, slopes: Mapping[str, Array] | None, omega: Array, rows: Index, columns: Index
) -> Iterator[tuple[slice, Complex, Complex | None]]:
    """Yield some lines at a time with G (n, outputs, inputs) and dG (v, n, outputs, inputs), None without slopes.

    ``matrices``: M, C, K, B, Cq, Cv, Ca, D; ``slopes``: their derivatives (v, ...) by name; ``rows``, ``columns``: the
    outputs and inputs.
    """
    m, count = len(matrices.K), 0 if slopes is None else len(slopes["K"])
    scale, middle = _scale(matrices, omega), float(np.exp(np.log(np.maximum(omega, omega.max() * 1e-6)).mean()))
    pencil = [matrix * scale[:, None] * scale for matrix in (matrices.K, matrices.C, matrices.M)]
    b = scale[:, None] * matrices.B[:, columns]
    h = [matrix[rows] * scale for matrix in (matrices.Cq, matrices.Cv, matrices.Ca)]
    d = matrices.D[np.ix_(rows, columns)]
    symmetric = all((matrix == matrix.T).all() for matrix in pencil)
    changes = None if slopes is None else _changes(slopes, scale, rows, columns, middle)
    step = max(1, BLOCK // max(1, (count + 2) * len(rows) * len(columns) + m * (m + len(rows) + len(columns))))
    for start in range(0, len(omega), step):
        which = slice(start, start + step)
        s: Complex = (1j * omega[which, None, None]).astype(complex)
        z, sensing = (x[0] + s * x[1] + s * s * x[2] for x in (pencil, h))
        try:
            if changes is None:
                right = np.linalg.solve(z, np.broadcast_to(b, (len(z), *b.shape)))
            elif symmetric:
                both = np.linalg.solve(z, np.concatenate((np.broadcast_to(b, (len(z), *b.shape)),
                                                          sensing.swapaxes(1, 2)), axis=2))  # fmt: skip
                right, left = both[:, :, : b.shape[1]], both[:, :, b.shape[1] :]
            else:
                right = np.linalg.solve(z, np.broadcast_to(b, (len(z), *b.shape)))
                left = np.linalg.solve(z.swapaxes(1, 2), sensing.swapaxes(1, 2))
        except np.linalg.LinAlgError:
            raise ResponseError("fit: a measured line is at an undamped pole of the model, where its response is "
                                "infinite (0 Hz if it moves freely); leave the line out or give the model damping."
                                ) from None  # fmt: skip
        response = sensing @ right + d
        yield which, response, None if changes is None else _slopes(changes, left.swapaxes(1, 2), right, s)


def responses(matrices: Any, omega: Array, rows: Index, columns: Index) -> Complex:
    """Return G (n, outputs, inputs) at all lines, see ``blocks``."""
    return np.concatenate([response for _, response, _ in blocks(matrices, None, omega, rows, columns)])


def _scale(matrices: Any, omega: Array) -> Array:
    """Powers of two that give all coordinates one size in the middle of the lines."""
    size = np.abs(matrices.K).diagonal() + np.median(omega) ** 2 * np.abs(matrices.M).diagonal()
    size = np.where(size > 0.0, size, size.max(initial=0.0) or 1.0)
    return np.asarray(np.exp2(np.round(-0.5 * np.log2(size))))


def _changes(
    slopes: Mapping[str, Array], scale: Array, rows: Index, columns: Index, middle: float
) -> list[tuple[Any, ...]]:
    """Factors of dZ, dB, dH (3, outputs, m) and dD of each variable, None where these do not change."""
    result = []
    pencils = np.array([slopes[key] for key in ("K", "C", "M")]).swapaxes(0, 1) * scale[:, None] * scale
    sensed = np.array([slopes[key][:, rows] for key in ("Cq", "Cv", "Ca")]).swapaxes(0, 1) * scale
    acting, direct = slopes["B"][:, :, columns] * scale[:, None], slopes["D"][:, rows][:, :, columns]
    for pencil, b, h, d in zip(pencils, acting, sensed, direct, strict=True):
        result.append((_factors(pencil, middle), *(x if x.any() else None for x in (b, h, d))))
    return result


def _factors(pencil: Array, middle: float) -> Factors | None:
    """dK, dC and dM (3, m, m) as products of low rank."""
    if not pencil.any():
        return None
    weighted = pencil * np.array([1.0, middle, middle**2])[:, None, None]
    moves = np.flatnonzero(weighted.any(axis=(0, 1)) | weighted.any(axis=(0, 2)))
    part = weighted[:, moves[:, None], moves]
    symmetric = bool((part == part.swapaxes(1, 2)).all())
    left = _range(np.concatenate(part, axis=1))
    right = left if symmetric else _range(np.concatenate(part.swapaxes(1, 2), axis=1))
    core = left.T @ pencil[:, moves[:, None], moves] @ right
    full = np.zeros((2, pencil.shape[1], max(left.shape[1], right.shape[1])))
    full[0, moves, : left.shape[1]], full[1, moves, : right.shape[1]] = left, right
    return Factors(full[0, :, : left.shape[1]], full[1, :, : right.shape[1]], core)


def _range(matrix: Array) -> Array:
    """Orthonormal columns of what the columns of a matrix span, without rounding."""
    u, size, _ = np.linalg.svd(matrix, full_matrices=False)
    return np.asarray(u[:, size > ZERO_SLOPE * size[0]])


def _slopes(changes: list[Any], left: Complex, right: Complex, s: Complex) -> Complex:
    """dG (v, n, outputs, inputs)."""
    result = np.zeros((len(changes), len(left), left.shape[1], right.shape[2]), dtype=complex)
    for total, (factors, b, h, d) in zip(result, changes, strict=True):
        if factors is not None:
            middle = factors.middle[0] + s * factors.middle[1] + s * s * factors.middle[2]
            total -= ((left @ factors.left) @ middle) @ (factors.right.T @ right)
        if b is not None:
            total += left @ b
        if h is not None:
            total += (h[0] + s * h[1] + s * s * h[2]) @ right
        if d is not None:
            total += d
    return result
