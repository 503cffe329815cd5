"""How far mbsvib is above the bare LAPACK call on its own matrices, at 200 degrees of freedom."""

import statistics
import time

import scipy.linalg as la
from rich.table import Table

from mbsvib import library
from mbsvib.modes import modes

REPEATS = 60


def ratios(repeats=REPEATS):
    """Return {what: (CPU time [ms], ratio to the floor)}; the calls take turns, ratios are medians over the turns."""
    model = library.chain(200, line=(0, 1, 0))
    system = model.linearize()
    calls = {
        "floor: scipy.linalg.eigh(K, M)": lambda: la.eigh(system.K, system.M),
        "modes, rtol 1e-6": lambda: modes(system, 1e-6, clean=False),
        "modes, rtol 1e-10 (default)": lambda: modes(system, 1e-10, clean=False),
        "modes, rtol 1e-12": lambda: modes(system, 1e-12, clean=False),
        "modes and shapes for responses": lambda: modes(system, 1e-13),
        "linearize": model.linearize,
        "linearize + modes (default)": lambda: modes(model.linearize(), 1e-10, clean=False),
    }
    times = {name: [] for name in calls}
    for _ in range(repeats):
        for name, call in calls.items():
            start = time.process_time_ns()
            call()
            times[name].append(1e-6 * (time.process_time_ns() - start))
    floor = next(iter(times.values()))
    return {
        name: (statistics.median(t), statistics.median(a / b for a, b in zip(t, floor, strict=True)))
        for name, t in times.items()
    }


def table(measured):
    """Return the ratios as a table."""
    result = Table(title="Chain of 200 bodies, against the floor", title_justify="left")
    for header in ("call", "CPU ms", "ratio"):
        result.add_column(header, justify="left" if header == "call" else "right")
    for name, (middle, ratio) in measured.items():
        result.add_row(name, f"{middle:.2f}", f"{ratio:.2f}")
    return result
