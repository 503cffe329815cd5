"""Run time of batches against one by one, and the difference of their results.

    OPENBLAS_NUM_THREADS=1 python benchmarks/batches.py [--variants 1000] [--repeat 7] [SWEEP ...]

Medians of CPU time for a variant, in one process with one BLAS thread; the model is built beforehand. ``one by one``
linearizes the changed models in the coordinates of the batch, without the time to change them. ``apart`` is the
largest difference of any matrix, relative to its largest entry, over some of the variants; of modes, the largest
relative difference of an eigenvalue; of responses, which include the modes, relative to the largest of them.
``budget`` is what the project asks of the batch.
"""

from __future__ import annotations

import argparse
import os
from dataclasses import replace

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import statistics
import time

import numpy as np
from rich.console import Console
from rich.table import Table

import mbsvib as mv
from mbsvib import library
from mbsvib.modes import modes
from mbsvib.modes.batch import batch_modes

MATRICES = ("M", "C", "K", "B", "Cq", "Cv", "Ca", "D")
LOOKED_AT = 20  # variants that are computed by themselves
FREQUENCIES = np.geomspace(10.0, 1e5, 20)


def parts_of(model, group, field):
    """Names of the parameters of a field of the bodies, joints or springs."""
    names = getattr(model, group)
    return [name for name in model.parameters if model.parameters.entry(name).part in names
            and model.parameters.entry(name).field == field]  # fmt: skip


def scaled(model, names, rng, count):
    """Values between half and twice the given ones; those that are 0 stay."""
    return {name: model.parameters[name] * rng.uniform(0.5, 2.0, size=count) for name in names}


def shifted(model, names, rng, count, *, step=1e-3):
    """Values around the given ones."""
    return {name: model.parameters[name] + step * rng.normal(size=count) for name in names}


def guide():
    """A parallel guide of two leaf springs under gravity."""
    model = mv.Model("guide", gravity=(0.0, 0.0, -9.81))
    model.add_model("guide", library.parallel_guide())
    return model


def of_flexures(model, rng, count):
    """Moduli and thicknesses of all flexures, 1 % around theirs."""
    names = [name for name in model.parameters if name.endswith((".E", ".thickness"))]
    return {name: model.parameters[name] * rng.uniform(0.99, 1.01, size=count) for name in names}


SWEEPS = {
    "Stewart, 6 stiffnesses": (
        library.stewart, lambda m, *a: scaled(m, parts_of(m, "springs", "stiffness"), *a), "30",
    ),
    "Stewart, 12 joints x y z": (
        library.stewart,
        lambda m, *a: shifted(m, [n for n in parts_of(m, "joints", "position") if ".slide." not in n], *a), "40",
    ),
    "Stewart, one joint z": (library.stewart, lambda m, *a: shifted(m, ["leg3.head.position.z"], *a), "40"),
    "Stewart, 13 masses": (library.stewart, lambda m, *a: scaled(m, parts_of(m, "bodies", "mass"), *a), ""),
    "Stewart, all at once": (
        library.stewart,
        lambda m, *a: scaled(m, parts_of(m, "springs", "stiffness") + parts_of(m, "bodies", "mass"), *a)
        | shifted(m, parts_of(m, "joints", "position") + parts_of(m, "joints", "orientation"), *a), "",
    ),
    "L5RF1 (redundant loops), 2 lengths": (
        lambda: library.ladder(5),
        lambda m, *a: shifted(m, parts_of(m, "joints", "position")[:6:3], *a, step=1e-4), "",
    ),
    "C50RF1, 10 stiffnesses": (
        lambda: library.chain(50, line=(0, 1, 0)),
        lambda m, *a: scaled(m, [n for n in parts_of(m, "springs", "stiffness") if m.parameters[n]][:10], *a), "",
    ),
    "parallel guide, 2 leaf springs": (library.parallel_guide, of_flexures, "60"),
    "parallel guide under gravity": (guide, of_flexures, "60"),
}  # fmt: skip


def median(call, repeat, count):
    """Median CPU time of a call for a variant [us]."""
    times = []
    for _ in range(repeat):
        start = time.process_time_ns()
        call()
        times.append(time.process_time_ns() - start)
    return statistics.median(times) * 1e-3 / count


def apart(found, expected):
    """Largest difference relative to the largest entry."""
    return float(np.abs(found - expected).max(initial=0.0)) / (float(np.abs(expected).max(initial=0.0)) or 1.0)


def measure(name, count, repeat):
    """Rows of the table: linearize, modes and frequency response of one sweep."""
    make, choose, budget = SWEEPS[name]
    model = make()
    values = choose(model, np.random.default_rng(1), count)
    batch = model.linearize(values=values)
    which = np.linspace(0, count - 1, min(count, LOOKED_AT)).astype(int).tolist()
    models = [model.with_values({key: array[i] for key, array in values.items()}) for i in which]
    for each in models:
        each.linearize()  # the topology is found once
    singles = [each.linearize(independent=batch.coordinates) for each in models]
    rows = [(
        name, "linearize", median(lambda: model.linearize(values=values), repeat, count),
        median(lambda: [each.linearize(independent=batch.coordinates) for each in models], repeat, len(models)), budget,
        max(apart(getattr(batch, key)[i], getattr(single, key)) for i, single in zip(which, singles, strict=True)
            for key in MATRICES),
    )]  # fmt: skip
    result, alone = batch_modes(batch), [modes(single) for single in singles]
    rows.append((
        "", "modes", median(lambda: batch_modes(batch), repeat, count),
        median(lambda: [modes(single) for single in singles], repeat, len(singles)), "",
        max(float(np.max(np.abs(result.eigenvalues[i] / one.eigenvalues - 1.0)))
            for i, one in zip(which, alone, strict=True)),
    ))  # fmt: skip
    found = batch.frequency_response(FREQUENCIES)
    rows.append((  # of fresh copies, which know no modes yet
        "", f"{len(FREQUENCIES)} frequencies",
        median(lambda: replace(batch).frequency_response(FREQUENCIES), repeat, count),
        median(lambda: [replace(each).frequency_response(FREQUENCIES) for each in singles], repeat, len(singles)), "",
        max(apart(found[i], single.frequency_response(FREQUENCIES)) for i, single in zip(which, singles, strict=True)),
    ))  # fmt: skip
    return rows


def main():
    """Measure the sweeps named on the command line, or all."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("sweeps", nargs="*", default=list(SWEEPS), metavar="SWEEP")
    parser.add_argument("--variants", type=int, default=1000)
    parser.add_argument("--repeat", type=int, default=7)
    arguments = parser.parse_args()
    table = Table(title=f"CPU time for a variant in us, {arguments.variants} variants")
    for header in ("sweep", "stage", "batch", "one by one", "ratio", "budget", "apart"):
        table.add_column(header, justify="left" if header in ("sweep", "stage") else "right")
    for sweep in arguments.sweeps:
        for name, stage, batch, single, budget, off in measure(sweep, arguments.variants, arguments.repeat):
            table.add_row(name, stage, f"{batch:.1f}", f"{single:.0f}", f"{single / batch:.0f}", budget, f"{off:.1e}")
    Console(width=110).print(table)


if __name__ == "__main__":
    main()
