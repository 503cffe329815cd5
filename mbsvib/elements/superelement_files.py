"""Reduced matrices from files: MATLAB .mat, Nastran OP4 and DMIG cards, and sparse matrices of Abaqus.

Abaqus (``*MATRIX OUTPUT``) has text with a node, a degree of freedom, another node, another degree of freedom and an
entry in each line; of symmetric matrices one triangle or both. Degrees of freedom 1 to 6 are displacements and
rotations. Internal nodes have numbers below zero.

Source: Abaqus Keywords Guide, *MATRIX OUTPUT and *MATRIX INPUT.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, replace
from os import PathLike
from typing import Any

import numpy as np

from mbsvib.common.arrays import Array, Index
from mbsvib.common.dmig_cards import read_dmig_cards
from mbsvib.common.file_content import ContentError, content_of
from mbsvib.common.mat_file import read_mat_file
from mbsvib.common.op4_file import read_op4_file
from mbsvib.errors import ModelError


@dataclass(frozen=True, slots=True, eq=False)
class Reduced:
    """Matrices ``M``, ``C`` (or None) and ``K`` (n, n) for ``add_superelement``; of scipy.sparse from ``read_abaqus``.

    ``labels`` (n,) are grid point and component (1 to 6, 0 for an internal coordinate) of each row, if the file has
    them.
    """

    M: Array
    C: Array | None
    K: Array
    labels: tuple[tuple[int, int], ...] = ()

    def ordered(self, grids: Iterable[int]) -> Reduced:
        """Return the matrices with the six components of some grid points first, in their order, then all others.

        Parameters
        ----------
        grids : iterable of int
            Numbers of the grid points, in the order of the superelement's nodes.

        Returns
        -------
        Reduced
            The same model.

        Raises
        ------
        ModelError
            If a grid point has not all six components.
        """
        row_of = {label: i for i, label in enumerate(self.labels)}
        first = []
        for grid in grids:
            for component in range(1, 7):
                if (grid, component) not in row_of:
                    raise ModelError(f"grid point {grid} has no component {component} in the reduced matrices; an "
                                     f"interface node needs all six.", element=str(grid))  # fmt: skip
                first.append(row_of[grid, component])
        order = first + [i for i in range(len(self.labels)) if i not in set(first)]
        at = np.ix_(order, order)
        return Reduced(self.M[at], None if self.C is None else self.C[at], self.K[at],
                       tuple([self.labels[i] for i in order]))  # fmt: skip


def read_mat(path: str | PathLike[str], M: str = "M", K: str = "K", C: str | None = None) -> Reduced:
    """Read reduced matrices from a MATLAB file of level 5 or 4 (``save -v7``, ``-v6`` or ``-v4``, not ``-v7.3``).

    Parameters
    ----------
    path : str or path-like
        The file.
    M, K : str
        Names of its mass and stiffness matrices.
    C : str, optional
        Name of its damping matrix.

    Returns
    -------
    Reduced
        The matrices, dense.

    Raises
    ------
    ModelError
        If the file cannot be read or has no such matrix.
    """
    return _read(path, read_mat_file, (M, K, C),
                 "a MATLAB file", "Save it with version -v7.")  # fmt: skip


def _read(
    path: Any, reader: Callable[[bytes, list[str]], Mapping[str, Any]], matrices: tuple[str, str, str | None],
    what: str, advice: str,
) -> Reduced:  # fmt: skip
    """The matrices of a file by what reads its content."""
    raw = content_of(path, _error(path), what)
    try:
        content = reader(raw, [name for name in matrices if name is not None])
    except ContentError as error:
        raise ModelError(f"{path}: cannot be read as {what}: {error}. {advice}", element=str(path)) from error
    return _reduced(path, content, *matrices)


def read_op4(path: str | PathLike[str], M: str = "MAA", K: str = "KAA", C: str | None = None) -> Reduced:
    """Read reduced matrices from a Nastran OUTPUT4 file: text or binary, dense or sparse, of either byte order.

    Parameters
    ----------
    path : str or path-like
        The file.
    M, K : str
        Names of its mass and stiffness matrices.
    C : str, optional
        Name of its damping matrix.

    Returns
    -------
    Reduced
        The matrices, dense.

    Raises
    ------
    ModelError
        If the file cannot be read, or has no such matrix.
    """
    return _read(path, read_op4_file, (M, K, C), "an OP4 file", "Write it again.")


def read_punch(
    path: str | PathLike[str], M: str = "MAAX", K: str = "KAAX", C: str | None = None
) -> Reduced:
    """Read reduced matrices from the DMIG cards of a Nastran punch file (``EXTSEOUT(DMIGPCH)``), real and symmetric.

    Parameters
    ----------
    path : str or path-like
        The file.
    M, K : str
        Names of its mass and stiffness matrices.
    C : str, optional
        Name of its damping matrix.

    Returns
    -------
    Reduced
        The matrices with labels: grid points in ascending order, then scalar points, which have no component. Scalar
        points of SPOINT cards are included even if all their entries are zero.

    Raises
    ------
    ModelError
        If the file cannot be read, has no such matrix, or a card is not understood.
    """
    raw = content_of(path, _error(path), "a punch file with DMIG cards")
    try:
        cards = read_dmig_cards(raw)
    except ContentError as error:
        raise ModelError(f"{path}, {error}", element=str(path)) from error
    for name in (M, K, C):
        if name in cards.left_out:
            raise ModelError(f"{path}: '{name}' is not read: {cards.left_out[name]}.", element=str(path), field=name)
    return replace(_reduced(path, cards.matrices, M, K, C), labels=cards.labels)


def _reduced(path: Any, content: Mapping[str, Any], M: str, K: str, C: str | None) -> Reduced:
    """Checked matrices from the content of a file."""
    matrices = []
    for name in (M, K) if C is None else (M, K, C):
        if name not in content:
            known = ", ".join(sorted(content)) or "none"
            raise ModelError(f"{path}: there is no matrix '{name}'; the file has {known}.",
                             element=str(path), field=name)  # fmt: skip
        value = np.asarray(content[name])
        if value.dtype.kind == "c" and not value.imag.any():  # as programs with structural damping write all matrices
            value = value.real
        if value.dtype.kind not in "fiu" or value.ndim != 2 or value.shape[0] != value.shape[1]:
            raise ModelError(f"{path}: '{name}' is of type {value.dtype} and shape {value.shape}; expected a square "
                             f"matrix of real numbers.", element=str(path), field=name)  # fmt: skip
        if not np.isfinite(value).all():
            raise ModelError(f"{path}: '{name}' holds NaN or infinity; expected finite numbers.", element=str(path),
                             field=name)  # fmt: skip
        matrices.append(value.astype(float))
    if len({matrix.shape for matrix in matrices}) > 1:
        raise ModelError(f"{path}: the matrices have {', '.join(str(len(matrix)) for matrix in matrices)} rows; "
                         f"expected as many in each.", element=str(path))  # fmt: skip
    return Reduced(matrices[0], matrices[2] if C is not None else None, matrices[1])


def _error(path: Any) -> Callable[[str], ModelError]:
    return lambda text: ModelError(text, element=str(path))


# Diagonal of degrees of freedom that boundary conditions hold, in files of Abaqus.
HELD = 1e35
# Both triangles are the same up to this share of the diagonals beside: files have twelve digits or more.
SYMMETRIC = 1e-9
EXPECTED = "five columns: node, degree of freedom, node, degree of freedom, entry (FORMAT=MATRIX INPUT or LABELS)"


def read_abaqus(
    stiffness: str | PathLike[str], mass: str | PathLike[str], damping: str | PathLike[str] | None = None
) -> Reduced:
    """Read sparse matrices from text files of Abaqus, NAME_STIF1.mtx and NAME_MASS1.mtx.

    They are written by a step with ``*MATRIX GENERATE, STIFFNESS, MASS`` and ``*MATRIX OUTPUT, STIFFNESS, MASS,
    FORMAT=MATRIX INPUT``, or LABELS. COORDINATE has no labels: ``scipy.io`` and ``numpy.loadtxt`` read it.

    Parameters
    ----------
    stiffness, mass : str or path-like
        The files.
    damping : str or path-like, optional
        The file of viscous damping.

    Returns
    -------
    Reduced
        ``M``, ``C`` and ``K`` of scipy.sparse in the units of the model, with ``labels``: node and degree of freedom of
        each row, ascending. What boundary conditions hold is left out.

    Raises
    ------
    ModelError
        If a file cannot be read, is not symmetric, or a degree of freedom is none of 1 to 6.
    """
    from scipy.sparse import coo_matrix

    tables = {name: _table(path) for name, path in (("K", stiffness), ("M", mass), ("C", damping)) if path is not None}
    ends = np.concatenate([labels.reshape(-1, 2) for _, _, labels in tables.values()])
    every, number = np.unique(ends, axis=0, return_inverse=True)
    wrong = every[((every[:, 1] < 1) | (every[:, 1] > 6)) & (every[:, 0] > 0)]
    if len(wrong):
        raise ModelError(f"{stiffness}: node {wrong[0, 0]} has the degree of freedom {wrong[0, 1]}; expected 1 to 6, "
                         f"displacements and rotations.", element=str(stiffness))  # fmt: skip
    matrices: dict[str, Any] = {}
    pairs = np.split(number.reshape(-1, 2), np.cumsum([len(values) for _, values, _ in tables.values()])[:-1])
    for (name, (path, values, _)), pair in zip(tables.items(), pairs, strict=True):
        matrices[name] = _both_triangles(coo_matrix((values, pair.T), shape=(len(every),) * 2), path)
    free = np.flatnonzero(matrices["K"].diagonal() < HELD)
    parts: dict[str, Any] = {name: matrix[free][:, free].tocsc() for name, matrix in matrices.items()}
    labels = tuple([(node, component if node > 0 else 0) for node, component in every[free].tolist()])
    return Reduced(parts["M"], parts.get("C"), parts["K"], labels)


def _table(path: Any) -> tuple[Any, Array, Index]:
    """The path, entries (n,), and the labels (n, 2, 2) of rows and columns."""
    raw = content_of(path, lambda text: ModelError(text, element=str(path)), "a text file of a matrix")
    lines = [line.replace(b",", b" ").split() for line in raw.upper().replace(b"D", b"E").splitlines()
             if line.strip() and not line.lstrip().startswith(b"*")]  # fmt: skip
    try:
        table = np.array(lines, dtype=float)
    except ValueError:
        table = np.zeros((0, 0))
    if table.ndim != 2 or table.shape[1] != 5 or not np.isfinite(table).all() or (table[:, :4] % 1.0).any():
        raise ModelError(f"{path}: expected {EXPECTED}.", element=str(path))
    return path, table[:, 4], table[:, :4].astype(np.intp).reshape(-1, 2, 2)


def _both_triangles(matrix: Any, path: Any) -> Any:
    """A symmetric matrix of which an entry of either triangle stands for both."""
    from scipy.sparse import diags, tril, triu

    matrix = matrix.tocsr()
    lower, upper = tril(matrix, -1).tocsr(), triu(matrix, 1).T.tocsr()
    both = lower.astype(bool).multiply(upper.astype(bool))
    size = np.sqrt(np.abs(matrix.diagonal()))
    unit = diags(1.0 / np.where(size > 0.0, size, 1.0))  # held diagonals are 1e36, which is no measure of the others
    if abs(unit @ (lower - upper).multiply(both) @ unit).max() > SYMMETRIC:
        raise ModelError(f"{path}: entries above and below the diagonal differ; expected a symmetric matrix.",
                         element=str(path))  # fmt: skip
    lower = lower + upper - upper.multiply(both)
    return (lower + lower.T + diags(matrix.diagonal())).tocsr()
