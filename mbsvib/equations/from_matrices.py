"""Equations of motion from matrices of another program, such as a finite element program."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import Any, TypeVar

import numpy as np
from numpy.typing import ArrayLike

from mbsvib.common.arguments import shown
from mbsvib.common.arrays import Array
from mbsvib.common.expected import reals
from mbsvib.common.selection import signal_names
from mbsvib.equations.equations import Equations, Provenance
from mbsvib.errors import ModelError
from mbsvib.kinematics.loops import Reduction
from mbsvib.linalg.products import nonzero_eigenrows
from mbsvib.mechanism.topology import Topology

Read = Callable[[str, str, Any], Any]

E = TypeVar("E", bound=Equations)

# Entries of a symmetric matrix that differ by less than this share of the larger of both and of the diagonal's
# geometric mean are rounding of the program that wrote them, usually in files with nine digits or more.
SYMMETRIC = 1e-9
# A mass matrix of unit diagonal whose smallest eigenvalue is below this share of the largest counts as singular.
SINGULAR = 1e-13
OWNERS = ("matrices",)
OUTPUT_MATRICES = ("Cq", "Cv", "Ca", "D")
# Sparse matrices whose dense form takes more bytes than this are refused: modes and factors take several times as much.
LARGEST = 1e9


def from_matrices(
    matrices: tuple[ArrayLike, ArrayLike | None, ArrayLike],
    ports: tuple[ArrayLike | None, ArrayLike | None, ArrayLike | None, ArrayLike | None, ArrayLike | None],
    names: tuple[Sequence[str] | None, Sequence[str] | None, Sequence[str] | None], name: str, form: type[E],
) -> E:  # fmt: skip
    """Return equations of motion from given matrices.

    ``matrices`` (m, m): M, C or None, and K. ``ports``: B (m, inputs), Cq, Cv, Ca (outputs, m) and D (outputs,
    inputs), or None. ``names``: of inputs, outputs and coordinates, or None. Factors are a Cholesky factor of M, and
    eigenvectors of the symmetric parts of K and C, with unit diagonals, as rows.
    """
    mass = _array(name, "M", matrices[0])
    m = len(mass)
    if mass.shape != (m, m):
        raise ModelError(f"System '{name}': M has shape {mass.shape}; expected (m, m).", field="M")
    mass, factor = _factored(name, mass)
    damping, stiffness = (np.zeros((m, m)) if value is None else shaped(name, label, value, (m, m), _array)
                          for label, value in (("C", matrices[1]), ("K", matrices[2])))  # fmt: skip
    (k_rows, k, circulatory), (c_rows, c, gyroscopic) = _rows(stiffness), _rows(damping)
    b = np.zeros((m, 0)) if ports[0] is None else shaped(name, "B", ports[0], (m, None), _array)
    inputs = signal_names(names[0], b.shape[1], "inputs", f"System '{name}'")
    coordinates = signal_names(names[2], m, "coordinates", f"System '{name}'")
    outputs, (cq, cv, ca, d) = outputs_of(name, ports[1:], (coordinates, inputs), names[1], (_array, np.zeros, np.eye))
    return form(
        name=name, coordinates=coordinates, coordinate_units=("",) * m, inputs=inputs, input_units=("",) * len(inputs),
        outputs=outputs, output_units=("",) * len(outputs), bodies=(), M=mass, C=damping, K=stiffness, B=b, Cq=cq,
        Cv=cv, Ca=ca, D=d, inertia_factor=factor, elastic_rows=np.concatenate((k_rows, c_rows)),
        row_stiffness=np.concatenate((k, np.zeros(len(c)))), row_damping=np.concatenate((np.zeros(len(k)), c)),
        row_owner=np.zeros(len(k) + len(c), dtype=np.intp), body_motion=np.zeros((0, 6, m)), gyroscopic=gyroscopic,
        circulatory=circulatory,
        provenance=Provenance(Topology((), (), (), (), ()), Reduction(np.arange(m), None, ()), coordinates, OWNERS,
                              from_matrices=True),
    )  # fmt: skip


def _array(name: str, label: str, value: Any) -> Array:
    if hasattr(value, "toarray"):
        _check_size(name, label, value.shape)
        value = value.toarray()
    array = np.array(reals(value, f"System '{name}'", label, "a matrix of real numbers", ModelError), ndmin=2)
    if array.ndim != 2 or not np.isfinite(array).all():
        raise ModelError(f"System '{name}': {label} = {shown(value)}; expected a matrix of finite numbers.",
                         field=label)  # fmt: skip
    return array


def _check_size(name: str, label: str, shape: tuple[int, ...]) -> None:
    """Refuse a sparse matrix of a shape that takes too much memory as a dense one."""
    size = np.dtype(float).itemsize * math.prod(shape)
    if size > LARGEST:
        raise ModelError(
            f"System '{name}': {label} is a sparse matrix of shape {tuple(shape)} and takes {size / 1e9:.3g} GB as a "
            f"dense one beside a dense M, C or K; expected at most {LARGEST / 1e9:g} GB. Give M, C and K as sparse "
            f"matrices too: they stay sparse.", field=label)  # fmt: skip


def shaped(name: str, label: str, value: Any, shape: tuple[int | None, int | None], read: Read) -> Any:
    """Return a matrix of a shape, of which None is any; ``read`` makes a matrix of the argument ``label``."""
    array = read(name, label, value)
    if array.shape[0] != shape[0] and shape == (array.shape[1], None):
        array = array.T  # a vector for a single input
    if any(size is not None and length != size for length, size in zip(array.shape, shape, strict=True)):
        expected = ", ".join({"B": "inputs"}.get(label, "outputs") if size is None else str(size) for size in shape)
        raise ModelError(f"System '{name}': {label} has shape {array.shape}; expected ({expected}).", field=label)
    return array


def _factored(name: str, mass: Array) -> tuple[Array, Array]:
    """M, symmetric to the last bit, and W with M = W^T W."""
    diagonal = mass.diagonal()
    want = "expected a symmetric positive definite matrix"
    if (diagonal <= 0.0).any():
        worst = int(np.flatnonzero(diagonal <= 0.0)[0])
        raise ModelError(f"System '{name}': M[{worst}, {worst}] = {diagonal[worst]:g}; {want}. Remove coordinates "
                         f"without mass by static condensation, K_aa - K_ab K_bb^-1 K_ba, or give first-order "
                         f"equations to StateSpace.from_arrays.", field="M")  # fmt: skip
    size = np.sqrt(diagonal)
    difference = np.abs(mass - mass.T) / size[:, None] / size
    if difference.size and difference.max() > SYMMETRIC:
        i, j = np.unravel_index(int(difference.argmax()), difference.shape)
        raise ModelError(f"System '{name}': M[{i}, {j}] = {mass[i, j]:g}, but M[{j}, {i}] = {mass[j, i]:g}; {want}. "
                         f"Give 0.5 * (M + M.T) if the difference is rounding.", field="M")  # fmt: skip
    mass = 0.5 * (mass + mass.T)
    scaled = mass / size[:, None] / size
    values = np.linalg.eigvalsh(scaled) if len(mass) else np.ones(1)
    if values[0] <= SINGULAR * values[-1]:
        raise ModelError(f"System '{name}': M, scaled to a diagonal of ones, has the eigenvalue {values[0]:.3g} beside "
                         f"{values[-1]:.3g}; {want}. Some combination of coordinates has no mass or a negative one: "
                         f"remove it by static condensation, or correct M.", field="M")  # fmt: skip
    factor: Array = np.linalg.cholesky(scaled).T.astype(float) * size if len(mass) else mass
    return mass, factor


def _rows(matrix: Array) -> tuple[Array, Array, Array | None]:
    """Rows E and weights w with E^T diag(w) E = the symmetric part, and the antisymmetric part or None.

    Rows are eigenvectors of the matrix with a diagonal of ones, so that small entries beside large ones keep their
    digits; weights that are rounding are left out, so that rigid-body modes are at 0.
    """
    size = np.sqrt(np.maximum(np.abs(matrix.diagonal()), SYMMETRIC * np.abs(matrix).max(axis=1, initial=0.0)))
    size = np.where(size > 0.0, size, 1.0)
    scaled = matrix / size[:, None] / size
    scaled_antisymmetric = 0.5 * (scaled - scaled.T)
    scaled_antisymmetric[np.abs(scaled_antisymmetric) <= SYMMETRIC * np.maximum(1.0, np.abs(scaled))] = 0.0
    weights, rows = nonzero_eigenrows(0.5 * (matrix + matrix.T), size)
    antisymmetric = np.asarray(scaled_antisymmetric * size[:, None] * size) if scaled_antisymmetric.any() else None
    return rows, weights, antisymmetric


def outputs_of(
    name: str, matrices: tuple[Any, ...], columns: tuple[tuple[str, ...], tuple[str, ...]],
    names: Sequence[str] | None, kind: tuple[Read, Callable[[tuple[int, int]], Any], Callable[[int], Any]],
) -> tuple[tuple[str, ...], list[Any]]:  # fmt: skip
    """Return the names of outputs, and Cq, Cv, Ca and D; the coordinates themselves if no matrix is given.

    ``columns``: names of coordinates and of inputs. ``kind``: functions that read a matrix, and that make one of zeros
    and an identity.
    """
    (read, zeros, identity), m = kind, len(columns[0])
    if all(value is None for value in matrices):
        matrices, names = (identity(m), None, None, None), columns[0] if names is None else names
    rows, known = None, []
    for label, value, count in zip(OUTPUT_MATRICES, matrices, (m, m, m, len(columns[1])), strict=True):
        known.append(None if value is None else shaped(name, label, value, (rows, count), read))
        rows = rows if known[-1] is None else known[-1].shape[0]
    assert rows is not None
    filled = [zeros((rows, count)) if matrix is None else matrix
              for matrix, count in zip(known, (m, m, m, len(columns[1])), strict=True)]  # fmt: skip
    return signal_names(names, rows, "outputs", f"System '{name}'"), filled
