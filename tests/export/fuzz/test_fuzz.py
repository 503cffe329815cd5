"""Damaged and hostile files of every kind: the right object or an error of mbsvib, and never much memory."""

import subprocess
import sys
from pathlib import Path

import pytest

from tests.export.fuzz.kinds import KINDS

ROOT = Path(__file__).parents[3]

pytestmark = pytest.mark.skipif(not sys.platform.startswith("linux"), reason="memory is limited as on Linux")


def run(kind, seed, count, folder):
    """Numbers of files that were refused and that were read."""
    pytest.importorskip(KINDS[kind].package)
    done = subprocess.run([sys.executable, "-m", "tests.export.fuzz.worker", kind, str(seed), str(count), str(folder)],
                          cwd=ROOT, capture_output=True, text=True, env=environment(), check=False)  # fmt: skip
    assert done.returncode == 0, f"status {done.returncode}\n{done.stdout[-3000:]}\n{done.stderr[-3000:]}"
    return tuple(map(int, done.stdout.split()[-2:]))


def environment():
    import os

    return os.environ | {"PYTHONPATH": os.pathsep.join((str(ROOT), str(ROOT / "export"))), "OPENBLAS_NUM_THREADS": "1"}


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["json", "npz", "superelement mat"])
def test_some_damaged_files(kind, tmp_path):
    refused, read = run(kind, 0, 60, tmp_path)
    assert refused > 20
    assert refused + read == 60


@pytest.mark.slow
@pytest.mark.parametrize("kind", KINDS)
def test_many_damaged_files(kind, tmp_path):
    refused, read = run(kind, 1, 600, tmp_path)
    assert refused > 120, (refused, read)
