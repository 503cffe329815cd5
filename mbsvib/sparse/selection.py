"""Selection of outputs and inputs of sparse equations by name."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Any, TypeVar

import numpy as np

from mbsvib.common.selection import port_numbers
from mbsvib.equations.selection import port_fields
from mbsvib.sparse.equations import SparseEquations

S = TypeVar("S", bound=SparseEquations)

if TYPE_CHECKING:
    from mbsvib.sparse.massless import SparseSeparation


def with_ports(system: S, outputs: Any = None, inputs: Any = None) -> S:
    """Return a system with some of its outputs and inputs, by name or pattern, and the same unknowns."""
    o, i = port_numbers(outputs, inputs, (system.outputs, system.inputs), system.name)
    ports = port_fields(system, o, i)
    separation: SparseSeparation | None = system.separation
    if separation is not None:
        separation = replace(separation, at_once=separation.at_once[np.ix_(o, i)])
    displacement, velocity, acceleration = (rows[o] for rows in system.output_rows)
    return replace(
        system, input_rows=system.input_rows[i], output_rows=(displacement, velocity, acceleration),
        undetermined=tuple([forces.among(ports["outputs"]) for forces in system.undetermined]), separation=separation,
        **ports,
    )  # fmt: skip
