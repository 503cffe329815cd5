"""How far the linear model holds: amplitudes at which the second-order part of a free vibration reaches a share.

Second-order parts of free vibration: exact second derivatives of equations of motion, closures and outputs.

R(q, q', q'', mu) = M q'' - f - J^T mu = 0,  phi(q) = 0,  q = a Re(q1 e^(lambda t)) + a^2 q2 + ...
L(s) q2 - J^T mu2 = -1/4 R''(x1, x1),  J q2 = -1/4 phi''(q1, q1)    at s = 2 lambda
L(s) q2 - J^T mu2 = -1/4 R''(x1, x1*),  J q2 = -1/4 phi''(q1, q1*)  at s = lambda + lambda*

with x = (q, q', q'', mu) and L(s) the derivative of R to q, q' and q'' times 1, s and s^2.

Source: Nayfeh & Mook, Nonlinear Oscillations (1979), section 2.3, method of Lindstedt and Poincare.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import casadi as ca
import numpy as np

from mbsvib.common.arrays import Array, Complex, Index
from mbsvib.equations.equations import Equations
from mbsvib.errors import ModelError
from mbsvib.finite_motion.lagrange import FiniteMotion
from mbsvib.finite_motion.statement import finite_motion
from mbsvib.kinematics.pose import size_of
from mbsvib.linalg.qr import minimum_norm_solution
from mbsvib.linalg.rank import REDUNDANT_LOOPS
from mbsvib.mechanism.mechanism import Mechanism
from mbsvib.simulation.outputs import Measured, measured
from mbsvib.simulation.reactions import is_reaction

if TYPE_CHECKING:
    from mbsvib.modes.result import Modes


# A force that acts along motions without stiffness counts as rounding below this share of all forces.
BALANCED = 1e-8


@dataclass(frozen=True)
class SecondOrder:
    """Derivatives of a mechanism's equations in the pose as described.

    ``to_all`` T (n, m) are the motions of tree coordinates by the independent ones, ``independent`` (m,) their numbers.
    ``linear`` are R_q, R_q', R_q'' (n, n) and ``jacobian`` J (rows, n); ``curvature`` is a function (x, u, v) ->
    (R''(u, v), phi''(u, v), y''(u, v)), ``outputs`` (outputs, 3 n) are derivatives of the outputs to (q, q', q'').
    """

    to_all: Array
    independent: Index
    linear: tuple[Array, Array, Array]
    jacobian: Array
    outputs: Array
    reactions: Array
    curvature: Any

    def operator(self, s: complex) -> Complex:
        """Return L(s) (n, n)."""
        stiffness, damping, mass = self.linear
        return np.asarray(stiffness + s * damping + s**2 * mass)

    def first(self, shape: Array | Complex, s: complex) -> Complex:
        """Return x1 = (q1, s q1, s^2 q1, mu1) of a shape (m,) of the independent coordinates."""
        q = self.to_all @ shape
        forces = minimum_norm_solution(self.jacobian.T, self.operator(s) @ q)
        return np.concatenate((q, s * q, s**2 * q, forces))

    def residual(self, shape: Array | Complex, s: complex) -> float:
        """Return the share of the forces along the independent coordinates that a mode leaves unbalanced."""
        q = self.to_all @ shape
        parts = [self.to_all.T @ (matrix * s**k @ q) for k, matrix in enumerate(self.linear)]
        return float(np.abs(sum(parts)).max() / max(max(float(np.abs(part).max()) for part in parts), 1e-300))

    def along(self, x: Complex) -> tuple[list[Complex], list[Complex]]:
        """Return 1/4 of R''(u, v), phi''(u, v) and y''(u, v) for u = v = x, and for u = x, v = conj(x)."""
        parts = self.curvature(np.column_stack((x.real, x.real, x.imag)), np.column_stack((x.real, x.imag, x.imag)))
        values = [0.25 * np.asarray(part).T for part in parts]
        return [rr - ii + 2j * ri for rr, ri, ii in values], [rr + ii + 0j for rr, _, ii in values]

    def dependent_part(self, opening: Complex) -> Complex:
        """Return motions (n,) of the dependent coordinates alone that close loops open by ``opening`` (rows,)."""
        result = np.zeros(len(self.to_all), dtype=complex)
        dependent = np.setdiff1d(np.arange(len(result)), self.independent)
        if len(dependent):
            result[dependent] = -minimum_norm_solution(self.jacobian[:, dependent], opening)
        return result

    def forced(self, force: Complex, opening: Complex, s: complex) -> tuple[Complex, bool]:
        """Return q2 (n,) at s, and whether there is one: none if forces act along motions that nothing holds."""
        start, operator = self.dependent_part(opening), self.operator(s)
        reduced = self.to_all.T @ operator @ self.to_all
        right = -self.to_all.T @ (force + operator @ start)
        scale = 1.0 / np.sqrt(np.maximum(np.abs(reduced).max(axis=0), 1e-300))
        scaled = reduced * np.outer(scale, scale)
        answer = np.linalg.lstsq(scaled, scale * right, rcond=REDUNDANT_LOOPS)[0]
        residual = float(np.abs(scaled @ answer - scale * right).max(initial=0.0))
        size = float(np.abs(scale * (np.abs(self.to_all.T) @ np.abs(force))).max(initial=0.0))
        return start + self.to_all @ (scale * answer), residual <= BALANCED * max(size, 1e-300)


def second_order(statement: FiniteMotion, measured: Measured, independent: Index, u: Array) -> SecondOrder:
    """Return the derivatives of a mechanism's equations in the pose as described, a pose of equilibrium.

    ``statement``: its finite motion, without bases and first-order states. ``independent`` (m,): numbers of the
    independent coordinates. ``u`` (inputs,): inputs [N, N m, m/s^2].
    """
    motion, n = statement.motion, len(statement.motion.names)
    q, qd, qdd = motion.q, motion.qd, ca.SX.sym("qdd", n)
    mu = ca.SX.sym("mu", motion.closures.shape[0])
    x = ca.vertcat(q, qd, qdd, mu)
    closures = ca.densify(motion.closures)
    balance = ca.jtimes(statement.momenta, motion.qd, qdd) - statement.forces - ca.gradient(ca.dot(closures, mu), q)
    values, vectors, _, _ = measured.function(q, qd, qdd, statement.yields, motion.bases, ca.SX(u))
    weights = ca.DM(measured.weights)
    turned = [ca.dot(weights[i, :].T, vectors[3 * i : 3 * i + 3]) for i in range(len(measured.names))]
    outputs = values + ca.vertcat(*turned) if turned else ca.SX(0, 1)
    every = [ca.densify(balance), closures, ca.densify(outputs)]
    zero = np.zeros(x.shape[0])
    a, b, identity = ca.SX.sym("a", x.shape[0]), ca.SX.sym("b", x.shape[0]), np.eye(x.shape[0])
    once = [ca.densify(ca.jtimes(part, x, a)) for part in every]
    slopes = ca.Function("slopes", [x, a], [every[0], *once])
    unbalanced, _, opening, _ = map(np.asarray, slopes(zero, identity[:, :n]))
    J = opening.reshape(-1, n)
    zero[3 * n :] = minimum_norm_solution(J.T, unbalanced[:, 0])
    _, loop_slopes, _, output_slopes = map(np.asarray, slopes(zero, identity))
    twice = [ca.densify(ca.jtimes(part, x, b)) for part in once]
    full = ca.Function("curvature", [x, a, b], twice)
    dependent = np.setdiff1d(np.arange(n), independent)
    to_all = np.eye(n)[:, independent]
    if len(dependent):
        to_all[dependent] = -minimum_norm_solution(J[:, dependent], J[:, independent])
    return SecondOrder(
        to_all, independent, (loop_slopes[:, :n], loop_slopes[:, n : 2 * n], loop_slopes[:, 2 * n : 3 * n]), J,
        output_slopes.reshape(-1, x.shape[0])[:, : 3 * n], zero[3 * n :], lambda left, right: full(zero, left, right),
    )  # fmt: skip


# Parts of outputs below this share of the terms that they are sums of are rounding.
ROUNDING = 1e-10
# Outputs that a mode moves by less than this share of what its coordinates could are rounding of its shape.
NOT_SHOWN = 1e-8
# Outputs whose second-order part is as large as the first when a coordinate has moved by this much [rad, mechanism
# sizes] have no first-order part: poses, also those of equilibria, are known no better.
POSE = 1e-11
# Modes must solve the equations of finite motion, linearized, to this share of the forces: another model otherwise.
SAME_EQUATIONS = 1e-6


def linear_range(system: Equations, modes: Modes, share: float) -> tuple[Array, Array]:
    """Return the amplitude of each output in each mode at which the second-order part reaches a share of the first.

    Returns (modes, outputs): amplitudes [unit of the output]; inf where there is no second-order part; (modes,
    outputs): amplitudes of the coordinate of largest motion there [rad, mechanism sizes].
    """
    model = _mechanism(system)
    statement = finite_motion(model, cut=system.cut_joints)
    if statement.yields.numel():
        element = statement.yield_names[0].rpartition(".")[0]
        family = model.springs[element].family
        raise ModelError(f"linear_range: '{element}' is a {family}, whose first-order state has no second-order "
                         f"part here yet; compare with model.simulate().", element=element)  # fmt: skip
    names = statement.motion.names
    unknown = [name for name in system.coordinates if name not in names]
    if unknown:
        raise ModelError(f"linear_range: '{unknown[0]}' is not a coordinate of finite motion; linearize with others as "
                         f"independent=[...]. It has {', '.join(names[:8])}.")  # fmt: skip
    motions = {name: part for name, part in model.outputs.items() if not is_reaction(model, part)}
    outputs = measured(model.with_parts(outputs=motions), statement)
    independent = np.array([names.index(name) for name in system.coordinates], dtype=np.intp)
    parts = second_order(statement, outputs, independent, np.zeros(len(statement.inputs)))
    scale, _ = statement.motion.scales(size_of(model))
    values, travel = (np.full((len(modes), len(system.outputs)), np.nan) for _ in range(2))
    columns = [outputs.names.index(name) for name in system.outputs if name in outputs.names]
    selected = [i for i, name in enumerate(system.outputs) if name in outputs.names]
    for k in range(len(modes)):
        reached, moved = _of_mode(parts, modes.shapes[:, k], modes.pairs[k, 0], scale, share)
        values[k, selected], travel[k, selected] = reached[columns], moved[columns]
    return values, travel


def _mechanism(system: Equations) -> Mechanism:
    """The model in whose pose a system is linear."""
    origin = system.provenance
    if origin.from_matrices or origin.truncation is not None or origin.closed_loop or origin.origin is None:
        raise ModelError(f"linear_range: '{system.name}' is not the system of a mechanism alone (it is reduced, closed "
                         f"by a controller, or made of matrices); ask model.linearize().")  # fmt: skip
    if origin.moved_to_equilibrium:
        raise ModelError(f"linear_range: '{system.name}' is linear about another pose than the model's; ask "
                         f"model.equilibrium().linearize().")  # fmt: skip
    if origin.removed is not None or origin.separation is not None:
        raise ModelError(f"linear_range: coordinates of '{system.name}' were condensed or left out; ask the system as "
                         f"linearized, and give every motion a mass.")  # fmt: skip
    if origin.origin.composed:
        part = next(iter(origin.origin.composed))
        raise ModelError(f"linear_range: '{part}' is a beam or superelement, whose modes are other coordinates in "
                         f"finite motion; compare with model.simulate().", element=part)  # fmt: skip
    return origin.origin


def _of_mode(parts: SecondOrder, shape: Array | Complex, s: complex, scale: Array, share: float) -> \
        tuple[Array, Array]:  # fmt: skip
    """Amplitudes (outputs,) of outputs and of the coordinate of largest motion, in one mode."""
    n = len(scale)
    if parts.residual(shape, s) > SAME_EQUATIONS and s != 0.0:
        raise ModelError("linear_range: the modes do not solve the equations of finite motion in this pose; linearize "
                         "the model as it is described.")  # fmt: skip
    x = parts.first(shape, s)
    first = np.abs(parts.outputs @ x[: 3 * n])
    amplitude = float(np.abs(x[:n] / scale).max())
    units = amplitude * np.concatenate((scale, abs(s) * scale, abs(s) ** 2 * scale))
    noise = NOT_SHOWN * np.abs(parts.outputs) @ units
    kinematic, largest = np.zeros(len(first)), np.zeros(len(first))
    reached = True
    for rate, (force, opening, direct) in zip((2.0 * s, s + np.conj(s)), parts.along(x), strict=True):
        follow = parts.dependent_part(opening)
        kinematic += np.abs(direct + parts.outputs @ _motion(follow, rate))
        if s != 0.0:
            q, exists = parts.forced(force, opening, rate)
            reached &= exists
            largest = np.maximum(largest, np.abs(direct + parts.outputs @ _motion(q, rate)))
    second = np.maximum(kinematic, largest)
    second[second <= ROUNDING * first * amplitude] = 0.0
    first[(first <= noise) | (first * amplitude <= POSE * second)] = 0.0
    size = np.divide(share * first, second, out=np.full(len(first), np.inf), where=second > 0.0)
    if not reached:
        size[:] = 0.0
    values = np.where(second > 0.0, 0.0, np.inf)
    np.multiply(size, first, out=values, where=first > 0.0)
    return values, size * amplitude


def _motion(q: Complex, s: complex) -> Complex:
    return np.concatenate((q, s * q, s**2 * q))
