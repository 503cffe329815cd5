"""CPU time that commands take from start to end, against importing scipy.linalg alone.

python benchmarks/start.py
"""

import subprocess
import sys
from statistics import median

from mbsvib.common import tables

RUNS = 11
BASE = "import scipy.linalg"
CASES = {
    "import mbsvib": "import mbsvib",
    "mbsvib --help": "from mbsvib.cli._app import run; run(['--help'])",
    "mbsvib modes stewart": "from mbsvib.cli._app import run; run(['modes', 'stewart'])",
    "mbsvib check stewart": "from mbsvib.cli._app import run; run(['check', 'stewart'])",
    "mbsvib params stewart": "from mbsvib.cli._app import run; run(['params', 'stewart'])",
}


def seconds(code):
    """Return the CPU time of a new process that runs some code."""
    from resource import RUSAGE_CHILDREN, getrusage

    before = getrusage(RUSAGE_CHILDREN)
    subprocess.run([sys.executable, "-c", code], stdout=subprocess.DEVNULL, check=True)
    after = getrusage(RUSAGE_CHILDREN)
    return after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime


def main():
    """Print the table; processes of all cases take turns, so that a busy machine disturbs all alike."""
    times = {code: [] for code in (BASE, *CASES.values())}
    for _ in range(RUNS):
        for code, spent in times.items():
            spent.append(seconds(code))
    base = median(times[BASE])
    rows = [(name, f"{1e3 * median(times[code]):.0f}", f"{median(times[code]) / base:.2f}")
            for name, code in {BASE: BASE, **CASES}.items()]  # fmt: skip
    tables.show(f"CPU time of a process, medians of {RUNS}",
                [("what", "left"), ("time [ms]", "right"), ("ratio", "right")], rows)  # fmt: skip


if __name__ == "__main__":
    main()
