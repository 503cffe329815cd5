"""Responses of many bodies: one sparse factorisation a frequency, with right sides and outputs as sparse rows.

Modal responses have a truncation error, with a static correction: well below their frequencies the omitted modes
respond statically, and their contribution to the displacements is the full static compliance minus that of the included
modes, a constant matrix. If the mechanism has free motions, it is the compliance about the free motion, under loads
that the inertia of the free motion balances.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TypeVar

import numpy as np
from numpy.typing import ArrayLike

from mbsvib.common.arrays import AnyArray, Array, Complex
from mbsvib.common.expected import angular
from mbsvib.equations.equations import Equations
from mbsvib.errors import ResponseError
from mbsvib.modes.general import is_general
from mbsvib.modes.undamped import undamped
from mbsvib.responses.basis import Basis
from mbsvib.responses.frequency_response import frequency_response as dense_response
from mbsvib.sparse.equations import SparseEquations
from mbsvib.sparse.from_matrices import quadratic_of
from mbsvib.sparse.galerkin import extended, split_massless
from mbsvib.sparse.operator import operator
from mbsvib.sparse.reduction import RTOL, reduced
from mbsvib.sparse.tableau import FINE, SINGULAR

E = TypeVar("E", bound=Equations)


def frequency_response(system: SparseEquations, omega: ArrayLike) -> Complex:
    """Return G(i w) = (Cq + i w Cv - w^2 Ca) (K + i w C - w^2 M)^-1 B + D, (outputs, inputs, n), at ``omega`` (n,)."""
    w = angular(omega)
    right = quadratic_of(system).right(system.input_rows.toarray().T)
    damped = quadratic_of(system).damped
    displacement, velocity, acceleration = system.output_rows
    through = _through(system)
    result = np.zeros((len(system.outputs), len(system.inputs), len(w)), dtype=complex)
    for i, frequency in enumerate(w.tolist()):
        s = 1j * frequency
        answer = _answer(system, right, s, damped)
        if answer is None and not frequency and system.matrices is None:
            at_zero = _beside_free_motions(system)
            if at_zero is not None:
                result[:, :, i] = at_zero
                continue
        if answer is None:
            kind = "a rigid-body mode" if frequency == 0.0 else "an undamped mode"
            raise ResponseError(
                f"frequency_response: omega[{i}] = {frequency:g} rad/s is a pole of the system ({kind}), where the "
                f"response is infinite; leave this frequency out, or give the mechanism damping."
            )
        result[:, :, i] = displacement @ answer + s * (velocity @ answer) + s * s * (acceleration @ answer) + through
    return result


def _beside_free_motions(system: SparseEquations) -> Array | None:
    """G(0) of a system with motions that no spring resists; None where it is infinite or they are not known.

    With the free motions N and the M-orthogonal inverse K^+ of K on the others, terms of displacements
    z_-2 / s^2 + z_-1 / s + z_0 + ... are in the span of N, K^+ B and K^+ C N, and their equations at s = 0 are those of
    the system in this span, which the dense path answers.
    """
    quadratic = quadratic_of(system)
    t = operator(system, None, system.dof)
    if t.sigma or not t.rigid.shape[1] or not quadratic.symmetric:
        return None
    rates = system.elastic_rows.T @ (system.row_damping[:, None] * (system.elastic_rows @ t.rigid))
    force = np.concatenate((system.input_rows.toarray().T, rates), axis=1)
    force = force - t.wt @ t.deflated @ (t.rigid.T @ force)
    mass, massless = split_massless(system, t.flexible(t.factor.solve(t.right(force))))
    basis = np.concatenate((extended(quadratic, t.rigid, mass, quadratic.speed), massless), axis=1)
    small = reduced(system, basis, t.rigid.shape[1], Equations, massless.shape[1])
    try:
        return np.asarray(dense_response(Basis(small), [0.0])[:, :, 0].real)
    except ResponseError:
        return None


def static_compliance(system: SparseEquations) -> Array:
    """Return Cq K^-1 B + D, (outputs, inputs)."""
    answer = _answer(system, quadratic_of(system).right(system.input_rows.toarray().T), 0.0, False)
    if answer is None:
        raise ResponseError(
            f"static_compliance: the stiffness of '{system.name}' is singular, a motion of the mechanism has no "
            f"stiffness; modes(k) shows these rigid-body modes."
        )
    return np.asarray(system.output_rows[0] @ answer + _through(system), dtype=float)


def _through(system: SparseEquations) -> Array:
    """Feedthrough without the direct contribution of massless motions, which are among the unknowns."""
    return system.D if system.separation is None else system.D - system.separation.at_once


def _answer(system: SparseEquations, right: Array, s: complex, damped: bool) -> AnyArray | None:
    """Displacements and coordinates for unit inputs; None where the matrix is singular to rounding."""
    try:
        factor = system.tableau.factor(s=s) if damped and s else system.tableau.factor(square=-(s * s).real)
    except np.linalg.LinAlgError:
        return None
    answer, change = factor.solve_closely(right, FINE)
    return answer if change <= SINGULAR else None


def corrected(system: SparseEquations, small: E, count: int) -> E:
    """Return the system of the lowest modes with the static displacements of all others in its D.

    D + Cq (K^-1 - sum_i phi_i phi_i^T / omega_i^2) B, the sum over the included modes without free motions; with spin,
    circulatory forces or motions without mass, the static response of the small system replaces the sum

    Refused if free motions are not all among the ``count`` modes, or exist together with spin, circulatory forces or
    motions without mass.
    """
    if is_general(small):
        # G(0) - G_small(0); K is regular, or static_compliance refuses
        full = static_compliance(system) - system.D
        return replace(small, D=small.D + (full - small.Cq @ np.linalg.solve(small.K, small.B)))
    t = operator(system, None, system.dof)
    rigid = t.rigid.shape[1]
    basis = undamped(small, RTOL)
    if t.sigma or basis.rigid < rigid:
        free = f"at least {rigid}" if rigid else "others"
        raise ResponseError(
            f"reduced: static correction of '{system.name}' with {count} modes; free motions have no static part, so "
            f"all of them must be among the modes, and differ from slow ones: ask for more modes ({free}), or for no "
            f"correction."
        )
    force = np.asarray(system.input_rows.toarray().T)
    force = force - t.wt @ t.deflated[:, :rigid] @ (t.rigid.T @ force)
    full = np.asarray(system.output_rows[0] @ t.flexible(t.factor.solve(t.right(force))))
    phi = basis.shapes[:, basis.rigid :]
    modal = (small.Cq @ phi / basis.square[basis.rigid :]) @ (phi.T @ small.B)
    at_once = 0.0 if system.separation is None else system.separation.at_once  # is in ``full`` too
    return replace(small, D=small.D - at_once + (full - modal))


def truncation_error(system: SparseEquations, small: Equations, omega: ArrayLike) -> Array:
    """Return the errors of the responses of a reduced system at ``omega`` (n,) [rad/s], (outputs, inputs, n).

    |G_small - G| / max over omega of |G|, for each output and input; 0 where the response is 0
    """
    if (small.inputs, small.outputs) != (system.inputs, system.outputs):
        raise ResponseError(f"truncation_error: '{small.name}' has the inputs {', '.join(small.inputs)} and outputs "
                            f"{', '.join(small.outputs)}; expected those of '{system.name}', {', '.join(system.inputs)}"
                            f" and {', '.join(system.outputs)}.")  # fmt: skip
    full = frequency_response(system, omega)
    off = np.abs(dense_response(Basis(small), omega) - full)
    size = np.abs(full).max(axis=2, keepdims=True, initial=0.0)
    return np.asarray(off / np.where(size > 0.0, size, 1.0))
