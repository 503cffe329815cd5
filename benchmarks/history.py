"""Run times over commits: measure the stages and append them to a JSON-lines file, or show what is in it.

    OPENBLAS_NUM_THREADS=1 python benchmarks/history.py [--file .benchmarks/history.jsonl] [SCENE ...]
    python benchmarks/history.py --show

Machines differ and are busy: what is shown beside the milliseconds is the ratio to the bare LAPACK call of the same
size in the same process (of ``modes`` and of ``linearize``), and its change against the line before. The tests hold
such ratios to limits (``tests/test_run_time.py``); this file tells a slow drift below them.
"""

from __future__ import annotations

import argparse
import json
import platform
import subprocess
import sys
from datetime import UTC, datetime
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
sys.path.insert(0, str(ROOT))

from benchmarks import stages  # noqa: E402

FILE = Path(".benchmarks/history.jsonl")
# A ratio that has grown by this factor since the line before is marked.
SLOWER = 1.25


def commit():
    """Short name of the commit, with a plus sign where files have changed since; empty outside a checkout."""
    try:
        done = subprocess.run(["git", "describe", "--always", "--dirty=+"], cwd=ROOT, capture_output=True, text=True,
                              check=True)  # fmt: skip
    except (OSError, subprocess.CalledProcessError):
        return ""
    return done.stdout.strip()


def record(file, scenes, repeat):
    """Measure and append one line."""
    line = {
        "date": f"{datetime.now(UTC):%Y-%m-%d %H:%M}", "commit": commit(),
        "machine": f"{platform.machine()}, Python {platform.python_version()}",
        "scenes": {scene: stages.measure(scene, repeat) for scene in scenes},
    }  # fmt: skip
    file.parent.mkdir(parents=True, exist_ok=True)
    with file.open("a") as stream:
        stream.write(json.dumps(line) + "\n")


def show(file):
    """Return the table of all lines, scene by scene."""
    from rich.table import Table

    lines = [json.loads(text) for text in file.read_text().splitlines() if text]
    table = Table(title="CPU time in ms, and ratio to the bare eigenproblem")
    for header in ("scene", "date", "commit", "build", "linearize", "modes", "linearize", "modes", "error"):
        table.add_column(header, justify="left" if header in ("scene", "date", "commit") else "right")
    for scene in dict.fromkeys(scene for line in lines for scene in line["scenes"]):
        before = {}
        for line in (line for line in lines if scene in line["scenes"]):
            a = line["scenes"][scene]
            cells = []
            for stage in ("linearize", "modes"):
                ratio = a[stage] / a["floor"]
                late = ratio > SLOWER * before.get(stage, float("inf"))
                cells.append(f"[bold red]{ratio:.2f}[/]" if late else f"{ratio:.2f}")
                before[stage] = ratio
            error = "" if a["error"] is None else f"{a['error']:.0e}"
            times = [f"{a[stage]:.3f}" for stage in ("build", "linearize", "modes")]
            table.add_row(scene, line["date"], line["commit"], *times, *cells, error)
        table.add_section()
    return table


def main():
    """Measure and append, or show."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("scenes", nargs="*", default=list(stages.SCENES), metavar="SCENE")
    parser.add_argument("--file", type=Path, default=FILE)
    parser.add_argument("--repeat", type=int, default=30)
    parser.add_argument("--show", action="store_true", help="measure nothing")
    arguments = parser.parse_args()
    if not arguments.show:
        record(arguments.file, arguments.scenes, arguments.repeat)

    from rich.console import Console

    Console(width=120).print(show(arguments.file))


if __name__ == "__main__":
    main()
