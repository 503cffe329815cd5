"""Units under test: instances through fmpy, and the exact answers that they are held against."""

import ctypes
from contextlib import contextmanager

import numpy as np
from fmpy import extract, read_model_description
from fmpy.fmi2 import FMU2Model, FMU2Slave
from fmpy.fmi3 import FMU3Model, FMU3Slave, fmi3IntermediateUpdateCallback
from scipy.linalg import matrix_balance

DOUBLES = ctypes.POINTER(ctypes.c_double)


class Unit:
    """An instance of either version, by names: ``set``, ``get``, ``step``."""

    def __init__(self, file, folder, kind="cs", inputs_at=None, event_mode=False):
        self.description = read_model_description(str(file), validate=True)
        self.new = self.description.fmiVersion.startswith("3")
        self.references = {item.name: item.valueReference for item in self.description.modelVariables}
        words = {"guid": self.description.guid, "unzipDirectory": extract(str(file), str(folder)),
                 "modelIdentifier": self.description.coSimulation.modelIdentifier, "instanceName": "unit"}  # fmt: skip
        classes = {"cs": (FMU2Slave, FMU3Slave), "me": (FMU2Model, FMU3Model)}
        self.fmu = classes[kind][self.new](**words)
        self.inputs_at = inputs_at
        if not inputs_at:
            self.fmu.instantiate(**({"eventModeUsed": True} if event_mode else {}))
        else:
            self._callback = fmi3IntermediateUpdateCallback(self._update)
            self.fmu.instantiate(intermediateUpdate=self._callback, earlyReturnAllowed=True)

    def _update(self, environment, time, set_requested, get_allowed, finished, can_return, requested, early):
        if set_requested:
            self.set(self.inputs_at(time))

    def initialize(self, start=0.0):
        if self.new:
            self.fmu.enterInitializationMode(startTime=start)
        else:
            self.fmu.setupExperiment(startTime=start)
            self.fmu.enterInitializationMode()
        self.fmu.exitInitializationMode()
        return self

    def set(self, values):
        call = self.fmu.setFloat64 if self.new else self.fmu.setReal
        call([self.references[name] for name in values], [float(value) for value in values.values()])

    def get(self, names):
        call = self.fmu.getFloat64 if self.new else self.fmu.getReal
        return np.array(call([self.references[name] for name in names]))

    def step(self, t, h):
        return self.fmu.doStep(currentCommunicationPoint=t, communicationStepSize=h)

    def derivatives(self, t, x, inputs):
        self.fmu.setTime(t)
        self.set(inputs)
        x, dx = np.array(x, dtype=float), np.zeros(len(x))
        self.fmu.setContinuousStates(x.ctypes.data_as(DOUBLES), len(x))
        call = self.fmu.getContinuousStateDerivatives if self.new else self.fmu.getDerivatives
        call(dx.ctypes.data_as(DOUBLES), len(x))
        return dx


@contextmanager
def unit(file, folder, kind="cs", start=0.0, **more):
    """An instance that is initialized and freed."""
    made = Unit(file, folder, kind, **more).initialize(start)
    try:
        yield made
    finally:
        made.fmu.terminate()
        made.fmu.freeInstance()


def names_of(file, kind):
    """Names in the file, in the order of the system."""
    return list(file.names[kind].values())


def exponential(a):
    """The exponential of a matrix of balanced rows and columns by squaring, in numbers of 64 bits behind the point."""
    doublings = max(0, int(np.ceil(np.log2(max(np.abs(a).sum(axis=1).max(initial=0.0), 1e-300))))) + 4
    part = a.astype(np.longdouble) / np.longdouble(2) ** doublings
    term = result = np.eye(len(a), dtype=np.longdouble)
    for k in range(1, 16):
        term = term @ part / k
        result = result + term
    for _ in range(doublings):
        result = result @ result
    return result.astype(float)


def held(space, h, u):
    """Outputs after each step with inputs held (steps, inputs), by the exponential of balanced states."""
    n, m = space.B.shape
    balanced, (size, _) = matrix_balance(space.A, permute=False, separate=True)
    e = exponential(np.block([[balanced, space.B / size[:, None]], [np.zeros((m, n + m))]]) * h)
    x, result = np.zeros(n), []
    for row in u:
        x = e[:n, :n] @ x + e[:n, n:] @ row
        result.append(space.C @ (size * x) + space.D @ row)
    return np.array(result)


def worst(result, truth):
    """Largest error of each output against its own size, the largest of them."""
    size = np.abs(truth).max(axis=0)
    return (np.abs(result - truth).max(axis=0) / np.where(size > 0, size, 1.0)).max()
