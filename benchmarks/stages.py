"""Run time of every stage against the error of its result: build, linearize, modes.

    OPENBLAS_NUM_THREADS=1 python benchmarks/stages.py [--repeat 30] [SCENE ...]

Medians of CPU time in one process with one BLAS thread. ``error`` is the largest relative error of a damped eigenvalue
against the 50-digit references of the tests, ``promised`` what ``modes.errors`` says of it, ``floor`` the bare LAPACK
call (symmetric-definite eigenproblem) on the same M and K, ``budget`` what the project asks of build, linearize, modes.
"""

from __future__ import annotations

import argparse
import os

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import json
import statistics
import time
from pathlib import Path

import numpy as np
import scipy.linalg as la
from rich.console import Console
from rich.table import Table

from mbsvib import library
from mbsvib.modes import modes

REFERENCE = Path(__file__).parent.parent / "tests" / "data" / "reference"
SCENES = {
    "stewart": (library.stewart, "0.4 0.35 0.1"),
    "C10RF1": (lambda: library.chain(10, line=(0, 1, 0)), ""),
    "C50RF1": (lambda: library.chain(50, line=(0, 1, 0)), ""),
    "C200RF1": (lambda: library.chain(200, line=(0, 1, 0)), "- 8 -"),
    "T5RF1": (lambda: library.tree(5), ""),
    "T7RF1": (lambda: library.tree(7), "- 3 -"),
    "L5RF1": (lambda: library.ladder(5), ""),
    "L20RF1": (lambda: library.ladder(20), ""),
}


def median(call, repeat):
    """Median CPU time of a call [ms]."""
    times = []
    for _ in range(repeat):
        start = time.process_time_ns()
        call()
        times.append(time.process_time_ns() - start)
    return statistics.median(times) * 1e-6


def error(scene, eigenvalues):
    """Largest relative error against the reference, or None where there is none."""
    file = REFERENCE / f"ref_{scene}.json"
    if not file.exists():
        return None
    data = json.loads(file.read_text())
    exact = np.array([complex(float(re), float(im)) for re, im in zip(data["lam_re"], data["lam_im"], strict=True)])
    return float(np.max(np.abs(eigenvalues[0::2] - exact) / np.abs(exact)))


def measure(scene, repeat):
    """Times of the stages [ms], error of the result and the error that is promised."""
    make, _ = SCENES[scene]
    model = make()
    system = model.linearize()
    result = modes(system, clean=False)
    calls = {"build": make, "linearize": model.linearize, "modes": lambda: modes(system, clean=False),
             "floor": lambda: la.eigh(system.K, system.M)}  # fmt: skip
    return {
        "dof": system.dof, **{name: median(call, repeat) for name, call in calls.items()},
        "error": error(scene, result.eigenvalues), "promised": float(result.errors.max()),
    }  # fmt: skip


def row(scene, measured):
    """One row of the table."""
    times = [f"{measured[name]:.3f}" for name in ("build", "linearize", "modes", "floor")]
    off = measured["error"]
    return (scene, str(measured["dof"]), *times, SCENES[scene][1], "-" if off is None else f"{off:.1e}",
            f"{measured['promised']:.1e}")  # fmt: skip


def main():
    """Measure the scenes named on the command line, or all."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("scenes", nargs="*", default=list(SCENES), metavar="SCENE")
    parser.add_argument("--repeat", type=int, default=30)
    arguments = parser.parse_args()
    table = Table(title="CPU time in ms, median")
    for header in ("scene", "DOF", "build", "linearize", "modes", "floor", "budget", "error", "promised"):
        table.add_column(header, justify="left" if header == "scene" else "right")
    for scene in arguments.scenes:
        table.add_row(*row(scene, measure(scene, arguments.repeat)))
    Console(width=110).print(table)


if __name__ == "__main__":
    main()
