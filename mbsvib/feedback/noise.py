"""Plants whose sensors and actuators are noisy: further inputs for the noise of each.

u = K (y + n) + d: the controller sees the noise n [unit of the sensor] beside what the sensor measures, and d [unit of
the actuator] acts beside what it commands.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

from mbsvib.equations.selection import port_fields
from mbsvib.errors import ResponseError
from mbsvib.feedback.closing import Gathered
from mbsvib.feedback.controller import Controller

if TYPE_CHECKING:
    from mbsvib.common.arrays import Array
    from mbsvib.feedback.loop import LoopPlant

# Ends of the names of the inputs, and of what controllers see; loops do not show the latter.
NOISE, MEASURED = ".noise", ".measured"


def with_noise(plant: LoopPlant, law: Controller) -> tuple[LoopPlant, Controller]:
    """Return a plant with the noise of a controller's sensors and actuators as inputs, and the
    controller that sees it.

    Inputs: those of the system, "SENSOR.noise" in the order of the sensors, "ACTUATOR.noise" in that of the actuators;
    outputs: those of the system, then what the controller sees, "SENSOR.measured".
    """
    system = plant.system if plant.system.kind == "system" else plant.system.state_space()
    y = [system.outputs.index(name) for name in law.inputs]
    u = [system.inputs.index(name) for name in law.outputs]
    added = [f"{name}{NOISE}" for name in (*law.inputs, *law.outputs)]
    for name in added:
        if name in system.inputs or added.count(name) > 1:
            raise ResponseError(f"feedback: noise=True adds the input '{name}', which there is already; give the "
                                f"sensor or actuator another name.")  # fmt: skip
    rows, columns = [*range(len(system.outputs)), *y], [*range(len(system.inputs)), *u]
    ports = port_fields(system, rows, columns)
    at, count = len(system.inputs), len(y)
    measured = tuple([f"{name}{MEASURED}" for name in law.inputs])
    noise = np.zeros((len(rows), count))
    noise[len(system.outputs) :] = np.eye(count)
    ports |= {
        "outputs": (*system.outputs, *measured), "inputs": (*system.inputs, *added),
        "input_units": (*system.input_units, *[system.output_units[k] for k in y], *[system.input_units[k] for k in u]),
        "D": np.insert(ports["D"], [at] * count, noise, axis=1),
    }  # fmt: skip
    result = replace(system, **ports, **_inputs(system, columns, at, count), **_outputs(system, rows))
    noisy = replace(plant, system=result, without_noise=plant.system, gathered=Gathered(
        rows, [*columns[:at], *[-1] * count, *u], ([*range(len(rows) - count, len(rows))], [*range(at, at + count)])))
    return noisy, replace(law, inputs=measured).for_plant(result)


def _inputs(system: Any, columns: list[int], at: int, count: int) -> dict[str, Array]:
    """The matrices of inputs with columns of zeros for the noise of sensors, which acts through D alone."""
    return {key: np.insert(matrix[:, columns], [at] * count, np.zeros((len(matrix), 1)), axis=1)
            for key in ("B", "through") if (matrix := getattr(system, key, None)) is not None}  # fmt: skip


def _outputs(system: Any, rows: list[int]) -> dict[str, Array]:
    """The matrices of outputs; C of a system of second order is its damping."""
    keys = ("Cq", "Cv", "Ca") if system.kind == "system" else ("C",)
    return {key: getattr(system, key)[rows] for key in keys}
