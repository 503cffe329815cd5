"""A mean square that no values within limits exceed: energy against dissipation of a passive mechanism.

M q'' + C q' + K q = B w,  y = Cq q + Cv q',  w white noise of intensity 1:

A X + X A^T + B B^T <= 0  with  X = tau diag(K^-1, M^-1)  if  2 tau C >= B B^T,  so that
E[y^2] <= tau (Cq K^-1 Cq^T + Cv M^-1 Cv^T)

M, C and K are affine in the parameters, M0 + sum of x_k M_k with |x_k| <= 1, and so at least M0 - sum of |M_k|; what is
convex in B, Cq and Cv is largest at vertices. The bound is reached by one mode, and where noise is in proportion to
damping. It does not depend on how close or how lightly damped the modes are. What noise does not reach, or the output
does not see, is left out where nothing connects it.

Source: Lyapunov's theorem, Zhou, Doyle & Glover, Robust and Optimal Control (1996), section 3.8, with the covariance of
mechanisms in thermal equilibrium; R. Kubo, Rep. Prog. Phys. 29 (1966) 255.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import product
from typing import Any

import numpy as np
from numpy.typing import NDArray

from mbsvib.common.arrays import Array, Index
from mbsvib.common.expected import kind_of
from mbsvib.linalg.groups import part_numbers
from mbsvib.linalg.rank import ZERO_RATE
from mbsvib.responses.densities import Shaped
from mbsvib.uncertain.blocks import Block
from mbsvib.uncertain.search import peak_of

CORNERS = 8  # parameters in which inputs and outputs may change
ROUNDING = 1e-9  # share by which the bound is above what is computed


@dataclass(frozen=True, eq=False)
class Affine:
    """A matrix in the ``middle`` of a box, and its changes ``halves`` to the ends of each parameter."""

    middle: Array
    halves: list[Array]

    @classmethod
    def of(cls, nominal: Array, left: Array, right: Array, parameters: Sequence[Block]) -> Affine:
        """Return ``nominal`` + ``left`` delta ``right`` within the limits of parameters."""
        middle, halves, at = nominal.copy(), [], 0
        for block in parameters:
            own, (low, high) = slice(at, at + block.repetitions), block.changes
            slope, at = left[:, own] @ right[own], own.stop
            middle += 0.5 * (low + high) * slope
            halves.append(0.5 * (high - low) * slope)
        return cls(middle, halves)

    def within(self, rows: Index, columns: Index) -> Affine:
        """Return some rows and columns."""
        part = np.ix_(rows, columns)
        return Affine(self.middle[part], [half[part] for half in self.halves])

    @property
    def entries(self) -> NDArray[np.bool_]:
        """Which entries are not 0 everywhere."""
        return np.asarray(np.any([part != 0.0 for part in (self.middle, *self.halves)], axis=0), dtype=np.bool_)

    @property
    def size(self) -> float:
        """The largest entry."""
        return max(float(np.abs(part).max(initial=0.0)) for part in (self.middle, *self.halves))

    @property
    def skew(self) -> float:
        """The largest entry of what is not symmetric."""
        return max(float(np.abs(part - part.T).max(initial=0.0)) for part in (self.middle, *self.halves))

    @property
    def least(self) -> Array:
        """A symmetric matrix that the symmetric part is not below anywhere."""
        result = 0.5 * (self.middle + self.middle.T)
        for half in self.halves:
            values, vectors = np.linalg.eigh(0.5 * (half + half.T))
            result = result - (vectors * np.abs(values)) @ vectors.T
        return result

    def largest(self, function: Callable[[Array], float]) -> float:
        """The largest value of a convex function."""
        moving = [half for half in self.halves if half.any()]
        return max(function(self.middle + sum(x * half for x, half in zip(signs, moving, strict=True)))
                   for signs in product((-1.0, 1.0), repeat=len(moving)))  # fmt: skip


def energy_bound(
    linear: Any, parameters: Sequence[Block], output: str, sources: Sequence[str], filters: Sequence[Shaped]
) -> float:  # fmt: skip
    """Return a mean square of an output that no values exceed, infinite where there is no such proof, as of loops.

    ``linear``: the system with the inputs and outputs of changes first. Filtered noise counts as white noise of its
    highest density.
    """
    if kind_of(linear) != "system" or not set(sources) <= set(linear.inputs):
        return np.inf
    r = sum(block.repetitions for block in parameters)
    u, y = [linear.inputs.index(name) for name in sources], [linear.outputs.index(output)]
    into, out, seen = linear.B[:, :r], linear.D[y][:, :r], linear.D[:r, u]
    m, c, k = (Affine.of(base, -into, rows[:r], parameters) for base, rows in
               ((linear.M, linear.Ca), (linear.C, linear.Cv), (linear.K, linear.Cq)))  # fmt: skip
    b = Affine.of(linear.B[:, u], into, seen, parameters)
    cq, cv, ca = (Affine.of(rows[y], out, rows[:r], parameters) for rows in (linear.Cq, linear.Cv, linear.Ca))
    through = Affine.of(linear.D[np.ix_(y, u)], out, seen, parameters)
    varied = max(sum(bool(half.any()) for half in part.halves) for part in (b, cq, cv))
    if linear.D[:r, :r].any() or ca.size or through.size or k.skew > ZERO_RATE * k.size or varied > CORNERS:
        return np.inf
    number = part_numbers(np.any([part.entries for part in (m, c, k)], axis=0))
    kept = np.flatnonzero(np.isin(number, number[b.entries.any(axis=1)]) &
                          np.isin(number, number[(cq.entries | cv.entries)[0]]))  # fmt: skip
    every, one = np.arange(len(u)), np.arange(1)
    m, c, k = (part.within(kept, kept) for part in (m, c, k))
    b, cq, cv = b.within(kept, every), cq.within(one, kept), cv.within(one, kept)
    try:
        low = [np.linalg.cholesky(part.least) for part in (m, c, k)]
    except np.linalg.LinAlgError:
        return np.inf
    levels = [np.sqrt(0.5 * f.level) * (float(peak_of((f.a, f.b, f.c, np.array([[f.d]]))).value) if len(f.a) else
                                        abs(f.d)) for f in filters]  # fmt: skip
    tau = 0.5 * b.largest(lambda at: float(np.linalg.norm(np.linalg.solve(low[1], at * levels), 2)) ** 2)
    position = cq.largest(lambda at: float(np.square(np.linalg.solve(low[2], at.T)).sum()))
    speed = cv.largest(lambda at: float(np.square(np.linalg.solve(low[0], at.T)).sum()))
    return float((1.0 + ROUNDING) * tau * (position + speed))
