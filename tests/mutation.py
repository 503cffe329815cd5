"""Mutation run: plants defects in a copy of a package and tells which of them the tests do not notice.

    pytest --cov --cov-context=test --cov-report= --junitxml=durations.xml       (once; writes .coverage)
    python -m tests.mutation --package mbsvib.couplers --count 20 --seed 1

Only tests that cover a changed line run, those of the package's own folder first, then the fastest, up to the first
failure. mutmut and cosmic-ray were tried: neither drops transposes and terms nor exchanges indices, which is what goes
wrong here; the former takes no sample, the latter edits files in place and runs one command for all mutants.
"""

from __future__ import annotations

import argparse
import os
import random
import resource
import shutil
import signal
import subprocess
import sys
import tempfile
from collections import defaultdict
from pathlib import Path
from xml.etree import ElementTree

from tests.support.mutants import Mutant, mutants

ROOT = Path(__file__).resolve().parents[1]
PRELOADED = ("numpy", "scipy.linalg", "scipy.optimize", "scipy.sparse.linalg", "pytest", "hypothesis", "mpmath")
FIRST_CHUNK = 10.0  # seconds of tests after which a mutant is a likely survivor, and the others run
NOT_RUN = (5, 99)  # exit codes: pytest collected nothing, or an error of our own


def collected() -> set[str]:
    """Names of all tests that run: one that is gone since coverage was measured would end pytest, as a failure does."""
    words = [sys.executable, "-m", "pytest", "--collect-only", "-n", "0", "--dist", "no"]
    return {*subprocess.check_output(words, cwd=ROOT, text=True).splitlines()}


class Tests:
    """Which tests cover a line, and how long each takes."""

    def __init__(self, coverage_file: str, durations: list[str]) -> None:
        from coverage import CoverageData

        self.data = CoverageData(coverage_file)
        self.data.read()
        if not any(self.data.measured_contexts()):
            raise SystemExit(f"{coverage_file} does not say which test runs which line; expected --cov-context=test, "
                             f"and --dist no with -n 0.")  # fmt: skip
        self.seconds, self.of_file, known = {}, defaultdict(list), collected()
        for file in durations:
            for case in ElementTree.parse(file).iter("testcase"):
                path = case.get("classname", "").replace(".", "/") + ".py"
                if (name := f"{path}::{case.get('name')}") in known:
                    self.seconds[name] = float(case.get("time", 0.0))
        for test in self.seconds:
            self.of_file[test.partition("::")[0]].append(test)

    def covering(self, mutant: Mutant, limit: float) -> list[list[str]]:
        """Tests in the order in which they run, as many as ``limit`` seconds allow: the first, and the others."""
        lines = self.data.contexts_by_lineno(str(mutant.file))
        inside = {context for line in mutant.lines for context in lines.get(line, ()) if context}
        if not inside:  # what an import runs
            inside = {context for contexts in lines.values() for context in contexts if context}
        names = set()
        for context in inside:
            test, _, phase = context.partition("|")
            names.update(self.of_file[test.partition("::")[0]] if phase == "setup" else [test])
        top, inner = mutant.file.relative_to(ROOT).parts[:2]
        folder = top if top == "export" else Path(inner).stem
        own = (f"tests/{folder}/", f"tests/test_{folder}")
        known = sorted((not name.startswith(own), self.seconds[name], name) for name in names & set(self.seconds))
        total = 0.0
        first: list[str] = []
        others: list[str] = []
        for _, seconds, name in known:
            total += seconds
            if total <= limit or not first:
                (first if total <= FIRST_CHUNK or not first else others).append(name)
        return [chunk for chunk in (first, others) if chunk]


def fails(folder: Path, names: list[str], seconds: float) -> str:
    """Run tests in a fork: "" where all pass, else why not. Limits are of CPU time, as the machine may be busy."""
    pid = os.fork()
    if pid:
        status = os.waitstatus_to_exitcode(os.waitpid(pid, 0)[1])
        if status in NOT_RUN:
            raise SystemExit(f"tests did not run, status {status}: {names[:3]} ...")
        return "" if status == 0 else "time" if status in (-signal.SIGXCPU, -signal.SIGALRM) else "failed"
    try:
        limit = int(3 * seconds + 30)
        resource.setrlimit(resource.RLIMIT_CPU, (limit, limit + 5))
        signal.alarm(10 * limit)
        for stream in (1, 2):
            os.dup2(os.open(os.devnull, os.O_WRONLY), stream)
        os.chdir(folder)
        for name in [name for name in sys.modules if name.partition(".")[0] in ("tests", "mbsvib", "mbsvib_export")]:
            del sys.modules[name]
        paths = [str(folder), str(folder / "export")]
        sys.path[:] = [*paths, *(path for path in sys.path if path not in ("", str(ROOT)))]
        os.environ |= {"PYTHONPATH": os.pathsep.join(paths), "MBSVIB_CACHE": str(folder / ".cache")}
        import pytest

        os._exit(int(pytest.main(["-x", "-q", "-n", "0", "-p", "no:cacheprovider", "-W",
                                  "ignore::pytest.PytestAssertRewriteWarning", *names])))  # fmt: skip
    finally:
        os._exit(NOT_RUN[1])


def run(mutant: Mutant, folder: Path, tests: Tests, limit: float, stamp: int) -> str:
    """Plant a mutant in the copy, run its tests and take it back; return what caught it."""
    target = folder / mutant.file.relative_to(ROOT)
    target.write_bytes(mutant.source())
    os.utime(target, (stamp, stamp))  # caches of byte code know files by time and size
    try:
        for chunk in tests.covering(mutant, limit):
            if why := fails(folder, chunk, sum(tests.seconds[name] for name in chunk)):
                return why
        return ""
    finally:
        shutil.copy2(mutant.file, target)


def sampled(package: str, count: int, seed: int) -> list[Mutant]:
    """Mutants of a module or package, one a line; of ``mbsvib`` itself the files beside its folders."""
    base = ROOT / "export" if package.startswith("mbsvib_export") else ROOT
    top = base / package.replace(".", "/")
    files = [top.with_suffix(".py")] if top.with_suffix(".py").exists() else (
        top.glob("*.py") if package == "mbsvib" else top.rglob("*.py"))  # fmt: skip
    by_line = defaultdict(list)
    for file in sorted(files):
        for mutant in mutants(file):
            by_line[file, mutant.lines[0]].append(mutant)
    rng = random.Random(seed)
    return [rng.choice(by_line[line]) for line in rng.sample(sorted(by_line), min(count, len(by_line)))]


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--package", required=True, help="mbsvib.modes, mbsvib.kinematics.loops, ...")
    parser.add_argument("--count", type=int, default=20)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--limit", type=float, default=60.0, help="seconds of tests for each mutant")
    parser.add_argument("--coverage", default=".coverage")
    parser.add_argument("--durations", nargs="+", default=["durations.xml"])
    words = parser.parse_args()
    for name in PRELOADED:
        __import__(name)
    tests, sample, survivors = Tests(words.coverage, words.durations), sampled(
        words.package, words.count, words.seed), 0  # fmt: skip
    with tempfile.TemporaryDirectory() as scratch:
        folder = Path(scratch) / "copy"
        for name in subprocess.check_output(["git", "ls-files"], cwd=ROOT, text=True).splitlines():
            (folder / name).parent.mkdir(parents=True, exist_ok=True)
            shutil.copy2(ROOT / name, folder / name)
        for k, mutant in enumerate(sample):
            caught = run(mutant, folder, tests, words.limit, 10**9 + k)
            survivors += not caught
            where = f"{mutant.file.relative_to(ROOT)}:{mutant.lines[0]}"
            print(f"{caught or 'SURVIVED':9} {where} {mutant.what}", flush=True)
            if not caught:
                print(mutant.diff(), flush=True)
    print(f"{words.package}, seed {words.seed}: {len(sample) - survivors} of {len(sample)} caught")
    return int(survivors > 0)


if __name__ == "__main__":
    sys.exit(main())
