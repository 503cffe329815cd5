"""Sparse matrices of finite element models from text files of Abaqus (``*MATRIX OUTPUT``).

Each line has a node, a degree of freedom, another node, another degree of freedom and an entry; of symmetric matrices
one triangle or both. Degrees of freedom 1 to 6 are displacements and rotations. Internal nodes have numbers below zero.

Source: Abaqus Keywords Guide, *MATRIX OUTPUT and *MATRIX INPUT.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from mbsvib.common.file_content import content_of
from mbsvib.elements.superelement_files import Reduced
from mbsvib.errors import ModelError

if TYPE_CHECKING:
    from os import PathLike

    from mbsvib.common.arrays import Array, Index

# Diagonal of degrees of freedom that boundary conditions hold, in files of Abaqus.
HELD = 1e35
# Both triangles are the same up to this share of the diagonals beside: files have twelve digits or more.
SYMMETRIC = 1e-9
EXPECTED = "five columns: node, degree of freedom, node, degree of freedom, entry (FORMAT=MATRIX INPUT or LABELS)"


def read_abaqus(
    stiffness: str | PathLike[str], mass: str | PathLike[str], damping: str | PathLike[str] | None = None
) -> Reduced:
    """Read sparse matrices from text files of Abaqus, NAME_STIF1.mtx and NAME_MASS1.mtx.

    They come of a step with ``*MATRIX GENERATE, STIFFNESS, MASS`` and ``*MATRIX OUTPUT, STIFFNESS, MASS,
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
