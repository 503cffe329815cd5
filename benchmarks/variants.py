"""One structure, many numbers: run time of eigenvalues against their error, for new parameters and for new poses.

    OPENBLAS_NUM_THREADS=1 python benchmarks/variants.py [--repeat 7] [--out benchmarks/images/variants.png]

``model by model`` changes a model, linearizes it and asks for its modes; ``compiled`` asks a plant that was compiled
once, by ``model.compile``, for the eigenvalues of one variant or of many at once. Times are medians of the CPU time for
a variant, in one process with one BLAS thread. Errors are the largest relative ones of any natural frequency in some
of the variants, against 50 digits.
"""

from __future__ import annotations

import argparse
import os
import sys
from pathlib import Path

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import numpy as np
from rich.console import Console
from rich.table import Table

from mbsvib import library

ROOT = Path(__file__).resolve().parent.parent
sys.path.insert(0, str(ROOT))

from benchmarks.stages import median  # noqa: E402
from tests.support.exact import Exact  # noqa: E402

MANY = 1000
ONE_BY_ONE = 20  # variants that are computed by themselves
EXACT = 4  # of these are compared with 50 digits
LEGS = [f"leg{i}.slide.z" for i in range(1, 7)]


def parameters(make, end, spread):
    """A model, its parameters with an end of their names, and values of these: (model, plant, values, change)."""
    model = make()
    names = [name for name in model.parameters if name.endswith(end) and model.parameters[name]]
    plant = model.compile(names)
    values = plant.nominal * (1.0 + spread * np.random.default_rng(0).uniform(-1.0, 1.0, (MANY, len(names))))
    return plant, values, lambda row: model.with_values(dict(zip(names, row.tolist(), strict=True)))


def poses(make, names, reach):
    """The same for joint coordinates, by which a model is moved."""
    model = make()
    plant = model.compile([], pose=names, relaxed=True)
    values = reach * np.random.default_rng(0).uniform(-1.0, 1.0, (MANY, len(names)))
    return plant, values, lambda row: model.moved(dict(zip(names, row.tolist(), strict=True)), relaxed=True)


TASKS = {
    "Stewart, 6 stiffnesses": lambda: parameters(lambda: library.stewart(ports="none"), "k.stiffness", 0.5),
    "ladder of 15 bodies, 6 heights": lambda: parameters(lambda: library.ladder(5), "head.position.y", 1e-3),
    "Stewart, poses of 6 legs": lambda: poses(lambda: library.stewart(ports="none"), LEGS, 5e-3),
    "chain of 10 bodies, poses of 4 joints": lambda: poses(
        lambda: library.chain(10, line=(0, 1, 0)), [f"joint{i}.rz" for i in range(1, 5)], 0.3),
}


def sizes(eigenvalues):
    """Natural frequencies [rad/s], ascending."""
    return np.sort(np.abs(eigenvalues), axis=-1)


def measure(task, repeat):
    """Return {way: (CPU time of a variant [ms], largest error)} of one task."""
    plant, values, change = TASKS[task]()
    few, exact = values[:ONE_BY_ONE], [sizes(Exact(change(row)).eigenvalues) for row in values[:EXACT]]
    ways = {"model by model": (lambda: [change(row).linearize().modes().eigenvalues for row in few], ONE_BY_ONE),
            "compiled, one at a time": (lambda: [plant.eigenvalues(row) for row in few], ONE_BY_ONE)}  # fmt: skip
    for count in (10, 100, MANY):
        ways[f"compiled, {count} at once"] = (lambda n=count: plant.eigenvalues(values[:n]), count)
    result = {}
    for way, (call, count) in ways.items():
        found = sizes(np.array(call())[:EXACT])
        errors = [np.max(np.abs(a / b - 1.0)) for a, b in zip(found, exact, strict=True)]
        result[way] = median(call, repeat) / count, float(max(errors))
    return result


def figure(results, path):
    """Draw the work-precision diagram, one panel a task."""
    from matplotlib.figure import Figure
    from matplotlib.style import context

    from mbsvib.plots import STYLE
    from mbsvib.plots._style import logarithmic

    with context(STYLE):
        drawing = Figure(figsize=(8.6, 6.2), layout="constrained")
        panels = drawing.subplots(2, 2, sharex=True, sharey=True).flat
        for axes, (task, ways) in zip(panels, results.items(), strict=True):
            for mark, (way, (milliseconds, error)) in zip("sXov^", ways.items(), strict=True):
                axes.loglog(milliseconds, max(error, 1e-17), mark, markersize=7, label=way)
            axes.set_title(task)
            logarithmic(axes.xaxis)
            if axes.get_subplotspec().is_last_row():
                axes.set_xlabel("CPU time of a variant [ms]")
            if axes.get_subplotspec().is_first_col():
                axes.set_ylabel("largest relative error [1]")
        axes.set_ylim(1e-17, 1e-12)
        drawing.legend(*axes.get_legend_handles_labels(), loc="outside lower center", ncols=3)
        drawing.savefig(path, dpi=110)


def main():
    """Measure, print and draw."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--repeat", type=int, default=7)
    parser.add_argument("--out", type=Path, default=ROOT / "benchmarks" / "images" / "variants.png")
    arguments = parser.parse_args()
    results = {task: measure(task, arguments.repeat) for task in TASKS}
    table = Table(title="Eigenvalues of variants")
    for header in ("task", "way", "CPU ms a variant", "ratio", "error"):
        table.add_column(header, justify="left" if header in ("task", "way") else "right")
    for task, ways in results.items():
        first = next(iter(ways.values()))[0]
        for k, (way, (milliseconds, error)) in enumerate(ways.items()):
            table.add_row("" if k else task, way, f"{milliseconds:.3f}", f"{first / milliseconds:.1f}", f"{error:.0e}")
    Console(width=110).print(table)
    figure(results, arguments.out)


if __name__ == "__main__":
    main()
