"""What an exporter was given, with some of its outputs and inputs."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

from mbsvib.common.expected import kind_of
from mbsvib.common.selection import Names, port_numbers
from mbsvib_export.neutral import SystemData, space_of


def with_ports(source: Any, outputs: Names, inputs: Names) -> Any:
    """Return a system, loop, state space or what was read from a file with some of its outputs and inputs.

    ``outputs``, ``inputs``: names or patterns; None: all.
    """
    if outputs is None and inputs is None:
        return source
    if isinstance(source, SystemData):
        return _with_ports(source, outputs, inputs)
    linear = source if kind_of(source) == "closed loop" else space_of(source, "physical")
    return linear.with_ports(outputs, inputs) if hasattr(linear, "with_ports") else source


def _with_ports(data: SystemData, outputs: Names, inputs: Names) -> SystemData:
    o, i = port_numbers(outputs, inputs, (data.outputs, data.inputs), data.name)
    return replace(
        data, outputs=tuple(data.outputs[k] for k in o), output_units=tuple(data.output_units[k] for k in o),
        inputs=tuple(data.inputs[k] for k in i), input_units=tuple(data.input_units[k] for k in i),
        B=data.B[:, i], Cq=data.Cq[o], Cv=data.Cv[o], Ca=data.Ca[o], D=data.D[o][:, i],
        state_space=data.state_space.with_ports([data.outputs[k] for k in o], [data.inputs[k] for k in i]),
    )  # fmt: skip
