"""Balanced scaling of first-order equations: states multiplied by powers of two, without rounding of A, B, C.

In physical states A has entries of 1 and of squared frequencies. Algorithms that transform A (Hessenberg forms in
frequency responses, expm) have rounding errors relative to its largest entry.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import lapack

from mbsvib.common.arrays import Array
from mbsvib.linalg.groups import part_numbers

Exponents = NDArray[np.int64]

# Osborne's iteration ends when no state gains this much (LAPACK's gebal: the same), or after this many rounds.
GAIN = 0.95
ROUNDS = 60
# Size of inputs and outputs relative to A; with 1, the gain from forces to displacements would unbalance q and q'.
PORTS = 2.0**-20


def balanced(a: Array, b: Array, c: Array, transform: Array) -> tuple[Array, Array, Array, Array, Exponents]:
    """Return first-order equations with their states scaled by powers of two, every bit of their entries kept.

    x = T z, z' = T^-1 A T z + T^-1 B u, y = C T z + D u, T = diag(2^k), k (n,)

    ``transform`` (rows, n): matrix from the states to other coordinates, which is scaled with them.
    """
    power = exponents(a, b, c)
    while True:
        with np.errstate(over="ignore"):
            result, scaled_transform = scaled_by(power, a, b, c), np.ldexp(transform, power)
            back = (*scaled_by(-power, *result), np.ldexp(scaled_transform, -power))
        if not power.any() or all(map(np.array_equal, back, (a, b, c, transform))):
            return *result, scaled_transform, power
        power = np.trunc(power / 2).astype(np.int64)  # less scaling where numbers leave the range of floating point


def scaled_by(power: Exponents, a: Array, b: Array, c: Array) -> tuple[Array, Array, Array]:
    """Return T^-1 A T, T^-1 B, C T with T = diag(2^k), k (n,)."""
    return np.ldexp(a, power[None, :] - power[:, None]), np.ldexp(b, -power[:, None]), np.ldexp(c, power)


def scaled(a: Array, b: Array, c: Array) -> tuple[Array, Array, Array]:
    """Return T^-1 A T, T^-1 B, C T with the states scaled as by ``balanced``."""
    return balanced(a, b, c, np.empty((0, len(a))))[:3]


def column_units(b: Array, size: float) -> Array:
    """Return powers of two (columns,) that give each column of a matrix times its own the ``size``; 1 of zeros."""
    largest = np.abs(b).max(axis=0, initial=0.0)
    used = largest > 0.0
    return np.asarray(np.where(used, np.exp2(np.round(np.log2(size / np.where(used, largest, size)))), 1.0))


def matrix_exponents(a: Array) -> Exponents:
    """Return k (n,) so that the rows and columns of T^-1 A T, T = diag(2^k), are of like size.

    Parts whose states act on each other both ways are balanced each for itself. Between parts that act one way, any
    scaling is possible: entries there are made small, and some may underflow; no entry is rounded.
    """
    part = part_numbers(a != 0.0, strong=True)
    inside = part[:, None] == part
    coupling = np.where(inside, np.abs(a), 0.0)
    np.fill_diagonal(coupling, 0.0)
    power = np.frexp(lapack.dgebal(coupling, scale=1)[3])[1].astype(np.int64) - 1
    even = np.ldexp(a, power[None, :] - power[:, None])
    _, excess = np.frexp(np.abs(even) / (PORTS * (float(np.abs(even[inside]).max(initial=0.0)) or 1.0)))
    one_way = np.argwhere(~inside & (a != 0.0))
    shift = np.zeros(int(part.max(initial=-1)) + 1, dtype=np.int64)
    while True:  # the longest path through parts, which has no circle
        before = shift.copy()
        for i, j in one_way:
            shift[part[i]] = max(shift[part[i]], shift[part[j]] + excess[i, j])
        if np.array_equal(before, shift):
            break
    return np.asarray(power + shift[part])


def exponents(a: Array, b: Array, c: Array) -> Exponents:
    """Return k (n,), so that with T = diag(2^k) rows and columns of [[T^-1 A T, T^-1 B], [C T, 0]] are of like size.

    The units of inputs and outputs do not matter.

    Source: E. E. Osborne, J. ACM 7 (1960) 338; the stopping rule of LAPACK's gebal.
    """
    n = len(a)
    off, inward, outward = np.abs(a), np.abs(b), np.abs(c)
    off[np.arange(n), np.arange(n)] = 0.0
    total = np.zeros(n, dtype=np.int64)
    # speeds that no scaling changes: entries that follow ports become small in chains that run one way only
    speed = max(float(np.sqrt((off * off.T).max(initial=0.0))), float(np.abs(a.diagonal()).max(initial=0.0)))
    size = PORTS * (speed or float(off.max(initial=0.0)) or 1.0)
    for _ in range(ROUNDS):
        # inputs and outputs have other units: they only matter for states that A does not connect
        for ports, axis in ((inward, 0), (outward, 1)):
            largest = ports.max(axis=axis, keepdims=True, initial=0.0)
            ports *= size / np.where(largest == 0.0, 1.0, largest)
        with np.errstate(over="ignore"):
            if not _sweep(off, inward, outward, total):
                break
    return total + _unconnected_parts(off, inward, outward)


def _unconnected_parts(off: Array, inward: Array, outward: Array) -> Exponents:
    """Exponents of parts that A does not connect: input and output gains of each part are made equal."""
    part = part_numbers(off != 0.0)
    count = int(part.max(initial=-1)) + 1
    into, out = np.zeros(count), np.zeros(count)
    np.maximum.at(into, part, inward.max(axis=1, initial=0.0))
    np.maximum.at(out, part, outward.max(axis=0, initial=0.0))
    known = (into > 0.0) & (out > 0.0)
    power = np.zeros(count, dtype=np.int64)
    power[known] = np.round(0.5 * np.log2(into[known] / out[known])).astype(np.int64)
    result: Exponents = power[part]
    return result


def _sweep(off: Array, inward: Array, outward: Array, total: Exponents) -> bool:
    changed = False
    for i in range(len(off)):
        column, row = (math.sqrt(own.dot(own) + ports.dot(ports))
                       for own, ports in ((off[:, i], outward[:, i]), (off[i], inward[i])))  # fmt: skip
        if not (column and row and column + row < math.inf):
            continue
        exponent = round(0.5 * (math.log2(row) - math.log2(column)))
        if exponent and column * 2.0**exponent + row * 2.0**-exponent < GAIN * (column + row):
            off[:, i] = np.ldexp(off[:, i], exponent)
            outward[:, i] = np.ldexp(outward[:, i], exponent)
            off[i] = np.ldexp(off[i], -exponent)
            inward[i] = np.ldexp(inward[i], -exponent)
            total[i] += exponent
            changed = True
    return changed
