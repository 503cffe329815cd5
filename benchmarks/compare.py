"""mbsvib beside the traditional method, the bare LAPACK call and other libraries: run time against error.

    python benchmarks/compare.py [--peers mbsvib exudyn ...] [--scenes C10 stewart ...] [--rounds 3] [--out FOLDER]

Every method runs in a process of its own, with one BLAS thread; rounds go through all methods in turn (A B C, A B C),
so that a busy machine hits all alike, and each figure is the median over rounds of medians of CPU time. Errors are
the largest relative ones of any eigenvalue against 50 digits. A library that is not installed is named and skipped.
"""

from __future__ import annotations

import argparse
import importlib.util
import json
import os
import platform
import statistics
import subprocess
import sys
from datetime import UTC, datetime
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
sys.path.insert(0, str(ROOT))

# Name on the command line: (script, what it imports, how to get it, labels of its methods)
PEERS = {
    "mbsvib": ("mbsvib_", "mbsvib", "mbsvib", ("mbsvib 1e-6", "mbsvib 1e-10", "mbsvib 1e-14")),
    "floor": ("floor", "scipy", "scipy", ("LAPACK floor",)),
    "traditional": ("traditional", "scipy", "scipy", ("traditional",)),
    "exudyn": ("exudyn_", "exudyn", "exudyn", ("exudyn", "exudyn tree")),
    "pinocchio": ("pinocchio_", "pinocchio", "pin", ("pinocchio",)),
    "mujoco": ("mujoco_", "mujoco", "mujoco", ("mujoco inverse", "mujoco step")),
    "drake": ("drake_", "pydrake", "drake", ("drake",)),
    "sympy": ("sympy_", "sympy", "sympy", ("sympy",)),
}
SCENES = ("C4", "C10", "C50", "C200", "T5", "T7", "L5", "L20", "stewart")
STAGES = ("build", "linearise", "modes", "undamped", "base_mb", "peak_mb")


def run(script, label, scene, budget, limit, options=()):
    """Run one method on one scene in a new process; return what it answers, or why it does not."""
    command = [sys.executable, "-m", f"benchmarks.peers.{script}", label, scene, "--budget", str(budget),
               *options]  # fmt: skip
    try:
        done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, timeout=limit, check=False)
    except subprocess.TimeoutExpired:
        return {"skipped": f"took more than {limit:g} s"}
    if done.returncode:
        last = done.stderr.strip().splitlines()
        return {"skipped": f"failed: {last[-1] if last else f'exit status {done.returncode}'}"}
    return json.loads(done.stdout.strip().splitlines()[-1])


def measure(peers, scenes, arguments):
    """Return {scene: {label: answer}}, each time the median over the rounds."""
    results: dict[str, dict[str, dict]] = {}
    for scene in scenes:
        answers: dict[str, list[dict]] = {}
        for turn in range(arguments.rounds):
            for peer in peers:
                script, *_, labels = PEERS[peer]
                for label in labels:
                    if turn and "skipped" in answers[label][-1]:
                        continue
                    progress(f"{scene}, round {turn + 1}: {label}")
                    answers.setdefault(label, []).append(
                        run(script, label, scene, arguments.budget, arguments.limit))  # fmt: skip
        results[scene] = {}
        for label, several in answers.items():
            whole = [a for a in several if "skipped" not in a] or several[:1]
            middle = {s: statistics.median(a[s] for a in whole) for s in STAGES if s in whole[0]}
            results[scene][label] = whole[-1] | middle
    progress("")
    return results


def progress(text):
    """Say on a terminal what is going on."""
    if sys.stderr.isatty():
        print(f"\r{text}".ljust(60), end="", file=sys.stderr, flush=True)


def judge(scene, answers):
    """Put the errors of the eigenvalues into the answers, in their place."""
    from benchmarks.peers import reference

    exact, omega = reference.exact(scene)
    for answer in answers.values():
        if "eigenvalues" in answer:
            real, imaginary = answer.pop("eigenvalues")
            answer["error"] = reference.error([complex(*v) for v in zip(real, imaginary, strict=True)], exact)
        if "omega" in answer:
            answer["undamped_error"] = reference.error(answer.pop("omega"), omega)


def table(scene, title, answers):
    """Return the table of one scene."""
    from rich.table import Table

    from benchmarks.peers.markdown import milliseconds, size, total

    result = Table(title=f"{scene}: {title}. CPU time in ms", title_justify="left")
    for header in ("method", "build", "linearise", "modes", "all", "error", "undamped", "error", "peak MB", "imports"):
        result.add_column(header, justify="left" if header == "method" else "right")
    for label, a in answers.items():
        if "skipped" in a:
            continue
        stages = [None, None] if label == "LAPACK floor" else [a["build"], a["linearise"]]  # it is handed its matrices
        result.add_row(label, *map(milliseconds, [*stages, a["modes"], total(label, a)]), size(a["error"]),
                       milliseconds(a.get("undamped")), size(a["undamped_error"]) if "undamped_error" in a else "",
                       f"{a['peak_mb']:.0f}", f"{a['base_mb']:.0f}",
                       style="bold" if label.startswith("mbsvib") else None)  # fmt: skip
    absent = [f"{label}: {a['skipped']}" for label, a in answers.items() if "skipped" in a]
    result.caption, result.caption_justify = "; ".join(absent), "left"
    return result


def installed(names):
    """Return the peers that can run, and say how to get the others."""
    result = []
    for name in names:
        _, module, package, _ = PEERS[name]
        if importlib.util.find_spec(module) is None:
            print(f"{name} is not installed and left out; to have it: pip install {package}", file=sys.stderr)
        else:
            result.append(name)
    return result


def main():
    """Measure, print, write."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--peers", nargs="+", choices=PEERS, default=list(PEERS), metavar="PEER", help=" ".join(PEERS))
    parser.add_argument("--scenes", nargs="+", choices=SCENES, default=SCENES, metavar="SCENE", help=" ".join(SCENES))
    parser.add_argument("--rounds", type=int, default=3)
    parser.add_argument("--budget", type=float, default=1.0, help="CPU seconds for a method, scene and round")
    parser.add_argument("--limit", type=float, default=120.0, help="seconds after which a method is given up")
    parser.add_argument("--out", type=Path, default=Path(".benchmarks"), help="folder of compare.json, .md and .png")
    arguments = parser.parse_args()
    # nothing large is imported before this is done: a process inherits the peak memory of the one that starts it
    results = measure(installed(arguments.peers), arguments.scenes, arguments)

    from rich.console import Console

    from benchmarks.peers import figure, floor_ratio, markdown, scenes

    console = Console(width=120)
    titles = {scene: scenes.SCENES[scene][1] for scene in results}
    for scene, answers in results.items():
        judge(scene, answers)
        console.print(table(scene, titles[scene], answers))
    notes = {label: f"{a['version']}: {a['note']}" for answers in results.values() for label, a in answers.items()
             if "version" in a}  # fmt: skip
    for label, note in notes.items():
        console.print(f"[bold]{label}[/] {note}", highlight=False)
    ratios = floor_ratio.ratios()
    console.print(floor_ratio.table(ratios))
    arguments.out.mkdir(parents=True, exist_ok=True)
    machine = f"{os.cpu_count()} cores {platform.machine()}, Python {platform.python_version()}"
    record = {"date": f"{datetime.now(UTC):%Y-%m-%d}", "machine": machine, "floor": ratios, "scenes": results}
    (arguments.out / "compare.json").write_text(json.dumps(record, indent=1) + "\n")
    figure.work_precision(results, titles).savefig(arguments.out / "compare.png", dpi=100)
    (arguments.out / "compare.md").write_text(markdown.report(results, titles))
    console.print(f"{machine}. Written: compare.json, compare.md and compare.png in {arguments.out}")


if __name__ == "__main__":
    main()
