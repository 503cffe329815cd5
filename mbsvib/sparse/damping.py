"""Damped modes of many bodies: are the undamped ones modes still, and if not, Arnoldi on the quadratic problem.

(lambda^2 M + lambda C + K) phi = 0 is linear in (phi, lambda phi); shifted and inverted it takes one solve with the
tableau K + s C + s^2 M. The real span of the vectors found makes a small dense system, whose eigenvalues (by the dense
path, left vectors included) are off by the square of what is left of the residual.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from mbsvib.modes import modes as dense_modes
from mbsvib.sparse.operator import NOISE
from mbsvib.sparse.reduction import reduced
from mbsvib.sparse.subspace import strains

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from mbsvib.kinematics import Array, Index
    from mbsvib.modes import Modes
    from mbsvib.sparse.subspace import Subspace
    from mbsvib.sparse.system import SparseSystem
    from mbsvib.system import System

    Complex = NDArray[np.complex128]

RTOL = 1e-13
# Undamped modes count as damped ones if nothing but this is left of their equations: eigenvalues are off by its square.
DECOUPLED = 1e-9
# Residual of the Arnoldi vectors, for the same reason.
TOLERANCE = 1e-9
# What is a mode of the small system but not of the whole leaves more than this.
SPURIOUS = 1e-4
# What real and imaginary parts differ by from the others, less than this, is rounding and residual.
SAME = 1e-9
GUARDS = 2
ROUNDS = 3


@dataclass(frozen=True, slots=True)
class Quadratic:
    """The quadratic problem around a shift ``s``, on the places ``at`` of displacements and coordinates."""

    system: SparseSystem
    s: complex
    factor: Any
    at: Index
    row: Index
    sign: Array

    @staticmethod
    def around(system: SparseSystem, s: complex) -> Quadratic:
        """Factor K + s C + s^2 M."""
        row, sign = system.layout.balance()
        body, direction = system.layout.moving
        at = np.sort(np.concatenate((system.layout.displacement[body, direction], system.layout.coordinate)))
        return Quadratic(system, s, system.tableau.factor(s=s), at, row[at], sign[at])

    def solve(self, force: NDArray[Any]) -> NDArray[Any]:
        """Return displacements and coordinates under generalised forces, both (places,) or (places, n)."""
        right = np.zeros((self.system.layout.size, *force.shape[1:]), dtype=force.dtype)
        right[self.row] = force * (self.sign if force.ndim == 1 else self.sign[:, None])
        result: NDArray[Any] = self.factor.solve(right)[self.at]
        return result

    def forces(self, z: NDArray[Any], damping: NDArray[Any], inertia: NDArray[Any]) -> NDArray[Any]:
        """Return damping * C z + inertia * M z."""
        rows, w = self.system.elastic_rows[:, self.at], self.system.inertia_factor[:, self.at]
        c = self.system.damping if z.ndim == 1 else self.system.damping[:, None]
        result: NDArray[Any] = (rows.T @ (c * (rows @ z))) * damping + (w.T @ (w @ z)) * inertia
        return result

    def residual(self, values: Complex, z: NDArray[Any]) -> Array:
        """Size of Q(s)^-1 Q(lambda) z against that of z, in the norm of the kinetic energy."""
        w = self.system.inertia_factor[:, self.at]
        # Q(lambda) = Q(s) + (lambda - s) C + (lambda^2 - s^2) M
        force = self.forces(z, values - self.s, (values - self.s) * (values + self.s))
        left = z + self.solve(force)
        size = np.linalg.norm(w @ z, axis=0)
        result: Array = np.linalg.norm(w @ left, axis=0) / np.where(size > 0.0, size, 1.0)
        return result


def decoupled(found: Subspace, result: Modes, z: Array) -> bool:
    """Tell whether undamped modes, as they are, are modes of the damped system too.

    Parameters
    ----------
    found : Subspace
        Where they come from.
    result : Modes
        Modes of the small system that they make.
    z : array, shape (size, n)
        Their displacements and coordinates.

    Returns
    -------
    bool
        Whether the whole system's equations hold for each eigenvalue and shape.
    """
    system, t = found.operator.system, found.operator
    if not system.damping.any():
        return True
    brakes = system.elastic_rows[system.damping != 0.0]
    felt = np.abs(brakes @ z[:, : found.rigid]) > NOISE * (abs(brakes) @ np.abs(z[:, : found.rigid]))
    if not result.classical or felt.any():
        return False
    values = result.eigenvalues[0::2]
    rows = system.elastic_rows
    damping = rows.T @ (system.damping[:, None] * (rows @ z))
    # what C does to a shape must be inertia of that same shape, Gamma_ii M phi, which a solve brings to common units
    inertia = system.inertia_factor.T @ (system.inertia_factor @ z)
    gamma = np.einsum("ij,ij->j", z, damping)
    rest = values * (damping - gamma * inertia)
    left = t.w @ t.factor.solve(t.right(rest))
    if t.away.shape[1]:
        left -= t.away @ (t.away.T @ left)
    return bool((np.linalg.norm(left, axis=0) <= DECOUPLED).all())


def coupled(found: Subspace, k: int, near: float, start: Array) -> tuple[System, Modes, Array, Index]:
    """Return the damped modes whose eigenvalues are nearest to a frequency.

    Parameters
    ----------
    found : Subspace
        The undamped subspace; its rigid-body modes are kept.
    k : int
        Number of modes.
    near : float
        Frequency [Hz], 0 for the lowest.
    start : array, shape (size, k)
        Undamped modes.

    Returns
    -------
    tuple
        The small system, its modes, a bound of the relative error of each eigenvalue (2n,), and which modes to take.
    """
    system = found.operator.system
    rigid = min(found.rigid, k)
    if not np.isfinite(found.reach):
        return _whole(found, k, near)
    problem = Quadratic.around(system, _shift(found, near, start))
    shift = problem.s
    wanted = k - rigid + GUARDS
    for _ in range(ROUNDS):
        values, vectors = _arnoldi(problem, 2 * wanted, start)
        reach = float(np.abs(values - shift).max())
        basis = _span(system, problem, start[:, :rigid], values, vectors)
        small = reduced(system, basis, rigid)
        result = dense_modes(small, RTOL)
        left = problem.residual(
            result.eigenvalues, np.repeat(basis[problem.at] @ result.shapes, 2, axis=1)
            if not np.iscomplexobj(result.shapes) else _pairs(problem, basis, result))  # fmt: skip
        genuine = left.reshape(-1, 2)[:, 0] <= SPURIOUS
        genuine[result.natural == 0.0] = True
        if np.count_nonzero(genuine) >= k:
            break
        wanted *= 2
    good = np.flatnonzero(genuine)
    apart = np.abs(result.natural[good] - 2.0 * np.pi * near)
    chosen = np.sort(good[np.argsort(apart, kind="stable")[:k]])
    gap = np.maximum(reach / np.maximum(np.abs(result.eigenvalues - shift), 1e-300) - 1.0, 1e-6)
    bound = np.minimum(left, left**2 / gap) * (result.eigenvalues != 0.0)
    return small, result, bound, chosen


def _shift(found: Subspace, near: float, start: Array) -> complex:
    """The frequency asked for; for the lowest modes zero or, beside rigid-body modes, growth as fast as they swing."""
    if near:
        return 2j * np.pi * near
    if found.operator.total == 0 and not found.operator.sigma:
        return 0.0
    elastic, _ = strains(found.operator.system, start, min(found.rigid, start.shape[1]))
    square = np.einsum("ij,i,ij->j", elastic, np.abs(found.operator.system.stiffness), elastic)
    scale = float(np.sqrt(square[square > 0.0].min(initial=np.inf)))
    return scale if np.isfinite(scale) else 1.0


def _whole(found: Subspace, k: int, near: float) -> tuple[System, Modes, Array, Index]:
    """The subspace holds every motion: its small system is the whole one."""
    small = reduced(found.operator.system, found.z, found.rigid)
    result = dense_modes(small, RTOL)
    chosen = np.sort(np.argsort(np.abs(result.natural - 2.0 * np.pi * near), kind="stable")[:k])
    return small, result, np.repeat(found.noise, 2) * (result.eigenvalues != 0.0), chosen


def _pairs(problem: Quadratic, basis: Array, result: Modes) -> NDArray[Any]:
    """Shapes of both eigenvalues of every pair."""
    vectors = result.damped.vectors
    assert vectors is not None
    amplitude = np.einsum("ij,jkp->ikp", result.damped.shapes, vectors)
    return np.asarray(basis[problem.at] @ amplitude.reshape(len(amplitude), -1))


def _arnoldi(problem: Quadratic, wanted: int, start: Array) -> tuple[Complex, Complex]:
    from scipy.sparse.linalg import LinearOperator, eigs

    n = len(problem.at)
    rows = problem.system.elastic_rows[:, problem.at]
    w = problem.system.inertia_factor[:, problem.at]
    c = (rows.T.multiply(problem.system.damping) @ rows).tocsr()
    m = (w.T @ w).tocsr()
    c = c + problem.s * m

    def step(pair: NDArray[Any]) -> NDArray[Any]:
        x, v = pair[:n], pair[n:]
        # Q(s) x' = -(C + s M) x - M v,  v' = x + s x'
        moved = -problem.solve(c @ x + m @ v)
        return np.concatenate((moved, x + problem.s * moved))

    kind = complex if isinstance(problem.s, complex) and problem.s.imag else float
    first = start[problem.at].sum(axis=1)
    v0 = step(np.concatenate((first, np.zeros(n))).astype(kind))
    wanted = min(wanted, 2 * problem.system.dof - 2)
    mu, vectors = eigs(LinearOperator((2 * n, 2 * n), matvec=step, dtype=kind), k=wanted, which="LM", tol=TOLERANCE,
                       v0=v0, ncv=min(2 * n, max(2 * wanted + 1, 20)))  # fmt: skip
    used = mu != 0.0
    return problem.s + 1.0 / mu[used], vectors[:n, used]


def _span(system: SparseSystem, problem: Quadratic, rigid: Array, values: Complex, vectors: Complex) -> Array:
    """Real vectors that span complex ones and the rigid-body modes, M-orthonormal, after one more solve."""
    if not np.iscomplexobj(problem.s):  # the conjugates have the same real span
        values, vectors = values[values.imag >= 0.0], vectors[:, values.imag >= 0.0]
    force = problem.forces(vectors, problem.s - values, (problem.s - values) * (problem.s + values))
    vectors = problem.solve(force)
    w = system.inertia_factor[:, problem.at]
    h = w @ vectors
    # the phase in which the imaginary part is smallest, and orthogonal to the real one
    phase = np.sqrt(np.einsum("ij,ij->j", h, h) + 0j)
    vectors = vectors * (np.conj(phase) / np.maximum(np.abs(phase), 1e-300) / np.linalg.norm(h, axis=0))
    parts = np.concatenate((vectors.real, vectors.imag), axis=1)
    fixed = w @ rigid[problem.at]
    for _ in range(2):
        if rigid.shape[1]:
            parts = parts - rigid[problem.at] @ (fixed.T @ (w @ parts))
        _, singular, right = np.linalg.svd(w @ parts, full_matrices=False)
        kept = singular > SAME * singular[0]
        parts = parts @ (right[kept].T / singular[kept])
    result = np.zeros((system.layout.size, rigid.shape[1] + parts.shape[1]))
    result[:, : rigid.shape[1]] = rigid
    result[problem.at, rigid.shape[1] :] = parts
    return result
