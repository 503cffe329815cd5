"""Equations of motion from sparse matrices of another program, in the form of those of a large mechanism.

Unknowns are the coordinates of the matrices. In place of a tableau and its LU stand M, C and K themselves and the
fronts of a symmetric factor; products are those of the matrices.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import cached_property
from typing import Any, TypeVar

import numpy as np
from scipy.sparse import csc_matrix, eye

from mbsvib.common.arguments import shown
from mbsvib.common.arrays import AnyArray, Array
from mbsvib.common.selection import signal_names
from mbsvib.elements import Body, Joint
from mbsvib.equations.equations import Equations
from mbsvib.equations.from_matrices import SYMMETRIC, from_matrices, outputs_of, shaped
from mbsvib.errors import ModelError
from mbsvib.kinematics.loops import Reduction
from mbsvib.linalg.rank import RIGID_ENERGY, UNCOUPLED, ZERO_SUM
from mbsvib.mechanism.mechanism import Mechanism
from mbsvib.sparse.assembly import linearized
from mbsvib.sparse.equations import SparseEquations, SparseMatrices
from mbsvib.sparse.quadratic import Quadratic

S = TypeVar("S", bound="SparseEquations")
E = TypeVar("E", bound="Equations")


class MatrixQuadratic(Quadratic):
    """P(s) = s^2 M + s C + K of matrices."""

    @property
    def _given(self) -> SparseMatrices:
        return matrices_of(self.system)

    @cached_property
    def speed(self) -> float:
        """A typical frequency [rad/s], by the diagonals of stiffness and inertia; 1 without either."""
        k, m = self._given.K.diagonal(), self._given.M.diagonal()
        return float(np.sqrt(np.median(np.abs(k[m > 0.0]) / m[m > 0.0]) if m.any() else 1.0)) or 1.0

    def force(self, values: Any, z: AnyArray, transposed: bool = False) -> AnyArray:
        """Return P(lambda) z, column by column (size, n)."""
        del transposed
        given = self._given
        return np.asarray(given.K @ z + (given.C @ z) * values + (given.M @ z) * values**2)

    def inertia(self, z: AnyArray) -> AnyArray:
        """Return M z."""
        return np.asarray(self._given.M @ z)

    def size(self, z: AnyArray) -> Array:
        """Return sqrt(z^H M z) of each column."""
        return np.asarray(np.sqrt(np.abs(np.einsum("ij,ij->j", z.conj(), self.inertia(z)))))

    def damping(self, z: AnyArray) -> AnyArray:
        """Return C z."""
        return np.asarray(self._given.C @ z)

    def is_damped(self, z: Array) -> bool:
        """Whether damping resists some of the motions (size, n), beyond rounding."""
        c = self._given.C
        power, terms = np.einsum("ij,ij->j", z, c @ z), np.einsum("ij,ij->j", np.abs(z), abs(c) @ np.abs(z))
        return bool((np.abs(power) > RIGID_ENERGY * terms).any())

    @property
    def damped(self) -> bool:
        """Whether there is damping."""
        return bool(self._given.C.nnz)

    @property
    def proportional(self) -> bool:
        """Whether there is no damping; other damping is tested mode by mode."""
        return not self.damped


def quadratic_of(system: SparseEquations) -> Quadratic:
    """Return P(s) of a system."""
    return Quadratic(system) if system.matrices is None else MatrixQuadratic(system)


def matrices_of(system: SparseEquations) -> SparseMatrices:
    """Return the matrices of a system that was made of them."""
    if system.matrices is None:
        raise TypeError("the equations are those of a mechanism")
    return system.matrices


def sparse_from_matrices(
    matrices: tuple[Any, Any, Any], ports: tuple[Any, ...], names: tuple[Sequence[str] | None, ...], name: str,
    form: type[S],
) -> S:  # fmt: skip
    """Return the equations of sparse matrices M, C or None, and K (m, m), of the class ``form``.

    ``ports``: B (m, inputs), Cq, Cv, Ca (outputs, m) and D (outputs, inputs), or None. ``names``: of inputs, outputs
    and coordinates, or None.
    """
    m = np.shape(matrices[0])[0] if np.ndim(matrices[0]) == 2 or hasattr(matrices[0], "shape") else 0
    mass, damping, stiffness = (csc_matrix((m, m)) if value is None else _symmetric(name, label, value, m)
                                for label, value in zip("MCK", matrices, strict=True))  # fmt: skip
    _check_mass(name, mass, damping)
    b = csc_matrix((m, 0)) if ports[0] is None else shaped(name, "B", ports[0], (m, None), _matrix)
    inputs = signal_names(names[0], b.shape[1], "inputs", f"System '{name}'")
    coordinates = signal_names(names[2], m, "coordinates", f"System '{name}'")
    outputs, (cq, cv, ca, d) = outputs_of(name, ports[1:], (coordinates, inputs), names[1], (_matrix, csc_matrix, eye))
    held = Mechanism(name).with_parts(bodies={"held": Body("held", 1.0, (1.0, 1.0, 1.0, 0.0, 0.0, 0.0))},
                                      joints={"weld": Joint("weld", "fixed", "ground", "held")})  # fmt: skip
    empty = replace(linearized(held, form=form), bodies=(), model=Mechanism(name))
    layout = replace(empty.layout, coordinate=np.arange(m), size=m)
    given = SparseMatrices(name, mass, damping, stiffness)
    tableau: Any = given  # of a tableau, what takes matrices needs its factors alone
    nothing = csc_matrix((0, m)).tocsr()
    return replace(
        empty, joint_coordinates=coordinates, inputs=inputs, input_units=("",) * len(inputs), outputs=outputs,
        output_units=("",) * len(outputs), layout=layout, elastic_rows=nothing, inertia_factor=nothing,
        input_rows=b.T.tocsr(), output_rows=(cq.tocsr(), cv.tocsr(), ca.tocsr()), D=d.toarray(), matrices=given,
        tableau=tableau,
    )  # fmt: skip


def _matrix(name: str, label: str, value: Any) -> Any:
    """A sparse matrix by columns, of finite real numbers."""
    try:
        matrix = csc_matrix(value, dtype=complex if np.iscomplexobj(getattr(value, "data", value)) else float)
    except (TypeError, ValueError):
        raise ModelError(f"System '{name}': {label} = {shown(value)}; expected a matrix of real numbers.",
                         field=label) from None  # fmt: skip
    matrix.sum_duplicates()
    if np.iscomplexobj(matrix.data) or not np.isfinite(matrix.data).all():
        bad = next((v for v in matrix.data.tolist() if not isinstance(v, float) or not np.isfinite(v)), None)
        raise ModelError(f"System '{name}': {label} has the entry {bad}; expected a matrix of finite real numbers.",
                         field=label)  # fmt: skip
    return matrix


def _symmetric(name: str, label: str, value: Any, m: int) -> Any:
    """A sparse matrix (m, m), symmetric to the last bit."""
    matrix = shaped(name, label, value, (m, m), _matrix)
    other = matrix.T.tocsc()
    difference = (matrix - other).tocoo()
    if not difference.nnz:
        return matrix
    size = np.sqrt(np.abs(matrix.diagonal()))
    entry = abs(matrix).maximum(abs(other)).tocsr()
    scale = np.maximum(np.asarray(entry[difference.row, difference.col]).reshape(-1),
                       size[difference.row] * size[difference.col])  # fmt: skip
    worst = int(np.argmax(np.abs(difference.data) / np.where(scale > 0.0, scale, 1.0)))
    if np.abs(difference.data[worst]) > SYMMETRIC * scale[worst]:
        i, j = int(difference.row[worst]), int(difference.col[worst])
        kind = {"M": "", "C": " Gyroscopic terms", "K": " Circulatory terms"}[label]
        advice = f"{kind} need dense matrices: give {label}.toarray() and the others likewise." if kind else ""
        raise ModelError(f"System '{name}': {label}[{i}, {j}] = {matrix[i, j]:g}, but {label}[{j}, {i}] = "
                         f"{matrix[j, i]:g}; expected a symmetric sparse matrix. Give both triangles, or "
                         f"0.5 * ({label} + {label}.T) if they differ by rounding.{advice}", field=label)  # fmt: skip
    return (0.5 * (matrix + other)).tocsc()


def _check_mass(name: str, mass: Any, damping: Any) -> None:
    """Refuse negative masses, and coordinates without mass that have dampers."""
    diagonal, entries = mass.diagonal(), mass.tocoo()
    size = np.sqrt(np.maximum(diagonal, 0.0))
    too_large = (entries.row != entries.col) & (np.abs(entries.data) >= size[entries.row] * size[entries.col])
    wrong = diagonal < 0.0
    wrong[entries.row[too_large & (entries.data != 0.0)]] = True
    if wrong.any() or not (diagonal > 0.0).any():
        i = int(np.flatnonzero(wrong)[0]) if wrong.any() else 0
        raise ModelError(f"System '{name}': M[{i}, {i}] = {diagonal[i] if len(diagonal) else 0.0:g}, beside the other "
                         f"entries of its row; expected a symmetric positive definite matrix, with rows of zeros for "
                         f"coordinates without mass.", field="M")  # fmt: skip
    damped = np.flatnonzero((diagonal == 0.0) & (abs(damping).sum(axis=0).A1 > 0.0))
    if len(damped):
        raise ModelError(f"System '{name}': coordinate {damped[0]} has damping and no mass; expected mass, or neither. "
                         f"Give it a small mass, or dense matrices to StateSpace.from_arrays.", field="C")  # fmt: skip


def projected(system: SparseEquations, z: Array, rigid: int, form: type[E]) -> E:
    """Return the dense equations in the amplitudes of motions ``z`` (size, n); the first ``rigid`` have no stiffness.

    Entries below the rounding of their sums become zeros, and damping that couples modes by less than UNCOUPLED, which
    the residual of the full equations includes.
    """
    given, n = matrices_of(system), z.shape[1]

    def of(matrix: Any, free: int = 0, coupling: float = 0.0) -> Array:
        result: Array = z.T @ (matrix @ z)
        size = np.sqrt(np.abs(result.diagonal()))
        limit = np.maximum(ZERO_SUM * (np.abs(z).T @ (abs(matrix) @ np.abs(z))), coupling * np.outer(size, size))
        result[(np.abs(result) <= limit) & ~np.eye(n, dtype=bool)] = 0.0
        result[:free], result[:, :free] = 0.0, 0.0
        return 0.5 * (result + result.T)

    free = 0 if quadratic_of(system).is_damped(z[:, :rigid]) else rigid
    names = tuple(f"mode{i + 1}" for i in range(n))
    cq, cv, ca = (np.asarray(rows @ z) for rows in system.output_rows)
    small = from_matrices((of(given.M), of(given.C, free, UNCOUPLED), of(given.K, rigid)),
                          (np.asarray(system.input_rows @ z).T, cq, cv, ca, system.D.copy()),
                          (system.inputs, system.outputs, names), system.name, form)  # fmt: skip
    return replace(
        small, coordinate_units=("modal",) * n, input_units=system.input_units, output_units=system.output_units,
        provenance=replace(small.provenance, reduction=Reduction(np.arange(n), z, ()),
                           joint_coordinates=system.joint_coordinates),
    )  # fmt: skip


def motions_of(small: Equations) -> Array:
    """Return the motions (size, n) that the coordinates of projected matrices are amplitudes of."""
    motions = small.provenance.reduction.matrix
    return np.zeros((0, small.dof)) if motions is None else motions
