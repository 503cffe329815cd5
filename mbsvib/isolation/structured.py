"""Structured singular values: bounds by scalings D and G, found by interior points."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike

from mbsvib.common.arrays import Array, Complex
from mbsvib.errors import ResponseError
from mbsvib.linalg.groups import part_numbers

_GAP = 1e-7  # of the squared bound: the scalings leave no more than this much below the level
_ZERO = 1e-12  # squared bound of a matrix of norm 1 that is as good as zero
_STEPS = 600  # of Newton's method, for all levels together; 60 to 150 are usual
_CENTRED = 0.3  # Newton decrement below which scalings are near enough to the centre for the next level
_SHARE = 0.1  # of the way down to the bound of these scalings that the next level leaves
_LARGEST = 1e4  # of G for matrices of norm 1; more helps real parameters only where mu is next to its jump
_SWEEPS = 20  # of balancing
_RIDGE = 1e-14  # added to second derivatives of unit diagonal, which rounding may leave singular


def structured_singular_values(
    matrices: ArrayLike, blocks: Sequence[int] | None = None, real: Sequence[int] = (), complex_share: float = 0.0
) -> Array:
    """Return upper bounds of structured singular values: how near uncertain blocks come to make a loop singular.

    mu(M) = 1 / min {sigma(Delta) : det(1 - M Delta) = 0, Delta = diag(Delta_1, Delta_2, ...)}

    A loop with ``Delta_i`` in its way, each of a gain below 1 at all frequencies, is stable where mu of what it sees
    stays below 1.

    Where all blocks that act on each other are real, mu can be 0 at all frequencies but single ones, at which a grid
    does not look: an unstable loop would show a mu of 0. So frequency responses of such blocks need a
    ``complex_share`` e, by which delta becomes delta + e delta', |delta'| < 1, complex: mu is then continuous and an
    upper bound for the real parameters. Of a single complex matrix (n, n) mu is that of this matrix alone: it may be 0
    where matrices as near as one likes have another one, so that it says nothing of a loop.

    Parameters
    ----------
    matrices : array-like, shape (n, n) or (n, n, points)
        M at one or several frequencies, as frequency responses have them.
    blocks : sequence of int, optional
        Sizes of the blocks, full; default: n blocks of size 1.
    real : sequence of int, optional
        Numbers of blocks, from 0, that are real parameters (of size 1); all others are complex.
    complex_share : float
        Part e of real parameters that is complex, 0.01 for example; needed for frequency responses where only real
        blocks act on each other.

    Returns
    -------
    array, shape () or (points,)
        Upper bounds: the least beta that D > 0 and G, diagonal, give by M* D M + i (G M - M* G) <= beta^2 D; exact for
        up to three complex blocks.

    Raises
    ------
    ResponseError
        If shapes or numbers do not fit, or only real blocks act on each other over frequencies, without a complex
        share.

    Source: Fan, Tits & Doyle, Robustness in the presence of mixed parametric uncertainty and unmodeled dynamics, IEEE
    Trans. Automatic Control 36 (1991); Boyd & El Ghaoui, Method of centers for minimizing generalized eigenvalues,
    Linear Algebra and its Applications 188 (1993); Packard & Pandey, Continuity properties of the real/complex
    structured singular value, IEEE Trans. Automatic Control 38 (1993), for the complex share.
    """
    caller = "structured_singular_values"
    m = np.asarray(matrices, dtype=complex)
    n = m.shape[0] if m.ndim else 0
    sizes = [1] * n if blocks is None else [int(size) for size in blocks]
    if m.ndim not in (2, 3) or m.shape[:2] != (n, n) or sum(sizes) != n or min(sizes, default=0) < 1:
        raise ResponseError(f"{caller}: matrices have shape {m.shape}, blocks = {sizes}; expected square matrices "
                            f"(n, n) or (n, n, points), and sizes of blocks whose sum is n.")  # fmt: skip
    if not np.isfinite(m).all():
        raise ResponseError(f"{caller}: matrices hold NaN or infinity; expected finite numbers.")
    if any(k not in range(len(sizes)) or sizes[k] != 1 for k in real) or len(set(real)) != len(real):
        raise ResponseError(f"{caller}: real = {list(real)}; expected numbers from 0 of blocks of size 1, each once; "
                            f"blocks = {sizes}.")  # fmt: skip
    if not 0.0 <= complex_share < np.inf:
        raise ResponseError(f"{caller}: complex_share = {complex_share!r}; expected a number from 0 on, such as 0.01.")
    points = np.moveaxis(m.reshape(n, n, -1), 2, 0)
    if complex_share and len(real):
        # one more complex block for each real parameter, of a share of its range
        t = np.eye(n)
        t = np.concatenate((t, np.sqrt(complex_share) * t[np.cumsum([0, *sizes])[list(real)]]))
        points, sizes = t @ points @ t.T, [*sizes, *[1] * len(real)]
    masks = np.repeat(np.eye(len(sizes)), sizes, axis=1)
    # blocks that act on others one way make a triangular determinant, of which each part counts alone
    part = part_numbers(masks @ np.any(points, axis=0) @ masks.T, strong=True)
    result = np.zeros(len(points))
    for k in range(part.max(initial=-1) + 1):
        part_masks = masks[part == k]
        at = np.flatnonzero(part_masks.any(axis=0))
        members = set(np.flatnonzero(part == k).tolist())
        if m.ndim == 3 and members <= set(real) and np.iscomplex(points[:, at][:, :, at]).any():
            raise ResponseError(
                f"{caller}: blocks {sorted(members)} are all real, so that mu is 0 at almost all frequencies, also of "
                f"loops that become unstable: a grid shows nothing. Give complex_share=0.01, with which each real "
                f"parameter is by 1 % of its range complex; or take them as complex.")  # fmt: skip
        real_blocks = [j for j, block in enumerate(np.flatnonzero(part == k).tolist()) if block in set(real)]
        np.maximum(result, _part(points[:, at][:, :, at], part_masks[:, at], real_blocks), out=result)
    return result.reshape(m.shape[2:])


def _part(m: Complex, masks: Array, real: list[int]) -> Array:
    """Bounds of matrices (points, n, n) of any size, whose blocks all act on each other."""
    size = np.abs(m).max(axis=(1, 2))
    result, nonzero = np.zeros(len(m)), size > 0.0
    if nonzero.any():
        normal = _balanced(m[nonzero] / size[nonzero, None, None], masks)
        norm = np.linalg.norm(normal, 2, axis=(1, 2))
        result[nonzero] = _bounds(normal / norm[:, None, None], masks, real) * norm * size[nonzero]
    return result


def _balanced(m: Complex, masks: Array) -> Complex:
    """D M D^-1 with rows and columns of each block of the same norm outside of it, by Osborne's iteration."""
    result = m.copy()
    for _ in range(_SWEEPS):
        for mask in masks.astype(bool):
            row = np.linalg.norm(result[:, mask][:, :, ~mask], axis=(1, 2))
            column = np.linalg.norm(result[:, ~mask][:, :, mask], axis=(1, 2))
            ratio = np.ones(len(m))
            np.divide(column, row, out=ratio, where=(row > 0.0) & (column > 0.0))
            scale = np.exp2(np.round(0.5 * np.log2(ratio)))[:, None, None]  # powers of two round nothing
            result[:, mask] *= scale
            result[:, :, mask] /= scale
    return result


def _bounds(m: Complex, masks: Array, real: list[int]) -> Array:
    """The least beta for matrices of norm 1 (points, n, n); never below the infimum.

    Centres of {D, G : N(D, G) < level D, 0 < D < 1, |G| < L} by damped Newton steps, which stay inside; from each
    centre the level is lowered, until no room is left.
    """
    count = len(masks)
    slopes, weight = _slopes(m, masks, real)
    x = np.tile(np.concatenate((np.full(count, 0.5), np.zeros(len(real)))), (len(m), 1))
    level, best = np.full(len(m), 2.0), np.ones(len(m))
    at = np.arange(len(m))
    for _ in range(_STEPS):
        if not len(at):
            break
        step, decrement = _newton(*_derivatives(x[at], level[at, None, None, None] * weight - slopes[at], count))
        after = x[at] + step / (1.0 + decrement)[:, None]
        bound = _level(after, slopes[at], masks)
        inside = (bound < level[at]) & (after[:, :count] < 1.0).all(axis=1)  # always, but for rounding
        inside &= (np.abs(after[:, count:]) < _LARGEST).all(axis=1)
        x[at[inside]], bound = after[inside], np.where(inside, bound, level[at])
        best[at] = np.minimum(best[at], bound)
        centred = decrement < _CENTRED
        room = level[at] - bound
        done = ~inside | (centred & (room <= _GAP * level[at])) | (bound < _ZERO)
        level[at] = np.where(centred, bound + _SHARE * room, level[at])
        at = at[~done]
    return np.sqrt(np.maximum(best, 0.0))


def _slopes(m: Complex, masks: Array, real: list[int]) -> tuple[Complex, Array]:
    """Derivatives of N = M* D M + i (G M - M* G) and of D to the entries d, g: (points, variables, n, n)."""
    units = masks[:, :, None] * np.eye(m.shape[1])
    turned = 1j * (units[real] @ m[:, None])
    slopes = np.concatenate((_adjoint(m)[:, None] @ units @ m[:, None], turned + _adjoint(turned)), axis=1)
    return slopes, np.concatenate((units, np.zeros_like(units[real])))


def _derivatives(x: Array, slopes: Complex, count: int) -> tuple[Array, Array]:
    """Gradient and Hessian of -log det(level D - N) - log det D (1 - D) - log det(L^2 - G^2) at x = (d, g)."""
    values, vectors = np.linalg.eigh(np.einsum("pv,pvij->pij", x, slopes))
    values = np.maximum(values, np.finfo(float).eps * values[:, -1:])
    root = (vectors / np.sqrt(values)[:, None])[:, None]  # R with R R* the inverse
    parts = _adjoint(root) @ slopes @ root
    flat = parts.reshape(*parts.shape[:2], -1)
    least = np.zeros(x.shape[1])
    least[count:] = -_LARGEST
    most = np.where(np.arange(x.shape[1]) < count, 1.0, _LARGEST)
    below, above = 1.0 / (x - least), 1.0 / (most - x)
    first = -np.einsum("pvii->pv", parts).real - below + above
    second = (np.conj(flat) @ np.swapaxes(flat, 1, 2)).real
    return first, second + (below**2 + above**2)[:, :, None] * np.eye(x.shape[1])


def _adjoint(matrix: Complex) -> Complex:
    return np.conj(np.swapaxes(matrix, -1, -2))


def _newton(first: Array, second: Array) -> tuple[Array, Array]:
    """Newton's step from derivatives, and its decrement, sqrt(-step' first)."""
    size = np.sqrt(np.einsum("pvv->pv", second))
    scaled = second / (size[:, :, None] * size[:, None]) + _RIDGE * np.eye(first.shape[1])
    step = -np.linalg.solve(scaled, (first / size)[:, :, None])[:, :, 0] / size
    return step, np.sqrt(np.maximum(-np.einsum("pv,pv->p", step, first), 0.0))


def _level(x: Array, slopes: Complex, masks: Array) -> Array:
    """The largest eigenvalue of D^-1/2 N D^-1/2, infinite where D is not positive."""
    d = x[:, : len(masks)]
    root = 1.0 / np.sqrt(np.where(d > 0.0, d, 1.0) @ masks)
    total = np.einsum("pv,pvij->pij", x, slopes)
    return np.where((d > 0.0).all(axis=1), np.linalg.eigvalsh(root[:, :, None] * total * root[:, None])[:, -1], np.inf)
