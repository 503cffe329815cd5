"""Many poses of the Stewart platform: run time, and whether the bound of its function of the pose holds.

    OPENBLAS_NUM_THREADS=1 python benchmarks/poses.py [--poses 10000] [--reach 0.005] [--repeat 5]

Poses are random in the six lengths of the legs. ``family``: median CPU time of all matrices, in one process with one
BLAS thread, asked for 2 s for 10 000 poses; ``apart`` is the largest difference of M, C, K and B from models that are
moved and linearized one by one, relative to their largest entries, in scaled coordinates. ``one pose``: the time of a
pose by itself, of its matrices, its system and its model. ``interpolated``: functions of the pose with an error of
1e-6; ``apart`` is then the largest error in all poses over the bound, which is to be less than 1.
"""

from __future__ import annotations

import argparse
import os

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import statistics
import time

import numpy as np
from rich.console import Console
from rich.table import Table

from mbsvib import library

LEGS = [f"leg{i}.slide.z" for i in range(1, 7)]
LOOKED_AT, ALONE = 10, 50  # poses that are compared, and that are computed, by themselves


def seconds(call, repeat):
    """Median CPU time of a call, and its result."""
    times = []
    for _ in range(repeat):
        start = time.process_time()
        result = call()
        times.append(time.process_time() - start)
    return statistics.median(times), result


def errors(found, exact):
    """Largest errors (n,) of M, C, K and B, (n, ...) each, relative to their largest entries; coordinates are scaled by
    the roots of their masses.
    """
    root = np.sqrt(np.einsum("nii->ni", exact[0]))
    rows, columns = 1.0 / root[:, :, None], 1.0 / root[:, None, :]
    scales = (rows * columns,) * 3 + (rows,)
    return np.max([np.abs((a - b) * scale).max(axis=(1, 2)) / np.abs(b * scale).max(axis=(1, 2))
                   for a, b, scale in zip(found, exact, scales, strict=True)], axis=0)  # fmt: skip


def matrices(source, which=slice(None)):
    """M, C, K and B."""
    return [getattr(source, key)[which] for key in "MCKB"]


def main():
    """Measure, and print a table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--poses", type=int, default=10_000)
    parser.add_argument("--reach", type=float, default=5e-3, help="of each leg, to both sides [m]")
    parser.add_argument("--repeat", type=int, default=5)
    arguments = parser.parse_args()
    model, reach = library.stewart(), arguments.reach
    values = dict(zip(LEGS, np.random.default_rng(0).uniform(-reach, reach, (6, arguments.poses)), strict=True))
    table = Table(title=f"Stewart platform, {arguments.poses} poses")
    for header in ("what", "poses", "CPU time [s]", "us a pose", "apart"):
        table.add_column(header, justify="left" if header == "what" else "right")
    spent, family = seconds(lambda: model.family(values), arguments.repeat)
    few = np.linspace(0, len(family) - 1, LOOKED_AT).astype(int)
    singles = [model.moved(family.pose(i), relaxed=True).linearize(independent=LEGS) for i in few.tolist()]
    apart = errors(matrices(family, few), [np.array([getattr(one, key) for one in singles]) for key in "MCKB"]).max()
    table.add_row("family", str(len(family)), f"{spent:.2f}", f"{1e6 * spent / len(family):.0f}", f"{apart:.1e}")
    plant, alone = model.compile([], pose=LEGS, relaxed=True), np.stack(list(values.values()), axis=1)[:ALONE]
    for name, call in (("plant(values)", plant), ("plant.system(values)", plant.system),
                       ("moved", lambda row: model.moved(dict(zip(LEGS, row.tolist(), strict=True)), relaxed=True))):
        spent, _ = seconds(lambda call=call: [call(row) for row in alone], arguments.repeat)
        table.add_row(f"one pose, {name}", str(len(alone)), f"{spent:.2f}", f"{1e6 * spent / len(alone):.0f}", "")
    for count in (1, 2, 6):
        box = model.family({key: [-reach, reach] for key in LEGS[:count]}, grid=True)
        spent, lpv = seconds(box.interpolated, 1)
        poses = np.stack(list(values.values())[:count], axis=1)
        found = lpv.matrices(poses)
        off = errors([found[key] for key in "MCKB"], matrices(box.plant(poses))) / lpv.error_bound
        table.add_row(f"interpolated, {count} legs, bound {lpv.error_bound:.1e}", str(lpv.poses), f"{spent:.2f}",
                      f"{1e6 * spent / lpv.poses:.0f}",
                      f"{off.max():.2f} of the bound, held in {np.count_nonzero(off <= 1.0)}")  # fmt: skip
    Console(width=110).print(table)


if __name__ == "__main__":
    main()
