"""Run time and memory against the number of bodies: the ten lowest modes of revolute chains of up to 100 000.

    python benchmarks/many_bodies.py [--sizes 100 1000 ...] [--peers mbsvib pinocchio ...] [--out FOLDER]

Every method and size runs in a process of its own, with one BLAS thread; what takes more than ``--limit`` seconds is
given up, with all larger sizes. Peers have dense matrices, of which the lowest frequencies are asked
(``scipy.linalg.eigh`` with ``subset_by_index``); with loops or springs that are no joint's they need more. The error is
the Newton step of the three lowest frequencies in 60 digits (transfer matrices).
"""

from __future__ import annotations

import argparse
import json
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
sys.path.insert(0, str(ROOT))

from benchmarks import compare  # noqa: E402

SIZES = (100, 300, 1000, 10_000, 100_000)
# Name on the command line: (label of the method, bodies that it is tried with at most). Beyond, dense matrices and
# derivatives don't fit into some GB, or take hours.
PEERS = {
    "mbsvib": ("mbsvib 1e-10", 100_000), "traditional": ("traditional", 1000), "exudyn": ("exudyn tree", 1000),
    "pinocchio": ("pinocchio", 300), "mujoco": ("mujoco inverse", 1000),
}  # fmt: skip
LOWEST = 10
LOOKED_AT = 3


def newton_step(n, omega):
    """Largest relative error of the first frequencies of a chain of n bodies, as their Newton steps in 60 digits."""
    from mpmath import mp, mpf

    from mbsvib import library
    from tests.support.transfer_matrix import closure

    model = library.chain(n, line=(0, 1, 0))
    steps = []
    with mp.workdps(60):
        for w in map(mpf, omega[:LOOKED_AT]):
            step = w * mpf("1e-20")
            low, high = closure(model, w - step), closure(model, w + step)
            steps.append(abs((low + high) * step / (high - low) / w))
    return float(max(steps))


def measure(peers, sizes, arguments):
    """Return {label: {size: answer}}."""
    results = {}
    for peer in peers:
        script, (label, most) = compare.PEERS[peer][0], PEERS[peer]
        results[label] = {}
        for n in (n for n in sizes if n <= most):
            compare.progress(f"{label}, {n} bodies")
            answer = compare.run(script, label, f"C{n}", arguments.budget, arguments.limit, ["--lowest", str(LOWEST)])
            results[label][n] = answer
            if "skipped" in answer:
                break
    compare.progress("")
    return results


def report(results):
    """Return the table as Markdown."""
    from benchmarks.peers.markdown import milliseconds, rows, size

    lines = []
    for label, sizes in results.items():
        for n, a in sizes.items():
            if "skipped" in a:
                lines.append([label, f"{n}", a["skipped"], "", "", "", "", ""])
                continue
            stages = [a["build"], a["linearise"], a["modes"]]
            lines.append([label, f"{n}", *map(milliseconds, [*stages, sum(stages)]), size(a["error"]),
                          f"{a['peak_mb'] - a['base_mb']:.0f}"])  # fmt: skip
    return rows(["method", "bodies", "build", "linearise", "modes", "all", "error", "memory MB"], lines)


def figure(results):
    """Return run time and memory against the number of bodies."""
    from matplotlib.figure import Figure

    from benchmarks.peers.figure import LOOKS

    result = Figure(figsize=(9.0, 3.6), layout="constrained")
    for axes, name in zip(result.subplots(1, 2), ("CPU time, model to ten modes [s]", "memory beside imports [MB]"),
                          strict=True):  # fmt: skip
        for label, sizes in results.items():
            look = "mbsvib" if label.startswith("mbsvib") else label
            done = {n: a for n, a in sizes.items() if "skipped" not in a}
            value = [a["build"] + a["linearise"] + a["modes"] if name.startswith("CPU")
                     else max(1.0, a["peak_mb"] - a["base_mb"]) for a in done.values()]  # fmt: skip
            colour, marker = LOOKS[look]
            axes.loglog(list(done), value, marker=marker, color=colour, label=look, markersize=6, linewidth=1.2)
        axes.set_xlabel("bodies", fontsize=8.5)
        axes.set_title(name, fontsize=10, loc="left")
        axes.grid(True, which="major", color="#e4e4e4", linewidth=0.7)
        axes.set_axisbelow(True)
        axes.spines[["top", "right"]].set_visible(False)
        axes.tick_params(labelsize=8)
    result.axes[0].legend(fontsize=8, frameon=False)
    return result


def main():
    """Measure, print, write."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--sizes", nargs="+", type=int, default=SIZES)
    parser.add_argument("--peers", nargs="+", choices=PEERS, default=list(PEERS), metavar="PEER", help=" ".join(PEERS))
    parser.add_argument("--budget", type=float, default=1.0, help="CPU seconds for a method and size")
    parser.add_argument("--limit", type=float, default=180.0, help="seconds after which a method is given up")
    parser.add_argument("--out", type=Path, default=Path(".benchmarks"), help="folder of many_bodies.json, .md, .png")
    arguments = parser.parse_args()
    # nothing large is imported before this is done: a process inherits the peak memory of the one that starts it
    results = measure(compare.installed(arguments.peers), arguments.sizes, arguments)
    for sizes in results.values():
        for n, answer in sizes.items():
            if "omega" in answer:
                answer["error"] = newton_step(n, answer.pop("omega"))
    arguments.out.mkdir(parents=True, exist_ok=True)
    (arguments.out / "many_bodies.json").write_text(json.dumps(results, indent=1) + "\n")
    (arguments.out / "many_bodies.md").write_text(report(results))
    figure(results).savefig(arguments.out / "many_bodies.png", dpi=100)
    print(report(results))


if __name__ == "__main__":
    main()
