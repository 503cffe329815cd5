"""Derivatives of the matrices themselves, as whole matrices and as factors of low rank."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from mbsvib.common.arrays import Array
from mbsvib.common.display import Displayed
from mbsvib.equations.equations import Equations
from mbsvib.errors import ModelError, nearest
from mbsvib.linalg.rank import ZERO_FACTOR, ZERO_MATRIX_SLOPE
from mbsvib.linalg.vectors import Field
from mbsvib.sensitivities.adjoint_fields import fields, motions
from mbsvib.sensitivities.parameter_groups import ParameterGroups
from mbsvib.sensitivities.ports import Loads, feedthrough, no_loads, port_forms

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

    def factors(self, variable: str, matrix: str) -> tuple[Array, Array]:
        """Return the derivative of M, C or K to one variable as a product of low rank, P Q^T + Q P^T.

        They have as few columns as can be: one for the stiffness of a spring, three at most for a mass.

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
            If there is no such variable or matrix, or the derivative is not symmetric.
        """
        if variable not in self.variables or matrix not in _POWERS:
            known, requested = (self.variables, variable) if matrix in _POWERS else (tuple(_POWERS), matrix)
            raise ModelError(
                f"factors('{variable}', '{matrix}'): there is no '{requested}'.{nearest(requested, known)} There is: "
                f"{', '.join(known[:12])}{', ...' if len(known) > 12 else ''}.", element=requested,
            )  # fmt: skip
        return _factors(getattr(self, matrix)[self.variables.index(variable)], matrix, variable)

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
        of_outputs["D"],
    )  # fmt: skip


def _ports(pair: tuple[Loads, Loads]) -> tuple[int, int]:
    return len(pair[1].order), len(pair[0].order)


def _factors(change: Array, matrix: str, variable: str) -> tuple[Array, Array]:
    """Return P and Q (m, rank) with P Q^T + Q P^T = A of a symmetric matrix A, whose rows are scaled alike.

    A = sum of a a^T - sum of b b^T, of its positive and its negative eigenvalues, has a column (a + b) / 2 in P and one
    a - b in Q for each pair of them.
    """
    size = np.abs(change).max(initial=0.0)
    if not np.abs(change - change.T).max(initial=0.0) <= ZERO_MATRIX_SLOPE * size:
        raise ModelError(f"factors: the derivative of {matrix} to '{variable}' is not symmetric, or not a number, and "
                         f"has no such factors; take the matrix itself.", element=variable)  # fmt: skip
    moves = np.flatnonzero(change.any(axis=1) | change.any(axis=0))
    acting = 0.5 * (change + change.T)[np.ix_(moves, moves)]
    unit = np.abs(acting).max(axis=1, initial=0.0) / np.sqrt(size or 1.0)
    sizes, vectors = np.linalg.eigh(acting / unit[:, None] / unit)
    largest = np.abs(sizes).max(initial=0.0)
    a, b = (unit[:, None] * vectors[:, which] * np.sqrt(np.abs(sizes[which]))
            for which in (sizes > ZERO_FACTOR * largest, sizes < -ZERO_FACTOR * largest))  # fmt: skip
    p, q = np.zeros((2, len(change), max(a.shape[1], b.shape[1])))
    for part, sign in ((a, 1.0), (b, -1.0)):
        p[moves, : part.shape[1]] += 0.5 * part
        q[moves, : part.shape[1]] += sign * part
    return p, q
