"""Beams and superelements over a cycle: the periodic motion of their coordinates under the prescribed one.

Independent elastic coordinates e are driven without force: their motion over the period T is that at which

r = T_e^T (M q'' - f) = 0,  e(t + T) = e(t),  T_e = dq/de

at all samples, with rates and accelerations from the trigonometric interpolation of e. Newton's method solves

M_e d'' + C_e d' + K_e d = -r,  M_e = T_e^T M T_e,  C_e = T_e^T (2 M T_e' + C T_e),
K_e = T_e^T (M T_e'' + C T_e' + K T_e)

with C and K the derivatives of M q'' - f - J^T lambda, by GMRES, preconditioned by the mean of M_e, C_e and K_e in each
harmonic (harmonic balance).

Source: Nayfeh & Mook (1979), Nonlinear Oscillations, section 4.1, for harmonic balance.
"""

from __future__ import annotations

import warnings
from dataclasses import dataclass, replace
from typing import Any

import casadi as ca
import numpy as np
from scipy.linalg import qr
from scipy.sparse.linalg import LinearOperator, gmres

from mbsvib.common.arrays import Array
from mbsvib.cycles.expressions import Statement
from mbsvib.cycles.machine import Machine, Solved
from mbsvib.cycles.prescribed import RESOLVED, Prescribed, period_of
from mbsvib.cycles.total_derivatives import Derivatives, total_derivatives
from mbsvib.errors import AccuracyWarning, ModelError, SingularPoseError
from mbsvib.finite_motion.elastic import warn_of_bending
from mbsvib.finite_motion.evaluation import matrices
from mbsvib.linalg.rank import REDUNDANT_LOOPS

Slopes = tuple[Array, Array, Array]
# Steps of Newton's method at most, and the share of the deflection at which the last one counts as rounding.
STEPS, CONVERGED = 20, 1e-10
# Relative residual of GMRES, and its iterations before a restart, and restarts.
TOLERANCE, KRYLOV, RESTARTS = 1e-11, 150, 4
# Prescribed motions that differ from their harmonics by more than this share do not repeat after the period.
REPEATS = 1e-3


@dataclass(frozen=True)
class Spectral:
    """Derivatives with respect to time of samples (n, ...), evenly spread over the ``period`` [s]."""

    period: float

    def multiplied(self, samples: Array, *factors: Any) -> list[Array]:
        """Return the samples with each harmonic multiplied by factors (harmonics,)."""
        spectrum, n = np.fft.rfft(samples, axis=0), len(samples)
        shape = (-1,) + (1,) * (samples.ndim - 1)
        return [np.fft.irfft(spectrum * factor.reshape(shape), n, axis=0) for factor in factors]

    def rates(self, n: int) -> Array:
        """Return the angular frequencies of the harmonics [rad/s]."""
        return np.asarray(2.0 * np.pi / self.period * np.arange(n // 2 + 1))

    def derivatives(self, samples: Array) -> list[Array]:
        """Return first and second derivatives."""
        n = len(samples)
        w = self.rates(n)
        first = 1j * w
        if n % 2 == 0:
            first[-1] = 0.0
        return self.multiplied(samples, first, -(w**2))


def with_elastic_motion(plant: Machine, period: float | None) -> Machine:
    """Return a machine with the periodic motion of its beams and superelements.

    ``period`` [s]: that over which the samples are evenly spread; default: one turn of a drive at constant speed.
    """
    spectral = Spectral(period_of(plant.motion, period))
    free = _independent(plant)
    _check_repeats(plant, spectral, free)
    e = np.zeros((len(plant.motion.values), len(free)))
    motion = _driven(plant, free, e, spectral).solved
    for _ in range(STEPS):
        forces, slopes = _linearized(plant, motion, spectral, len(free))
        size = np.sqrt(np.abs(np.einsum("nii->ni", slopes[2])).mean(axis=0))
        step = _step(plant, forces, slopes, spectral, size)
        e = e + step
        try:
            motion = _driven(plant, free, e, spectral).solved
        except SingularPoseError as error:
            raise _no_solution(plant) from error
        if np.abs(step * size).max() <= CONVERGED * np.abs(e * size).max():
            break
    else:
        raise _no_solution(plant)
    m = len(plant.motion.names)
    height = np.abs(np.fft.rfft(e * size, axis=0))
    unresolved = float(height[max(1, len(height) - 2) :].max(initial=0.0)) / (float(height.max()) or 1.0)
    if unresolved > RESOLVED:
        warnings.warn(f"cycle: {len(e)} samples leave {unresolved:.1e} of the elastic motion of '{plant.model.name}' "
                      f"to harmonics that they do not resolve; take more.", AccuracyWarning, stacklevel=4)  # fmt: skip
    kinematics = plant.statement.motion.motion
    warn_of_bending("cycle", plant.statement.motion.bends, kinematics, motion.q, kinematics.no_turns, 5)
    known = replace(motion, coefficients=motion.coefficients[:, :, :m], driven=motion.driven[:m])
    return replace(plant, compiled=plant.statement, known=known, period=spectral.period)


def with_elastic_drives(plant: Machine) -> Machine:
    """Return a machine in the same motion with the independent coordinates of its beams among the drives."""
    if plant.period is None:
        return plant
    free, names = _independent(plant), plant.statement.motion.motion.names
    e = plant.solved.q[:, [names.index(name) for name in free]]
    return replace(_driven(plant, free, e, Spectral(plant.period)), period=plant.period)


def with_parameters(plant: Machine, names: tuple[str, ...]) -> Machine:
    """Return a machine in the same motion whose equations have some numbers as symbols.

    Where beams bend in more directions as a number changes, these are among its coordinates.
    """
    statement = plant.with_symbols(names)
    same = statement.motion.motion.names == plant.statement.motion.motion.names
    result = replace(plant, compiled=statement, known=plant.solved if same else None)
    return result if same else with_elastic_motion(result, plant.period)


def parameter_derivatives(plant: Machine) -> Derivatives:
    """Return the derivatives to the parameters of the equations, as which beams bend otherwise.

    d y / dp = y_p + y_e d + y_e' d' + y_e'' d'',  M_e d'' + C_e d' + K_e d = -r_p,  d = de/dp
    """
    extended, names = with_elastic_drives(plant), plant.statement.names
    fixed = total_derivatives(extended, "parameters", names)
    m, k = len(plant.motion.names), len(extended.motion.names) - len(plant.motion.names)
    if not k or not names:
        return fixed
    assert plant.period is not None
    spectral, elastic = Spectral(plant.period), slice(m, m + k)
    marked = [f"{name}{mark}" for mark in ("", "'", "''") for name in extended.motion.names]
    by_drive = total_derivatives(extended, "drives", marked)
    own = [i * (m + k) + m + j for i in range(3) for j in range(k)]
    stiffness, damping, mass = np.split(by_drive.results[:, elastic][:, :, own], 3, axis=2)
    size = np.sqrt(np.abs(np.einsum("nii->ni", stiffness)).mean(axis=0))
    changes = [_step(plant, -right, (mass, damping, stiffness), spectral, size)
               for right in fixed.results[:, elastic].transpose(2, 0, 1)]  # fmt: skip
    change = np.stack(changes, axis=2)
    change = np.concatenate((change, *spectral.derivatives(change)), axis=1)
    results, state = (before + slopes[:, :, own] @ change for before, slopes in
                      ((fixed.results, by_drive.results), (fixed.state, by_drive.state)))  # fmt: skip
    return Derivatives(np.delete(results, elastic, axis=1), state)


def _driven(plant: Machine, free: tuple[str, ...], e: Array, spectral: Spectral) -> Machine:
    """The machine with elastic coordinates (n, k) among its drives."""
    motion = plant.motion
    more = zip((motion.values, motion.rates, motion.accelerations), (e, *spectral.derivatives(e)), strict=True)
    return replace(plant, motion=Prescribed((*motion.names, *free), *(np.hstack(pair) for pair in more)), known=None,
                   compiled=plant.statement)


def _independent(plant: Machine) -> tuple[str, ...]:
    """The elastic coordinates that are left when loops determine all others of the mechanism that are not driven."""
    statement = plant.statement
    kinematics, elastic = statement.motion.motion, statement.elastic
    units, rows = kinematics.scales(plant.size)
    zero = np.zeros(len(units))
    jacobian = statement.compiled("rows", lambda: (ca.densify(ca.jacobian(statement.closures[0], statement.q)),))
    matrix = np.asarray(jacobian(zero, zero, zero, plant.values(statement), plant.about)) * units / rows[:, None]
    index = {name: i for i, name in enumerate(kinematics.names)}
    own = [index[name] for name in elastic]
    others = [i for name, i in index.items() if name not in {*elastic, *plant.motion.names}]
    if not len(matrix):
        return elastic
    basis, sizes, _ = np.linalg.svd(matrix[:, others])
    left = basis[:, int((sizes > REDUNDANT_LOOPS * max(1.0, float(sizes.max(initial=0.0)))).sum()) :]
    _, triangle, order = qr(left.T @ matrix[:, own], mode="economic", pivoting=True)
    dependent = {elastic[i] for i, value in zip(order, np.abs(np.diagonal(triangle)), strict=False)
                 if value > REDUNDANT_LOOPS}  # fmt: skip
    return tuple([name for name in elastic if name not in dependent])


def _linearized(plant: Machine, motion: Solved, spectral: Spectral, k: int) -> tuple[Array, Slopes]:
    """-r (n, k), and M_e, C_e and K_e (n, k, k), at a motion."""
    expressions = plant.statement
    function = expressions.compiled("balance", lambda: _balance(expressions))
    p = plant.values(expressions)
    required, jacobian = matrices(function, motion.q, motion.qd, motion.qdd, p, plant.about)
    rest = np.setdiff1d(np.arange(jacobian.shape[2]), motion.driven[: len(plant.motion.names)])
    inverse = np.linalg.pinv(jacobian[:, :, rest].transpose(0, 2, 1), rcond=REDUNDANT_LOOPS)
    acting = (inverse @ required[:, rest])[:, :, 0]
    mass, damping, stiffness = matrices(_slopes(expressions), motion.q, motion.qd, motion.qdd, p, plant.about, acting)
    ways = motion.coefficients[:, :, -k:]
    first, second = spectral.derivatives(ways)
    left = ways.transpose(0, 2, 1)
    slopes = (left @ mass @ ways, left @ (2.0 * mass @ first + damping @ ways),
              left @ (mass @ second + damping @ first + stiffness @ ways))  # fmt: skip
    return -(left @ required)[:, :, 0], slopes


def _balance(expressions: Statement) -> tuple[Any, Any]:
    jacobian = ca.jacobian(expressions.closures[0], expressions.q)
    return ca.densify(expressions.required), ca.densify(jacobian)


def _slopes(expressions: Statement) -> ca.Function:
    """Function of (q, q', q'', p, O, lambda) for the derivatives of M q'' - f - J^T lambda to q'', q' and q."""
    if "slopes" not in expressions.functions:
        phi, states = expressions.closures[0], (expressions.qdd, expressions.qd, expressions.q)
        loads = ca.SX.sym("lambda", phi.shape[0])
        balance = expressions.required - ca.jtimes(phi, expressions.q, loads, True)
        expressions.functions["slopes"] = ca.Function(
            "f", [expressions.q, expressions.qd, expressions.qdd, expressions.p, expressions.about, loads],
            [ca.densify(ca.jacobian(balance, state)) for state in states])
    return expressions.functions["slopes"]


def _step(plant: Machine, right: Array, slopes: Slopes, spectral: Spectral, size: Array) -> Array:
    """The periodic solution d (n, k) of M_e d'' + C_e d' + K_e d = right."""
    n, k = right.shape
    mass, damping, stiffness = slopes
    flexibility = np.linalg.pinv(stiffness)
    w = spectral.rates(n)[:, None, None]
    odd = w * (np.arange(len(w)) < n / 2)[:, None, None]
    mean = (np.eye(k) + 1j * odd * (flexibility @ damping).mean(axis=0)
            - w**2 * (flexibility @ mass).mean(axis=0))  # fmt: skip
    inverse = np.linalg.inv(mean)

    def applied(d: Array) -> Array:
        samples = d.reshape(n, k)
        first, second = spectral.derivatives(samples)
        return preconditioned(sum(_times(*pair) for pair in ((mass, second), (damping, first), (stiffness, samples))))

    def preconditioned(forces: Any) -> Array:
        spectrum = np.fft.rfft(_times(flexibility, forces), axis=0)
        return np.asarray(np.fft.irfft(_times(inverse, spectrum), n, axis=0) * size).ravel()

    operator = LinearOperator((n * k, n * k), lambda y: applied((y.reshape(n, k) / size).ravel()))
    result, unsolved = gmres(operator, preconditioned(right), rtol=TOLERANCE, restart=KRYLOV, maxiter=RESTARTS)
    if unsolved or not np.isfinite(result).all():
        raise _no_solution(plant)
    return np.asarray(result.reshape(n, k) / size)


def _times(matrices_: Any, vectors: Any) -> Any:
    """Products of matrices (n, k, k) and vectors (n, k)."""
    return (matrices_ @ vectors[:, :, None])[:, :, 0]


def _check_repeats(plant: Machine, spectral: Spectral, free: tuple[str, ...]) -> None:
    """Refuse a period over which the prescribed motion, or the mechanism that it moves, does not repeat."""
    motion, period = plant.motion, spectral.period
    mean = motion.rates.mean(axis=0)
    time = np.arange(len(motion.values))[:, None] * period / len(motion.values)
    rates = spectral.derivatives(motion.values - motion.values[0] - mean * time)[0] + mean
    apart, size = (np.abs(array).max(axis=0) for array in (rates - motion.rates, motion.rates))
    agrees = bool((apart <= REPEATS * size).all())
    ends = motion.ends(period)
    if agrees and ends is not None:
        ways = _driven(replace(plant, motion=ends), free, np.zeros((2, len(free))), spectral).solved.coefficients
        agrees = bool(np.abs(ways[1] - ways[0]).max() <= RESOLVED * np.abs(ways).max())
    if not agrees:
        raise ModelError(f"cycle: the motion of '{plant.model.name}' does not repeat after {period:.6g} s; beams and "
                         f"superelements need samples that are evenly spread over the whole period, without its end, "
                         f"and the period as period= [s].", element=motion.names[0], field="period")  # fmt: skip


def _no_solution(plant: Machine) -> ModelError:
    parts = ", ".join(f"'{name}'" for name in plant.statement.motion.bends)
    return ModelError(f"cycle: no periodic motion of {parts} was found; a harmonic of the cycle is at a resonance "
                      f"without damping, or the deflections are not small. Give the material damping, change the "
                      f"speed, or simulate.", element=next(iter(plant.statement.motion.bends)))  # fmt: skip
