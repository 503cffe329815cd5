"""Outputs that are tiny compared with the motions: if a sum over modes is inaccurate, they are computed by refinement.

Modes are accurate to rounding of the largest amplitudes. An output of 1e-12 of these (the slip of a joint that a strong
damper nearly locks, the force in a soft spring far below resonance) then has four digits. A bound of this rounding,
evaluated at a few frequencies, shows which entries may have less than six digits. The bound is pessimistic: most have
eight or more. Most of the doubtful entries are zeros, for example by symmetry, and their values are rounding of the
model's own numbers (``rounding``). Entries that exceed this are computed again from the equations (``refined``), in the
columns and at the frequencies concerned.
"""

from __future__ import annotations

import warnings
from typing import TYPE_CHECKING, Any

import numpy as np

from mbsvib.errors import AccuracyWarning
from mbsvib.linalg.products import product
from mbsvib.linalg.rank import EPS, ZERO_RESPONSE
from mbsvib.responses.refined import Factors, Refined, refined
from mbsvib.responses.rounding import differentiated

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from mbsvib.common.arrays import Array, Bools, Complex
    from mbsvib.equations.equations import Equations
    from mbsvib.modes.damped import Damped
    from mbsvib.responses.basis import Basis

    Solver = Callable[[Array], Callable[[Complex], Complex]]

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


def _motions(basis: Basis, modal: Damped, w: Array, solve: Callable[[Complex], Complex]) -> Complex:
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
