"""Frequency responses in twice the working precision, from the factors of the matrices.

The residual of the equations,

    r = B u - D^T (k + i w c) D q + w^2 W^T W q,

is computed in twice the working precision, and q is corrected by a solution in working precision, which is itself
refined by its residual. This is repeated until the outputs converge: then also outputs that nearly cancel in a sum over
modes or coordinates are accurate. If bodies are many and coordinates few, W^T W is formed in advance, also in twice the
working precision.

Outputs that are tiny compared with the motions: if a sum over modes is inaccurate, they are computed by refinement.

Modes are accurate to rounding of the largest amplitudes. An output of 1e-12 of these (the slip of a joint that a strong
damper nearly locks, the force in a soft spring far below resonance) then has four digits. A bound of this rounding,
evaluated at a few frequencies, shows which entries may have less than six digits. The bound is pessimistic: most have
eight or more. Most of the doubtful entries are zeros, for example by symmetry, and their values are rounding of the
model's own numbers (``rounding``). Entries that exceed this are computed again from the equations (``refined``), in the
columns and at the frequencies concerned.
"""

from __future__ import annotations

import warnings
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from mbsvib.common.arrays import Array, Bools, Complex
from mbsvib.equations.equations import Equations
from mbsvib.errors import AccuracyWarning
from mbsvib.linalg.double_double import DoubleDouble, Sliced, double_double
from mbsvib.linalg.products import product
from mbsvib.linalg.rank import EPS, ZERO_RESPONSE
from mbsvib.modes.damped import Damped
from mbsvib.responses.basis import Basis
from mbsvib.responses.rounding import differentiated

Solve = Callable[[Complex], Complex]
Solver = Callable[[Array], Solve]


# Corrections stop if outputs change by less than the first number times themselves, or the second number times the
# value that the largest motion may give them.
STILL, LAST = 1e-14, 1e-28
STEPS = 12


@dataclass(frozen=True, slots=True)
class Refined:
    """Transfer functions (outputs, loads, n), their change by the last correction and the magnitude of their terms;
    values below ``floor`` are rounding. Motions q (m, loads, n), and ``exact``, which ``rows`` multiply.
    """

    value: Complex
    change: Array
    size: Array
    floor: Array
    motion: Complex
    rows: Array
    exact: DoubleDouble

    @property
    def relative_motion(self) -> Complex:
        """Relative motions along the rows, (rows, loads, n)."""
        return _complex(Sliced.of(self.rows).product(self.exact).high)


@dataclass(frozen=True, slots=True)
class Factors:
    """Rows of springs and dampers and, below, of inertia, and their factors (rows, n): k or -w^2, the latter with its
    digits beyond a double as ``low``, and i w c for dampers, on the first rows only.
    """

    rows: Array
    stiffness: Array
    low: Array
    damping: Array
    w: Array

    @staticmethod
    def of(system: Equations, w: Array) -> Factors:
        """Return the factors of a system at the angular frequencies ``w`` (n,) [rad/s]."""
        used = (system.row_stiffness != 0.0) | (system.row_damping != 0.0)
        inertia = system.inertia_factor[system.inertia_factor.any(axis=1)]
        square = double_double(w).times(double_double(w))
        springs = int(np.count_nonzero(used))
        stiffness = np.empty((springs + len(inertia), len(w)))
        stiffness[:springs], stiffness[springs:] = system.row_stiffness[used][:, None], -square.high
        low = np.zeros_like(stiffness)
        low[springs:] = -square.low
        rows = np.concatenate((system.elastic_rows[used], inertia))
        return Factors(rows, stiffness, low, system.row_damping[used], w)

    def force(self) -> Callable[[DoubleDouble], DoubleDouble]:
        """Return the function that maps D q to (k + i w c) D q and W q to -w^2 W q, (rows, loads, n, 2)."""
        stiff = DoubleDouble(_doubled(self.stiffness), _doubled(self.low))
        damped = len(self.damping) if self.damping.any() else 0
        brake = double_double(_doubled(np.broadcast_to(self.w, (damped, len(self.w)))))
        brake = brake.times(double_double(self.damping[:damped, None, None, None]))

        def of(motion: DoubleDouble) -> DoubleDouble:
            result = motion.times(stiff)
            if damped:
                part = DoubleDouble(result.high[:damped], result.low[:damped])
                part += DoubleDouble(motion.high[:damped], motion.low[:damped]).times_i().times(brake)
                result.high[:damped], result.low[:damped] = part.high, part.low
            return result

        return of

    def ordinary(self) -> Callable[[Complex], Complex]:
        """Return the same in working precision, for relative motions (rows, loads, n)."""
        strength: Complex = self.stiffness.astype(complex)
        strength.imag[: len(self.damping)] = self.damping[:, None] * self.w
        return lambda motion: motion * strength[:, None]

    def size(self) -> Array:
        """Return |k + i w c| and w^2, (rows, n)."""
        result: Array = np.abs(self.stiffness)
        if self.damping.any():
            elastic = slice(len(self.damping))
            result[elastic] = np.hypot(result[elastic], self.damping[:, None] * self.w)
        return result


def refined(
    factors: Factors, shapes: Array, load: Complex, outputs: tuple[list[tuple[int, Array]], Array], solve: Solve
) -> Refined:
    """Return transfer functions from solutions in twice the working precision.

    ``shapes`` (m, m): basis of the solutions, normalised by mass. ``load`` (m, loads, n): right-hand sides.
    ``outputs``: orders of differentiation with their rows (outputs, m), and the feedthrough. ``solve``: an approximate
    solver for loads in the basis.
    """
    # powers of two make the coordinates comparable without rounding
    scale = np.ldexp(1.0, np.frexp(np.linalg.norm(shapes, axis=1))[1])
    equations = _Equations.of(factors, scale)
    readings = _Outputs(tuple((k, Sliced.of(c * scale), c * scale) for k, c in outputs[0]), outputs[1], factors.w)
    basis = shapes / scale[:, None]

    def correction(residual: Array) -> Array:
        eta = _parts(solve(_complex(product(basis.T, residual))))
        return product(basis, eta)

    b = _parts(scale[:, None, None] * load)
    x, exact = double_double(correction(b)), double_double(b)
    for _ in range(STEPS):
        residual = (exact + -equations.of_motion(x)).high
        first = correction(residual)
        second = correction(residual - equations.of_small(first))
        x += double_double(first + second)
        value, most = readings.of(x), LAST * readings.most(x)
        change = np.abs(readings.change(_complex(second)))
        if (change <= STILL * np.abs(value) + most).all() or not np.isfinite(change).all():
            break
    motion = scale[:, None, None] * _complex(x.high)
    return Refined(value, change, readings.size(x), most, motion, factors.rows * scale, x)


@dataclass(frozen=True, slots=True)
class _Equations:
    """The left-hand side, (k + i w c) and -w^2 by ``factors``; and if bodies are many and coordinates few, the mass
    matrix in twice the working precision, ``mass``, with w^2, ``square``, instead of the rows of inertia.
    """

    factors: Factors
    rows: Array
    cut: Sliced
    columns: Sliced
    force: Callable[[DoubleDouble], DoubleDouble]
    ordinary: Callable[[Complex], Complex]
    mass: DoubleDouble | None
    square: DoubleDouble

    @staticmethod
    def of(factors: Factors, scale: Array) -> _Equations:
        rows, springs, mass = factors.rows * scale, len(factors.damping), None
        square = double_double(_doubled(factors.w[None])).times(double_double(_doubled(factors.w[None])))
        if springs and len(rows) - springs > 2 * len(scale):
            inertia = rows[springs:]
            mass = Sliced.of(np.ascontiguousarray(inertia.T)).product(double_double(inertia))
            few = slice(springs)
            factors = Factors(factors.rows[few], factors.stiffness[few], factors.low[few], factors.damping, factors.w)
            rows = rows[few]
        cut = Sliced.of(rows)
        columns = cut.transposed(rows)
        return _Equations(factors, rows, cut, columns, factors.force(), factors.ordinary(), mass, square)

    def of_motion(self, x: DoubleDouble) -> DoubleDouble:
        """Return the loads that cause a motion."""
        result = self.columns.product(self.force(self.cut.product(x)))
        return result if self.mass is None else result + -Sliced.of(self.mass).product(x).times(self.square)

    def of_small(self, x: Array) -> Array:
        """Return the same in working precision."""
        result = product(self.rows.T, _parts(self.ordinary(_complex(product(self.rows, x)))))
        return result if self.mass is None else result - product(self.mass.high, x) * self.square.high


def _doubled(values: Array) -> Array:
    """Values copied for real and imaginary parts, (rows, 1, n, 2), contiguous for fast sums."""
    return np.repeat(values, 2, axis=-1).reshape(len(values), 1, values.shape[1], 2)


def _parts(values: Complex) -> Array:
    """Real and imaginary parts side by side along a last axis."""
    contiguous: Complex = np.ascontiguousarray(values, dtype=complex)
    return contiguous.view(float).reshape(*values.shape, 2)


def _complex(parts: Array) -> Complex:
    return np.ascontiguousarray(parts).view(complex)[..., 0]


@dataclass(frozen=True, slots=True)
class _Outputs:
    """Rows of the outputs, cut and as they are, by how often they are differentiated."""

    rows: tuple[tuple[int, Sliced, Array], ...]
    direct: Array
    w: Array

    def of(self, x: DoubleDouble) -> Complex:
        start = np.zeros((*self.direct.shape, len(self.w), 2))
        start[..., 0] = self.direct[:, :, None]
        total, w = double_double(start), double_double(_doubled(self.w[None]))
        for order, rows, _ in self.rows:
            part = rows.product(x)
            for _ in range(order):
                part = part.times_i().times(w)
            total = total + part
        return _complex(total.high)

    def change(self, motion: Complex) -> Complex:
        """Changes of the outputs by a change of motions, in working precision."""
        result: Complex = np.zeros((*self.direct.shape, len(self.w)), dtype=complex)
        for order, _, rows in self.rows:
            result += _complex(product(rows, _parts(motion))) * (1j * self.w) ** order
        return result

    def size(self, x: DoubleDouble) -> Array:
        return self._sum(np.abs(_complex(x.high)))

    def most(self, x: DoubleDouble) -> Array:
        magnitude = np.abs(_complex(x.high))
        return self._sum(np.broadcast_to(magnitude.max(axis=0), magnitude.shape))

    def _sum(self, magnitude: Array) -> Array:
        result = np.broadcast_to(np.abs(self.direct)[:, :, None], (*self.direct.shape, len(self.w))).copy()
        for order, _, rows in self.rows:
            result += product(np.abs(rows), magnitude) * self.w**order
        return result


# A response is zero if an error of this many eps in every number of the model changes it by more than its value.
LEFT = 64.0
# Entries whose error bound exceeds this part of their value are computed again.
DIGITS = 1e-6
# An entry that the last correction changes by more than this part of its value is zero.
RESTLESS = 1e-3
PROBES, CLOSER = 8, 4
# Arrays of this size stay in the cache.
BATCH_BYTES = 2**16


def recomputed(basis: Basis, modal: Damped, w: Array, responses: tuple[Complex, bool], solver: Solver) -> Complex:
    """Return the responses (outputs, inputs, n); those that may be inaccurate are computed again from the equations.

    ``w`` (n,) [rad/s]: none negative. ``responses``, and whether they are sums over modes. ``solver``: takes
    frequencies (k,) and returns a solver of the equations in the basis for loads (m, inputs, k).
    """
    system = basis.equations
    value, by_modes = responses
    if not value.size or not system.dof:
        return value
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        entries = _entries(basis, modal, w, responses, solver)
        if not entries.any():
            return value
        limit = basis.rounding.at(w, by_modes)
        inaccurate = (limit > DIGITS * np.abs(value)) & entries[:, :, None]
        result, failed = value.copy(), np.zeros_like(inaccurate)
        at = np.flatnonzero(inaccurate.any(axis=(0, 1)))
        batch = max(1, BATCH_BYTES // (16 * len(system.elastic_rows) * len(system.inputs)))
        for start in range(0, len(at), batch):
            part = at[start : start + batch]
            columns = np.flatnonzero(inaccurate[:, :, part].any(axis=(0, 2)))
            block = np.ix_(np.arange(len(value)), columns, part)
            new = _forward(system, modal, w[part], solver, columns)
            better = new.change + EPS * new.size <= limit[block]
            result[block] = np.where(inaccurate[block] & better, new.value, value[block])
            failed[block] = inaccurate[block] & ~(new.change <= limit[block])
    result.imag[:, :, w == 0.0] = 0.0
    _warn(system, w, failed)
    return result


def vanishing(basis: Basis, modal: Damped, w: Array, value: Complex, solver: Solver) -> Bools:
    """Return which responses (outputs, inputs) have no digit that the numbers of the model determine.

    ``value`` (outputs, inputs, n): responses at frequencies ``w`` (n,) [rad/s], none negative.
    """
    changes = basis.rounding_changes[1].at(w, _motions(basis, modal, w, solver(w)))
    return np.asarray((np.abs(value) <= ZERO_RESPONSE * changes).all(axis=2))


def _entries(basis: Basis, modal: Damped, w: Array, responses: tuple[Complex, bool], solver: Solver) -> Bools:
    """Entries (outputs, inputs) that are in doubt at some of the frequencies, and exceed rounding there."""
    system = basis.equations
    many = len(w) > PROBES
    probes = np.arange(PROBES) * (len(w) - 1) // (PROBES - 1) if many else np.arange(len(w))
    value, at = np.abs(responses[0][:, :, probes]), w[probes]
    inaccurate: Bools = basis.rounding.at(at, responses[1]) > DIGITS * value
    result: Bools = np.asarray(inaccurate.any(axis=2))
    if not result.any():
        return result
    (quick, all_numbers), motions = basis.rounding_changes, _motions(basis, modal, at, solver(at))
    inaccurate &= value > LEFT * EPS * quick.at(at, motions)
    if quick is not all_numbers and inaccurate.any():
        inaccurate &= value > LEFT * EPS * all_numbers.at(at, motions)
    result = np.asarray(inaccurate.any(axis=2))
    if result.any():
        frequencies = np.flatnonzero(inaccurate.any(axis=(0, 1)))
        at = w[probes[frequencies[np.unique(np.linspace(0, len(frequencies) - 1, CLOSER).astype(int))]]]
        solution, inputs = _both(system, modal, at, solver), len(system.inputs)
        value, changes, floor = (a[:, :inputs] for a in (np.abs(solution.value), solution.change, solution.floor))
        change = all_numbers.at(at, solution.motion, solution.relative_motion)
        result &= (value > np.maximum(LEFT * EPS * change, np.maximum(changes / RESTLESS, floor))).any(axis=2)
    return result


def _motions(basis: Basis, modal: Damped, w: Array, solve: Solve) -> Complex:
    """Forward and adjoint motions (m, inputs + outputs, n), in working precision."""
    return product(modal.shapes, solve(_loads(basis.rounding.b, basis.rounding.outputs, w)))


def _loads(b: Array, outputs: Sequence[tuple[int, Array]], w: Array) -> Complex:
    """Columns (m, inputs + outputs, n) of B and of Cq^T + i w Cv^T - w^2 Ca^T."""
    m, inputs = b.shape
    result: Complex = np.zeros((m, inputs + len(outputs[0][1]) if outputs else inputs, len(w)), dtype=complex)
    result[:, :inputs] = b[:, :, None]
    for order, c in outputs:
        result[:, inputs:] += c.T[:, :, None] * (1j * w) ** order if order else c.T[:, :, None]
    return result


def _forward(system: Equations, modal: Damped, w: Array, solver: Solver, inputs: Any = slice(None)) -> Refined:
    outputs = differentiated(system), system.D[:, inputs]
    return refined(Factors.of(system, w), modal.shapes, _loads(system.B[:, inputs], [], w), outputs, solver(w))


def _both(system: Equations, modal: Damped, w: Array, solver: Solver) -> Refined:
    """Responses to the inputs and, after them, to the adjoint loads of the outputs."""
    rows = differentiated(system)
    direct = np.concatenate((system.D, np.zeros((len(system.D), len(system.D)))), axis=1)
    return refined(Factors.of(system, w), modal.shapes, _loads(system.B, rows, w), (rows, direct), solver(w))


def _warn(system: Equations, w: Array, failed: Bools) -> None:
    if failed.any():
        i, j, k = (int(v) for v in np.argwhere(failed)[0])
        warnings.warn(
            f"frequency_response of {system.name}: {system.outputs[i]!r} is so small compared with the "
            f"motions due to {system.inputs[j]!r} at {w[k]:g} rad/s that it may be rounding only; its refinement does "
            f"not converge ({np.count_nonzero(failed)} such values in total).", AccuracyWarning, stacklevel=4,
        )  # fmt: skip
