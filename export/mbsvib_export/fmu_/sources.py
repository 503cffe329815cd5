"""Plants from what users hand over: systems, state spaces, data that was read, and systems of python-control."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from mbsvib.errors import ExportError
from mbsvib.responses.from_control import is_control, is_transfer_function, of_control
from mbsvib_export.fmu_.nominal import scales
from mbsvib_export.fmu_.plant import Plant
from mbsvib_export.fmu_.tunable import tunable_plant
from mbsvib_export.names_ import SignalNames
from mbsvib_export.neutral import state_space_of

if TYPE_CHECKING:
    from mbsvib.common.arrays import Array
    from mbsvib.responses.state_space import StateSpace


def plant_of(source: Any, realization: str, tunable: tuple[str, ...]) -> Plant:
    """Return what goes into an FMU."""
    if of_control(source):
        plant = _controller(source, tunable)
    elif tunable:
        plant = tunable_plant(source, realization, tunable)
    else:
        plant = _of_space(state_space_of(source, realization, "to_fmu"))
    return plant


def _check_finite(name: str, **matrices: Array) -> None:
    for label, matrix in matrices.items():
        if not np.isfinite(matrix).all():
            raise ExportError(f"to_fmu: {label} of '{name}' holds NaN or infinity; expected finite numbers.")


def _of_space(space: StateSpace) -> Plant:
    _check_finite(space.name, A=space.A, B=space.B, C=space.C, D=space.D)
    return Plant(
        space.name, space.realization, space.A, space.B, space.C, space.D, space.states, space.state_units,
        space.inputs, space.input_units, space.outputs, space.output_units,
        *scales(space.A, space.B, space.C, space.D, space.state_units),
    )  # fmt: skip


def _controller(source: Any, tunable: tuple[str, ...]) -> Plant:
    if not (is_control(source) or is_transfer_function(source)):
        raise ExportError(f"to_fmu: system = control.{type(source).__name__}; expected a control.StateSpace or "
                          f"control.TransferFunction.")  # fmt: skip
    name = str(source.name)
    if tunable:
        raise ExportError(f"to_fmu: tunable = {tunable!r}, but '{name}' comes from python-control, which knows no "
                          f"parameters; give a System (model.linearize()).")  # fmt: skip
    if source.dt not in (0, None):
        raise ExportError(f"to_fmu: '{name}' is discrete in time (dt = {source.dt}); expected one in continuous time. "
                          f"Design it in continuous time, or give control.d2c or an equivalent of it.")  # fmt: skip
    if is_transfer_function(source):
        return _of_space(state_space_of(source, "physical", "to_fmu"))
    a, b, c, d = (np.array(getattr(source, label), dtype=float) for label in "ABCD")
    _check_finite(name, A=a, B=b, C=c, D=d)
    inputs, outputs, states = (tuple(map(SignalNames.original, getattr(source, f"{kind}_labels")))
                               for kind in ("input", "output", "state"))  # fmt: skip
    return Plant(
        SignalNames.original(name), "given", a, b, c, d, states, ("",) * len(states), inputs, ("",) * len(inputs),
        outputs, ("",) * len(outputs), *scales(a, b, c, d, ("",) * len(states)),
    )  # fmt: skip
