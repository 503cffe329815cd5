"""Responses of first-order equations x' = A x + B u, y = C x + D u.

States are scaled by powers of two first. One Schur form serves all frequencies; solutions are refined until their
residual is rounding.

How poles and gains of x' = A x + B u, y = C x + D u change with the entries of [A B; C D].

d lambda = l^H dA r / l^H r of a simple pole with eigenvectors l, r;  d sigma = Re(u^H dG v) of a simple singular value
with u, v, and dG = [C R 1] d[A B; C D] [R B; 1], R = (i w - A)^-1.

Source: Magnus & Neudecker, Matrix Differential Calculus (1999), chapter 8.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.linalg import eig, schur

from mbsvib.common.arrays import Array, Bools, Complex
from mbsvib.common.expected import angular, reals
from mbsvib.common.memory import BATCH_BYTES
from mbsvib.errors import ResponseError
from mbsvib.linalg.balancing import exponents, scaled_by
from mbsvib.linalg.lasting import Separation
from mbsvib.linalg.rank import EPS
from mbsvib.responses.energy_schur import triangular_solutions
from mbsvib.responses.time_response import checked_record, stepped

Matrices = tuple[Array, Array, Array, Array]


REFINEMENTS = 3
FEW = 60_000  # numbers of all matrices up to which one factorization a point costs less than substitution in a loop
# A right-hand side below this many roundings of the terms of (s - A) x is rounding: s is a pole.
SINGULAR = 4.0


@dataclass(frozen=True, slots=True, eq=False)
class FirstOrderSolver:
    """A with states scaled by 2^``power``, and its Schur form ``vectors`` ``triangle`` vectors^H."""

    name: str
    a: Array
    power: NDArray[np.int64]
    triangle: Complex
    vectors: Complex

    def frequency_response(self, omega: ArrayLike, b: Array, c: Array, d: Array) -> Complex:
        """Return G(i w) = C (i w - A)^-1 B + D, (outputs, inputs, n), at ``omega`` (n,) [rad/s]."""
        w = angular(omega)
        observed = np.ldexp(c, self.power)
        result: Complex = np.empty((len(c), b.shape[1], len(w)), dtype=complex)
        for part, x in self.states(np.asarray(1j * w, dtype=complex), w, b):
            result[:, :, part] = np.tensordot(observed, x, axes=1) + d[:, :, None]
        result.imag[:, :, w == 0.0] = 0.0
        return result

    def bounded(self, s: Complex, w: Array, space: tuple[Array, Array, Array]) -> tuple[Complex, Array]:
        """Return G = C (s - A)^-1 B + D and the size of its terms |C| |x| + |D|, both (outputs, inputs, n).

        ``s`` (n,): points, those of the angular frequencies ``w`` (n,) [rad/s]. ``space``: B, C and D.
        """
        b, c, d = space
        observed = np.ldexp(c, self.power)
        result: Complex = np.empty((len(c), b.shape[1], len(s)), dtype=complex)
        size = np.empty(result.shape)
        for part, x in self.states(s, w, b):
            result[:, :, part] = np.tensordot(observed, x, axes=1) + d[:, :, None]
            size[:, :, part] = np.tensordot(np.abs(observed), np.abs(x), axes=1) + np.abs(d)[:, :, None]
        return result, size

    def states(self, s: Complex, w: Array | Complex, b: Array | Complex) -> Iterator[tuple[slice, Complex]]:
        """Return (s - A)^-1 B in scaled states, (states, inputs, points), for batches of points ``s`` (n,).

        ``w`` (n,): their angular frequencies [rad/s]. ``b`` (states, inputs), or (states, inputs, n) if it differs from
        point to point, in scaled states then.
        """
        right = np.ldexp(b, -self.power[:, None]) if b.ndim == 2 else b
        batch = max(1, BATCH_BYTES // (64 * max(1, right.shape[0] * right.shape[1])))
        for start in range(0, len(s), batch):
            part = slice(start, start + batch)
            loads = right[:, :, None] if right.ndim == 2 else right[:, :, part]
            with np.errstate(invalid="ignore", over="ignore"):  # next to a pole, which is refused
                x = self._solved(s[part], loads)
                pole = np.flatnonzero(~np.isfinite(x).all(axis=(0, 1)) | self._singular(s[part], loads, x))
            if len(pole):
                _refuse_pole(w, start + int(pole[0]), self.name)
            yield part, x

    def _solved(self, s: Complex, right: Array | Complex) -> Complex:
        """(s - A)^-1 right, shape (states, inputs, n); ``right`` (states, inputs, n or 1)."""
        wide = np.broadcast_to(right, (*right.shape[:2], len(s))).astype(complex)
        x = self._once(s, wide)
        for _ in range(REFINEMENTS):
            residual = wide - (s * x - np.tensordot(self.a, x, axes=1))
            small = np.abs(residual) <= EPS * (np.abs(s * x) + np.tensordot(np.abs(self.a), np.abs(x), axes=1))
            if small.all() or not np.isfinite(residual).all():
                break
            x = x + self._once(s, residual)
        return x

    def _once(self, s: Complex, right: Complex) -> Complex:
        n, columns, count = right.shape
        if count * n * n <= FEW:
            try:
                x = np.linalg.solve(s[:, None, None] * np.eye(n) - self.a, right.transpose(2, 0, 1))
                return np.asarray(x.transpose(1, 2, 0))
            except np.linalg.LinAlgError:  # at a pole: the triangle tells at which point
                pass
        inside = (self.vectors.conj().T @ right.reshape(n, columns * count)).reshape(n, columns, count)
        x = triangular_solutions(self.triangle, inside, s)
        return np.asarray((self.vectors @ x.reshape(n, columns * count)).reshape(n, columns, count))

    def _singular(self, s: Complex, right: Array | Complex, x: Complex) -> Bools:
        """Whether a change of A and s by rounding alone makes up for a whole right-hand side, for each point."""
        terms = np.abs(s * x) + np.tensordot(np.abs(self.a), np.abs(x), axes=1)
        cancelled = np.asarray((np.abs(right) <= SINGULAR * len(self.a) * EPS * terms).all(axis=0))
        return np.asarray((cancelled & np.asarray(right.any(axis=0))).any(axis=0))


def first_order_solver(a: Array, b: Array, c: Array, name: str) -> FirstOrderSolver:
    """Return the solver of first-order equations ``a`` (n, n), ``b`` (n, inputs), ``c`` (outputs, n)."""
    power = exponents(a, b, c)
    scaled = np.ldexp(a, power[None, :] - power[:, None])
    triangle, vectors = schur(scaled, output="complex") if len(a) else (scaled.astype(complex),) * 2
    return FirstOrderSolver(name, scaled, power, triangle, vectors)


def check_poles(omega: ArrayLike, parts: Separation, name: str) -> None:
    """Refuse frequencies ``omega`` (n,) [rad/s] that rounding cannot tell from poles that responses contain."""
    w = angular(omega)
    for group in parts.shown:
        pole = np.flatnonzero((np.abs(1j * w[:, None] - group.part.poles) <= group.part.errors[0]).any(axis=1))
        if len(pole):
            _refuse_pole(w, int(pole[0]), name)


def _refuse_pole(w: Array | Complex, at: int, name: str) -> None:
    raise ResponseError(f"frequency_response: omega[{at}] = {w[at]:g} rad/s is a pole of '{name}', where the response "
                        f"is infinite; leave this frequency out.")  # fmt: skip


def decaying_response(parts: Separation, d: Array, name: str) -> Callable[[ArrayLike], Complex]:
    """Return the frequency response (outputs, inputs, n) of the part that decays, with the feedthrough ``d``."""
    part = parts.decaying
    solver = first_order_solver(part.a, part.b, part.c, name)
    return lambda omega: solver.frequency_response(omega, part.b, part.c, d)


def time_response(
    space: tuple[Array, Array, Array, Array], inputs: Sequence[str],
    record: tuple[ArrayLike, ArrayLike, str, ArrayLike | None],
) -> Array:  # fmt: skip
    """Return outputs (outputs, n) of A, B, C, D; exact for inputs that are held or linear between samples.

    ``record``: times (n,) [s], inputs (inputs, n), hold "first" or "zero", and initial states (states,) or None.
    """
    a, b, c, d = space
    t, u, hold, initial = record
    time, samples = checked_record(inputs, t, u, hold)
    start = np.zeros(len(a)) if initial is None else _start(initial, len(a))
    if not len(a):
        return np.asarray(d @ samples)
    power = exponents(a, b, c)
    a, b, c = scaled_by(power, a, b, c)
    return np.asarray(c @ stepped(a, b, np.ldexp(start, -power), (time, samples, hold == "first")) + d @ samples)


def _start(initial: Any, n: int) -> Array:
    start = reals(initial, "time_response", "initial", "states at t[0]")
    if start.shape != (n,) or not np.isfinite(start).all():
        raise ResponseError(f"time_response: initial has shape {start.shape}; expected {n} finite states at t[0].")
    return start


def pole_slope(a: Array, number: Callable[[Complex], int]) -> tuple[complex, Complex]:
    """Return a pole, the one whose ``number`` among all (n,) a function tells, and its derivatives to A (n, n)."""
    values, left, right = eig(a, left=True)
    k = int(number(values))
    y, x = left[:, k].conj(), right[:, k]
    return complex(values[k]), np.asarray(np.outer(y, x) / (y @ x or np.finfo(float).eps))


def gain_slope(
    space: Matrices, w: float, weight: Array | Complex | None = None,
    norm: Callable[[Complex], tuple[float, Complex, Complex]] | None = None,
) -> tuple[float, Array]:  # fmt: skip
    """Return the largest singular value of W G(i w), and its derivatives to the entries of [A B; C D].

    ``w``: angular frequency, inf for D. ``weight`` W (rows, outputs) or (1, 1), the same for all; default: 1. ``norm``:
    function in place of the largest singular value, with factors N, P of its slopes: d norm = Re tr(P N d(W G)).
    """
    a, b, c, d = space
    n, one = len(a), np.eye(len(c))
    w_out = one if weight is None else np.asarray(weight) * one if np.size(weight) == 1 else np.asarray(weight)
    x = np.zeros((n, b.shape[1]), dtype=complex)
    inside = 1j * w * np.eye(n) - a if np.isfinite(w) else np.eye(n)
    if np.isfinite(w):
        x = np.linalg.solve(inside, b.astype(complex))
    value, rows, columns = (norm or _largest)(np.asarray(w_out @ (c @ x + d), dtype=complex))
    rows = rows @ w_out
    left = np.linalg.solve(inside.T, c.T @ rows.T) if np.isfinite(w) else np.zeros((n, len(rows)))
    return value, (np.concatenate((left, rows.T)) @ np.concatenate((x @ columns, columns)).T).real


def _largest(g: Complex) -> tuple[float, Complex, Complex]:
    u, s, vh = np.linalg.svd(g)
    return float(s[0]), u[:, :1].conj().T, vh[:1].conj().T
