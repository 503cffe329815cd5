"""One step of each kind of master on exactly discretised equations, and the loop that they all approximate.

The vector between two steps is z = (states of the plant, of the controller, outputs of the plant, of the controller),
and for linear extrapolation the rates of those outputs too. Inputs that are not connected are held: e.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from scipy.linalg import expm

if TYPE_CHECKING:
    from mbsvib.common.arrays import Array


MASTERS = {
    "jacobi": "both FMUs step in parallel, inputs held",
    "gauss-seidel": "the plant steps first, the controller takes its new outputs, inputs held",
    "slopes": "both step in parallel, inputs by linear extrapolation of the outputs",
    "iteration": "steps are repeated until inputs, linear in time, meet the outputs",
}


@dataclass(frozen=True, slots=True)
class Block:
    """x' = A x + B u, y = C x + D u of an FMU, its step: x(h) = phi x + g0 u + g1 u'."""

    A: Array
    B: Array
    C: Array
    D: Array
    phi: Array
    g0: Array
    g1: Array


def discretised(a: Array, b: Array, c: Array, d: Array, h: float) -> Block:
    """Return an FMU's equations with their exact step of ``h`` [s]."""
    n, m = b.shape
    size = np.where(np.abs(b).max(axis=0, initial=0.0) > 0, np.abs(b).max(axis=0, initial=0.0), 1.0)
    big = np.zeros((n + 2 * m, n + 2 * m))
    big[:n, :n], big[:n, n : n + m] = a * h, b / size * h
    big[n : n + m, n + m :] = np.eye(m)
    e = expm(big)
    return Block(a, b, c, d, e[:n, :n], e[:n, n : n + m] * size, e[:n, n + m :] * size * h)


@dataclass(frozen=True, slots=True)
class Loop:
    """Plant and controller with a step ``h``, ``actuate`` and ``measure`` between them, inputs from outside added."""

    plant: Block
    controller: Block
    actuate: Array
    measure: Array
    plant_free: Array
    controller_free: Array
    h: float

    @property
    def sizes(self) -> tuple[int, int, int, int]:
        """Numbers of states and outputs: plant, controller."""
        return (len(self.plant.A), len(self.controller.A), len(self.plant.C), len(self.controller.C))

    def split(self, z: Array) -> list[Array]:
        """Return the parts of z."""
        return np.split(z, np.cumsum(self.sizes))

    def monolithic(self) -> tuple[Array, Array, Array, Array]:
        """Return A, B, C, D of the closed loop with the outputs of both, from the inputs that are free."""
        p, k = self.plant, self.controller
        n, nk, out, outk = self.sizes
        # outputs v = L v + (C x + D e) of both
        inner = np.block([[np.zeros((out, out)), p.D @ self.actuate], [k.D @ self.measure, np.zeros((outk, outk))]])
        c = np.block([[p.C, np.zeros((out, nk))], [np.zeros((outk, n)), k.C]])
        d = np.concatenate((p.D @ self.plant_free, k.D @ self.controller_free))
        solved = np.linalg.solve(np.eye(out + outk) - inner, np.concatenate((c, d), axis=1))
        c, d = solved[:, : n + nk], solved[:, n + nk :]
        into = np.block([[np.zeros((n, out)), p.B @ self.actuate], [k.B @ self.measure, np.zeros((nk, outk))]])
        a = np.block([[p.A, np.zeros((n, nk))], [np.zeros((nk, n)), k.A]]) + into @ c
        b = np.concatenate((p.B @ self.plant_free, k.B @ self.controller_free)) + into @ d
        return a, b, c, d

    def start(self, x: Array, e: Array, slopes: bool) -> Array:
        """Return z at the beginning, all outputs as they follow from states and inputs at once."""
        a, b, c, d = self.monolithic()
        del a, b
        v = c @ x + d @ e
        if not slopes:
            return np.concatenate((x, v))
        n, _, out, _ = self.sizes
        p, k = self.plant, self.controller
        up = self.actuate @ v[out:] + self.plant_free @ e
        uk = self.measure @ v[:out] + self.controller_free @ e
        rate = (p.C @ (p.A @ x[:n] + p.B @ up), k.C @ (k.A @ x[n:] + k.B @ uk))
        return np.concatenate((x, v, *rate))

    def step(self, method: str, z: Array, e: Array) -> Array:
        """Return z after a step of a master; z and e may have columns."""
        p, k = self.plant, self.controller
        xp, xk, y, f, rest = self.split(z)
        up, uk = self.actuate @ f + self.plant_free @ e, self.measure @ y + self.controller_free @ e
        if method == "slopes":
            dy, df = np.split(rest, [len(y)])
            sp, sk = self.actuate @ df, self.measure @ dy
            xp, y, dy = _sloped(p, xp, up, sp, self.h)
            xk, f, df = _sloped(k, xk, uk, sk, self.h)
            return np.concatenate((xp, xk, y, f, dy, df))
        if method == "iteration":
            return self._iterated(xp, xk, y, f, e)
        xp = p.phi @ xp + p.g0 @ up
        y = p.C @ xp + p.D @ up
        if method == "gauss-seidel":
            uk = self.measure @ y + self.controller_free @ e
        xk = k.phi @ xk + k.g0 @ uk
        return np.concatenate((xp, xk, y, k.C @ xk + k.D @ uk))

    def sweep(
        self, xp: Array, xk: Array, y: Array, f: Array, e: Array, guess: Array
    ) -> tuple[Array, Array, Array, Array]:
        """Return states and outputs at the end of a step in which the controller's outputs run from f to a guess."""
        h = self.h
        up, uk = self.actuate @ f + self.plant_free @ e, self.measure @ y + self.controller_free @ e
        xp, y1, _ = _sloped(self.plant, xp, up, self.actuate @ (guess - f) / h, h)
        xk, f1, _ = _sloped(self.controller, xk, uk, self.measure @ (y1 - y) / h, h)
        return xp, xk, y1, f1

    def _iterated(self, xp: Array, xk: Array, y: Array, f: Array, e: Array) -> Array:
        contraction = self.contraction()
        first = self.sweep(xp, xk, y, f, e, np.zeros_like(f))[3]
        end = np.asarray(np.linalg.solve(np.eye(len(f)) - contraction, first), dtype=float)
        return np.concatenate(self.sweep(xp, xk, y, f, e, end))

    def contraction(self) -> Array:
        """Return what one iteration makes of an error of the controller's outputs."""
        n, nk, out, outk = self.sizes
        xp, xk, y, f, e = (np.zeros((size, outk)) for size in (n, nk, out, outk, self.plant_free.shape[1]))
        return self.sweep(xp, xk, y, f, e, np.eye(outk))[3]

    def matrix(self, method: str) -> Array:
        """Return the matrix of a master's step."""
        size = sum(self.sizes) + (sum(self.sizes[2:]) if method == "slopes" else 0)
        return self.step(method, np.eye(size), np.zeros((self.plant_free.shape[1], size)))


def _sloped(block: Block, x: Array, u: Array, slope: Array, h: float) -> tuple[Array, Array, Array]:
    x, end = block.phi @ x + block.g0 @ u + block.g1 @ slope, u + h * slope
    return x, block.C @ x + block.D @ end, block.C @ (block.A @ x + block.B @ end) + block.D @ slope
