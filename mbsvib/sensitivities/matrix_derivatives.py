"""Derivatives of the matrices themselves, as whole matrices and as factors of low rank."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np

from mbsvib.common.display import Displayed
from mbsvib.errors import ModelError, nearest
from mbsvib.linalg.rank import SAME_TRANSPOSE, ZERO_FACTOR
from mbsvib.sensitivities.adjoint_fields import fields, motions
from mbsvib.sensitivities.port_forms import feedthrough, port_forms
from mbsvib.sensitivities.ports import no_loads
from mbsvib.sensitivities.products import factored

if TYPE_CHECKING:
    from mbsvib.common.arrays import Array
    from mbsvib.equations.equations import Equations
    from mbsvib.linalg.vectors import Field
    from mbsvib.sensitivities.parameter_groups import ParameterGroups
    from mbsvib.sensitivities.ports import Loads

_ONE, _NONE = np.ones(1), np.zeros(1)
_STILL = (_NONE, _NONE, _NONE)
_POWERS = {"K": (_ONE, _NONE, _NONE), "C": (_NONE, _ONE, _NONE), "M": (_NONE, _NONE, _ONE)}
_OUTPUTS = {"K": "Cq", "C": "Cv", "M": "Ca"}
# Numbers that the derivatives of some rows may hold.
BLOCK = 4_000_000


@dataclass(frozen=True, repr=False)
class MatrixDerivatives(Displayed):
    """Derivatives of a system's matrices to ``variables`` (v,), in the coordinates of the system.

    ``M``, ``C``, ``K`` (v, m, m), ``B`` (v, m, inputs), ``Cq``, ``Cv``, ``Ca`` (v, outputs, m), ``D`` (v, outputs,
    inputs) [unit of the entry per unit of the parameter]. Not a number where a parameter, changed alone, takes degrees
    of freedom away.
    """

    variables: tuple[str, ...]
    M: Array
    C: Array
    K: Array
    B: Array
    Cq: Array
    Cv: Array
    Ca: Array
    D: Array
    _groups: ParameterGroups = field(repr=False)

    def factors(self, variable: str, matrix: str) -> tuple[Array, Array]:
        """Return the derivative of M, C or K to one variable as a product of low rank, P Q^T + Q P^T.

        A stiffness of a spring has one column, a mass three, whatever the number of coordinates.

        Parameters
        ----------
        variable : str
            One of the variables.
        matrix : str
            "M", "C" or "K".

        Returns
        -------
        tuple of array, shape (m, rank)
            P and Q; no columns where the matrix does not change.

        Raises
        ------
        ModelError
            If there is no such variable or matrix.
        """
        if variable not in self.variables or matrix not in _POWERS:
            known, requested = (self.variables, variable) if matrix in _POWERS else (tuple(_POWERS), matrix)
            raise ModelError(
                f"factors('{variable}', '{matrix}'): there is no '{requested}'.{nearest(requested, known)} There is: "
                f"{', '.join(known[:12])}{', ...' if len(known) > 12 else ''}.", element=requested,
            )  # fmt: skip
        index = self.variables.index(variable)
        # what the equilibrium does, and spin, is no symmetric product of few parts
        if self._groups.loaded is not None or self._groups.network.spin is not None:
            p, q = factored(getattr(self, matrix)[index], matrix, variable, SAME_TRANSPOSE)
            return p.T, q.T
        return _factors(self._groups, index, matrix)

    def __repr__(self) -> str:
        return f"MatrixDerivatives({len(self.variables)} variables, {self.M.shape[1]} DOF)"


def matrix_derivatives(
    system: Equations, groups: ParameterGroups, actuation: Loads, sensing: Loads
) -> MatrixDerivatives:
    """Return the derivatives of all matrices to variables, as whole matrices and as factors of low rank.

    ``groups``: the variables and the groups of the parameters that they move.

    Source: Jiang, Chen & Luo (2011), equations 78-87; ports and loops by the wrenches that connections transmit.
    """
    m, i, o = system.dof, list(range(len(system.inputs))), list(range(len(system.outputs)))
    network, unit = groups.network, np.eye(system.dof)
    free, turns = no_loads(network, m), feedthrough(system, (i, actuation), (o, sensing))[1]
    left, right = unit[:, :, None, None], unit[:, None, :, None]

    def chained(form: Field, key: str) -> Array:
        if groups.matrix_group is not None:
            form[groups.matrix_group.rows, ..., 0] = groups.matrix_group.slopes[key]
        return np.asarray(groups.chain(form[..., 0]))

    def ports(
        key: str, pair: tuple[Loads, Loads], powers: tuple[Array, Array, Array], vectors: tuple[Array, Array]
    ) -> Array:
        turning = turns if pair[0] is actuation and pair[1] is sensing else np.zeros((*_ports(pair), 3))
        return chained(port_forms(groups, pair, powers, vectors, turning), key)

    def square(key: str) -> Array:
        """Some of the rows at a time, where all parameters count whichever few were asked for."""
        powers = _POWERS[key]
        x = fields(network, motions(network, right), *powers, side=1)
        step = max(1, m if groups.loaded is None else BLOCK // max(1, groups.size * m))
        parts = []
        for start in range(0, max(1, m), step):
            y = fields(network, motions(network, left[:, start : start + step]), *powers, side=-1)
            parts.append(chained(groups.forms(y, x), key))
        return np.concatenate(parts, axis=1)

    no_inputs, no_outputs = np.zeros((m, 1, len(i), 1)), np.zeros((m, len(o), 1, 1))
    of_outputs = {_OUTPUTS[key]: ports(_OUTPUTS[key], (free, sensing), powers, (right, no_outputs))
                  for key, powers in _POWERS.items()}  # fmt: skip
    of_outputs["D"] = ports("D", (actuation, sensing), _STILL, (no_inputs, no_outputs))
    if sensing.excluded:
        for key, change in of_outputs.items():
            change[:, sensing.excluded] = groups.variable_slopes[key][:, sensing.excluded]
    return MatrixDerivatives(
        tuple(groups.variables.names), square("M"), square("C"), square("K"),
        ports("B", (actuation, free), _STILL, (no_inputs, left)), of_outputs["Cq"], of_outputs["Cv"], of_outputs["Ca"],
        of_outputs["D"], groups,
    )  # fmt: skip


def _ports(pair: tuple[Loads, Loads]) -> tuple[int, int]:
    return len(pair[1].order), len(pair[0].order)


def _factors(groups: ParameterGroups, variable: int, matrix: str) -> tuple[Array, Array]:
    network = groups.network
    m = network.displacements.shape[1]
    motion = fields(network, motions(network, np.eye(m)), *_POWERS[matrix])
    entries = groups.variables.variable == variable
    rate = np.zeros(groups.size)
    np.add.at(rate, groups.variables.parameter[entries], groups.variables.rate[entries])
    first, second = [np.zeros((0, m))], [np.zeros((0, m))]
    if (matrices := groups.matrix_group) is not None:
        for row in matrices.rows[rate[matrices.rows] != 0.0].tolist():
            p, q = matrices.factors(row, matrix, groups.variables.names[variable])
            first.append(rate[row] * p)
            second.append(q)
    for group in groups.by_rule:
        which = np.flatnonzero(((group.rows >= 0) & (rate[group.rows] != 0.0)).any(axis=1))
        for k in which.tolist():
            number, data, rows = group.part(k, k + 1)
            for row, terms in zip(rows[0].tolist(), group.rule(motion, number, data), strict=True):
                if row >= 0 and rate[row] != 0.0:
                    first += [rate[row] * p for p, _ in terms]
                    second += [q for _, q in terms]
    p, q = np.concatenate(first), np.concatenate(second)
    size = np.abs(p).max(axis=1, initial=0.0) * np.abs(q).max(axis=1, initial=0.0)
    acts = size > ZERO_FACTOR * size.max(initial=0.0)
    return p[acts].T, q[acts].T
