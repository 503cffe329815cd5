"""Balanced scaling: states multiplied by powers of two, so that no digit of A, B, C is lost and none is wasted.

Physical states put 1 and the squares of frequencies side by side in A. What turns A round before it computes with it
(Hessenberg forms in frequency responses, expm) rounds at the size of the largest entry.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from mbsvib.common.arrays import Array

    Exponents = NDArray[np.int64]

# Osborne's iteration ends when no state gains this much (LAPACK's gebal: the same), or after this many rounds.
GAIN = 0.95
ROUNDS = 60
# Size of inputs and outputs beside A; with 1 displacements out of forces would pull q and q' apart.
PORTS = 2.0**-20


def balanced(a: Array, b: Array, c: Array, transform: Array) -> tuple[Array, Array, Array, Array, Exponents]:
    """Return first-order equations with their states scaled by powers of two, every bit of their entries kept.

    x = T z,  z' = T^-1 A T z + T^-1 B u,  y = C T z + D u,  T = diag(2^k)

    Parameters
    ----------
    a, b, c : array, shape (n, n), (n, inputs), (outputs, n)
        First-order equations.
    transform : array, shape (rows, n)
        What leads from the states back to other coordinates.

    Returns
    -------
    tuple of array
        A, B, C and the transform of the scaled states, and k (n,).
    """
    power = exponents(a, b, c)
    while True:
        scaled = np.ldexp(a, power[None, :] - power[:, None]), np.ldexp(b, -power[:, None]), np.ldexp(c, power)
        back = (np.ldexp(scaled[0], power[:, None] - power[None, :]), np.ldexp(scaled[1], power[:, None]),
                np.ldexp(scaled[2], -power))  # fmt: skip
        moved = np.ldexp(transform, power)
        if all(map(np.array_equal, (*back, np.ldexp(moved, -power)), (a, b, c, transform))):
            return *scaled, moved, power
        power = np.trunc(power / 2).astype(np.int64)  # what would leave the range of floating point is scaled less


def exponents(a: Array, b: Array, c: Array) -> Exponents:
    """Return k, so that with T = diag(2^k) the rows and columns of [[T^-1 A T, T^-1 B], [C T, 0]] are of like size.

    Parameters
    ----------
    a : array, shape (n, n)
        Matrix A.
    b : array, shape (n, inputs)
        Matrix B; the unit of an input does not matter.
    c : array, shape (outputs, n)
        Matrix C; the unit of an output does not matter.

    Returns
    -------
    array of int, shape (n,)
        Exponents of two.

    Source: E. E. Osborne, J. ACM 7 (1960) 338; the stopping rule of LAPACK's gebal.
    """
    n = len(a)
    off, inward, outward = np.abs(a), np.abs(b), np.abs(c)
    off[np.arange(n), np.arange(n)] = 0.0
    total = np.zeros(n, dtype=np.int64)
    for _ in range(ROUNDS):
        # inputs and outputs have units of their own: they decide only between states that A leaves apart
        size = PORTS * (float(off.max(initial=0.0)) or 1.0)
        for ports, axis in ((inward, 0), (outward, 1)):
            largest = ports.max(axis=axis, keepdims=True, initial=0.0)
            ports *= size / np.where(largest == 0.0, 1.0, largest)
        with np.errstate(over="ignore"):
            if not _round(off, inward, outward, total):
                break
    return total + _apart(off, inward, outward)


def _apart(off: Array, inward: Array, outward: Array) -> Exponents:
    """Exponents of parts that A does not connect: what goes into each and what comes out are made alike."""
    from scipy.sparse.csgraph import connected_components

    _, part = connected_components(off != 0.0, directed=False)
    count = int(part.max(initial=-1)) + 1
    into, out = np.zeros(count), np.zeros(count)
    np.maximum.at(into, part, inward.max(axis=1, initial=0.0))
    np.maximum.at(out, part, outward.max(axis=0, initial=0.0))
    known = (into > 0.0) & (out > 0.0)
    power = np.zeros(count, dtype=np.int64)
    power[known] = np.round(0.5 * np.log2(into[known] / out[known])).astype(np.int64)
    result: Exponents = power[part]
    return result


def _round(off: Array, inward: Array, outward: Array, total: Exponents) -> bool:
    changed = False
    for i in range(len(off)):
        column = float(np.hypot(np.linalg.norm(off[:, i]), np.linalg.norm(outward[:, i])))
        row = float(np.hypot(np.linalg.norm(off[i]), np.linalg.norm(inward[i])))
        if not (column and row and np.isfinite(column) and np.isfinite(row)):
            continue
        step = round(0.5 * float(np.log2(row / column)))
        if step and column * 2.0**step + row * 2.0**-step < GAIN * (column + row):
            off[:, i] = np.ldexp(off[:, i], step)
            outward[:, i] = np.ldexp(outward[:, i], step)
            off[i] = np.ldexp(off[i], -step)
            inward[i] = np.ldexp(inward[i], -step)
            total[i] += step
            changed = True
    return changed
