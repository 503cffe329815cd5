"""Sensitivities of the eigenvalues, repeated ones included.

With y^T (2 lambda M + C) x = 1 an eigenvalue moves by d lambda = -y^T (lambda^2 dM + lambda dC + dK) x. Where
eigenvalues coincide, those of this form in their common subspace are the directions in which they part.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from mbsvib.sensitivities.fields import fields, motions
from mbsvib.sensitivities.plans import plan
from mbsvib.sensitivities.products import forms, picked, table
from mbsvib.sensitivities.spectrum import spectrum
from mbsvib.sensitivities.variables import variables

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping

    from numpy.typing import NDArray

    from mbsvib.kinematics import Array, Index
    from mbsvib.sensitivities.fields import Field, Fields, Motions
    from mbsvib.sensitivities.network import Network
    from mbsvib.sensitivities.plans import Plan
    from mbsvib.sensitivities.spectrum import Spectrum
    from mbsvib.system import System

    Asked = str | Iterable[str] | Mapping[str, Mapping[str, float]] | None
    Complex = NDArray[np.complex128]

EPS = float(np.finfo(float).eps)
# A form in a rigid-body motion below this share of the largest in any motion is zero but for rounding.
ZERO_FORM = 1e-12


def eigenvalue_sensitivities(system: System, parameters: Asked = None) -> Complex:
    """Return the derivatives of all eigenvalues.

    d lambda / dp = -y^T (lambda^2 dM/dp + lambda dC/dp + dK/dp) x / y^T (2 lambda M + C) x

    Parameters
    ----------
    system : System
        The equations of motion.
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
    chosen = planned(system, parameters)
    found = spectrum(system)
    x = motions(chosen.network, found.right[:, None])
    y = x if found.left is None else motions(chosen.network, found.left[:, None])
    groups = found.clusters()
    with np.errstate(divide="ignore", invalid="ignore"):
        scale = -1.0 / _gram(x, y, 2.0 * found.lead)
    resting = np.flatnonzero(found.lead == 0.0)
    for some in (resting, *groups):
        scale[some] = 1.0
    right = _fields(chosen.network, x, found.lead, scale if found.left is not None else 2.0 * scale)
    left = None if found.left is None else _fields(chosen.network, y, found.lead, scale)
    result = _simple(chosen, found, left, right)
    if len(resting):
        lead = np.abs(result[:, found.place])
        size = (lead / np.abs(scale)).max(axis=1, keepdims=True)
        _set(result, found, resting, np.where(lead[:, resting] <= ZERO_FORM * size, 0.0, np.inf))
    if groups:
        _part(result, chosen, found, groups, (x, y), (left, right))
    return result


def planned(system: System, parameters: Asked) -> Plan:
    """Return the plan for the variables asked for; that for all parameters is kept by the system."""
    network = system._network
    return network.every if parameters is None else plan(network, variables(system.parameters, parameters))


def _gram(x: Motions, y: Motions, twice: Complex) -> Complex:
    """Return y^T (2 lambda M + C) x."""
    result: Complex = twice * (y.body * x.momentum).sum(axis=(0, 1))[0]
    if x.viscous is not None:
        result += (y.relative[-len(x.viscous) :] * x.viscous).sum(axis=(0, 1))[0]
    return result


def _fields(network: Network, motion: Motions, values: Complex, scale: Complex) -> Fields:
    """Fields of e^(lambda t), times a scale; of real shapes the real and the imaginary parts, in real arithmetic."""
    powers = np.array([scale, scale * values, scale * values * values])[:, None]
    if motion.body.dtype.kind != "c":
        powers = np.concatenate((powers.real, powers.imag), axis=1)
    return fields(network, motion, *powers)


def _simple(chosen: Plan, found: Spectrum, left: Fields | None, right: Fields) -> Complex:
    """Forms of all eigenvalues, conjugates included, (variables, eigenvalues)."""
    first, second = (right, None) if left is None else (left, right)
    if chosen.variables.identity and found.alternates:
        result = np.empty((chosen.size, found.count), dtype=complex)
        for rows, stride, block in forms(chosen.families, first, second):
            view = picked(result, rows, stride)
            into = np.empty((*rows.shape, found.count), dtype=complex) if view is None else view
            values = _joined(block)
            into[..., ::2] = values
            np.conjugate(values, out=into[..., 1::2])
            if view is None:
                result[rows[rows >= 0]] = into[rows >= 0]
        result[chosen.breaking] = np.nan
        return result
    form = chosen.variables.chain(_complex(table(chosen, first, second), chosen))
    result = np.empty((len(form), found.count), dtype=complex)
    _set(result, found, np.arange(len(found.lead)), form)
    return result


def _joined(form: Field) -> Complex:
    """Forms (..., n) of their real and imaginary parts (..., 2, n), where they come in real arithmetic."""
    real, *imag = (form[..., i, :] for i in range(form.shape[-2]))
    if not imag:
        return np.asarray(real)
    result = np.empty(real.shape, dtype=complex)
    result.real, result.imag = real, imag[0]
    return result


def _complex(form: Field, chosen: Plan) -> Complex:
    result = _joined(form)
    result[chosen.breaking] = np.nan
    return result


def _set(result: Complex, found: Spectrum, which: Index, form: Complex | Array) -> None:
    """Set the columns of some of the lead eigenvalues, and of their conjugates."""
    result[:, found.place[which]] = form
    mirror = np.full(len(found.lead), -1)
    mirror[found.mirrored] = found.mirror
    paired = mirror[which] >= 0
    result[:, mirror[which][paired]] = form[:, paired].conj()


def _part(
    result: Complex, chosen: Plan, found: Spectrum, groups: list[Index], motion: tuple[Motions, Motions],
    at: tuple[Fields | None, Fields],
) -> None:  # fmt: skip
    """Eigenvalues that coincide part along branches of their own."""
    pairs = [np.array(np.meshgrid(group, group, indexing="ij")).reshape(2, -1) for group in groups]
    left, right = np.concatenate(pairs, axis=1)
    x, y = motion
    gram = _gram(x.take(right), y.take(left), found.lead[left] + found.lead[right])
    first = at[1].take(left) if at[0] is None else at[0].take(left)
    form = chosen.variables.chain(_complex(table(chosen, first, at[1].take(right)), chosen))
    if at[0] is None:
        form *= 0.5
    start = 0
    for group in groups:
        part = slice(start, start := start + len(group) ** 2)
        _set(result, found, group, _branches(form[:, part], gram[part], len(group)))


def _branches(form: Complex, gram: Complex, size: int) -> Complex:
    """Derivatives of eigenvalues that coincide, (variables, size), from their forms and y^T (2 lambda M + C) x."""
    pair = gram.reshape(size, size)
    if np.linalg.cond(pair) * EPS > 1.0:  # a defective pair parts with the square root of any change
        return np.full((len(form), size), np.inf, dtype=complex)
    matrix: Complex = np.asarray(-np.linalg.solve(pair, form.reshape(-1, size, size)), dtype=complex)
    if size == 2:
        half = 0.5 * (matrix[:, 0, 0] - matrix[:, 1, 1])
        root = np.sqrt(half * half + matrix[:, 0, 1] * matrix[:, 1, 0])
        mean: Complex = 0.5 * (matrix[:, 0, 0] + matrix[:, 1, 1])
        values: Complex = np.stack((mean - root, mean + root), axis=1)
    else:
        values = _eigenvalues(np.where(np.isfinite(matrix), matrix, 0.0))
        values[~np.isfinite(matrix).all(axis=(1, 2))] = np.nan
    along = np.where(np.abs(values.imag).max(axis=1, keepdims=True) > np.abs(values.real).max(axis=1, keepdims=True),
                     values.imag, values.real)  # fmt: skip
    result: Complex = np.take_along_axis(values, np.argsort(along, axis=1), axis=1)
    return result


def _eigenvalues(matrices: Complex) -> Complex:
    return np.asarray(np.linalg.eigvals(matrices), dtype=complex)
