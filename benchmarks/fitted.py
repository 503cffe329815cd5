"""Fits to simulated measurements: an arm of 36 degrees of freedom, 24 stiffnesses from 360 responses at 200 lines.

python benchmarks/fitted.py: CPU time and errors from 30 and 73 % off with 2 % noise; the Jacobian of 24 parameters
against one set of responses; the share of intervals that hold their value in 150 fits of a chain.
"""

from __future__ import annotations

import sys
import time
from pathlib import Path

import numpy as np

import mbsvib as mv

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))
from mbsvib.fitting.response_data import blocks
from tests.fitting.scenes import away, chain, measured

AXES = ("x", "y", "z", "rx", "ry", "rz")
OMEGA = 2 * np.pi * np.linspace(2.0, 800.0, 200)
FREE = [f"j{k}.stiffness.{axis}" for k in range(6) for axis in ("y", "z", "ry", "rz")]


def arm() -> mv.Model:
    """Six bodies in a row, each on a bushing on the one before; all displacements are measured."""
    model, below = mv.Model("arm"), "ground"
    for k in range(6):
        model.add_body(f"link{k}", 2.0 + 0.3 * k, (0.02 + 0.002 * k, 0.03, 0.015 + 0.001 * k),
                       position=(0.3 * (k + 1), 0.1 * (k % 2), 0.05 * k))  # fmt: skip
        model.add_bushing(f"j{k}", below, f"link{k}", (0.3 * k + 0.15, 0.05, 0.02 * k),
                          (4e6, 5e6, 6e6, 4e4, 5e4, 6e4), (200, 250, 300, 3.0, 4.0, 5.0))  # fmt: skip
        below = f"link{k}"
        for axis in AXES:
            model.add_output(f"link{k}.{axis}", below, axis)
        for axis in (("x", "y") if k % 2 else ("y", "z"))[: 2 if k < 5 else 0]:
            model.add_input(f"F{k}{axis}", below, axis)
    return model


def cpu(function, count: int) -> float:
    """Least CPU time of some calls [s]."""
    times = []
    for _ in range(count):
        began = time.process_time()
        function()
        times.append(time.process_time() - began)
    return min(times)


if __name__ == "__main__":
    model = arm()
    data = measured(model, OMEGA, 0.02, 1)
    model.fit(data, FREE)  # imports
    for share in (0.3, 0.73):
        start, began = away(model, FREE, share, 0), time.process_time()
        fit = start.fit(data, FREE)
        spent = time.process_time() - began
        off = max(abs(fit.values[name] / model.parameters[name] - 1.0) for name in FREE)
        print(f"from {100 * share:.0f} % off: {spent:.2f} s, largest error {100 * off:.3f} %, "
              f"residuals {'are' if fit.residual_test.passed else 'are not'} noise")  # fmt: skip
    system, plant = model.linearize(), model.compile(FREE)
    tangent = plant.tangent(plant.nominal, np.eye(24))
    slopes = {key: getattr(tangent, key) for key in ("M", "C", "K", "B", "Cq", "Cv", "Ca", "D")}
    rows, columns = np.arange(36), np.arange(10)
    one = cpu(lambda: list(blocks(system, None, OMEGA, rows, columns)), 9)
    all_ = cpu(lambda: list(blocks(system, slopes, OMEGA, rows, columns)), 9)
    print(f"Jacobian of 24 parameters: {all_ / one:.1f} sets of responses ({1e3 * one:.0f} ms)")
    model, omega = chain(), 2 * np.pi * np.linspace(2.0, 60.0, 80)
    free, held, count = ["k*.stiffness", "k*.damping", "b1.mass"], 0, 0
    for seed in range(150):
        data = measured(model, omega, 0.03, seed, ["z0", "z1", "z2"], ["F"])
        fit = away(model, free, 0.3, 1000 + seed).fit(data, free)
        held += sum(low <= model.parameters[name] <= high for name, (low, high) in fit.intervals.items())
        count += len(fit.intervals)
    print(f"intervals of 95 % hold {100 * held / count:.1f} % of {count} values")
