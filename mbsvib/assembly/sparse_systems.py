"""Sparse equations of parts that are joined at ports: nodes that coincide become one, so that matrices stay sparse.

With L q = 0 along rigid connections q = N z: two coordinates that are equal are one of z, and what other rows say is
solved for some of their coordinates, those of the smallest mass. M, C, K become N^T M N and so on; a spring-damper adds
L^T k L. See ``systems`` for parts that are dense.

Source: de Klerk, Rixen & Voormeeren, AIAA J. 46 (2008) 1169, primal assembly.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from mbsvib.assembly.connections import WHO, Part
from mbsvib.assembly.systems import COLLOCATED, Ends, eliminated, ends_of
from mbsvib.common.arrays import Array
from mbsvib.elements.ports import BaseMotion
from mbsvib.equations.equations import Connection
from mbsvib.errors import ModelError
from mbsvib.sparse.from_matrices import matrices_of, sparse_from_matrices

# Numbers in the rows of rigid connections that are no pair of equal coordinates.
LARGEST = 4e7
# A coordinate without mass counts as one of this share of the largest mass, when it is chosen what is eliminated.
LIGHTEST = 1e-12


def assembled_sparse(parts: Sequence[Part], connections: Sequence[Connection], name: str) -> Any:
    """Return the sparse equations of parts of which one is sparse at least."""
    from scipy.sparse import block_diag, csc_matrix

    blocks = [_blocks(part) for part in parts]
    m, c, k, b, cq, cv, ca = (block_diag([block[i] for block in blocks], format="csc") for i in range(7))
    d = block_diag([csc_matrix(part.linear.D) for part in parts], format="csc").toarray()
    ends = ends_of(parts, connections)
    outputs, inputs, coordinates = (
        tuple([f"{part.name}.{one}" for part in parts for one in _names(part.linear, field)])
        for field in ("outputs", "inputs", "coordinates"))  # fmt: skip
    _check_ports(ends, (m, b, cq.tocsr(), cv + ca, d), outputs)
    rigid = [one for one in ends if one.connection.stiffness is None]
    motions, first = _motions(_relative(rigid, cq.tocsr()), m.diagonal(), rigid)
    for one in ends:
        if one.connection.stiffness is None:
            continue
        if one.connection.dynamic is not None:
            raise ModelError(f"{WHO}: {one.name} is joined by a Dynamic, whose states have no mass; expected a "
                             f"stiffness and damping between sparse parts, or reduced ones, reduced(40).",
                             element=one.connection.first)  # fmt: skip
        rows = _relative([one], cq.tocsr())
        k = k + rows.T @ csc_matrix(one.connection.stiffness) @ rows
        c = c + rows.T @ csc_matrix(one.connection.damping) @ rows
    m, c, k = (_symmetric(motions.T @ matrix @ motions) for matrix in (m, c, k))
    form = next(type(part.linear) for part in parts if getattr(part.linear, "matrices", None) is not None)
    result: Any = sparse_from_matrices(
        (m, c, k), (motions.T @ b, cq @ motions, cv @ motions, ca @ motions, d),
        (inputs, outputs, tuple([coordinates[i] for i in first])), name, form)  # fmt: skip
    units = {f"{kind}_units": sum((getattr(part.linear, f"{kind}_units") for part in parts), ())
             for kind in ("input", "output")}  # fmt: skip
    return replace(result, connections=tuple(connections), **units)


def _names(linear: Any, field: str) -> Sequence[str]:
    sparse = field == "coordinates" and getattr(linear, "matrices", None) is not None
    return tuple(getattr(linear, "joint_coordinates" if sparse else field))


def _blocks(part: Part) -> tuple[Any, ...]:
    """M, C, K, B, Cq, Cv and Ca of a part."""
    from scipy.sparse import csc_matrix

    linear = part.linear
    if getattr(linear, "matrices", None) is not None:
        given = matrices_of(linear)
        return (given.M, given.C, given.K, linear.input_rows.T, *linear.output_rows)
    moved = any(isinstance(one, BaseMotion) for one in linear.provenance.ports)
    for wrong, what in ((linear.massless, "motions without mass"), (linear.gyroscopic is not None, "gyroscopic terms"),
                        (linear.circulatory is not None, "follower forces"), (moved, "a motion of the ground")):
        if wrong:
            raise ModelError(f"{WHO}: '{part.name}' has {what}, which sparse parts cannot be joined with; give a "
                             f"reduced form of these, reduced(40) without correction.", element=part.name)  # fmt: skip
    return tuple([csc_matrix(getattr(linear, key)) for key in ("M", "C", "K", "B", "Cq", "Cv", "Ca")])


def _relative(ends: Sequence[Ends], rows: Any) -> Any:
    """Rows L of the second ports less those of the first, of rows (outputs, n) by rows."""
    one, other = (np.array([k for end in ends for k in end.outputs[side]], dtype=np.intp) for side in (0, 1))
    return (rows[other] - rows[one]).tocsr()


def _check_ports(ends: Sequence[Ends], matrices: tuple[Any, ...], outputs: Sequence[str]) -> None:
    """Refuse ports whose outputs are no displacements, or not those of the point where the inputs act."""
    m, b, cq, rates, d = matrices
    rows = np.array([k for end in ends for side in end.outputs for k in side], dtype=np.intp)
    columns = np.array([k for end in ends for side in end.inputs for k in side], dtype=np.intp)
    moving = np.asarray(abs(rates).sum(axis=1)).reshape(-1)[rows] > 0.0
    if moving.any() or d[:, columns].any():
        at = outputs[rows[int(moving.argmax())]] if moving.any() else outputs[int(d[:, columns].any(axis=1).argmax())]
        raise ModelError(f"{WHO}: output '{at}' is a velocity, an acceleration or a force, or follows forces at once; "
                         f"expected displacements, and forces only in parts that are all dense.", element=at)
    from scipy.sparse import diags

    mass = m.diagonal()
    unit = diags(1.0 / np.sqrt(np.where(mass > 0.0, mass, 1.0)))
    moved, pushed = cq[rows] @ unit, b.T.tocsr()[columns] @ unit
    size = np.maximum(*(abs(one).max(axis=1).toarray()[:, 0] for one in (moved, pushed)))
    off = abs(moved - pushed).max(axis=1).toarray()[:, 0] > COLLOCATED * size
    if off.any():
        at = outputs[rows[int(off.argmax())]]
        raise ModelError(f"{WHO}: input '{at}' does not act where and as output '{at}' is measured; expected pairs at "
                         f"one point along one direction.", element=at)  # fmt: skip


def _motions(rows: Any, mass: Array, rigid: Sequence[Ends]) -> tuple[Any, list[int]]:
    """N (n, z) of L q = 0, sparse, and for each of z the first coordinate that it is."""
    from scipy.sparse import coo_matrix, csc_matrix
    from scipy.sparse.csgraph import connected_components

    n = rows.shape[1]
    rows.eliminate_zeros()
    pair = np.diff(rows.indptr) == 2
    pair[pair] = np.asarray(rows[pair].sum(axis=1)).reshape(-1) == 0.0
    one, other = rows[pair].indices.reshape(-1, 2).T
    count, label = connected_components(coo_matrix((np.ones(len(one)), (one, other)), shape=(n, n)), directed=False)
    first = np.unique(label, return_index=True)[1]
    equal = csc_matrix((np.ones(n), (np.arange(n), label)), shape=(n, count))
    rest = (rows[~pair] @ equal).tocsc()
    at = np.flatnonzero(np.diff(rest.indptr))
    if not len(at):
        return equal, first.tolist()
    if rest.shape[0] * len(at) > LARGEST:
        raise ModelError(f"{WHO}: {rest.shape[0]} directions are joined rigidly with parts whose motions move many "
                         f"ports each; join fewer nodes, or give a part whose ports are coordinates.")  # fmt: skip
    weight = np.bincount(label, mass, count)[at]
    turns = np.array([direction[0] == "r" for end in rigid for direction in end.connection.directions])[~pair]
    _, dependent, independent, block = eliminated(
        rest[:, at].toarray(), np.sqrt(np.maximum(weight, LIGHTEST * weight.max())), turns, rigid[-1].name)
    stays = np.ones(count, dtype=bool)
    stays[at[dependent]] = False
    number = np.cumsum(stays) - 1
    i, j = np.nonzero(block)
    row = np.concatenate((np.flatnonzero(stays), at[dependent][i]))
    column = np.concatenate((number[stays], number[at[independent][j]]))
    values = np.concatenate((np.ones(stays.sum()), block[i, j]))
    left = csc_matrix((values, (row, column)), shape=(count, int(stays.sum())))
    return equal @ left, first[stays].tolist()


def _symmetric(matrix: Any) -> Any:
    return (0.5 * (matrix + matrix.T)).tocsc()
