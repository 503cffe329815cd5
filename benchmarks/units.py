"""Functional mock-up units: time of the export and of a step, size, and error against scipy's exact discretisation.

    OPENBLAS_NUM_THREADS=1 python benchmarks/units.py [--steps 2000]

A step is ``fmi3DoStep`` called through ctypes, with what that costs; the first of a size computes the exponential.
"""

from __future__ import annotations

import argparse
import os

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import ctypes
import tempfile
import time
from pathlib import Path

import numpy as np
from fmpy import extract, read_model_description
from fmpy.fmi3 import FMU3Slave
from rich.console import Console
from rich.table import Table
from scipy.linalg import expm

import mbsvib_export as mx
from mbsvib import library

CASES = ((12, "physical"), (12, "modal"), (50, "physical"), (200, "physical"), (200, "modal"))
H, STEPS = 1e-3, 50


def truth(space, u):
    """Outputs after each step with inputs held, by scipy's exponential."""
    n, m = space.B.shape
    e = expm(np.block([[space.A, space.B], [np.zeros((m, n + m))]]) * H)
    x, found = np.zeros(n), []
    for row in u:
        x = e[:n, :n] @ x + e[:n, n:] @ row
        found.append(space.C @ x + space.D @ row)
    return np.array(found)


def started(path, folder):
    """An instance in step mode, references of its inputs and outputs."""
    description = read_model_description(str(path))
    unit = FMU3Slave(guid=description.guid, unzipDirectory=extract(str(path), str(folder)),
                     modelIdentifier=description.coSimulation.modelIdentifier)  # fmt: skip
    unit.instantiate()
    unit.enterInitializationMode()
    unit.exitInitializationMode()
    references = [[each.valueReference for each in description.modelVariables if each.causality == kind]
                  for kind in ("input", "output")]  # fmt: skip
    return unit, *references


def stepped(unit, start, steps):
    """Time of a step [s], many in a row."""
    flags, last = [ctypes.c_bool() for _ in range(3)], ctypes.c_double()
    rest = [ctypes.c_bool(True), *map(ctypes.byref, flags), ctypes.byref(last)]
    call, instance, h = unit.dll.fmi3DoStep, ctypes.c_void_p(unit.component), ctypes.c_double(H)
    call.argtypes = None
    begin = time.perf_counter()
    for k in range(steps):
        if call(instance, ctypes.c_double(start + k * H), h, *rest):
            raise RuntimeError("a step failed")
    return (time.perf_counter() - begin) / steps


def measured(bodies, realization, steps, folder):
    """A row of the table."""
    system = library.chain(bodies, line=(0, 1, 0)).linearize()
    space = system.state_space(realization)
    path = folder / "unit.fmu"
    export = []
    for _ in range(4):  # the first may compile
        system = library.chain(bodies, line=(0, 1, 0)).linearize()
        begin = time.perf_counter()
        mx.to_fmu(system, path, realization=realization)
        export.append(time.perf_counter() - begin)
    unit, inputs, outputs = started(path, folder / f"{bodies}-{realization}")
    u, found, times = np.random.default_rng(0).standard_normal((STEPS, len(inputs))), [], []
    for k, row in enumerate(u):
        unit.setFloat64(inputs, row.tolist())
        begin = time.perf_counter()
        unit.doStep(currentCommunicationPoint=k * H, communicationStepSize=H)
        times.append(time.perf_counter() - begin)
        found.append(unit.getFloat64(outputs))
    exact = truth(space, u)
    each = stepped(unit, STEPS * H, steps)
    error = np.abs(np.array(found) - exact).max() / np.abs(exact).max()
    return (str(2 * bodies), realization, f"{1e3 * min(export):.0f}", f"{path.stat().st_size / 1024:.0f}",
            f"{1e3 * times[0]:.2f}", f"{1e6 * each:.1f}", f"{error:.0e}")  # fmt: skip


def main():
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--steps", type=int, default=2000)
    steps = parser.parse_args().steps
    table = Table("states", "realization", "export [ms]", "size [KiB]", "first step [ms]", "step [us]", "error")
    with tempfile.TemporaryDirectory() as folder:
        for bodies, realization in CASES:
            table.add_row(*measured(bodies, realization, steps, Path(folder)))
    Console().print(table)


if __name__ == "__main__":
    main()
