"""Sensitivities of some modes of a large mechanism, at a cost in proportion to modes times parameters.

A mode moves by d lambda = -y^T (lambda^2 dM + lambda dC + dK) x / y^T (2 lambda M + C) x, of which each parameter needs
what its own part sees of x and y, and the forces that joints hand on. M and C are those of the small system in which
the modes were found.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import TYPE_CHECKING, cast

import numpy as np

from mbsvib.elements.beam import Beam
from mbsvib.equations.equations import MATRICES
from mbsvib.errors import ModelError
from mbsvib.responses.basis import Basis
from mbsvib.sensitivities.basis import SensitivityBasis
from mbsvib.sensitivities.eigenvalues import eigenvalue_sensitivities
from mbsvib.sensitivities.network_assembly import assembled, is_complete
from mbsvib.sensitivities.shapes import ModeSensitivities
from mbsvib.sensitivities.sparse_network import ModalCoordinates
from mbsvib.sensitivities.spectrum import TOGETHER
from mbsvib.sparse.modes import modes

if TYPE_CHECKING:
    from collections.abc import Sequence

    from mbsvib.common.arrays import Array, Complex, Index
    from mbsvib.elements.part import Part
    from mbsvib.equations.equations import Equations
    from mbsvib.mechanism.mechanism import Mechanism
    from mbsvib.sensitivities.variables import Asked, Direction
    from mbsvib.sparse.equations import SparseEquations
    from mbsvib.sparse.modes import SomeModes

# Modes beyond those asked for, so that those that coincide are there together.
GUARDS = 2


def sparse_mode_sensitivities(
    system: SparseEquations, parameters: Asked, count: int, near: float, dense: type[Equations], form: type[SomeModes]
) -> ModeSensitivities:
    """Return the derivatives of some modes of a large mechanism.

    Parameters
    ----------
    system : SparseEquations
        The equations of motion.
    parameters : str, iterable of str, mapping or None
        Names, patterns or linear maps of parameters; None: every parameter of the model.
    count : int
        Number of modes.
    near : float
        The frequency [Hz] whose nearest modes are taken, 0 for the lowest.
    dense, form : type
        The classes of the small dense equations and of the modes.

    Returns
    -------
    ModeSensitivities
        Derivatives of eigenvalues, frequencies and damping ratios; those of shapes are refused.

    Raises
    ------
    ModelError
        If a parameter is unknown, or acts on the matrices in a way that is known of dense equations only.
    ResponseError
        If the number of modes or the frequency are not such numbers.
    """
    wanted = modes(system, count, near, dense, form)
    extra, known = GUARDS, wanted
    while True:
        known = modes(system, min(system.dof, count + extra), near, dense, form)
        wanted = cast("SomeModes", known.nearest(count, near))
        if len(known) == system.dof or not _cut(wanted, known, near):
            break
        extra *= 2
    basis = _basis(system, known.reduced)
    values = eigenvalue_sensitivities(basis, parameters)
    place = places(wanted.eigenvalues, basis.modes.eigenvalues)
    groups = basis.groups(parameters)
    return ModeSensitivities(tuple(groups.variables.names), wanted, values[:, place], basis, groups)


def _cut(wanted: SomeModes, known: SomeModes, near: float) -> bool:
    """Whether the mode farthest from the frequency coincides with a wanted one, so that more of them may be missing."""
    last = known.pairs[np.argmax(np.abs(known.natural - 2.0 * np.pi * near))]
    return bool((np.abs(wanted.pairs - last) <= TOGETHER * np.abs(last)).any() and np.abs(last).max() > 0.0)


def places(values: Complex, known: Complex) -> Index:
    """Return the numbers of some eigenvalues among all, both in ascending order, of those that coincide the first.

    Parameters
    ----------
    values : array, shape (n,)
        Some of them, as others have computed them.
    known : array, shape (m,)
        All of them.

    Returns
    -------
    array, shape (n,)
        Numbers.
    """
    free, result = np.ones(len(known), dtype=bool), []
    for value in values:
        distance = np.where(free, np.abs(known - value), np.inf)
        nearest = int(np.flatnonzero(distance <= distance.min() + TOGETHER * abs(value))[0])
        free[nearest] = False
        result.append(nearest)
    return np.sort(np.array(result, dtype=np.intp))


def _basis(system: SparseEquations, small: Equations) -> SparseSensitivityBasis:
    """The basis of a small system that knows the model, with the network of all of its parts."""
    came = replace(small.provenance, parts=declared_parts(system.model), origin=system.model, springs=system.springs)
    ways = ModalCoordinates.of(system, small)
    small = replace(small, provenance=came)
    network = assembled(small, ways)
    if not is_complete(small, network):
        raise ModelError(f"mode_sensitivities: the forces of the parts of '{system.name}' are not all that its "
                         f"equations have; use linearize(method='dense').", element=system.name)  # fmt: skip
    return SparseSensitivityBasis(Basis(small), network)


def declared_parts(model: Mechanism) -> tuple[Part, ...]:
    """Return the parts of a mechanism in the order of its parameters, those that stand for others in place of these."""
    parts: tuple[Part, ...] = (
        *model.gravity_parts, *model.bodies.values(), *model.joints.values(), *model.springs.values(),
        *model.couplers.values(), *model.rotors.values(), *model.loads.values(),
    )  # fmt: skip
    return parts if model.pieces is None else model.pieces.declared(parts)


class SparseSensitivityBasis(SensitivityBasis):
    """What the sensitivities of some modes share: parameters that act on more than the modes see are refused."""

    def matrix_slopes(self, directions: Sequence[Direction], every: bool = False) -> Mapping[str, Array]:
        """Refuse parameters that have no rule by name, or return that they are not a number where all are asked for."""
        if not every:
            name = directions[0].name
            parts = self.equations.provenance.parts
            beam = any(isinstance(part, Beam) and name.startswith(part.name + ".") for part in parts)
            why = "the axes of an upright beam" if beam else "its equilibrium or its spin"
            raise ModelError(
                f"mode_sensitivities: what '{name}' does to {why} is known of dense equations only; use "
                f"linearize(method='dense'), or name other parameters.", element=name,
            )  # fmt: skip
        own = self.equations
        return {key: np.full((len(directions), *getattr(own, key).shape), np.nan) for key in MATRICES}
