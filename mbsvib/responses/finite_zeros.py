"""Finite zeros of state-space matrices: orthogonal transformations deflate the infinite ones.

Deflation of systems that are not square takes many decisions of rank, whose rows shrink level by level. These are
combined to square ones, which need few, and zeros of the combination alone are told apart afterwards.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any, NamedTuple, NoReturn

import numpy as np
from scipy.linalg import eig, qr

from mbsvib.common.arrays import Array, Bools, Complex
from mbsvib.errors import ResponseError
from mbsvib.linalg.balancing import exponents, scaled_by
from mbsvib.linalg.rank import EPS, POLE_ROUNDINGS

# Rows and feedthroughs of unit size are zero below this: rounding in the products of some hundred states is 1e-14.
RANK = 2e-13
# A feedthrough whose inverse is larger is not inverted; its zeros are those of a pencil.
REGULAR = 1e3
# Points at which the normal rank is found, away from the axes, in units of the size of A; and the least singular value
# of a transfer matrix with rows and columns of unit size that is not rounding.
POINTS, NORMAL_RANK = (0.31 + 0.47j, 0.083 + 0.019j, 1.9 - 1.3j), 1e-10
# Points beside poles, as a share of these, at which a response is looked for that is rounding elsewhere.
BESIDE = 1e-2
# Responses of less than this many roundings of their factors are rounding.
RESPONSE_ROUNDINGS = 16.0
# At a zero the product of the singular values of the transfer matrix is FALLS of its geometric mean on a circle whose
# radius is the share AWAY of the way to the nearest pole. If it is not CLEARLY smaller, and near poles, where transfer
# matrices are rounding, the least singular value of the system matrix also falls to LOST roundings, the square root of
# fewer for a double zero, and grows GROWTH times up to the circle. Poles nearer than AT_POLE belong to modes that are
# not met.
FALLS, CLEARLY, LOST, GROWTH, AWAY, NEAR_POLE, AT_POLE = 1e-2, 1e-4, 3e4, 30.0, 0.25, 1e-3, 1e-6
CIRCLE = np.exp(2j * np.pi * np.arange(8) / 8)
# Circles about 0 grow until the system matrix is regular on so many points of them, at most up to a share of its size.
WIDER, DIRECTIONS, SLOWEST = 2.0, np.exp(0.5j * np.pi * np.arange(4) + 0.3j), 1e-3


class FiniteZeros(NamedTuple):
    """``zeros`` (n,), the normal ``rank``, and the outputs (``rows``) and inputs (``columns``) that have a response.

    The rank is 0 where no output responds to any input, and each s is a zero.
    """

    zeros: Complex
    rank: int
    rows: Bools
    columns: Bools


def finite_zeros(a: Array, b: Array, c: Array, d: Array) -> FiniteZeros:
    """Return the finite s at which [[A - s, B], [C, D]] loses rank; rows of C and D and columns of B are of the size of
    one.

    More outputs than inputs, or fewer, are combined to as many as the normal rank: zeros of the combination are those
    of all, and others, at which the whole matrix keeps its rank. Those that rounding cannot tell from 0 are 0.

    Source: Emami-Naeini & Van Dooren, Automatica 18 (1982).
    """
    rank, (rows, columns) = len(d), (np.ones(count, dtype=bool) for count in d.shape)
    if not _responds(a, b, c, d):
        return FiniteZeros(np.zeros(0, dtype=complex), 0, rows, columns)
    if len(d) != d.shape[1]:
        rows, columns = _connected(a, b, c, d)
        rank = normal_rank(a, b[:, columns], c[rows], d[np.ix_(rows, columns)])
    if len(d) == d.shape[1] or not rank:
        zeros = _of_square(a, b, c, d)
    else:
        left, right = (combination(count, rank) for count in d.shape)
        zeros = _of_square(a, b @ right, left.T @ c, left.T @ d @ right)
        zeros = zeros[_loses_rank((a, b, c, d), zeros, rank, np.ix_(rows, columns))]
    return FiniteZeros(_exact_at_zero((a, b, c, d), zeros, rank), rank, rows, columns)


def _connected(a: Array, b: Array, c: Array, d: Array) -> tuple[Bools, Bools]:
    """Tell which outputs and inputs have a response that is not rounding only; all of them if none has."""
    known: Bools = np.any([_above_rounding((a, b, c, d), s) for s in POINTS], axis=0)
    if not known.any():
        known[:] = True
    return np.asarray(known.any(axis=1)), np.asarray(known.any(axis=0))


def _above_rounding(equations: tuple[Array, Array, Array, Array], s: complex) -> Bools:
    """Tell which entries of C (s - A)^-1 B + D are not rounding only at a point s."""
    a, b, c, d = equations
    resolvent = np.linalg.inv(s * np.eye(len(a)) - a)
    noise = np.outer(np.linalg.norm(c @ resolvent, axis=1), np.linalg.norm(b, axis=0))
    noise += np.outer(np.linalg.norm(c, axis=1), np.linalg.norm(resolvent @ b, axis=0))
    return np.asarray(np.abs(c @ resolvent @ b + d) > RESPONSE_ROUNDINGS * EPS * noise)


def _responds(a: Array, b: Array, c: Array, d: Array) -> bool:
    """Tell whether an output responds to an input; beside poles, the far end of a chain does so above rounding."""
    equations = a, b, c, d
    if d.any() or any(_above_rounding(equations, s).any() for s in POINTS):
        return True
    poles = np.linalg.eigvals(a)
    beside = poles + BESIDE * np.where(poles == 0.0, 1.0, np.abs(poles))
    return any(_above_rounding(equations, s).any() for s in beside)


class NoResponseError(ResponseError):
    """No output responds to any of the inputs: every s is a zero."""


def refuse_none(outputs: Sequence[str], inputs: Sequence[str], name: str) -> NoReturn:
    """Refuse zeros of outputs that do not respond to any of some inputs."""
    raise NoResponseError(f"transmission_zeros: of '{name}', {', '.join(outputs)} does not respond to "
                        f"{', '.join(inputs)}, so that every s is a zero. Choose another output or input.")  # fmt: skip


def normal_rank(a: Array, b: Array, c: Array, d: Array) -> int:
    """Return the rank of C (s - A)^-1 B + D at almost all s."""
    rank = 0
    for gain in _gains((a, b, c, d), np.array(POINTS)):
        left, right = port_sizes(gain)
        values = np.linalg.svd(gain / left[:, None] / right, compute_uv=False)
        rank = max(rank, int(np.count_nonzero(values > NORMAL_RANK)))
    return rank


def _gains(equations: tuple[Array, Array, Array, Array], s: Complex) -> Complex:
    """C (s - A)^-1 B + D at the points ``s`` (n,), shape (n, outputs, inputs)."""
    a, b, c, d = equations
    return np.asarray(c @ np.linalg.solve(s[:, None, None] * np.eye(len(a)) - a, b[None]) + d)


def port_sizes(gain: Complex) -> tuple[Array, Array]:
    """Return sizes of the outputs and inputs of a transfer matrix (outputs, inputs), which bring it to unit size."""
    size = np.abs(gain)
    sizes = [np.ones(count) for count in size.shape]
    for _ in range(2):
        for axis in (1, 0):
            norm = np.linalg.norm(size, axis=axis, keepdims=True)
            norm[norm == 0.0] = 1.0
            size, sizes[1 - axis] = size / norm, sizes[1 - axis] * norm.reshape(-1)
    return sizes[0], sizes[1]


def combination(count: int, rank: int) -> Array:
    """Return orthonormal columns (count, rank) without any symmetry; the unit matrix where all are taken."""
    if count == rank:
        return np.eye(count)
    return np.linalg.qr(np.cos(1.0 + np.arange(count * rank) ** 2.0).reshape(count, rank))[0]


def _loses_rank(equations: tuple[Array, Array, Array, Array], zeros: Complex, rank: int, ports: Any) -> Bools:
    """Tell at which s the transfer matrix has less than its normal rank; near poles, at which the system matrix has.

    ``ports``: entries of the transfer matrix that are not rounding only. The logarithm of an analytic function without
    zeros is its mean on a circle, also where the function falls fast with s, as along a chain of many masses.
    """
    poles = np.linalg.eigvals(equations[0])
    least, rounding = _least(equations, rank)
    lost: Bools = np.zeros(len(zeros), dtype=bool)
    for i, s in enumerate(zeros.tolist()):
        away = np.abs(poles - s)
        reach = AWAY * float(away[away > AT_POLE * abs(s)].min(initial=np.inf))
        if away.min() > NEAR_POLE * abs(s):
            gains = _gains(equations, np.array([s, *(s + reach * CIRCLE)]))[:, *ports]
            left, right = port_sizes(np.abs(gains[1:]).max(axis=0))
            values = np.linalg.svd(gains / left[:, None] / right, compute_uv=False)[:, :rank]
            with np.errstate(divide="ignore"):
                size = np.log(values).sum(axis=1)
            fall = size[0] - size[1:].mean()
            if not np.log(CLEARLY) < fall < np.log(FALLS):
                lost[i] = fall <= np.log(CLEARLY)
                continue
        value, noise = least(s), rounding * max(1.0, abs(s))
        if value <= LOST * noise:
            lost[i] = max(least(s + reach * turn) for turn in (1.0, 1j)) > GROWTH * max(value, noise)
    return lost


def _least(equations: tuple[Array, Array, Array, Array], rank: int) -> tuple[Callable[[complex], float], float]:
    """The singular value of the system matrix that is 0 at zeros, as a function of s, and a rounding of the matrix."""
    a, b, c, d = equations
    n, whole = len(a), np.block([[a, b], [c, d]])
    shift = np.pad(np.eye(n), ((0, len(c)), (0, b.shape[1])))

    def least(s: complex) -> float:
        return float(np.linalg.svd(whole - s * shift, compute_uv=False)[n + rank - 1])

    return least, EPS * float(np.linalg.norm(whole, 2))


def _exact_at_zero(equations: tuple[Array, Array, Array, Array], zeros: Complex, rank: int) -> Complex:
    """The zeros, 0 in place of those within a circle on which the system matrix is singular but for rounding.

    As of eigenvalues, k zeros that coincide at 0 differ from it by the k-th root of rounding.
    """
    if not (np.abs(zeros) < SLOWEST).any():
        return zeros
    least, rounding = _least(equations, rank)
    radius = rounding = POLE_ROUNDINGS * rounding
    while min(least(radius * turn) for turn in DIRECTIONS) <= rounding:
        radius *= WIDER
        if radius > SLOWEST:  # singular everywhere
            return zeros
    return np.where(np.abs(zeros) <= radius, 0.0, zeros)


def _of_square(a: Array, b: Array, c: Array, d: Array) -> Complex:
    """Finite zeros of a system with as many outputs as inputs."""
    a, b, c, d = _peeled(a, b, c, d)
    if not len(d):  # no output is left to tell one input from the other
        return np.linalg.eigvals(a).astype(complex) if len(a) else np.zeros(0, dtype=complex)
    # the same from the other side: columns of the feedthrough
    a, b, c, d = _peeled(a.T, c.T, b.T, d.T)
    n = len(a)
    if n == 0:
        return np.zeros(0, dtype=complex)
    if not len(d):
        return np.linalg.eigvals(a).astype(complex)
    if np.linalg.norm(np.linalg.inv(d), 2) * np.linalg.norm(b, 2) * np.linalg.norm(c, 2) <= REGULAR:
        return np.linalg.eigvals(a - b @ np.linalg.solve(d, c)).astype(complex)
    turn = np.linalg.qr(np.concatenate((c, d), axis=1).T, mode="complete")[0][:, len(d) :]
    top = np.concatenate((a, b), axis=1) @ turn
    alpha, beta = eig(top, turn[:n], right=False, homogeneous_eigvals=True)
    finite = np.abs(beta) > EPS * np.abs(alpha)
    result: Complex = alpha[finite] / beta[finite]
    return result


def _peeled(a: Array, b: Array, c: Array, d: Array) -> tuple[Array, Array, Array, Array]:
    """Take off outputs without feedthrough and the states they show, until the feedthrough has full row rank."""
    while len(d):
        rank, turn = _rank(d, max(1.0, float(np.abs(d).max(initial=0.0))))
        c, d = turn.T @ c, turn.T @ d
        direct, hidden = (c[:rank], d[:rank]), c[rank:]
        if not len(hidden):
            break
        shown, turn = _rank(hidden.T, 1.0)
        left = turn[:, shown:]
        first = turn[:, :shown]
        a, b, c, d = (
            left.T @ a @ left, left.T @ b, np.concatenate((direct[0] @ left, first.T @ a @ left)),
            np.concatenate((direct[1], first.T @ b)),
        )  # fmt: skip
        if not shown:
            break
    return a, b, c, d


def _rank(matrix: Array, size: float) -> tuple[int, Array]:
    """Rank of a matrix against entries of ``size``, and an orthogonal matrix whose first columns span its range."""
    if not matrix.size:
        return 0, np.eye(len(matrix))
    turn, upper, _ = qr(matrix, pivoting=True)
    return int(np.count_nonzero(np.abs(upper.diagonal()) > RANK * size)), turn


def first_order_zeros(a: Array, b: Array, c: Array, d: Array, of: Any) -> Complex:
    """Return the finite s [1/s] at which [[A - s, B], [C, D]] has less than its normal rank, in ascending magnitude.

    ``of``: what has the ``outputs``, ``inputs`` and ``name`` of these equations.
    """
    if not len(a) or not d.size:
        return np.zeros(0, dtype=complex)
    a, b, c = scaled_by(exponents(a, b, c), a, b, c)
    unit = float(np.linalg.norm(a, 2)) or 1.0
    # columns of B and rows of (C, D) of unit size: zeros do not depend on units of inputs and outputs
    size = np.linalg.norm(b, axis=0)
    b, d = b / np.where(size > 0.0, size, 1.0), d / np.where(size > 0.0, size, 1.0)
    d = d * unit
    size = np.linalg.norm(np.concatenate((c, d), axis=1), axis=1)
    size = np.where(size > 0.0, size, 1.0)[:, None]
    found = finite_zeros(a / unit, b, c / size, d / size)
    if not found.rank:
        refuse_none(of.outputs, of.inputs, of.name)
    zeros = found.zeros * unit
    return np.asarray(zeros[np.lexsort((-zeros.imag, np.abs(zeros)))])
