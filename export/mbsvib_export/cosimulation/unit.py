"""FMUs from files, run through fmpy: their signals, instances of them, and the linear equations that they obey."""

from __future__ import annotations

import ctypes
import os
from collections.abc import Iterator, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from mbsvib.common.arrays import Array
from mbsvib.common.expected import a_path
from mbsvib.errors import ExportError
from mbsvib.responses.state_space import StateSpace
from mbsvib_export.fmu_.names import original_outputs
from mbsvib_export.fmu_.reading import description_of
from mbsvib_export.packages import need

_SAME = 1e-9  # of linear equations: what rounding may leave
_BASE = ("kg", "m", "s", "A", "K", "mol", "cd", "rad", "factor", "offset")


@dataclass(frozen=True, slots=True)
class Signal:
    """A scalar of an FMU: its name in mbsvib, its value reference, and its unit, also in SI base units."""

    name: str
    reference: int
    unit: str
    base: tuple[float, ...] | None


@dataclass(frozen=True, slots=True)
class UnitFile:
    """An unpacked FMU: data of its description, and data for making instances."""

    path: Path
    folder: str
    description: Any
    inputs: tuple[Signal, ...]
    outputs: tuple[Signal, ...]
    states: tuple[Signal, ...]
    rates: tuple[int, ...]

    @property
    def name(self) -> str:
        """Name of the FMU."""
        return str(self.description.modelName)

    @property
    def new(self) -> bool:
        """Whether it is one of FMI 3."""
        return str(self.description.fmiVersion).startswith("3")

    @property
    def hides_states(self) -> bool:
        """Whether it may have states that it does not list, as units for co-simulation only may."""
        return self.description.modelExchange is None and not self.states


@contextmanager
def open_unit(path: str | os.PathLike[str], caller: str) -> Iterator[UnitFile]:
    """Unpack an FMU for the time of a with statement."""
    fmpy = need("fmpy", caller)
    file = a_path(path, caller, ExportError)
    with TemporaryDirectory(prefix="mbsvib-", ignore_cleanup_errors=True) as folder:
        try:
            description_of(file)
            description = fmpy.read_model_description(str(file))
            platforms = fmpy.supported_platforms(str(file))
            fmpy.extract(str(file), folder)
        except ExportError:
            raise
        except Exception as error:  # fmpy raises its own and those of zlib and of XML, without a common root
            raise ExportError(f"{file}: cannot be read as an FMU: {error}. Export it again.") from error
        if not str(description.fmiVersion).startswith(("2.", "3.")):
            raise ExportError(f"{file}: is an FMU of FMI {description.fmiVersion}; expected 2.0 or 3.0.")
        if fmpy.platform not in platforms:
            raise ExportError(f"{file}: holds no binary for {fmpy.platform}, but for {', '.join(platforms) or 'none'}; "
                              f'export it on this platform, or for it: to_fmu(..., platforms="all").')  # fmt: skip
        yield _described(file, folder, description)


def _described(file: Path, folder: str, description: Any) -> UnitFile:
    units = {item.name: item.baseUnit for item in description.unitDefinitions}

    def signal(variable: Any, name: str) -> Signal:
        if variable.type not in ("Real", "Float64") or variable.dimensions:
            raise ExportError(f"{file}: '{variable.name}' is of type {variable.type}; expected scalars of type Real or "
                              f"Float64 only.")  # fmt: skip
        base = units.get(variable.unit)
        numbers = None if base is None else tuple(float(getattr(base, key)) for key in _BASE)
        return Signal(name, int(variable.valueReference), variable.unit or "", numbers)

    inputs, outputs = ([item for item in description.modelVariables if item.causality == kind]
                       for kind in ("input", "output"))  # fmt: skip
    names = original_outputs([item.name for item in outputs], [item.name for item in inputs])
    rates = [item.variable for item in description.derivatives]
    return UnitFile(
        file, folder, description, tuple(signal(item, item.name) for item in inputs),
        tuple(map(signal, outputs, names)), tuple(signal(item.derivative, item.derivative.name) for item in rates),
        tuple(int(item.valueReference) for item in rates),
    )  # fmt: skip


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
        inputs, outputs = ([signal.reference for signal in signals] for signals in (unit.inputs, unit.outputs))
        self._u, self._du, self._y, self._dy = _Values(inputs), _Values(inputs), _Values(outputs), _Values(outputs)
        self._x, self._dx = _Values([signal.reference for signal in unit.states]), _Values(unit.rates)
        self._start = (0.0, np.zeros(len(inputs)))
        self.slope = np.zeros(len(inputs))
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
        def message(*words: Any) -> None:
            self.log.append(words[-1].decode(errors="replace"))

        if self.new:
            self.fmu.instantiate(logMessage=message, **({"intermediateUpdate": self._update} if extrapolate else {}))
            return
        calls = fmi2.fmi2CallbackFunctions()
        # not through fmpy's formatting: it keeps one logger for all units, and would call this one after its end
        calls.logger = fmi2.fmi2CallbackLoggerTYPE(message)
        calls.allocateMemory, calls.freeMemory = fmi2.defaultCallbacks.allocateMemory, fmi2.defaultCallbacks.freeMemory
        self.fmu.instantiate(callbacks=calls)

    def _update(self, environment: Any, time: float, requested: bool, *_: Any) -> None:
        if requested:
            start, values = self._start
            self.set(values + (time - start) * self.slope)

    def enter(self) -> None:
        """Enter initialization mode."""
        if not self.new:
            self.fmu.setupExperiment(startTime=0.0)
        self.fmu.enterInitializationMode()

    def _call(self, fmi2: str, fmi3: str, values: _Values, *orders: Any) -> None:
        """Set or get values by the function of the version of FMI."""
        if values.count:
            getattr(self.fmu, fmi3 if self.new else fmi2)(
                self.fmu.component, values.references, values.count, *orders, values.values,
                *([values.count] if self.new else []))  # fmt: skip

    def set(self, values: Array) -> None:
        """Set all inputs."""
        self._u.array[:] = values
        self._call("fmi2SetReal", "fmi3SetFloat64", self._u)

    def get(self) -> Array:
        """Return all outputs."""
        self._call("fmi2GetReal", "fmi3GetFloat64", self._y)
        return self._y.array.copy()

    def stepped(self, t: float, h: float, u: Array, slope: Array | None = None) -> Array:
        """Return the outputs at the end of a step from ``t`` [s]; inputs are linear in time if their slopes are given.
        """
        self.set(u)
        if slope is not None:
            self.slope[:] = slope
            self._start = (t, self._u.array.copy())
            if not self.new:
                self._du.array[:] = slope
                self._call("fmi2SetRealInputDerivatives", "", self._du, self._du.first)
        self.fmu.doStep(currentCommunicationPoint=t, communicationStepSize=h)
        return self.get()

    def output_slopes(self) -> Array:
        """Return the time derivatives of all outputs."""
        self._call("fmi2GetRealOutputDerivatives", "fmi3GetOutputDerivatives", self._dy, self._dy.first)
        return self._dy.array.copy()

    def set_states(self, x: ArrayLike) -> None:
        """Set all states, in initialization mode or of model exchange."""
        self._x.array[:] = x
        self._call("fmi2SetReal", "fmi3SetFloat64", self._x)

    def rates(self) -> Array:
        """Return the derivatives of all states."""
        self._call("fmi2GetReal", "fmi3GetFloat64", self._dx)
        return self._dx.array.copy()


class _Values:
    """C arrays of references and values of signals."""

    def __init__(self, references: Sequence[int]) -> None:
        self.count = len(references)
        self.references = (ctypes.c_uint * self.count)(*references)
        self.first = (ctypes.c_int * self.count)(*([1] * self.count))
        self.values = (ctypes.c_double * self.count)()
        self.array = np.ctypeslib.as_array(self.values) if self.count else np.zeros(0)


def equations(unit: UnitFile) -> tuple[Array, Array, Array, Array]:
    """Return A, B, C, D of an FMU, its results for unit states and inputs, of model exchange where it has that.
    """
    n, m = len(unit.states), len(unit.inputs)
    with ExitStack() as stack:
        instance = Instance(unit, "cs" if unit.description.modelExchange is None else "me")
        stack.callback(instance.fmu.freeInstance)
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
    """Return the state space of an FMU that lists its states, from the answers of its binary, with the names of mbsvib.
    """
    with open_unit(path, "state_space_of_unit") as unit:
        if unit.hides_states:
            raise ExportError(f"{unit.path}: '{unit.name}' is for co-simulation only and lists no states "
                              f"(ModelStructure, derivatives); export it with model exchange, too.")  # fmt: skip
        a, b, c, d = equations(unit)
        words: Any = [tuple(getattr(signal, key) for signal in signals)
                      for signals in (unit.states, unit.inputs, unit.outputs) for key in ("name", "unit")]  # fmt: skip
        return StateSpace(unit.name, "unit", a, b, c, d, np.eye(len(a)), *words)
