"""Systems with some of their outputs and inputs."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Any, TypeVar

import numpy as np

from mbsvib.common.selection import port_numbers
from mbsvib.equations.equations import Equations

if TYPE_CHECKING:
    from collections.abc import Sequence

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
