"""What goes into a unit, whatever it came from: matrices, names, units, nominal values."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from mbsvib.errors import ExportError
from mbsvib.responses.state_space import StateSpace
from mbsvib_export.fmu_.nominal import nominal_values
from mbsvib_export.neutral import state_space_of

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from mbsvib.common.arrays import Array


@dataclass(frozen=True, slots=True)
class Tunable:
    """A parameter on which the matrices depend affinely: derivatives ``slope`` of the entries at ``place``, which
    counts from the start of A through B, C, D, E and F, row by row.
    """

    name: str
    unit: str
    value: float
    place: NDArray[np.int64]
    slope: Array


@dataclass(frozen=True, slots=True)
class Plant:
    """E x' = A x + B u,  y = C x + F x' + D u; E and F are there only where parameters are ``tunable``.

    ``realization`` tells what the states are; names are those of mbsvib, a unit is empty where none is known.
    """

    name: str
    realization: str
    A: Array
    B: Array
    C: Array
    D: Array
    states: tuple[str, ...]
    state_units: tuple[str, ...]
    inputs: tuple[str, ...]
    input_units: tuple[str, ...]
    outputs: tuple[str, ...]
    output_units: tuple[str, ...]
    nominal: Array
    E: Array | None = None
    F: Array | None = None
    tunable: tuple[Tunable, ...] = ()

    @property
    def blocks(self) -> NDArray[np.int64]:
        """First rows of the diagonal blocks of A, and the number of states."""
        n = len(self.states)
        if n == 0 or self.tunable:
            return np.unique(np.array([0, n], dtype=np.int64))
        coupled = self.A != 0
        index = np.arange(n)
        reach = np.maximum(index, np.where(coupled | coupled.T, index, -1).max(axis=1))
        ends = np.flatnonzero(np.maximum.accumulate(reach) == index) + 1
        return np.concatenate(([0], ends)).astype(np.int64)


def plant_of(source: Any, realization: str, tunable: tuple[str, ...]) -> Plant:
    """Return what goes into a unit.

    Parameters
    ----------
    source : System, StateSpace, SystemData or control.StateSpace
        Where it comes from.
    realization : str
        The states of a System.
    tunable : tuple of str
        Names of parameters, of a System only.

    Returns
    -------
    Plant
        Matrices, names and units.

    Raises
    ------
    ExportError
        If the source is none of these, is discrete in time, or holds what is not finite.
    ModelError
        If a parameter is unknown.
    """
    if type(source).__module__.split(".")[0] == "control":
        plant = _controller(source, tunable)
    elif tunable:
        from mbsvib_export.fmu_.tunable import tunable_plant

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
        space.inputs, space.input_units, space.outputs, space.output_units, nominal_values(space.A, space.B),
    )  # fmt: skip


def _controller(source: Any, tunable: tuple[str, ...]) -> Plant:
    if not all(hasattr(source, label) for label in "ABCD"):
        raise ExportError(f"to_fmu: system = control.{type(source).__name__}; expected a control.StateSpace, such as "
                          f"control.ss(...) makes of it.")  # fmt: skip
    name = str(source.name)
    if tunable:
        raise ExportError(f"to_fmu: tunable = {tunable!r}, but '{name}' comes from python-control, which knows no "
                          f"parameters; give a System (model.linearize()).")  # fmt: skip
    if source.dt not in (0, None):
        raise ExportError(f"to_fmu: '{name}' is discrete in time (dt = {source.dt}); expected one in continuous time. "
                          f"Design it in continuous time, or give control.d2c or an equivalent of it.")  # fmt: skip
    a, b, c, d = (np.array(getattr(source, label), dtype=float) for label in "ABCD")
    _check_finite(name, A=a, B=b, C=c, D=d)
    inputs, outputs, states = (tuple(map(_plain, getattr(source, f"{kind}_labels")))
                               for kind in ("input", "output", "state"))  # fmt: skip
    return Plant(
        _plain(name), "given", a, b, c, d, states, ("",) * len(states), inputs, ("",) * len(inputs), outputs,
        ("",) * len(outputs), nominal_values(a, b),
    )  # fmt: skip


def _plain(name: str) -> str:
    """The name that a signal had in mbsvib, if it came from there: ``leg1:force`` is ``leg1.force``."""
    from mbsvib_export.names_ import SignalNames

    try:
        return SignalNames.to_mbsvib(name)
    except ExportError:
        return name
