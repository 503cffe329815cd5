"""Controllable and observable part for given inputs and outputs, found by exact zeros of the matrices.

Coordinates that no chain of entries of M, C and K joins move independently of each other. Where no asked input acts on
such a part, or no asked output sees it, it has no share in the transfer function: leaving it out changes no entry of
what is left, and nothing is decided by size.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, TypeVar

import numpy as np

from mbsvib.common.selection import selected
from mbsvib.equations.equations import Dropped, Equations
from mbsvib.errors import ResponseError

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from mbsvib.common.arrays import Array, Index
    from mbsvib.equations.equations import Equations

    Mask = NDArray[np.bool_]


E = TypeVar("E", bound=Equations)


def chosen(
    known: tuple[str, ...], asked: str | Sequence[str] | None, what: str, name: str, others: tuple[str, ...] = ()
) -> list[int]:
    """Return the numbers of the ports asked for, in the system's order.

    Parameters
    ----------
    known : tuple of str
        Names that there are.
    asked : str or sequence of str, optional
        Names that are wanted; default: all.
    what : str
        "inputs" or "outputs".
    name : str
        The system's name, for messages.
    others : tuple of str
        Names of the ports of the other kind, to recognize exchanged arguments.

    Returns
    -------
    list of int
        At least one number.

    Raises
    ------
    ResponseError
        If a name is unknown, or there is none.
    """
    wanted = selected(asked, known, what[:-1], name, others)
    if not wanted:
        raise ResponseError(f"reachable: no {what} are asked for, which leaves nothing of '{name}'; expected one or "
                            f"more of {', '.join(known) or 'its ' + what + ', yet it has none'}.")  # fmt: skip
    return sorted(wanted)


def parts(*matrices: Array) -> Index:
    """Return the number of the part of every coordinate, which entries of the matrices (m, m) join.

    Parameters
    ----------
    *matrices : array, shape (m, m)
        Whose entries that are not zero join coordinates.

    Returns
    -------
    array, shape (m,)
        Numbers.
    """
    from scipy.sparse import csr_matrix
    from scipy.sparse.csgraph import connected_components

    joined = np.any([matrix != 0.0 for matrix in matrices], axis=0)
    return np.asarray(connected_components(csr_matrix(joined), directed=False)[1], dtype=np.intp)


def reachable(
    system: E, outputs: str | Sequence[str] | None = None, inputs: str | Sequence[str] | None = None
) -> E:
    """Return the controllable and observable part of a system for the given inputs and outputs, with these ports only.

    Parameters
    ----------
    system : Equations
        The equations of motion.
    outputs, inputs : str or sequence of str, optional
        Names of ports; default: all.

    Returns
    -------
    Equations
        The same equations without the other coordinates.

    Raises
    ------
    ResponseError
        If a name is unknown, or there is none.
    """
    i = chosen(system.inputs, inputs, "inputs", system.name, system.outputs)
    o = chosen(system.outputs, outputs, "outputs", system.name, system.inputs)
    label = parts(system.M, system.C, system.K) if system.dof else np.zeros(0, dtype=np.intp)
    acted = np.asarray(system.B[:, i].any(axis=1))
    seen = np.asarray((system.Cq[o] != 0.0).any(axis=0) | system.Cv[o].any(axis=0) | system.Ca[o].any(axis=0))
    reached, shown = (np.isin(label, label[mask]) for mask in (acted, seen))
    kept = reached & shown
    gone = Dropped(tuple(system.inputs[k] for k in i), tuple(system.outputs[k] for k in o),
                   _names(system, ~reached), _names(system, reached & ~shown))  # fmt: skip
    return _part(system, np.flatnonzero(kept), i, o, gone)


def _names(system: Equations, mask: Mask) -> tuple[str, ...]:
    return tuple(system.coordinates[k] for k in np.flatnonzero(mask))


def _part(system: E, kept: Index, inputs: list[int], outputs: list[int], gone: Dropped) -> E:
    i, o = np.array(inputs), np.array(outputs)
    square = np.ix_(kept, kept)
    rows = system.elastic_rows[:, kept]
    acts = np.asarray(rows.any(axis=1))
    null = system.null_inertia
    if null is not None:
        null = null[kept]
        null = null[:, null.any(axis=0)] if null.any() else None
    before = system.provenance.dropped
    if before is not None:
        gone = replace(gone, unreached=before.unreached + gone.unreached, unseen=before.unseen + gone.unseen)
    came = system.provenance
    if came.massless is None:
        whole, reduction = np.eye(len(came.joint_coordinates)), came.reduction
        matrix = whole[:, reduction.independent] if reduction.matrix is None else reduction.matrix
        came = replace(came, reduction=replace(reduction, independent=reduction.independent[kept],
                                               matrix=matrix[:, kept]))  # fmt: skip
    shown = {system.outputs[k] for k in outputs}
    undetermined = tuple([replace(forces, outputs=tuple([name for name in forces.outputs if name in shown]))
                          for forces in came.undetermined])  # fmt: skip
    return replace(
        system, coordinates=tuple(system.coordinates[k] for k in kept),
        coordinate_units=tuple(system.coordinate_units[k] for k in kept),
        inputs=tuple(system.inputs[k] for k in i), input_units=tuple(system.input_units[k] for k in i),
        outputs=tuple(system.outputs[k] for k in o), output_units=tuple(system.output_units[k] for k in o),
        M=system.M[square], C=system.C[square], K=system.K[square], B=system.B[np.ix_(kept, i)],
        Cq=system.Cq[np.ix_(o, kept)], Cv=system.Cv[np.ix_(o, kept)], Ca=system.Ca[np.ix_(o, kept)],
        D=system.D[np.ix_(o, i)], inertia_factor=system.inertia_factor[:, kept], elastic_rows=rows[acts],
        row_stiffness=system.row_stiffness[acts], row_damping=system.row_damping[acts],
        row_owner=system.row_owner[acts],
        body_motion=np.ascontiguousarray(system.body_motion[:, :, kept]),
        gyroscopic=_block(system.gyroscopic, square), circulatory=_block(system.circulatory, square),
        massless=0 if null is None else null.shape[1], null_inertia=null,
        provenance=replace(came, dropped=gone, undetermined=undetermined),
    )  # fmt: skip


def _block(matrix: Array | None, square: tuple[NDArray[np.intp], ...]) -> Array | None:
    if matrix is None or not (block := matrix[square]).any():
        return None
    return np.asarray(block)
