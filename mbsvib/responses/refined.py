"""Frequency responses to twice the digits, from the factors of the matrices.

The residual of the equations,

    r = B u - D^T (k + i w c) D q + w^2 W^T W q,

is computed with numbers of twice the digits, and q corrected by a solution in ordinary ones until the outputs stand
still: what a sum of modes or of coordinates all but cancels is there then.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from mbsvib.responses.twofold import Sliced, Twofold, twofold

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray

    from mbsvib.system import System

    Array = NDArray[np.float64]
    Complex = NDArray[np.complex128]
    Solver = Callable[[Complex], Complex]

# Corrections stop where outputs move by less than this part of themselves, or of what the largest motion may give them.
STILL, LAST = 1e-14, 1e-28
STEPS = 12


@dataclass(frozen=True, slots=True)
class Refined:
    """Transfer functions (outputs, loads, n), how far the last correction moved them and the size of what they are
    summed from; below ``floor`` even they tell nothing. Motions q (m, loads, n), and D q and W q (rows, loads, n).
    """

    value: Complex
    change: Array
    size: Array
    floor: Array
    motion: Complex
    felt: Complex


@dataclass(frozen=True, slots=True)
class Factors:
    """Rows of springs and dampers and of inertia, one below the other, and what multiplies them, (rows, n)."""

    rows: Array
    stiffness: Array
    damping: Array
    w: Array

    @staticmethod
    def of(system: System, w: Array) -> Factors:
        """Return the factors of a system at the angular frequencies ``w`` (n,) [rad/s]."""
        used = (system.stiffness != 0.0) | (system.damping != 0.0)
        inertia = system.inertia_factor[system.inertia_factor.any(axis=1)]
        springs = np.broadcast_to(system.stiffness[used][:, None], (int(np.count_nonzero(used)), len(w)))
        masses = np.broadcast_to(-w * w, (len(inertia), len(w)))
        damping = np.concatenate((system.damping[used], np.zeros(len(inertia))))
        rows = np.concatenate((system.elastic_rows[used], inertia))
        return Factors(rows, np.concatenate((springs, masses)), damping, w)

    def force(self, felt: Twofold) -> Twofold:
        """Return (k + i w c) D q and -w^2 W q."""
        result = felt.times(self.stiffness[:, None, :, None])
        if self.damping.any():
            brake = felt.turned().times(self.damping[:, None, None, None])
            result = result + brake.times(self.w[:, None])
        return result

    def size(self) -> Array:
        """Return |k + i w c| and w^2, (rows, n)."""
        result: Array = np.hypot(self.stiffness, self.damping[:, None] * self.w)
        return result


def refined(
    factors: Factors, shapes: Array, load: Complex, outputs: tuple[list[tuple[int, Array]], Array], solve: Solver
) -> Refined:
    """Return transfer functions from solutions to twice the digits.

    Parameters
    ----------
    factors : Factors
        The equations.
    shapes : array, shape (m, m)
        Basis of the solutions, normalised by mass.
    load : array, shape (m, loads, n)
        Right-hand sides.
    outputs : pair
        Orders of differentiation with their rows (outputs, m), and what is added, (outputs, loads).
    solve : callable
        Of loads (m, loads, n) in the basis: solutions of the same shape, to some digits.

    Returns
    -------
    Refined
        Values and last corrections.
    """
    # powers of two make the coordinates comparable, and round nothing
    scale = np.ldexp(1.0, np.frexp(np.linalg.norm(shapes, axis=1))[1])
    rows = factors.rows * scale
    cut = Sliced.of(rows)
    columns = cut.transposed(rows)
    seen = _Outputs(tuple((k, Sliced.of(c * scale), np.abs(c * scale)) for k, c in outputs[0]), outputs[1], factors.w)
    basis = shapes / scale[:, None]

    def correction(residual: Array) -> Twofold:
        flat = (basis.T @ residual.reshape(len(residual), -1)).reshape(residual.shape)
        eta = np.ascontiguousarray(solve(flat.view(complex)[..., 0]))
        return twofold((basis @ eta.view(float).reshape(len(eta), -1)).reshape(residual.shape))

    b = _parts(scale[:, None, None] * load)
    x = correction(b)
    value = seen.of(x)
    change = np.full(value.shape, np.inf)
    for _ in range(STEPS):
        x += correction((twofold(b) + -columns.product(factors.force(cut.product(x)))).high)
        new = seen.of(x)
        change, value = np.abs(new - value), new
        if (change <= STILL * np.abs(value) + LAST * seen.most(x)).all() or not np.isfinite(change).all():
            break
    motion, felt = scale[:, None, None] * _whole(x.high), _whole(cut.product(x).high)
    return Refined(value, change, seen.size(x), LAST * seen.most(x), motion, felt)


def _parts(values: Complex) -> Array:
    """Real and imaginary parts side by side along a last axis."""
    whole: Complex = np.ascontiguousarray(values, dtype=complex)
    return whole.view(float).reshape(*values.shape, 2)


def _whole(parts: Array) -> Complex:
    return np.ascontiguousarray(parts).view(complex)[..., 0]


@dataclass(frozen=True, slots=True)
class _Outputs:
    """Rows of the outputs, and their sizes, by how often they are differentiated."""

    rows: tuple[tuple[int, Sliced, Array], ...]
    direct: Array
    w: Array

    def of(self, x: Twofold) -> Complex:
        start = np.zeros((*self.direct.shape, len(self.w), 2))
        start[..., 0] = self.direct[:, :, None]
        total = twofold(start)
        for order, rows, _ in self.rows:
            part = rows.product(x)
            for _ in range(order):
                part = part.turned().times(self.w[:, None])
            total = total + part
        return _whole(total.high)

    def size(self, x: Twofold) -> Array:
        return self._sum(np.abs(_whole(x.high)))

    def most(self, x: Twofold) -> Array:
        moved = np.abs(_whole(x.high))
        return self._sum(np.broadcast_to(moved.max(axis=0), moved.shape))

    def _sum(self, moved: Array) -> Array:
        result = np.broadcast_to(np.abs(self.direct)[:, :, None], (*self.direct.shape, len(self.w))).copy()
        for order, _, sizes in self.rows:
            result += (sizes @ moved.reshape(len(moved), -1)).reshape(result.shape) * self.w**order
        return result
