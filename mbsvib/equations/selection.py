"""Systems with some of their outputs and inputs.

The controllable and observable part for given inputs and outputs is found by exact zeros of the matrices.

Coordinates that no chain of entries of M, C and K connects move independently of each other. A part on which none of
the inputs acts, or whose motion is in none of the outputs, does not contribute to the transfer function: its removal
changes no entry of the other parts, and no tolerance is needed.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any, TypeVar

import numpy as np

from mbsvib.common.arrays import Array, Bools, Index
from mbsvib.common.selection import port_numbers, selected
from mbsvib.equations.equations import Equations, Removed
from mbsvib.errors import ResponseError
from mbsvib.linalg.groups import part_numbers

E = TypeVar("E", bound=Equations)


def with_ports(system: E, outputs: Any = None, inputs: Any = None) -> E:
    """Return a system with some of its outputs and inputs; the coordinates stay.

    ``outputs``, ``inputs``: names or patterns, in the order in which they are wanted; None: all.
    """
    return with_port_numbers(system, *port_numbers(outputs, inputs, (system.outputs, system.inputs), system.name))


def with_port_numbers(system: E, o: Sequence[int], i: Sequence[int]) -> E:
    """Return a system with the outputs and inputs of some numbers; the coordinates stay."""
    ports = port_fields(system, o, i)
    undetermined = tuple([forces.among(ports["outputs"]) for forces in system.provenance.undetermined])
    return replace(system, B=system.B[:, i], Cq=system.Cq[o], Cv=system.Cv[o], Ca=system.Ca[o], **ports,
                   provenance=replace(system.provenance, undetermined=undetermined))  # fmt: skip


def port_fields(system: Any, o: Sequence[int], i: Sequence[int]) -> dict[str, Any]:
    """Return names and units of some outputs and inputs of dense or sparse equations, and D, by their fields."""
    return {
        "outputs": tuple([system.outputs[k] for k in o]), "inputs": tuple([system.inputs[k] for k in i]),
        "output_units": tuple([system.output_units[k] for k in o]),
        "input_units": tuple([system.input_units[k] for k in i]), "D": system.D[np.ix_(o, i)],
    }  # fmt: skip


def selected_ports(
    names: tuple[str, ...], selection: str | Sequence[str] | None, kind: str, name: str, others: tuple[str, ...] = ()
) -> list[int]:
    """Return the numbers of the selected ports, in the system's order.

    ``selection``: selected names; default: all. ``others``: names of the ports of the other kind, to recognise
    exchanged arguments.
    """
    numbers = selected(selection, names, kind[:-1], name, others)
    if not numbers:
        raise ResponseError(f"reachable: no {kind} are asked for, which leaves nothing of '{name}'; expected one or "
                            f"more of {', '.join(names) or 'its ' + kind + ', yet it has none'}.")  # fmt: skip
    return sorted(numbers)


def reachable(
    system: E, outputs: str | Sequence[str] | None = None, inputs: str | Sequence[str] | None = None
) -> E:
    """Return the controllable and observable part of a system for the given inputs and outputs, with these ports only.

    ``outputs``, ``inputs``: names of ports; default: all.
    """
    i = selected_ports(system.inputs, inputs, "inputs", system.name, system.outputs)
    o = selected_ports(system.outputs, outputs, "outputs", system.name, system.inputs)
    part = part_numbers((system.M != 0.0) | (system.C != 0.0) | (system.K != 0.0))
    actuated = np.asarray(system.B[:, i].any(axis=1))
    measured = np.asarray((system.Cq[o] != 0.0).any(axis=0) | system.Cv[o].any(axis=0) | system.Ca[o].any(axis=0))
    controllable, observable = (np.isin(part, part[mask]) for mask in (actuated, measured))
    removed = Removed(tuple(system.inputs[k] for k in i), tuple(system.outputs[k] for k in o),
                      _names(system, ~controllable), _names(system, controllable & ~observable))  # fmt: skip
    return _part(with_port_numbers(system, o, i), np.flatnonzero(controllable & observable), removed)


def _names(system: Equations, mask: Bools) -> tuple[str, ...]:
    return tuple(system.coordinates[k] for k in np.flatnonzero(mask))


def _part(system: E, remaining: Index, removed: Removed) -> E:
    square = np.ix_(remaining, remaining)
    rows = system.elastic_rows[:, remaining]
    nonzero = np.asarray(rows.any(axis=1))
    null = system.null_inertia
    if null is not None:
        null = null[remaining]
        null = null[:, null.any(axis=0)] if null.any() else None
    provenance = system.provenance
    if provenance.separation is None:
        identity, reduction = np.eye(len(provenance.joint_coordinates)), provenance.reduction
        matrix = identity[:, reduction.independent] if reduction.matrix is None else reduction.matrix
        provenance = replace(provenance, reduction=replace(
            reduction, independent=reduction.independent[remaining], matrix=matrix[:, remaining]))  # fmt: skip
    return replace(
        system, coordinates=tuple(system.coordinates[k] for k in remaining),
        coordinate_units=tuple(system.coordinate_units[k] for k in remaining),
        M=system.M[square], C=system.C[square], K=system.K[square], B=system.B[remaining],
        Cq=system.Cq[:, remaining], Cv=system.Cv[:, remaining], Ca=system.Ca[:, remaining],
        inertia_factor=system.inertia_factor[:, remaining], elastic_rows=rows[nonzero],
        row_stiffness=system.row_stiffness[nonzero], row_damping=system.row_damping[nonzero],
        row_owner=system.row_owner[nonzero],
        body_motion=np.ascontiguousarray(system.body_motion[:, :, remaining]),
        gyroscopic=_block(system.gyroscopic, square), circulatory=_block(system.circulatory, square),
        massless=0 if null is None else null.shape[1], null_inertia=null,
        provenance=replace(provenance, removed=removed.after(provenance.removed)),
    )  # fmt: skip


def _block(matrix: Array | None, square: tuple[Index, ...]) -> Array | None:
    if matrix is None or not (block := matrix[square]).any():
        return None
    return np.asarray(block)
