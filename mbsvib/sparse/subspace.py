"""The subspace of the modes nearest to a shift: Lanczos, until a count of eigenvalues shows that none is missed."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from scipy.linalg import eigh
from scipy.sparse.linalg import LinearOperator, eigsh

from mbsvib.common.arrays import Array
from mbsvib.linalg.rank import ZERO_SUM
from mbsvib.sparse.equations import SparseEquations
from mbsvib.sparse.operator import Operator, count_below, operator
from mbsvib.sparse.quadratic import Quadratic

# Residual of the Lanczos vectors: the error of frequencies is its square.
TOLERANCE = 1e-9
# Additional modes: they give the distance of the next mode, and speed up the convergence of the last.
GUARDS = 2
# All modes are computed up to this number of degrees of freedom, or up to three times the wanted modes.
DENSE_DOF = 24
# Rounds of searching for missed modes, mostly repeated frequencies of equal parts.
SEARCHES = 6
# Below this share of the shift, the square of a frequency may be that of a rigid-body mode.
RIGID = 1e-8
# Below this share of a typical frequency, modes are rigid-body modes but for rounding of the stiffness.
SLOW = 1e-8
# A shift within this fraction of the square of a frequency is too close,
TOO_CLOSE = 1e-6
# and is moved by one of these.
OFFSETS = (0.0, 1e-5, -2e-5, 5e-5, -1e-4, 2e-4)
# Displacements below this fraction of the largest are rounding, and their strains are set to 0.
ROUNDED = float(np.finfo(float).eps) ** 2
# The count is taken this much (relative to the distance from the shift) before the last mode.
BEFORE = 1e-6


@dataclass(frozen=True, slots=True)
class Subspace:
    """Vectors ``z`` (size, n) that span the modes nearest to ``centre`` [rad/s].

    The first ``rigid`` of them deform no spring. ``residual`` (n,) is that of T h = theta h relative to theta h,
    ``noise`` (n,) the relative rounding error of the energy, ``reach`` the distance |omega^2 - sigma| up to which all
    modes are in the subspace, ``missed`` the number of missed modes. ``growing`` is that of all modes of
    matrices that grow by negative stiffness.
    """

    operator: Operator
    z: Array
    rigid: int
    residual: Array
    noise: Array
    reach: float
    missed: int | None
    centre: float
    growing: int = 0


def subspace(system: SparseEquations, k: int, near: float) -> Subspace:
    """Return vectors that span the k lowest modes, or the k nearest to a frequency ``near`` [Hz], and some more."""
    t, centre = _operator_near(system, near, k)
    rigid = t.rigid.shape[1]
    flexible = system.dof - ((t.total or 0) if t.sigma == 0.0 else 0)
    requested = min(k - rigid + GUARDS, flexible)
    if rigid >= k:
        zero = np.zeros(rigid)
        return Subspace(t, t.rigid, rigid, zero, zero, 0.0, 0, centre)
    if flexible <= max(DENSE_DOF, 3 * requested):
        return _solved(t, _all_modes(t, flexible), np.inf, 0, centre)
    theta, h = _lanczos(t, requested)
    missed = None
    for _ in range(SEARCHES):
        missed = _missed(t, theta, k - rigid)
        if missed == 0:
            break
        more, vectors = _lanczos(t.deflating(h), min(missed or GUARDS, flexible - len(theta) - 1))
        last = np.sort(np.abs(theta))[-min(k - rigid, len(theta))]
        if missed is None and not (np.abs(more) > last * (1.0 + BEFORE)).any():
            break  # modes cannot be counted, but another search finds no more
        theta, h = np.concatenate((theta, more)), np.concatenate((h, vectors), axis=1)
    order = np.argsort(-np.abs(theta), kind="stable")[: max(requested, k - rigid)]
    theta, h = theta[order], h[:, order]
    return _solved(t, h, 1.0 / float(np.abs(theta).min()), missed, centre)


def _operator_near(system: SparseEquations, near: float, k: int) -> tuple[Operator, float]:
    """The operator around a frequency, and the angular frequency to which modes are nearest.

    A frequency far above all modes is reduced to the highest ones, so that they can be separated; the nearest modes
    stay the same, and the lowest ones if all have the frequency 0. A shift that coincides with a mode is moved, since
    every solve would return only that mode.
    """
    centre, slowest = 2.0 * np.pi * near, SLOW * Quadratic(system).speed
    try:
        while centre > slowest and count_below(system, 0.25 * centre**2) == system.dof:
            centre *= 0.5
    except np.linalg.LinAlgError:
        pass
    if centre <= slowest:
        return operator(system, None, k), 0.0
    for offset in OFFSETS:
        sigma = (1.0 + offset) * centre**2
        try:
            t = operator(system, sigma, k)
        except np.linalg.LinAlgError:
            continue
        h = np.random.default_rng(1).standard_normal(t.w.shape[0])
        for _ in range(2):
            h = t.apply(h / np.linalg.norm(h))
        if float(np.linalg.norm(h)) * sigma * TOO_CLOSE < 1.0:
            break
    return t, centre


def _lanczos(t: Operator, requested: int) -> tuple[Array, Array]:
    size = t.w.shape[0]
    start = t.apply(np.random.default_rng(2).standard_normal(size))
    op = LinearOperator((size, size), matvec=t.apply, dtype=float)
    theta, h = eigsh(op, k=requested, which="LM", tol=TOLERANCE, v0=start, ncv=min(size, max(2 * requested + 1, 20)))
    return theta, h


def _all_modes(t: Operator, dof: int) -> Array:
    """Vectors that span all flexible modes, from random loads by two solves."""
    h = np.random.default_rng(3).standard_normal((t.w.shape[0], dof))
    for _ in range(2):
        h = np.linalg.qr(t.apply(h))[0]
    return h


def _missed(t: Operator, theta: Array, requested: int) -> int | None:
    """Number of missed modes that are nearer to the shift than the last wanted one, by counts of eigenvalues."""
    distance = np.sort(1.0 / np.abs(theta))
    radius = float(distance[min(requested, len(distance)) - 1]) * (1.0 - BEFORE)
    try:
        above = count_below(t.system, t.sigma + radius)
        # at a shift of zero the rigid-body modes are deflated; without negative springs no mode is below zero
        deflated = (t.total or 0) if t.sigma == 0.0 else 0
        below: int | None = 0
        if t.sigma - radius > 0.0 or (t.system.row_stiffness < 0.0).any():
            below = count_below(t.system, t.sigma - radius)
    except np.linalg.LinAlgError:
        return None
    if above is None or below is None:
        return None
    return max(0, above - below - deflated - int(np.count_nonzero(distance < radius)))


def _solved(t: Operator, h: Array, reach: float, missed: int | None, centre: float) -> Subspace:
    """One more solve from the Lanczos vectors, refined, with estimates of their errors."""
    rough = t.solve(h)
    right = t.right(t.wt @ t.without_rigid(h))
    scale = t.factor.row_scale[:, None], t.factor.column_scale[:, None]
    correction = t.factor.lu.solve(right * scale[0] - t.factor.matrix @ (rough / scale[1])) * scale[1]
    z = t.flexible(rough + correction)
    hz = t.w @ z
    length = np.sqrt(np.einsum("ij,ij->j", hz, hz))
    theta = np.einsum("ij,ij->j", h, hz)
    residual = np.linalg.norm(hz / theta - h, axis=0)
    rows, k = t.system.elastic_rows, np.abs(t.system.row_stiffness)
    energy, error = (np.einsum("ij,i,ij->j", e, k, e) for e in (rows @ z, rows @ correction))
    kinetic_error = np.einsum("ij,ij->j", *([t.w @ correction] * 2)) / length**2
    noise = np.divide(error, energy, out=np.zeros_like(error), where=energy > 0.0) + kinetic_error
    z /= length
    space = Subspace(t, z, 0, residual, noise, reach, missed, centre)
    if t.sigma < 0.0 and t.total:
        return _rigid_by_strain(space, t.total)
    return _rigid_separated(space) if t.sigma > 0.0 else _with_rigid_first(space, t.rigid)


def _with_rigid_first(space: Subspace, rigid: Array) -> Subspace:
    """The subspace with rigid-body modes before the others."""
    zero = np.zeros(rigid.shape[1])
    residual, noise = (np.concatenate((zero, errors)) for errors in (space.residual, space.noise))
    return replace(space, z=np.concatenate((rigid, space.z), axis=1), rigid=len(zero), residual=residual, noise=noise)


def _rigid_separated(space: Subspace) -> Subspace:
    """The subspace around a frequency with rigid-body modes, as the springs determine them, before the others."""
    t = space.operator
    if not np.isfinite(space.reach):
        space = _rigid_by_strain(space, 0)  # vectors that span all modes become modes
    rows = t.system.elastic_rows @ space.z
    strain = np.abs(t.system.row_stiffness) @ rows**2
    near_zero = int(np.count_nonzero(strain < RIGID * t.sigma))
    if not near_zero:
        return space
    at_zero = operator(t.system, None, near_zero)
    if not at_zero.total:
        return space
    if at_zero.sigma < 0.0:
        return _rigid_by_strain(space, min(at_zero.total, near_zero))
    others = np.sort(np.argsort(strain, kind="stable")[at_zero.rigid.shape[1] :])
    flexible = replace(space, z=at_zero.flexible(space.z[:, others]), residual=space.residual[others],
                       noise=space.noise[others])  # fmt: skip
    return _with_rigid_first(flexible, at_zero.rigid)


def _rigid_by_strain(space: Subspace, total: int) -> Subspace:
    """The subspace with a known number of rigid-body modes first: those with the smallest strain energy."""
    t, z = space.operator, space.z
    rows, h = t.system.elastic_rows @ z, t.w @ z
    square, shapes = eigh(rows.T @ (t.system.row_stiffness[:, None] * rows), h.T @ h)
    shapes = shapes[:, np.argsort(np.abs(square), kind="stable")]
    squares = np.abs(shapes.T) ** 2
    return replace(space, z=z @ shapes, rigid=min(total, z.shape[1]), residual=np.sqrt(squares @ space.residual**2),
                   noise=squares @ space.noise)  # fmt: skip


def strains(system: SparseEquations, z: Array, rigid: int) -> tuple[Array, Array]:
    """Return the elastic displacements D z (rows, n), rounding as exact zeros, and the sums of the sizes of the terms.

    The first ``rigid`` of the vectors ``z`` (size, n) deform no spring.
    """
    e = np.asarray(system.elastic_rows @ z)
    terms = np.asarray(abs(system.elastic_rows) @ np.abs(z))
    largest = np.outer(abs(system.elastic_rows).sum(axis=1), np.abs(z).max(axis=0, initial=0.0))
    e[np.abs(e) <= np.maximum(ZERO_SUM * terms, ROUNDED * largest)] = 0.0
    e[np.flatnonzero(system.row_stiffness)[:, None], np.arange(rigid)] = 0.0
    return e, terms
