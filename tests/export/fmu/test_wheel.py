"""The wheel as users get it: it brings binaries for all platforms, and exports where there is no compiler."""

import os
import shutil
import subprocess
import sys
import tarfile
import zipfile
from pathlib import Path

import numpy as np
import pytest

from mbsvib import library
from mbsvib_export.fmu_ import binaries

ROOT = Path(__file__).parents[3]
EXPORT = """
import shutil
import warnings
from importlib.util import find_spec

warnings.simplefilter("error")
assert not any(map(shutil.which, ("gcc", "cc", "clang", "zig"))), "there is a compiler on the way"
assert not find_spec("ziglang")
import mbsvib as mv
import mbsvib_export as mx

assert "site-packages" in mv.__file__
system = mv.library.quarter_car().linearize()
for version in ("2.0", "3.0"):
    made = mx.to_fmu(system, f"car{version[0]}.fmu", version)
    assert (len(made.platforms), made.other_platforms) == (6, ())
"""


def ran(*command, **options):
    done = subprocess.run(list(map(str, command)), capture_output=True, text=True, check=False, **options)
    assert done.returncode == 0, f"{command}\n{done.stdout[-2000:]}\n{done.stderr[-4000:]}"


@pytest.mark.slow
def test_a_wheel_brings_all_binaries_and_needs_no_compiler(tmp_path):
    uv = shutil.which("uv")
    if not uv:
        pytest.skip("uv is not installed: pip install uv")
    fmpy = pytest.importorskip("fmpy", reason="fmpy is not installed: pip install 'mbsvib[fmu]'")
    quiet = {name: value for name, value in os.environ.items() if not name.startswith(("PYTHON", "VIRTUAL_ENV", "UV_"))}
    # source archive, and the wheel from it: what is missing there is missing in the wheel
    ran(uv, "build", "--out-dir", tmp_path / "dist", cwd=ROOT, env=quiet | {"MBSVIB_BINARIES": "all"})
    wheel, archive = next((tmp_path / "dist").glob("*.whl")), next((tmp_path / "dist").glob("*.tar.gz"))
    with tarfile.open(archive) as sources:
        assert not [name for name in sources.getnames() if name.endswith((".so", ".dll", ".dylib"))]
    with zipfile.ZipFile(wheel) as contents:
        brought = [name for name in contents.namelist() if name.endswith((".so", ".dll", ".dylib"))]
    folder = f"mbsvib_export/fmu_/binaries/{binaries.source_hash()}"
    assert sorted(brought) == sorted(f"{folder}/{name}/mbsvib_lti{goal.suffix}" for name, goal in
                                     binaries.PLATFORMS.items())  # fmt: skip
    ran(uv, "venv", "--python", sys.executable, tmp_path / "venv", env=quiet)
    ran(uv, "pip", "install", "--python", tmp_path / "venv", wheel, env=quiet, cwd=tmp_path)
    python = next(path for path in (tmp_path / "venv").glob("*/python*") if path.stem == "python")
    home = {"HOME": str(tmp_path), "PATH": str(tmp_path), "MBSVIB_CACHE": str(tmp_path / "cache"),
            "SYSTEMROOT": os.environ.get("SYSTEMROOT", "")}  # fmt: skip
    ran(python, "-c", EXPORT, cwd=tmp_path, env=home)
    assert not (tmp_path / "cache").exists()  # nothing was compiled
    system = library.quarter_car().linearize()
    for path in sorted(tmp_path.glob("car*.fmu")):
        result = fmpy.simulate_fmu(str(path), stop_time=1.0, output_interval=0.01, fmi_type="CoSimulation",
                                   start_values={"load": 1.0})  # fmt: skip
        truth = system.time_response(result["time"], np.ones(len(result)), inputs="load")
        for name, y in zip(system.outputs, truth, strict=True):
            assert np.abs(result[name] - y).max() <= 1e-9 * np.abs(y).max()
