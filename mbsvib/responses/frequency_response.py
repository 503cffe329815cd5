"""Frequency response: a sum over modes, all frequencies in one matrix product.

If damping couples the modes so that eigenvectors are nearly dependent, the sum is not accurate; the residual of the
equations at a few frequencies shows this. Then (Omega^2 - w^2 + i w Gamma) eta = Phi^T B is solved instead: with the
Schur form of the state matrix in energy coordinates, all frequencies at once, refined until the residual is rounding,
and frequency by frequency if this does not converge. If dampers are so strong that rounding of Gamma = L^T L affects
the motions that they do not damp, Gamma is not formed: damped and undamped motions are separated by a QR of L.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

import numpy as np
from numpy.typing import ArrayLike
from scipy.linalg import lapack

from mbsvib.common.arrays import Array, Bools, Complex, Index
from mbsvib.common.expected import angular
from mbsvib.common.memory import BATCH_BYTES
from mbsvib.errors import ResponseError
from mbsvib.linalg.products import product, square_difference
from mbsvib.linalg.qr import sorted_qr
from mbsvib.linalg.rank import EPS
from mbsvib.modes.damped import Damped
from mbsvib.modes.general import General
from mbsvib.responses.basis import Basis
from mbsvib.responses.modal_sum import residues, sum_of_motions
from mbsvib.responses.refined import recomputed, vanishing
from mbsvib.responses.rounding import differentiated

# The sum over modes solves the equations to this residual: rounding of a sum of some hundred modes, no more.
BACKWARD = 5e-14
CHECKED = 3  # frequencies next to the most ill-conditioned eigenvalues at which the residual is computed
REFINEMENTS = 4
NEARLY_STATIC = 1e-3  # in parts of the lowest eigenvalue
# Where zero responses are looked for: natural frequencies at most, and times which, as undamped ones have no response.
PROBES, NEAR_POLE = 16, 0.97
# Points at which they are looked for without symmetry, times a pole's size: right of the imaginary axis, on no pole.
ASIDE = np.array([0.83 + 0.41j, 1.07 + 0.29j, 0.91 + 0.57j])
# A response below this share of what it were if nothing cancelled is 0.
NOTHING = 1e-12


def frequency_response(basis: Basis, omega: ArrayLike) -> Complex:
    """Return the frequency response G(i w) (outputs, inputs, n) at the angular frequencies ``omega`` (n,) [rad/s].

    G(i w) = (Cq + i w Cv - w^2 Ca) (K + i w C - w^2 M)^-1 B + D

    The relative error is that of rounding, times frequency / half-width of a resonance there. Sums that cancel for a
    reason other than inertia (far above the modes, if only a long chain of springs connects the input to the output)
    are accurate relative to their largest term. Where this may leave less than six digits, responses are computed from
    the factors of the matrices in twice the working precision (``tiny_outputs``).
    """
    w = angular(omega)
    modal, size = basis.modal, np.abs(w)
    if not isinstance(modal, Damped):
        result = _general(basis, modal, w)
    else:
        by_modes = _by_modes(basis, modal, size)
        # solutions do not exist at 0 beside motions without stiffness, which the sum knows
        static = np.zeros(len(w), dtype=bool) if by_modes or modal.square.all() else size == 0.0
        at = np.where(static, NEARLY_STATIC * np.abs(modal.pairs[modal.pairs != 0.0]).min(initial=np.inf), size)
        result = basis.modal_sum.at(1j * size) if by_modes else _solved(basis, modal, at)
        result[:, :, static] = basis.modal_sum.at(1j * size[static])
        pole = None if np.isfinite(result).all() else basis.modal_sum.pole_at(1j * size)
        if pole:
            _refuse_pole(w, *pole)
        exact = recomputed(basis, modal, at, (result, by_modes), lambda part: _solver(basis, modal, part, by_modes))
        exact[:, :, static] = result[:, :, static]
        result = exact
    if (w < 0.0).any():
        result[:, :, w < 0.0] = result[:, :, w < 0.0].conj()
    return result


def zero_responses(basis: Basis) -> Bools:
    """Return which responses (outputs, inputs) are zero but for rounding of the model's own numbers.

    They are so next to natural frequencies, at which any mode shows; of systems without symmetry beside these.
    """
    system, modal = basis.equations, basis.modal
    if not differentiated(system):  # no output moves
        return np.asarray(system.D == 0.0)
    result = np.zeros((len(system.outputs), len(system.inputs)), dtype=bool)
    poles = np.unique(np.abs(basis.poles))
    if not (result.size and poles.any()):
        return result
    if not isinstance(modal, Damped):
        return silent(basis)
    poles = poles[poles > 0.0]
    w = NEAR_POLE * poles[np.unique(np.linspace(0, len(poles) - 1, PROBES).astype(int))]
    by_modes = _by_modes(basis, modal, w)
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        return vanishing(basis, modal, w, frequency_response(basis, w),
                         lambda part: _solver(basis, modal, part, by_modes))  # fmt: skip


def silent(basis: Basis) -> Bools:
    """Return which responses (outputs, inputs) are rounding at points between the slowest and the fastest pole."""
    system, speeds = basis.equations, np.abs(basis.poles)
    slow, fast = speeds[speeds > 0.0].min(initial=np.inf), speeds.max(initial=0.0)
    result = np.ones(system.D.shape, dtype=bool)
    for s in ASIDE * (np.geomspace(slow, fast, len(ASIDE)) if fast else np.ones(len(ASIDE))):
        square = system.K + s * (system.C + s * system.M)
        unit = 1.0 / np.sqrt(np.abs(square.diagonal()))
        motion = np.linalg.solve(unit[:, None] * square * unit, unit[:, None] * system.B)
        rows = (system.Cq + s * (system.Cv + s * system.Ca)) * unit
        terms = np.abs(rows).sum(axis=1)[:, None] * np.abs(motion).max(axis=0, initial=0.0) + np.abs(system.D)
        result &= np.abs(rows @ motion + system.D) <= NOTHING * terms
    return result


def _by_modes(basis: Basis, modal: Damped, w: Array) -> bool:
    """Tell whether responses are accurate as sums over modes."""
    return modal.vectors is None or (
        basis.strong_dampers is None and trusted(modal, modal.shapes.T @ basis.equations.B, w)
    )


def _general(basis: Basis, modal: General, w: Array) -> Complex:
    """Responses where matrices lack symmetry."""
    from mbsvib.responses import general_responses as responses

    system = basis.equations
    s, cancels = 1j * np.abs(w), responses.cancels(system, modal.state)
    symmetric = system.gyroscopic is None and system.circulatory is None
    residual = min(responses.SUMMED * len(modal.values), BACKWARD) if symmetric else BACKWARD
    if not cancels and responses.trusted(modal, modal.state.basis.T @ system.B, np.abs(w), residual):
        result = basis.modal_sum.at(s)
    elif not symmetric:
        result = responses.solved(system, modal.state, s)
    else:
        result = responses.refined_solutions(system, modal.state, np.abs(w))
        if modal.state.right.shape[1] and not s.all():  # the sum knows the motions without stiffness
            result[:, :, s == 0.0] = basis.modal_sum.at(s[s == 0.0])
    if not np.isfinite(result).all():
        values = modal.values
        i = int(np.nonzero(~np.isfinite(result).all(axis=(0, 1)))[0][0])
        _refuse_pole(w, int(modal.mode[np.abs(modal.spectrum.values - s[i]).argmin()]) if values.any() else 0, i)
    return result


def trusted(modal: Damped, b: Array, w: Array) -> bool:
    """Tell whether the sum over modes solves (s^2 + s Gamma + Omega^2) eta = b at a few s = i w.

    ``b`` (m, inputs): inputs in the basis. ``w`` (n,) [rad/s]: none negative.
    """
    inside, size = w[w > 0.0], np.abs(modal.pairs)
    if not b.size or not size.any():
        return True
    if not len(inside):  # at 0 rigid-body modes have no solution: check a frequency close to it
        inside = np.array([NEARLY_STATIC * size[size > 0.0].min()])
    condition = conditions(modal)
    if not np.isfinite(condition).all():
        return False
    worst = np.abs(modal.pairs.reshape(-1)[np.argsort(-condition.reshape(-1), kind="stable")[:CHECKED]])
    at = np.unique([*np.abs(inside - worst[:, None]).argmin(axis=1), len(inside) // 2, 0])
    s: Complex = 1j * inside[at]
    # one combination of all inputs represents them all
    mixed = b @ np.cos(np.arange(b.shape[1]))[:, None]
    return bool((_residual(modal, s, mixed, sum_of_motions(modal, mixed).at(s))[1] <= BACKWARD).all())


def conditions(modal: Damped) -> Array:
    """Return the condition numbers (m, 2) of the eigenvalues in energy coordinates: 1 is best, infinite is defective.

    (|lambda| + |Omega y|^2 / |lambda|) / |y^T (2 lambda + Gamma) y|; 1 for eigenvalues 0
    """
    assert modal.vectors is not None
    assert modal.slopes is not None
    size, slope = np.abs(modal.pairs), np.abs(modal.slopes)
    elastic = np.einsum("mkp,m,mkp->kp", modal.vectors, np.abs(modal.square), modal.vectors.conj()).real
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.asarray(np.where(size > 0.0, (size + elastic / size) / slope, 1.0))


def _residual(modal: Damped, s: Complex, b: Array, eta: Complex) -> tuple[Complex, Array]:
    """Residual b - Q(s) eta at s = i w, (m, inputs, n), and its size relative to the terms, (n,), as motions."""
    w, square = s.imag, modal.square[:, None, None]
    brake = s * product(modal.gamma, eta)
    residual = b[:, :, None] - square_difference(square, w) * eta - brake
    scale = np.abs(square) + w * w
    size = np.maximum(np.abs(eta), np.maximum(np.abs(b)[:, :, None], np.abs(brake)) / scale).max(axis=0)
    small = (np.abs(residual) / scale).max(axis=0)
    return residual, np.divide(small, size, out=np.zeros_like(small), where=size > 0.0).max(axis=0)


def _solved(basis: Basis, modal: Damped, w: Array) -> Complex:
    """Responses by linear solutions, in batches of frequencies."""
    system = basis.equations
    b = modal.shapes.T @ system.B
    outputs = [c @ modal.shapes for c in (system.Cq, system.Cv, system.Ca)]
    result: Complex = np.empty((len(system.outputs), b.shape[1], len(w)), dtype=complex)
    batch = max(1, BATCH_BYTES // (64 * max(1, b.size)))
    for start in range(0, len(w), batch):
        which = np.arange(start, min(start + batch, len(w)))
        s, eta = 1j * w[which], solved_motions(basis, modal, b, w, which)
        parts = [np.tensordot(c, eta, axes=1) for c in outputs]
        result[:, :, start : start + batch] = parts[0] + s * (parts[1] + s * parts[2])
    result += system.D[:, :, None]
    return result


def solved_motions(basis: Basis, modal: Damped, b: Array, w: Array, which: Index) -> Complex:
    """Return the solutions (m, inputs, which) for loads b in the basis at some of the frequencies by linear solutions.
    """
    if basis.strong_dampers is not None:
        eta = separated_solutions(modal, basis.strong_dampers, b, w, which)
    else:
        eta = refined_solutions(basis, modal, b, (1j * w[which]).astype(complex, copy=False))
    bad = np.flatnonzero(~np.isfinite(eta).all(axis=(0, 1)))
    eta[:, :, bad] = direct_solutions(modal, b, w, which[bad])
    return eta


def refined_solutions(basis: Basis, modal: Damped, b: Array, s: Complex) -> Complex:
    """Solutions (m, inputs, n) by the Schur form, refined; not a number where that does not converge."""
    schur = basis.schur
    eta = schur.solve(s, np.broadcast_to(b[:, :, None], (*b.shape, len(s))))
    for _ in range(REFINEMENTS):
        residual, error = _residual(modal, s, b, eta)
        inaccurate = ~(error <= 2.0 * EPS)
        if not inaccurate.any():
            return eta
        eta[:, :, inaccurate] += schur.solve(s[inaccurate], residual[:, :, inaccurate])
    eta[:, :, ~(_residual(modal, s, b, eta)[1] <= BACKWARD)] = np.nan
    return eta


def _solver(basis: Basis, modal: Damped, w: Array, by_modes: bool) -> Callable[[Complex], Complex]:
    """Return an approximate solver of the equations in the basis at some frequencies, for loads (m, inputs, n)."""
    s: Complex = (1j * w).astype(complex, copy=False)
    if basis.strong_dampers is not None:
        solutions = separated_solutions(modal, basis.strong_dampers, np.eye(len(modal.square)), w, np.arange(len(w)))
        inverse: Complex = np.ascontiguousarray(solutions.transpose(2, 0, 1))
        return lambda right: (inverse @ right.transpose(2, 0, 1)).transpose(1, 2, 0)
    if not by_modes:
        return partial(basis.schur.solve, s)
    if modal.vectors is None:
        matrix: Complex = square_difference(modal.square[:, None], w) + s * modal.gamma[:, None]
        return lambda right: right / matrix[:, None]
    y, weight = residues(modal, s)
    return lambda right: _product(y, weight[:, None] * _product(y.T, right))


def _product(left: Complex, right: Complex) -> Complex:
    return (left @ np.ascontiguousarray(right).reshape(len(right), -1)).reshape(-1, *right.shape[1:])


def direct_solutions(modal: Damped, b: Array, w: Array, which: Index) -> Complex:
    """Solutions (m, inputs, which) by one factorisation a frequency."""
    m = len(b)
    result = np.empty((*b.shape, len(which)), dtype=complex)
    batch = max(1, BATCH_BYTES // (16 * m * m))
    diagonal = np.arange(m)
    for start in range(0, len(which), batch):
        batch_points = which[start : start + batch]
        part = w[batch_points, None]
        matrix = 1j * part[:, :, None] * modal.gamma
        matrix[:, diagonal, diagonal] += square_difference(modal.square, part)
        try:
            result[:, :, start : start + batch] = np.linalg.solve(matrix, b).transpose(1, 2, 0)
        except np.linalg.LinAlgError:
            singular = [i for i, a in enumerate(matrix) if np.linalg.matrix_rank(a) < m]
            _refuse_pole(w, 0, int(batch_points[singular[0]]))
    return result


def separated_solutions(modal: Damped, dampers: Array, b: Array, w: Array, which: Index) -> Complex:
    """Solutions (m, inputs, which) in motions v = R eta of the dampers, L = Q R, and motions without damping.

    R is graded: sorted by size and pivoted, it preserves the digits of weak dampers next to strong ones. In v damping
    is diagonal, so that it is the imaginary part of the diagonal and is added to no other entry.
    """
    (m, inputs), rows = b.shape, min(dampers.shape)
    result = np.empty((m, inputs, len(which)), dtype=complex)
    motion, turn = np.arange(m), np.empty((m, m))
    for k, i in enumerate(which):
        scale = 1.0 / np.sqrt(np.abs(modal.square) + w[i] ** 2)
        stiff = square_difference(modal.square, w[i]) * scale**2
        upper, order = sorted_qr(dampers * scale)
        pivots = upper[:rows].diagonal()
        damped_motions = int(np.count_nonzero(pivots))
        change = np.eye(m)
        change[:damped_motions] = upper[:damped_motions] / pivots[:damped_motions, None]
        turn[order] = lapack.dtrtri(change, unitdiag=1)[0]
        matrix = (turn.T @ (stiff[:, None] * turn)).astype(complex)
        strength = np.zeros(m)
        strength[:damped_motions] = w[i] * pivots[:damped_motions] ** 2
        matrix[motion, motion] += 1j * strength
        size = 1.0 / np.sqrt(np.maximum(1.0, strength))
        right = (turn.T @ (b * scale[:, None])) * size[:, None]
        try:
            solution = np.linalg.solve(matrix * size[:, None] * size, right) * size[:, None]
        except np.linalg.LinAlgError:
            _refuse_pole(w, 0, int(i))
        result[:, :, k] = (turn @ solution) * scale[:, None]
    return result


def _refuse_pole(w: Array, mode: int, i: int) -> None:
    mode_text = "a rigid-body mode" if w[i] == 0.0 else f"undamped mode {mode + 1}"
    raise ResponseError(
        f"frequency_response: omega[{i}] = {w[i]:g} rad/s is a pole of the system ({mode_text}), where the response is "
        f"infinite; leave this frequency out, or give the mechanism damping."
    )
