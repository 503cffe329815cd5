"""Every solver of undamped modes: run time against error, on chains whose numbers span more and more decades.

    OPENBLAS_NUM_THREADS=1 python benchmarks/ladder.py [--bodies 30] [--repeat 15] [--out benchmarks/images/ladder.png]

Stiffness of the chains spans 0 to 16 decades and mass two thirds of that. ``eigh`` is scipy's on M and K; the others
are eigenproblem, singular values and Jacobi, each with its frequencies taken from the factors, and each with those
before it in its time. Errors are the largest relative ones of any frequency, against 80 digits.
"""

from __future__ import annotations

import argparse
import statistics
import sys
import time
from pathlib import Path

import numpy as np
import scipy.linalg as la
from rich.console import Console
from rich.table import Table

from mbsvib.modes.eigensolvers import Factors, by_factors, by_jacobi, by_products
from mbsvib.modes.undamped import refined

ROOT = Path(__file__).resolve().parent.parent
sys.path.insert(0, str(ROOT))

from tests.stress import reference  # noqa: E402
from tests.stress.families import wide  # noqa: E402
from tests.support.digits import mp  # noqa: E402

DECADES = (0, 4, 8, 12, 16)
SEED = 1


def bare(system):
    return np.sqrt(np.abs(la.eigh(system.K, system.M, eigvals_only=True)))


def products(system):
    scene = Factors(system)
    return refined(scene, by_products(scene)[0], "products", 0.0)


def factors(system):
    return refined(Factors(system), by_factors(Factors(system), products(system).shapes), "factors", 0.0)


def jacobi(system):
    return refined(Factors(system), by_jacobi(Factors(system), products(system).shapes), "jacobi", 0.0)


METHODS = {"eigh": bare, "products": products, "factors": factors, "jacobi": jacobi}


def measure(decades, bodies, repeat):
    """Return {method: (CPU time [ms], largest error, stated bound)} on one chain."""
    model = wide(SEED, bodies, far=0, stiffness_span=float(decades), mass_span=decades * 2 / 3)
    system = model.linearize()
    exact = reference.squares(reference.exact(model))
    result = {}
    for name, method in METHODS.items():
        times = []
        for _ in range(repeat):
            start = time.process_time_ns()
            found = method(system)
            times.append(1e-6 * (time.process_time_ns() - start))
        omega = found if name == "eigh" else found.omega
        with mp.workdps(reference.DIGITS):
            errors = [abs(mp.mpf(float(a)) / mp.sqrt(b) - 1) for a, b in zip(omega, exact, strict=True)]
        bound = None if name == "eigh" else float(found.errors.max())
        result[name] = statistics.median(times), float(max(errors)), bound
    return result


def figure(results, bodies, path):
    """Draw the work-precision diagram; hollow marks are stated bounds."""
    from matplotlib.figure import Figure
    from matplotlib.style import context

    from mbsvib.plots import STYLE
    from mbsvib.plots._style import logarithmic

    with context(STYLE):
        drawing = Figure(figsize=(7, 4.2), layout="constrained")
        axes = drawing.subplots()
        for decades, mark in zip(results, "osD^v", strict=True):
            for k, name in enumerate(METHODS):
                milliseconds, error, bound = results[decades][name]
                axes.loglog(milliseconds, error, mark, color=f"C{k}", markersize=7)
                if bound is not None:
                    axes.loglog(milliseconds, bound, mark, color=f"C{k}", markersize=7, fillstyle="none")
        for k, name in enumerate(METHODS):
            axes.plot([], [], "s", color=f"C{k}", label=name)
        for decades, mark in zip(results, "osD^v", strict=True):
            axes.plot([], [], mark, color="0.5", label=f"{decades} decades")
        axes.set(xlabel="CPU time [ms]", ylabel="largest relative error of a frequency",
                 title=f"Chains of {bodies} bodies; hollow: stated bounds")  # fmt: skip
        logarithmic(axes.xaxis)
        drawing.legend(loc="outside right center")
        drawing.savefig(path, dpi=110)


def main():
    """Measure, print and draw."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--bodies", type=int, default=30)
    parser.add_argument("--repeat", type=int, default=15)
    parser.add_argument("--out", type=Path, default=ROOT / "benchmarks" / "images" / "ladder.png")
    arguments = parser.parse_args()
    results = {decades: measure(decades, arguments.bodies, arguments.repeat) for decades in DECADES}
    table = Table(title=f"Undamped modes, chains of {arguments.bodies} bodies")
    for header in ("decades of stiffness", "method", "CPU ms", "error", "bound"):
        table.add_column(header, justify="right")
    for decades, methods in results.items():
        for name, (milliseconds, error, bound) in methods.items():
            table.add_row(str(decades), name, f"{milliseconds:.3f}", f"{error:.0e}",
                          "" if bound is None else f"{bound:.0e}")  # fmt: skip
    Console(width=100).print(table)
    figure(results, arguments.bodies, arguments.out)


if __name__ == "__main__":
    main()
