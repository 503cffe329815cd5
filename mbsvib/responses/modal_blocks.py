"""Blocks of modal states, also of a pair of eigenvalues that all but meet, as those of a critically damped mode."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from mbsvib.errors import ResponseError

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    Array = NDArray[np.float64]
    Complex = NDArray[np.complex128]

# Differences of eigenvectors lose the square of the relative distance of a pair; its invariant subspace loses nothing.
CLOSE = 0.05
# Modal coordinates lose the square of their condition number to rounding: here 1e-8 of the responses.
DEPENDENT = 1e4
# What vectors may leave of the equations, against the largest of their terms; eigenvalues that meet leave far more.
RESIDUAL = 1e-8


def pair_block(a: Array, one: complex, two: complex, first: Complex, second: Complex) -> tuple[Array, Array]:
    """Return the block N = [[0, 1], [-l1 l2, l1 + l2]] of a pair of eigenvalues, and T (n, 2) with A T = T N.

    T = [(l2 v1 - l1 v2), (v2 - v1)] / (l2 - l1); of a close pair T = Z [S c - tr(S) c, c] with A Z = Z S

    Parameters
    ----------
    a : array, shape (n, n)
        The state matrix A.
    one, two : complex
        The pair l1, l2: real, or conjugate.
    first, second : array, shape (n,)
        Its eigenvectors v1, v2.

    Returns
    -------
    tuple of array
        N and T.
    """
    if abs(two - one) > CLOSE * abs(one):
        pair = np.stack((two * first - one * second, second - first), axis=1) / (two - one)
        return np.array([[0.0, 1.0], [-(one * two).real, (one + two).real]]), pair.real
    from scipy.linalg import schur

    middle = 0.5 * (one + two).real
    near = np.sort(np.abs(np.linalg.eigvals(a) - middle))
    reach = 0.5 * (near[1] + near[2]) if len(near) > 2 else np.inf
    upper, basis, _ = schur(a, sort=lambda x, y=0.0: abs(complex(x, y) - middle) < reach)
    small, basis = upper[:2, :2], basis[:, :2]
    total = np.trace(small)
    block = np.array([[0.0, 1.0], [-np.linalg.det(small), total]])
    start = np.array((1.0, 0.0) if abs(small[1, 0]) > abs(small[0, 1]) else (0.0, 1.0))  # no eigenvector of S
    return block, basis @ np.stack((small @ start - total * start, start), axis=1)


def check_modal(a: Array, blocks: Array, columns: Array, names: Sequence[str], system: str) -> None:
    """Refuse modal states x = T z that all but depend on each other, or that are no solution of A T = T N.

    Parameters
    ----------
    a, blocks, columns : array, shape (n, n)
        A in energy coordinates, N and T.
    names : sequence of str
        Names of the states.
    system : str
        The system's name, for the message.

    Raises
    ------
    ResponseError
        If rounding would show in the responses.
    """
    if not len(columns):
        return
    length = np.linalg.norm(columns, axis=0)
    _, sizes, right = np.linalg.svd(columns / length)
    left = np.linalg.norm(a @ columns - columns @ blocks, axis=0) / (length * np.abs(a).max())
    if sizes[-1] * DEPENDENT < sizes[0] or left.max() > RESIDUAL:
        share = np.abs(right[-1]) if left.max() <= RESIDUAL else left
        modes = sorted({names[i].rstrip("'") for i in np.argsort(-share)[:4].tolist()})
        raise ResponseError(
            f"state_space: modal states of '{system}' depend on each other, as eigenvalues of {', '.join(modes)} all "
            f"but coincide and their shapes do too; take realization='physical' or 'balanced'."
        )
