"""Superelements: reduced finite element models, and the files of other programs that hold them."""

from __future__ import annotations

from collections.abc import Iterable

from mbsvib.api.sparse_system import SparseSystem
from mbsvib.api.system import System
from mbsvib.common.arguments import DIRECTIONS, refuse
from mbsvib.elements.superelement import Superelement
from mbsvib.elements.superelement_files import Reduced, read_abaqus, read_mat, read_op4, read_punch
from mbsvib.errors import ModelError

__all__ = ["Reduced", "Superelement", "read_abaqus", "read_mat", "read_op4", "read_punch", "system"]


def system(reduced: Reduced, nodes: Iterable[int], name: str = "part") -> System | SparseSystem:
    """Return the equations of matrices with labels, with a port at each of some nodes.

    M q'' + C q' + K q = B u,  y = B^T q

    Parameters
    ----------
    reduced : Reduced
        Matrices with ``labels``, dense or of scipy.sparse.
    nodes : iterable of int
        Grid points: inputs and outputs "NODE.x" ... "NODE.rz" of the displacements that each has, for ``mv.assemble``.
    name : str
        Name of the system.

    Returns
    -------
    System, or SparseSystem of sparse matrices
        With these inputs and outputs.

    Raises
    ------
    ModelError
        If a node is not in the labels, or the matrices are none of a mechanism.
    """
    from scipy.sparse import eye

    rows: list[int] = []
    of: dict[int, list[int]] = {}
    for k, (node, component) in enumerate(reduced.labels):
        if component:
            of.setdefault(node, []).append(k)
    if not hasattr(nodes, "__iter__"):
        raise refuse("system", "nodes", nodes, "a list of grid points")
    for node in nodes:
        if node not in of:
            raise ModelError(f"system: there is no node {node} among the {len(of)} of the labels of '{name}'.",
                             element=str(node))  # fmt: skip
        rows += of[node]
    select = eye(len(reduced.labels), format="csr")[rows]
    if not hasattr(reduced.K, "tocsc"):
        select = select.toarray()
    names = [f"{reduced.labels[k][0]}.{DIRECTIONS[reduced.labels[k][1] - 1]}" for k in rows]
    matrices = reduced.M, reduced.C, reduced.K
    result: System | SparseSystem = System.from_matrices(*matrices, select.T, select, inputs=names, outputs=names,
                                                         name=name)  # fmt: skip
    return result
