"""Uncertain plants for other tools: their equations with the signals w and z of parameters before chosen ports.

MATLAB takes the parameters as they are, delta = (p - nominal) / half, so that the plant keeps its nominal values. Tools
that know delta from -1 to 1 only take changes from the middle of the limits, to which the equations are moved.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

from mbsvib.common.expected import kind_of
from mbsvib.common.mat_file import variable_names
from mbsvib.common.selection import Names, port_numbers
from mbsvib.errors import ExportError

if TYPE_CHECKING:
    from mbsvib.responses.state_space import StateSpace
    from mbsvib.uncertain.plant import UncertainPlant


def is_uncertain(source: object) -> bool:
    """Return whether the source of an exporter is an uncertain plant."""
    return kind_of(source) == "uncertain plant"


def with_channels(plant: UncertainPlant, outputs: Names, inputs: Names) -> Any:
    """Return the equations of a plant with all signals of its parameters and some of its own ports, None: all."""
    o, i = port_numbers(outputs, inputs, (plant.outputs, plant.inputs), plant.name)
    r, linear = sum(plant.blocks.values()), plant.linear
    return linear.with_ports([*linear.outputs[:r], *[plant.outputs[k] for k in o]],
                             [*linear.inputs[:r], *[plant.inputs[k] for k in i]])  # fmt: skip


def centred(plant: UncertainPlant, realization: str, outputs: Names, inputs: Names) -> StateSpace:
    """Return a state space in which changes of parameters by delta from -1 to 1 lead to their limits."""
    middle = np.repeat([0.5 * sum(block.changes) for block in plant.parameters], list(plant.blocks.values()))
    linear, r = with_channels(plant, outputs, inputs), len(middle)
    if middle.any():
        linear = linear.feedback(np.diag(middle), list(linear.outputs[:r]), list(linear.inputs[:r]))
    space: StateSpace = linear.state_space(realization)
    return replace(space, name=plant.name)


def matlab_parameters(plant: UncertainPlant, cells: Any) -> dict[str, Any]:
    """Return the uncertain parameters as a struct of MATLAB; ``cells`` turns texts into a cell array."""
    parameters = plant.parameters
    numbers = {key: np.array([[getattr(block, field)] for block in parameters], dtype=float) for key, field in
               (("Nominal", "nominal"), ("Half", "half"), ("Repetitions", "repetitions"))}  # fmt: skip
    return {"Name": cells(tuple(plant.blocks)), "Variable": cells(variable_names(plant.blocks)),
            "Unit": cells(tuple([block.unit for block in parameters])),
            "Range": np.array(list(plant.limits.values())), **numbers}  # fmt: skip


def refuse_steps(plant: UncertainPlant, dt: float | None, method: str | None) -> None:
    """Refuse a discrete system of an uncertain plant: what a parameter changes acts between samples too."""
    if dt is not None or method is not None:
        raise ExportError(f"to_control: '{plant.name}' is uncertain, and its parameters act in continuous time; leave "
                          f"dt and method out, or export plant.at(values).")  # fmt: skip
