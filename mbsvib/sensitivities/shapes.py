"""Sensitivities of modes: frequencies, damping ratios and shapes, repeated eigenvalues included.

A shape x moves by x' with T(lambda) x' + T'(lambda) x lambda' = -dT x, which has one solution beside x itself: the
equations are bordered by the normalisation. Where eigenvalues coincide, the same holds of a basis of their common
subspace, and lambda' is a matrix.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from fnmatch import fnmatchcase
from functools import cached_property
from typing import Any

import numpy as np

from mbsvib.common.arrays import Array, Complex
from mbsvib.common.columnar import Columnar
from mbsvib.common.display import Displayed
from mbsvib.errors import ResponseError, counted
from mbsvib.modes import Modes
from mbsvib.sensitivities.adjoint_fields import fields, motions
from mbsvib.sensitivities.basis import SensitivityBasis
from mbsvib.sensitivities.eigenvalues import eigenvalue_sensitivities
from mbsvib.sensitivities.parameter_groups import ParameterGroups
from mbsvib.sensitivities.spectrum import coinciding
from mbsvib.sensitivities.states import StateBasis, state_basis
from mbsvib.sensitivities.variables import Requested
from mbsvib.sparse.modes import SomeModes

# Variables and modes that a table shows.
SHOWN_VARIABLES, SHOWN_MODES = 40, 6
# Derivatives below this share of the largest of their variable are rounding: 0 in the table.
ROUNDED = 1e-12
# Numbers that the forms of some modes may hold.
BLOCK = 4_000_000
# A rigid-body mode stays one if what would move it is less than this share of what moves the others.
RIGID = 1e-9
# A shape of unit size that moves less mass than this share moves none.
MOVES = 0.5


@dataclass(frozen=True, repr=False)
class ModeSensitivities(Columnar, Displayed):
    """Derivatives of the modes of a system to ``variables`` (v,), in the order of ``modes``.

    ``eigenvalues`` (v, 2m) as ``eigenvalue_sensitivities`` gives them. Not a number where a parameter, changed alone,
    takes degrees of freedom away.
    """

    variables: tuple[str, ...]
    modes: Modes = field(repr=False)
    eigenvalues: Complex
    _basis: SensitivityBasis = field(repr=False)
    _groups: ParameterGroups = field(repr=False)

    @cached_property
    def _pairs(self) -> Complex:
        """Derivatives mode by mode, (v, m, 2)."""
        starts = self.modes.starts
        return np.stack((self.eigenvalues[:, starts[:-1]], self.eigenvalues[:, starts[1:] - 1]), axis=2)

    @cached_property
    def _natural(self) -> Array:
        first, second = self.modes.pairs.T
        with np.errstate(all="ignore"):
            change = self._pairs[:, :, 0] * second + first * self._pairs[:, :, 1]
            slope = (change.real * np.sign((first * second).real)) / (2.0 * self.modes.natural)
            rigid = np.abs(self._pairs).max(axis=2)  # 0 where it stays one, infinity where it does not
        result: Array = np.where(self.modes.natural > 0.0, slope, rigid)
        return result

    @cached_property
    def frequencies(self) -> Array:
        """Derivatives of the natural frequencies [Hz per unit of the parameter], shape (v, m)."""
        return self._natural / (2.0 * np.pi)

    @cached_property
    def damped_frequencies(self) -> Array:
        """Derivatives of the frequencies of decaying oscillations [Hz per unit of the parameter], shape (v, m)."""
        first = self.modes.pairs[:, 0]
        return np.where(first.imag != 0.0, self._pairs[:, :, 0].imag * np.sign(first.imag), 0.0) / (2.0 * np.pi)

    @cached_property
    def damping_ratios(self) -> Array:
        """Derivatives of the damping ratios [1 per unit of the parameter], shape (v, m)."""
        first, second = self.modes.pairs.T
        natural = self.modes.natural
        with np.errstate(all="ignore"):
            ratio = -(first + second).real / (2.0 * natural)
            slope = -(self._pairs.sum(axis=2).real / 2.0 + ratio * self._natural) / natural
        fixed = (natural > 0.0) & ((first * second).real < 0.0)
        if self.modes.first_order is not None:
            fixed |= self.modes.first_order
        return np.where(fixed, 0.0, slope)

    @cached_property
    def shapes(self) -> Complex:
        """Derivatives of the shapes, shape (v, m, modes), with x^H M x and the phase kept as they are; of a shape that
        moves no mass, its largest entry.

        Shapes of eigenvalues that coincide are a basis of their subspace, which moves as a whole: their derivatives
        are those of such a basis. Not a number where a rigid-body mode becomes an elastic one. Refused for some modes
        of sparse equations.
        """
        if isinstance(self.modes, SomeModes):
            raise ResponseError(f"mode_sensitivities: derivatives of shapes of '{self.modes.name}' take all of its "
                                f"modes; use linearize(method='dense').")  # fmt: skip
        return shape_sensitivities(self._basis, self._groups, self.modes)

    _index = "variable"

    def columns(self) -> dict[str, Any]:
        """Return the derivatives of natural frequencies [Hz] and damping ratios as columns by name.

        Returns
        -------
        dict of str to array, shape (variables,)
            ``variable``, ``frequency_hz(1)``, ..., ``damping_ratio(1)``, ..., per unit of the variable.
        """
        result: dict[str, Any] = {"variable": np.array(self.variables)}
        for name, slopes in (("frequency_hz", self.frequencies), ("damping_ratio", self.damping_ratios)):
            result |= {f"{name}({i})": column for i, column in enumerate(slopes.T, 1)}
        return result

    @property
    def _units(self) -> Mapping[str, str]:
        return self._basis.equations.parameters.units

    def table(self) -> dict[str, Any]:
        """Return the table of the derivatives of natural frequencies, as arguments of ``mbsvib.common.tables.text``.

        Returns
        -------
        dict
            Title, columns, rows and notes: the first variables and the lowest modes.
        """
        count, units = min(len(self.modes), SHOWN_MODES), self._units
        rows = []
        for name, slopes in zip(self.variables[:SHOWN_VARIABLES], self.frequencies, strict=False):
            fitting = units.get(name) or next((unit for key, unit in units.items() if fnmatchcase(key, name)), "")
            seen = np.where(np.abs(slopes) <= ROUNDED * np.abs(slopes).max(initial=0.0), 0.0, slopes)[:count]
            rows.append((name, f"Hz per {fitting}" if fitting else "Hz", *(f"{slope:.4g}" for slope in seen)))
        columns: list[tuple[str, Any]] = [("variable", "left"), ("unit", "left")]
        columns += [(f"mode {k + 1}", "right") for k in range(count)]
        shown = ((len(rows), self.variables, "variable"), (count, self.modes, "mode"))
        cut = [f"{few} of {counted(len(every), what)}" for few, every, what in shown if few < len(every)]
        notes = [f"The first {' and '.join(cut)}."] if cut else []
        return {"title": f"Derivatives of natural frequencies: {self.modes.name}", "columns": columns, "rows": rows,
                "notes": notes}  # fmt: skip

    def __repr__(self) -> str:
        return f"ModeSensitivities({counted(len(self.variables), 'variable')}, {counted(len(self.modes), 'mode')})"


def mode_sensitivities(basis: SensitivityBasis, parameters: Requested = None) -> ModeSensitivities:
    """Return the derivatives of frequencies, damping ratios and shapes, see ``System.mode_sensitivities``.

    Source: Nelson, AIAA J. 14 (1976) 1201, for shapes; here bordered and for quadratic problems.
    """
    groups = basis.groups(parameters)
    values = eigenvalue_sensitivities(basis, parameters)
    return ModeSensitivities(tuple(groups.variables.names), basis.modes, values, basis, groups)


def shape_sensitivities(basis: SensitivityBasis, groups: ParameterGroups, modes: Modes) -> Complex:
    """Return the derivatives (variables, m, modes) of the columns of ``modes.shapes``.

    Raises an error if the system has both spin and motions without mass.
    """
    system, states = basis.equations, state_basis(basis.responses)
    vectors, k = states.vectors, states.massive
    m, values = system.dof, modes.pairs[:, 0].astype(complex)
    result = np.empty((len(groups.variables.names), m, m), dtype=complex)
    coordinates = np.concatenate((vectors[:, :k].T @ system.M, vectors[:, k:].T @ system.C)) @ modes.shapes
    resting = np.linalg.norm(coordinates[:k], axis=0) < MOVES
    largest = np.argmax(np.abs(modes.shapes), axis=0)
    groups_of_modes = coinciding(values)
    alone = np.setdiff1d(np.arange(len(values)), np.concatenate((*groups_of_modes, np.zeros(0, dtype=np.intp))))
    for group in (*groups_of_modes, *alone[:, None]):
        step = max(1, BLOCK // max(1, groups.size * m))
        residual_forces = np.concatenate([_pushed(groups, modes.shapes[:, chunk], values[chunk])
                                 for chunk in np.array_split(group, -(-len(group) // step))], axis=2)  # fmt: skip
        group_shapes = np.asarray(coordinates[:, group])
        forms = -(vectors.T @ groups.chain(residual_forces[0]))
        dual_shapes = group_shapes.conj().T.copy()
        dual_shapes[:, k:] = 0.0
        at_rest = bool(resting[group].any())
        rows = vectors[largest[group]] if at_rest else dual_shapes
        change = _bordered(states, values[group[0]], group_shapes, rows, forms)
        if not at_rest:
            mass = modes.shapes[:, group].conj().T @ groups.chain(residual_forces[1])
            change = change - group_shapes @ (dual_shapes @ change + 0.5 * mass)
        result[:, :, group] = vectors @ change
    return result


def _pushed(groups: ParameterGroups, shapes: Any, values: Complex) -> Complex:
    """dT x and dM x of some modes, (2, parameters, m, modes)."""
    network = groups.network
    unit = np.eye(len(shapes))[:, :, None]
    x, y = motions(network, shapes[:, None]), motions(network, unit)
    zeros, ones = np.zeros(len(values)), np.ones(len(values))
    result = np.empty((2, groups.size, len(shapes), len(values)), dtype=complex)
    for index, powers in enumerate(((ones.astype(complex), values, values * values), (zeros, zeros, ones))):
        result[index] = groups.forms(fields(network, y, *powers, side=-1), fields(network, x, *powers, side=1))
    return result


def _bordered(states: StateBasis, value: complex, columns: Any, rows: Any, forms: Complex) -> Complex:
    """Solve T X' + T' X lambda' = F, H X' = 0 in a basis, (v, m, k), with rows and columns balanced."""
    m, k = columns.shape
    mass = np.where(np.arange(m) < states.massive, 1.0, 0.0)
    matrix = np.zeros((m + k, m + k), dtype=complex)
    matrix[:m, :m] = states.stiffness + value * states.damping + value * value * np.diag(mass)
    # rigid-body modes stay at 0: what would move them must vanish, whichever damper brakes them
    matrix[:m, m:] = columns if value == 0.0 else 2.0 * value * mass[:, None] * columns + states.damping @ columns
    matrix[m:, :m] = rows
    row = 1.0 / np.maximum(np.abs(matrix).max(axis=1), np.finfo(float).tiny)
    matrix *= row[:, None]
    column = 1.0 / np.maximum(np.abs(matrix).max(axis=0), np.finfo(float).tiny)
    right = np.concatenate((forms, np.zeros((len(forms), k, k))), axis=1).transpose(1, 0, 2).reshape(m + k, -1)
    try:
        solution = column[:, None] * np.linalg.solve(matrix * column, row[:, None] * right)
    except np.linalg.LinAlgError:
        solution = np.full(right.shape, np.nan, dtype=complex)  # a defective pair has no derivative
    result = solution.reshape(m + k, -1, k).transpose(1, 0, 2)
    if value == 0.0:
        moved = np.abs(result[:, m:]).max(axis=(1, 2)) > RIGID * np.abs(forms).max(axis=(1, 2), initial=0.0)
        result[moved] = np.nan
    return np.asarray(result[:, :m])
