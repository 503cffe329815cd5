"""Derivatives of variants to the parameters of a plan, in the pose as it is, where loads need not balance.

They are complex steps along each parameter, or, where these are many, the adjoint statement of all of them with steps
along those that act by no rule of a part. Parameters are those of the plan: rotation vectors from the nominal axes.
"""

from __future__ import annotations

from dataclasses import replace
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from mbsvib.equations.matrices import MATRICES
from mbsvib.equations.plan_tangents import along_parameters
from mbsvib.mechanism.changes import to_angular_velocities
from mbsvib.mechanism.parameters import Parameter
from mbsvib.responses.basis import Basis
from mbsvib.sensitivities.basis import SensitivityBasis
from mbsvib.sensitivities.eigenvalues import eigenvalue_sensitivities
from mbsvib.sensitivities.network_assembly import bare_network
from mbsvib.sensitivities.parameter_groups import ParameterGroups
from mbsvib.sensitivities.products import MatrixDerivativeGroup
from mbsvib.sensitivities.variables import ListedLater, Variables

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from mbsvib.common.arrays import Array, Complex
    from mbsvib.equations.batch_assembly import BatchPlan
    from mbsvib.equations.batch_equations import BatchEquations
    from mbsvib.modes import Modes
    from mbsvib.modes.batch import BatchModes
    from mbsvib.sensitivities.loaded_network import LoadedNetwork
    from mbsvib.sensitivities.variables import Direction

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
