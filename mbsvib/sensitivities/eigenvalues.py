"""Sensitivities of the eigenvalues, repeated ones included.

With y^T (2 lambda M + C) x = 1 an eigenvalue moves by d lambda = -y^T (lambda^2 dM + lambda dC + dK) x. Where
eigenvalues coincide, those of this form in their common subspace are the directions in which they part.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from mbsvib.common.memory import keep_freed_memory
from mbsvib.linalg.rank import ZERO_RIGID_FORM, ZERO_RIGID_FORM_BY_MATRICES
from mbsvib.sensitivities.adjoint_fields import fields, motions
from mbsvib.sensitivities.branches import branches
from mbsvib.sensitivities.spectrum import put

if TYPE_CHECKING:
    from mbsvib.common.arrays import Complex
    from mbsvib.equations.equations import Equations
    from mbsvib.linalg.vectors import Field
    from mbsvib.sensitivities.adjoint_fields import Fields, Motions
    from mbsvib.sensitivities.basis import SensitivityBasis
    from mbsvib.sensitivities.network import Network
    from mbsvib.sensitivities.parameter_groups import ParameterGroups
    from mbsvib.sensitivities.spectrum import Spectrum
    from mbsvib.sensitivities.variables import Requested


def eigenvalue_sensitivities(basis: SensitivityBasis, parameters: Requested = None) -> Complex:
    """Return the derivatives of all eigenvalues.

    d lambda / dp = -y^T (lambda^2 dM/dp + lambda dC/dp + dK/dp) x / y^T (2 lambda M + C) x

    Parameters
    ----------
    basis : SensitivityBasis
        The equations of motion, their modes and their network.
    parameters : str, iterable of str, mapping or None
        Names, patterns or linear maps of parameters; None: every parameter of the system.

    Returns
    -------
    array, shape (parameters, eigenvalues)
        Derivatives [1/s per unit of the parameter], eigenvalues in the order of ``modes().eigenvalues``. Eigenvalues
        that coincide have the derivatives of their branches, in ascending order. An eigenvalue 0 has 0 where the
        parameter leaves the motion free, infinity where it does not. Not a number where a parameter, changed alone,
        takes degrees of freedom away (it tilts one pin of a planar loop).

    Raises
    ------
    ModelError
        If a parameter is unknown.

    Source: Jiang, Chen & Luo (2011), sensitivities of eigenvalues; Friswell, J. Vib. Acoust. 118 (1996) 390, for
    repeated ones.
    """
    system, groups = basis.equations, basis.groups(parameters)
    spectrum, pairs = basis.spectrum
    keep_freed_memory(groups.size)
    if len(pairs.groups) and spectrum.left is None and groups.unsymmetric:
        spectrum = replace(spectrum, left=spectrum.right)
    widened = spectrum if spectrum.left is not None else spectrum.with_sums(pairs)
    x = motions(groups.network, widened.right[:, None])
    y = x if spectrum.left is None else motions(groups.network, spectrum.left[:, None])
    norm = _modal_normalization(x, y, 2.0 * widened.lead)
    if groups.network.partial:
        norm = _normalization(system, widened, widened.right, spectrum.left)
    with np.errstate(divide="ignore", invalid="ignore"):
        scale = -1.0 / norm
    resting = np.flatnonzero(spectrum.lead == 0.0)
    scale[len(spectrum.lead) :] = 1.0
    for group in (resting, *pairs.groups):
        scale[group] = 1.0
    symmetric = spectrum.left is None
    right = _fields(groups.network, x, widened.lead, 2.0 * scale if symmetric else scale, 0 if symmetric else 1)
    left = None if symmetric else _fields(groups.network, y, spectrum.lead, scale, -1)
    result, of_sums = _simple(groups, spectrum, left, right)
    if len(resting):
        lead = np.abs(result[:, spectrum.index])
        size = (lead / np.abs(scale[: len(spectrum.lead)])).max(axis=1, keepdims=True)
        zero = ZERO_RIGID_FORM
        if groups.matrix_group is not None or groups.loaded is not None:
            zero = ZERO_RIGID_FORM_BY_MATRICES
            work = basis.variants.sizes(groups.variables.as_directions()) * float(np.abs(spectrum.right).max()) ** 2
            size = np.maximum(size, work[:, None])
        put(result, spectrum, resting, np.where(lead[:, resting] <= zero * size, 0.0, np.inf))
    if len(pairs.groups):
        diagonal = np.ascontiguousarray(result.T[spectrum.index])
        if left is None:  # between two motions: half of what both together have beyond each
            cross = 0.5 * (norm[len(spectrum.lead) :] - norm[pairs.first] - norm[pairs.second])
            form = 0.5 * (np.ascontiguousarray(of_sums.T) - diagonal[pairs.first] - diagonal[pairs.second])
        else:
            first, second = np.concatenate((pairs.first, pairs.second)), np.concatenate((pairs.second, pairs.first))
            cross = _modal_normalization(x.take(second), y.take(first), spectrum.lead[first] + spectrum.lead[second])
            if groups.network.partial:
                twice = replace(spectrum, lead=0.5 * (spectrum.lead[first] + spectrum.lead[second]))
                cross = _normalization(system, twice, spectrum.right[:, second], np.asarray(spectrum.left)[:, first])
            form = _joined(groups.chain(groups.forms(left.take(first), right.take(second)))).T
        for which, values in branches(pairs, diagonal, form, (norm, cross)):
            put(result, spectrum, which, values.T)
    return result


def _modal_normalization(x: Motions, y: Motions, twice: Complex) -> Complex:
    """Return y^T (2 lambda M + C) x."""
    result: Complex = twice * (y.body * x.momentum).sum(axis=(0, 1))[0]
    if x.viscous is not None:
        result += (y.relative[-len(x.viscous) :] * x.viscous).sum(axis=(0, 1))[0]
    return result


def _normalization(system: Equations, spectrum: Spectrum, right: Field, left: Field | None) -> Complex:
    """Return y^T (2 lambda M + C) x with all that there is in M and C."""
    y = right if left is None else left
    return np.asarray((y * (2.0 * spectrum.lead * (system.M @ right) + system.C @ right)).sum(axis=0), dtype=complex)


def _fields(network: Network, motion: Motions, values: Complex, scale: Complex, side: int) -> Fields:
    """Fields of e^(lambda t), times a scale; of real shapes the real and the imaginary parts, in real arithmetic."""
    powers = np.array([scale, scale * values, scale * values * values])[:, None]
    if motion.body.dtype.kind != "c":
        powers = np.concatenate((powers.real, powers.imag), axis=1)
    return fields(network, motion, powers[0], powers[1], powers[2], side=side)


def _simple(groups: ParameterGroups, spectrum: Spectrum, left: Fields | None, right: Fields) -> tuple[Complex, Complex]:
    """Forms of all eigenvalues, conjugates included, (variables, eigenvalues), and those of sums behind them."""
    first, second = (right, None) if left is None else (left, right)
    form, lead = groups.chain(groups.forms(first, second)), len(spectrum.lead)
    result = np.empty((len(form), spectrum.count), dtype=complex)
    if spectrum.alternates:
        result[:, ::2] = _joined(form[..., :lead])
        np.conjugate(result[:, ::2], out=result[:, 1::2])
    else:
        put(result, spectrum, np.arange(lead), _joined(form[..., :lead]))
    return result, _joined(form[..., lead:])


def _joined(form: Field) -> Complex:
    """Forms (..., n) of their real and imaginary parts (..., 2, n), where they come in real arithmetic."""
    real, *imag = (form[..., i, :] for i in range(form.shape[-2]))
    if not imag:
        return np.asarray(real)
    result = np.empty(real.shape, dtype=complex)
    result.real, result.imag = real, imag[0]
    return result
