"""Structured singular values of uncertain blocks, full or real."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike

from mbsvib.common.arrays import Array
from mbsvib.errors import ResponseError
from mbsvib.linalg.groups import part_numbers
from mbsvib.linalg.structured_norms import structured_norms


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
        np.maximum(result, structured_norms(points[:, at][:, :, at], part_masks[:, at], real_blocks), out=result)
    return result.reshape(m.shape[2:])
