"""Run time of sensitivities to every parameter, against that of the modes.

    OPENBLAS_NUM_THREADS=1 python benchmarks/sensitivities.py [--repeat 20] [SCENE ...]

Medians of CPU time in one process with one BLAS thread. ``modes`` is the solver alone, at the default accuracy;
``first`` the first call on a new system, which lists and groups the parameters; ``again`` any further one.
``differences`` is what central differences of linearize() and modes() would take, in loaded scenes without searching
the equilibrium of each variant.
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


def hanging(build):
    """A scene under gravity, in its equilibrium: the pose follows what parameters do."""
    model = build()
    model.gravity = (0.0, 0.0, -9.81)
    return model.equilibrium()


SCENES = {
    "stewart": library.stewart,
    "L20RF1": lambda: library.ladder(20),
    "T7RF1": lambda: library.tree(7),
    "C200RF1": lambda: library.chain(200, line=(0, 1, 0)),
    "stewart.loaded": lambda: hanging(library.stewart),
    "L20RF1.loaded": lambda: hanging(lambda: library.ladder(20)),
    "T7RF1.loaded": lambda: hanging(lambda: library.tree(7)),
    "C200RF1.loaded": lambda: hanging(lambda: library.chain(200, line=(0, 1, 0))),
}
BUDGETS = {"stewart": "1 ms", "T7RF1": "3 x modes", "C200RF1": "3 x modes"}
RESPONSES = ("stewart", "stewart.loaded")


def median(call, repeat, prepare=lambda: ()):
    """Median CPU time of a call [ms], what it needs prepared beforehand."""
    times = []
    for _ in range(repeat):
        given = prepare()
        start = time.process_time_ns()
        call(*given)
        times.append(time.process_time_ns() - start)
    return statistics.median(times) * 1e-6


def row(scene, repeat):
    """One row of the table of eigenvalues."""
    model = SCENES[scene]()

    def fresh(known=True):
        system = model.linearize()
        if known:
            system.modes()
        return (system,)

    system = fresh()[0]
    system.eigenvalue_sensitivities()
    linearize = median(model.linearize, repeat)
    modes = median(lambda system: system.modes(), repeat, lambda: fresh(known=False))
    first = median(lambda system: system.eigenvalue_sensitivities(), repeat, fresh)
    again = median(system.eigenvalue_sensitivities, repeat)
    count = len(system.parameters)
    differences = 2e-3 * count * (linearize + modes)
    return (scene, str(system.dof), str(count), f"{modes:.2f}", f"{first:.2f}", f"{again:.2f}", f"{again / modes:.1f}",
            BUDGETS.get(scene, "-"), f"{differences:.2f} s")  # fmt: skip


def responses(scene, repeat):
    """Rows of the table of everything else: name and time [ms], to every parameter."""
    system = SCENES[scene]().linearize()
    t = np.linspace(0.0, 0.5, 1001)
    u = np.ones((len(system.inputs), len(t)))
    calls = {
        "matrices": system.matrix_derivatives,
        "frequencies, damping, shapes": lambda: system.mode_sensitivities().shapes,
        "static compliance": system.compliance_sensitivities,
        "frequency response, 100 points": lambda: system.frequency_response_sensitivities(np.geomspace(1e3, 1e5, 100)),
        "time response, 1000 steps": lambda: system.time_response_sensitivities(t, u),
        "H2 norm": system.h2_norm,
        "Hinf norm": system.hinf_norm,
    }
    for name, call in calls.items():
        call()
        yield name, f"{median(call, max(3, repeat // 5)):.1f}"


def main():
    """Measure the scenes named on the command line, or all."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("scenes", nargs="*", default=list(SCENES), metavar="SCENE")
    parser.add_argument("--repeat", type=int, default=20)
    arguments = parser.parse_args()
    table = Table(title="eigenvalue sensitivities to every parameter, CPU time in ms, median")
    for header in ("scene", "DOF", "parameters", "modes", "first", "again", "again / modes", "budget", "differences"):
        table.add_column(header, justify="left" if header == "scene" else "right")
    for scene in arguments.scenes:
        table.add_row(*row(scene, arguments.repeat))
    console = Console(width=110)
    console.print(table)
    for scene in arguments.scenes:
        if scene in RESPONSES:
            table = Table("derivatives of", "ms", title=f"everything else, every parameter of {scene}")
            for entry in responses(scene, arguments.repeat):
                table.add_row(*entry)
            console.print(table)


if __name__ == "__main__":
    main()
