"""Balanced scaling: states multiplied by powers of two, so that no digit of A, B, C is lost and none is wasted.

Physical states put 1 and the squares of frequencies side by side in A. What turns A round before it computes with it
(Hessenberg forms in frequency responses, expm) rounds at the size of the largest entry.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from mbsvib.common.arrays import Array
    from mbsvib.responses.state_space import StateSpace

    Exponents = NDArray[np.int64]

# Osborne's iteration ends when no state gains this much (LAPACK's gebal: the same), or after this many rounds.
GAIN = 0.95
ROUNDS = 60
# Size of inputs and outputs beside A; with 1 displacements out of forces would pull q and q' apart.
PORTS = 2.0**-20


def balanced(space: StateSpace) -> StateSpace:
    """Return a state space with its states scaled by powers of two, every bit of its entries kept.

    x = T z,  z' = T^-1 A T z + T^-1 B u,  y = C T z + D u,  T = diag(2^k)

    Parameters
    ----------
    space : StateSpace
        First-order equations.

    Returns
    -------
    StateSpace
        The same equations; the unit of a state says what one of it is (``"2^-13 rad"``), ``transform`` leads back.
    """
    power = exponents(space.A, space.B, space.C)
    while True:
        a, b = np.ldexp(space.A, power[None, :] - power[:, None]), np.ldexp(space.B, -power[:, None])
        c, transform = np.ldexp(space.C, power), np.ldexp(space.transform, power)
        back = (np.ldexp(a, power[:, None] - power[None, :]), np.ldexp(b, power[:, None]), np.ldexp(c, -power),
                np.ldexp(transform, -power))  # fmt: skip
        if all(map(np.array_equal, back, (space.A, space.B, space.C, space.transform))):
            break
        power = np.trunc(power / 2).astype(np.int64)  # what would leave the range of floating point is scaled less
    units = tuple(f"2^{k} {unit}" if k else unit for k, unit in zip(power.tolist(), space.state_units, strict=True))
    return replace(space, realization="balanced", A=a, B=b, C=c, transform=transform, state_units=units)


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
