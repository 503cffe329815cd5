"""Blocks of modal states, also for a pair of nearly equal eigenvalues, such as that of a critically damped mode."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from mbsvib.common.arrays import Array, Complex
from mbsvib.errors import ResponseError
from mbsvib.linalg.rank import EPS

# Below this relative distance of a pair its invariant subspace is used: differences of its eigenvectors lose digits in
# proportion to the square of the distance.
CLOSE = 0.05
# Vectors of a close pair of one motion are parallel up to the distance of its eigenvalues, at most CLOSE; those of two
# equal motions of first order are independent.
INDEPENDENT = 0.2
# Limit of the condition number of modal coordinates times the growth of their shares: rounding errors reach 1e-8.
DEPENDENT = 1e8
TINY = float(np.finfo(float).tiny)
# Largest residual of the equations relative to their terms; coinciding eigenvalues give a far larger one.
RESIDUAL = 1e-8


def pair_block(
    a: Array, values: tuple[complex, complex], vectors: tuple[Complex, Complex], mode: str, system: str
) -> tuple[Array, Array]:
    """Return a block N of a pair of eigenvalues, [[0, 1], [-l1 l2, l1 + l2]], and T (n, 2) with A T = T N.

    T = [(l2 v1 - l1 v2), (v2 - v1)] / (l2 - l1); of a close pair T = Z [S c - tr(S) c, c] with A Z = Z S

    A close pair with independent vectors, such as two equal motions of first order, has no companion block but the
    diagonal one of l1 and l2 with T = [v1, v2], or its real form. ``values``: l1 and l2; ``vectors`` (n,): v1 and v2. A
    pair of a ``mode`` whose space cannot be told from that of others is refused.
    """
    (l1, l2), (first, second) = values, vectors
    if abs(l2 - l1) > CLOSE * abs(l1):
        pair = np.stack((l2 * first - l1 * second, second - first), axis=1) / (l2 - l1)
        return np.array([[0.0, 1.0], [-(l1 * l2).real, (l1 + l2).real]]), pair.real
    unit = np.stack((first / np.linalg.norm(first), second / np.linalg.norm(second)), axis=1)
    sizes = np.linalg.svd(unit, compute_uv=False)
    if sizes[1] > INDEPENDENT * sizes[0]:
        if l1.imag == 0.0:
            return np.diag((l1.real, l2.real)), unit.real
        rotated = unit[:, 0] * np.exp(-0.5j * np.angle(unit[:, 0] @ unit[:, 0]))
        parts = np.stack((rotated.real, rotated.imag), axis=1)
        return np.array([[l1.real, l1.imag], [-l1.imag, l1.real]]), parts
    from scipy.linalg import schur

    middle = 0.5 * (l1 + l2).real
    near = np.sort(np.abs(np.linalg.eigvals(a) - middle))
    reach = 0.5 * (near[1] + near[2]) if len(near) > 2 else np.inf
    try:
        upper, basis, _ = schur(a, sort=lambda x, y=0.0: abs(complex(x, y) - middle) < reach)
    except np.linalg.LinAlgError:  # rounding moves eigenvalues of others across the limit
        raise _dependent(system, [mode]) from None
    small, basis = upper[:2, :2], basis[:, :2]
    total = np.trace(small)
    block = np.array([[0.0, 1.0], [-np.linalg.det(small), total]])
    start = np.array((1.0, 0.0) if abs(small[1, 0]) > abs(small[0, 1]) else (0.0, 1.0))  # no eigenvector of S
    return block, basis @ np.stack((small @ start - total * start, start), axis=1)


def modal_inputs(
    a: Array, blocks: Array, columns: Array, sizes: Sequence[int], forces: Array, names: Sequence[str], system: str
) -> Array:
    """Return the inputs B of modal states x = T z, T B = F, and refuse states in which rounding shows in the responses.

    Rounding of B is eps times the condition number of T = [T1 T2 ...], with orthonormal columns in each block. It grows
    with the shares Ti Bi, which cancel in F: nearly dependent blocks lose no accuracy if inputs excite them equally.
    ``a``, ``blocks``, ``columns`` (n, n): A in energy coordinates, N and T with A T = T N; ``forces``: F in these.
    """
    if not len(columns):
        return np.zeros_like(forces)
    length = np.linalg.norm(columns, axis=0)
    residual = np.linalg.norm(a @ columns - columns @ blocks, axis=0) / (length * np.abs(a).max())
    parts = [np.linalg.qr(part) for part in np.split(columns / length, np.cumsum(sizes)[:-1], axis=1)]
    basis = np.concatenate([part for part, _ in parts], axis=1)
    _, values, right = np.linalg.svd(basis)
    grown, shares = np.inf, np.zeros_like(forces)
    if values[-1] > EPS * values[0]:
        shares = np.linalg.solve(basis, forces)
        grown = (np.abs(shares).sum(axis=0) / np.maximum(np.linalg.norm(forces, axis=0), TINY)).max(initial=1.0)
    if values[-1] * DEPENDENT < values[0] * grown or residual.max() > RESIDUAL:
        share = np.abs(right[-1]) if residual.max() <= RESIDUAL else residual
        modes = sorted({names[i].rstrip("'") for i in np.argsort(-share)[:4].tolist()})
        raise _dependent(system, modes)
    cut = np.split(shares, np.cumsum(sizes)[:-1])
    inputs = [np.linalg.solve(upper, share) for (_, upper), share in zip(parts, cut, strict=True)]
    return np.asarray(np.concatenate(inputs) / length[:, None], dtype=float)


def _dependent(system: str, modes: Sequence[str]) -> ResponseError:
    return ResponseError(
        f"state_space: modal states of '{system}' depend on each other, as eigenvalues of {', '.join(modes)} all but "
        f"coincide and their shapes do too; take realization='physical' or 'balanced'."
    )
