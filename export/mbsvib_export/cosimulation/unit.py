"""Units from files, run through fmpy: their signals, instances of them, and the linear equations that they obey."""

from __future__ import annotations

import ctypes
import os
from contextlib import ExitStack
from typing import TYPE_CHECKING, Any

import numpy as np

from mbsvib.errors import ExportError
from mbsvib.responses.state_space import StateSpace
from mbsvib_export.cosimulation.unit_file import Signal, UnitFile, open_unit

if TYPE_CHECKING:
    from mbsvib.common.arrays import Array


_SAME = 1e-9  # of linear equations: what rounding may leave


class Instance:
    """An instance of an FMU: values by arrays, calls without copies of references. ``log`` are its messages."""

    def __init__(self, unit: UnitFile, kind: str, extrapolate: bool = False) -> None:
        from fmpy import fmi2, fmi3

        interface = unit.description.coSimulation if kind == "cs" else unit.description.modelExchange
        if interface is None:
            words = {"cs": "co-simulation", "me": "model exchange"}
            raise ExportError(f"{unit.path}: has no {words[kind]}; export it with both, as to_fmu does.")
        classes = {"cs": (fmi2.FMU2Slave, fmi3.FMU3Slave), "me": (fmi2.FMU2Model, fmi3.FMU3Model)}
        self.unit, self.new, self.log = unit, unit.new, list[str]()
        self._u, self._y = _Values(unit.inputs), _Values(unit.outputs)
        self._du, self._dy = _Values(unit.inputs), _Values(unit.outputs)
        self._start = (0.0, np.zeros(len(unit.inputs)))
        self.slope = np.zeros(len(unit.inputs))
        folder = os.getcwd()
        try:
            self.fmu = classes[kind][self.new](
                guid=unit.description.guid, unzipDirectory=unit.folder, modelIdentifier=interface.modelIdentifier,
                instanceName="unit",
            )  # fmt: skip
        except Exception as error:
            os.chdir(folder)  # fmpy goes to the binary, and does not come back from one that it cannot load
            raise ExportError(f"{unit.path}: its binary cannot be loaded: {error}") from error
        try:
            self._instantiate(fmi2, extrapolate)
        except Exception as error:
            self.fmu.freeLibrary()
            raise ExportError(f"{unit.path}: cannot be instantiated: {'; '.join(self.log) or error}. The file is "
                              f"damaged, or was changed after it was written; export it again.") from error  # fmt: skip

    def _instantiate(self, fmi2: Any, extrapolate: bool) -> None:
        if self.new:
            def message(environment: Any, status: int, category: bytes, text: bytes) -> None:
                self.log.append(text.decode(errors="replace"))

            self.fmu.instantiate(logMessage=message, **({"intermediateUpdate": self._update} if extrapolate else {}))
            return

        def message_2(environment: Any, name: bytes, status: int, category: bytes, text: bytes) -> None:
            self.log.append(text.decode(errors="replace"))

        calls = fmi2.fmi2CallbackFunctions()
        # not through fmpy's formatting: it keeps one logger for all units, and would call this one after its end
        calls.logger = fmi2.fmi2CallbackLoggerTYPE(message_2)
        calls.allocateMemory, calls.freeMemory = fmi2.defaultCallbacks.allocateMemory, fmi2.defaultCallbacks.freeMemory
        self.fmu.instantiate(callbacks=calls)

    def _update(self, environment: Any, time: float, requested: bool, *_: Any) -> None:
        if requested:
            start, values = self._start
            self.set(values + (time - start) * self.slope)

    def enter(self) -> Instance:
        """Enter initialization mode."""
        if not self.new:
            self.fmu.setupExperiment(startTime=0.0)
        self.fmu.enterInitializationMode()
        return self

    def leave(self) -> Instance:
        """Leave initialization mode."""
        self.fmu.exitInitializationMode()
        return self

    def close(self) -> None:
        """Free the instance and its library."""
        self.fmu.freeInstance()

    def set(self, values: Array) -> None:
        """Set all inputs."""
        self._u.array[:] = values
        if self._u.count:
            f = self.fmu
            if self.new:
                f.fmi3SetFloat64(f.component, self._u.references, self._u.count, self._u.values, self._u.count)
            else:
                f.fmi2SetReal(f.component, self._u.references, self._u.count, self._u.values)

    def get(self) -> Array:
        """Return all outputs."""
        f, y = self.fmu, self._y
        if y.count:
            if self.new:
                f.fmi3GetFloat64(f.component, y.references, y.count, y.values, y.count)
            else:
                f.fmi2GetReal(f.component, y.references, y.count, y.values)
        return y.array.copy()

    def step(self, t: float, h: float, slope: Array | None = None) -> None:
        """Do a step; inputs are linear in time if their slopes are given."""
        if slope is not None:
            self.slope[:] = slope
            self._start = (t, self._u.array.copy())
            if not self.new and self._u.count:
                self._du.array[:] = slope
                self.fmu.fmi2SetRealInputDerivatives(self.fmu.component, self._u.references, self._u.count,
                                                     self._u.first, self._du.values)  # fmt: skip
        self.fmu.doStep(currentCommunicationPoint=t, communicationStepSize=h)

    def output_slopes(self) -> Array:
        """Return the time derivatives of all outputs."""
        f, y = self.fmu, self._dy
        if y.count:
            if self.new:
                f.fmi3GetOutputDerivatives(f.component, y.references, y.count, y.first, y.values, y.count)
            else:
                f.fmi2GetRealOutputDerivatives(f.component, y.references, y.count, y.first, y.values)
        return y.array.copy()

    def set_states(self, x: Array) -> None:
        """Set all states, in initialization mode or of model exchange."""
        references = [value.reference for value in self.unit.states]
        if references:
            (self.fmu.setFloat64 if self.new else self.fmu.setReal)(references, [float(value) for value in x])

    def rates(self) -> Array:
        """Return the derivatives of all states."""
        if not self.unit.rates:
            return np.zeros(0)
        call = self.fmu.getFloat64 if self.new else self.fmu.getReal
        return np.array(call(list(self.unit.rates)), dtype=float)


class _Values:
    """C arrays of references and values of signals."""

    def __init__(self, signals: tuple[Signal, ...]) -> None:
        self.count = len(signals)
        self.references = (ctypes.c_uint * self.count)(*(signal.reference for signal in signals))
        self.first = (ctypes.c_int * self.count)(*([1] * self.count))
        self.values = (ctypes.c_double * self.count)()
        self.array = np.ctypeslib.as_array(self.values) if self.count else np.zeros(0)


def equations(unit: UnitFile) -> tuple[Array, Array, Array, Array]:
    """Return A (n, n), B (n, inputs), C (outputs, n), D (outputs, inputs) of an FMU.

    They are its results for unit states and inputs in initialization mode, of model exchange where it has both kinds.
    """
    n, m = len(unit.states), len(unit.inputs)
    with ExitStack() as stack:
        instance = Instance(unit, "cs" if unit.description.modelExchange is None else "me")
        stack.callback(instance.close)
        instance.enter()

        def answer(z: Array) -> Array:
            instance.set_states(z[:n])
            instance.set(z[n:])
            return np.concatenate((instance.rates(), instance.get()))

        try:
            rest = answer(np.zeros(n + m))
            columns = [answer(point) for point in np.eye(n + m)]
            z = np.random.default_rng(0).standard_normal(n + m)
            outputs = answer(z)
        except Exception as error:
            raise ExportError(f"{unit.path}: {error} {'; '.join(instance.log)}".strip()) from error
    matrix = np.array(columns).T if columns else np.zeros((n + len(unit.outputs), 0))
    size = np.abs(matrix) @ np.abs(z)
    if not np.isfinite(matrix).all() or rest.any() or (np.abs(outputs - matrix @ z) > _SAME * size).any():
        raise ExportError(f"{unit.path}: '{unit.name}' is not linear, or does not rest at zero states and inputs; "
                          f"expected x' = A x + B u, y = C x + D u.")  # fmt: skip
    return matrix[:n, :n], matrix[:n, n:], matrix[n:, :n], matrix[n:, n:]


def state_space_of_unit(path: str | os.PathLike[str]) -> StateSpace:
    """Return the state space of an FMU, from the answers of its binary and not from the numbers in its archive.

    ``path``: a unit with model exchange, or one that lists its states, FMI 2.0 or 3.0. Names are those of mbsvib;
    ``transform`` is the identity, as an FMU knows no coordinates.
    """
    with open_unit(path, "state_space_of_unit") as unit:
        if unit.hides_states:
            raise ExportError(f"{unit.path}: '{unit.name}' is for co-simulation only and lists no states "
                              f"(ModelStructure, derivatives); export it with model exchange, too.")  # fmt: skip
        a, b, c, d = equations(unit)
        names = {kind: tuple(signal.name for signal in getattr(unit, kind)) for kind in ("states", "inputs", "outputs")}
        units = {kind: tuple(signal.unit for signal in getattr(unit, kind)) for kind in names}
        return StateSpace(unit.name, "unit", a, b, c, d, np.eye(len(a)), names["states"], units["states"],
                          names["inputs"], units["inputs"], names["outputs"], units["outputs"])  # fmt: skip
