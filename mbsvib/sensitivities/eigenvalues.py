"""Sensitivities of the eigenvalues, repeated ones included, also of variants of a plan.

With y^T (2 lambda M + C) x = 1 an eigenvalue moves by d lambda = -y^T (lambda^2 dM + lambda dC + dK) x. Where
eigenvalues coincide, those of this form in their common subspace are the directions in which they part.

Derivatives of variants are taken in the pose as it is, where loads need not balance: complex steps along each
parameter, or, where these are many, the adjoint statement of all of them with steps along those that act by no rule of
a part. Their parameters are those of the plan: rotation vectors from the nominal axes.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import cached_property

import numpy as np

from mbsvib.common.arrays import Array, Complex
from mbsvib.common.memory import keep_freed_memory
from mbsvib.equations.batch_assembly import BatchPlan
from mbsvib.equations.batch_equations import BatchEquations
from mbsvib.equations.equations import Equations
from mbsvib.equations.matrices import MATRICES
from mbsvib.equations.plan_tangents import along_parameters
from mbsvib.linalg.products import real_product
from mbsvib.linalg.rank import ZERO_RIGID_FORM, ZERO_RIGID_FORM_BY_MATRICES
from mbsvib.linalg.vectors import Field
from mbsvib.mechanism.changes import to_angular_velocities
from mbsvib.mechanism.parameters import Parameter
from mbsvib.modes import Modes
from mbsvib.modes.batch import BatchModes
from mbsvib.responses.basis import Basis
from mbsvib.sensitivities.adjoint_fields import Fields, Motions, fields, motions
from mbsvib.sensitivities.basis import SensitivityBasis
from mbsvib.sensitivities.forms import MatrixDerivativeGroup
from mbsvib.sensitivities.loaded_network import LoadedNetwork
from mbsvib.sensitivities.network import Network
from mbsvib.sensitivities.network_assembly import bare_network
from mbsvib.sensitivities.parameter_groups import ParameterGroups
from mbsvib.sensitivities.spectrum import Spectrum, branches, put
from mbsvib.sensitivities.variables import Direction, ListedLater, Requested, Variables


def eigenvalue_sensitivities(basis: SensitivityBasis, parameters: Requested = None) -> Complex:
    """Return the derivatives (parameters, eigenvalues) of all eigenvalues, see ``System.eigenvalue_sensitivities``.

    d lambda / dp = -y^T (lambda^2 dM/dp + lambda dC/dp + dK/dp) x / y^T (2 lambda M + C) x

    Eigenvalues that coincide have the derivatives of their branches, in ascending order. An eigenvalue 0 has 0 where
    the parameter leaves the motion free, infinity where it does not. Not a number where a parameter, changed alone,
    takes degrees of freedom away (it tilts one pin of a planar loop).

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
    norm = _normalization(system, 2.0 * widened.lead, widened.right, spectrum.left)
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
            cross = _normalization(system, spectrum.lead[first] + spectrum.lead[second], spectrum.right[:, second],
                                   np.asarray(spectrum.left)[:, first])  # fmt: skip
            form = _joined(groups.chain(groups.forms(left.take(first), right.take(second)))).T
        for which, values in branches(pairs, diagonal, form, (norm, cross)):
            put(result, spectrum, which, values.T)
    return result


def _normalization(system: Equations, twice: Complex, right: Field, left: Field | None) -> Complex:
    """Return y^T (2 lambda M + C) x, ``twice`` being 2 lambda."""
    y = right if left is None else left
    result = twice * (y * real_product(system.M, right)).sum(axis=0)
    if system.C.any():
        result = result + (y * real_product(system.C, right)).sum(axis=0)
    return np.asarray(result, dtype=complex)


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


# The adjoint costs less than complex steps along p parameters of a mechanism with n joint coordinates if p (n^2 + 8^2)
# exceeds this, without loads and with them: measured on platforms and chains of 2 to 60 coordinates.
WORTH_ADJOINT, WORTH_ADJOINT_LOADED, OWN = 10_000, 60_000, 8


class PoseBasis(SensitivityBasis):
    """What sensitivities of variant ``i`` of a batch share in its pose as it is; ``known``: its modes, if they are
    asked for.
    """

    pose_moves = False

    def __init__(self, plan: BatchPlan, batch: BatchEquations, i: int, known: Modes | None = None) -> None:
        super().__init__(Basis(batch[i]), known=known)
        self._variant = plan, batch.slice(i, i + 1)

    @cached_property
    def loaded(self) -> LoadedNetwork | None:
        """The network under its forces; None where bodies float: off balance, it takes screws for their motions, the
        equations a translation and a rotation, so that K differs.
        """
        return None if self.equations.provenance.topology.floating else super().loaded

    def matrix_slopes(self, directions: Sequence[Direction], every: bool = False) -> Mapping[str, Array]:
        """Return the derivatives of whole matrices along some directions, which have the names of parameters."""
        plan, batch = self._variant
        if not plan.at_once(batch.values):
            return super().matrix_slopes(directions, True)
        names = plan.slots.names
        which = [names.index(direction.name) for direction in directions]
        return {key: array[0] for key, array in steps(plan, batch, np.eye(len(names))[:, which]).items()}

    def rates(self, rates: Sequence[Mapping[str, float]]) -> list[dict[str, float]]:
        """Return rates of the parameters of the system from those of the plan, by name."""
        result = [dict(one) for one in rates]
        to_angular_velocities(result, {name: value[0] for name, value in self._variant[1].values.by_name.items()})
        return result


def steps(plan: BatchPlan, batch: BatchEquations, directions: Array) -> dict[str, Array]:
    """Return derivatives (n, k, ...) of the matrices along the columns of directions (p, k), by complex steps."""
    known = along_parameters(plan, batch, dict(zip(batch.parameters, directions, strict=True)))
    return {key: array for key in MATRICES if (array := known[key]) is not None}


def eigenvalue_slopes(plan: BatchPlan, batch: BatchEquations, modes: BatchModes) -> Complex:
    """Return the derivatives (n, eigenvalues, p) of the eigenvalues of all variants to the p parameters of their plan.

    ``modes``: those of the batch, in the order of whose eigenvalues derivatives are.
    """
    names, coordinates = plan.slots.names, len(plan.scene.coordinates.names)
    at_once, worth = plan.at_once(batch.values), WORTH_ADJOINT_LOADED if plan.own_decisions else WORTH_ADJOINT
    many = len(names) * (coordinates**2 + OWN**2) > worth and plan.nominal.provenance.separation is None
    if plan.posed is not None or (at_once and not many):
        return _by_steps(plan, batch, modes)
    result = []
    for i in range(len(batch)):
        basis = PoseBasis(plan, batch, i, modes[i])
        rates = basis.rates([{name: 1.0} for name in names])
        result.append(eigenvalue_sensitivities(basis, dict(zip(names, rates, strict=True))).T)
    return np.array(result)


def _by_steps(plan: BatchPlan, batch: BatchEquations, modes: BatchModes) -> Complex:
    """Derivatives of the eigenvalues of all variants by complex steps along all parameters."""
    parameters, names = plan.slots.parameters, tuple(batch.parameters)
    every = np.arange(len(names))
    network, slopes = bare_network(batch.nominal), steps(plan, batch, np.eye(len(names)))
    entries = ListedLater(len(names), lambda: [
        parameters.entry(name) if name in parameters else _displacement(name) for name in names])  # fmt: skip
    requested = Variables(names, entries, parameters.parts, every, every, np.ones(len(names)))
    result = []
    for i in range(len(batch)):
        known = {key: array[i] for key, array in slopes.items()}
        groups = ParameterGroups(network, requested, (), lambda *_: {}, MatrixDerivativeGroup(every, known), every=True)
        system = replace(batch.nominal, M=batch.M[i], C=batch.C[i], K=batch.K[i])
        basis = SensitivityBasis(Basis(system), network, modes[i], groups)
        result.append(eigenvalue_sensitivities(basis).T)
    return np.array(result)


def _displacement(name: str) -> Parameter:
    """A joint coordinate of the pose as a parameter."""
    joint, _, direction = name.rpartition(".")
    return Parameter(name, joint, "displacement", (), 0.0, "rad" if direction[0] == "r" else "m")


def tangents(plan: BatchPlan, batch: BatchEquations, directions: Array) -> dict[str, Array]:
    """Return the derivatives (n, k, ...) of the matrices of all variants along directions (p, k)."""
    if plan.posed is not None or plan.at_once(batch.values):
        return steps(plan, batch, directions)
    result = []
    for i in range(len(batch)):
        basis = PoseBasis(plan, batch, i)
        rates = basis.rates([dict(zip(plan.slots.names, column, strict=True)) for column in directions.T.tolist()])
        result.append(basis.matrix_derivatives({f"direction {k}": one for k, one in enumerate(rates)}))
    return {key: np.array([getattr(one, key) for one in result]) for key in MATRICES}
