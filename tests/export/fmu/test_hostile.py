"""Spoilt files and calls in any order: refused, and no memory touched that is not the library's own."""

import os
import shutil
import subprocess
import tempfile
import zipfile
from pathlib import Path

import pytest

import mbsvib_export as mx
from mbsvib import library
from mbsvib_export.fmu_.binaries import SOURCE

HARNESS = Path(__file__).parent / "harness.c"
SANITIZERS = ("-g", "-O1", "-fsanitize=address,undefined", "-fno-sanitize-recover=all")


def compilers():
    return [word for word in ("gcc", "clang") if shutil.which(word)]


@pytest.fixture
def quick_folder(tmp_path):
    """In memory where that is possible: the harness writes a file in every round."""
    memory = Path("/dev/shm")
    if not os.access(memory, os.W_OK):
        yield tmp_path
        return
    with tempfile.TemporaryDirectory(dir=memory) as folder:
        yield Path(folder)


def compiled(compiler, flags, folder):
    program = folder / "harness"
    command = [compiler, "-std=c11", "-Wall", "-Wextra", "-Werror", *flags, f"-I{SOURCE}", str(HARNESS),
               *map(str, sorted(SOURCE.glob("*.c"))), "-o", str(program), "-lm"]  # fmt: skip
    return program, subprocess.run(command, capture_output=True, text=True)


def survived(program, folder, rounds, seeds):
    """How many spoilt files were taken all the same, with and without tunable parameters."""
    taken, system = 0, library.quarter_car().linearize()
    for tunable in ((), ("*.stiffness", "*.mass")):
        target = folder / f"tunable{len(tunable)}"
        (target / "spoilt").mkdir(parents=True)
        with zipfile.ZipFile(mx.to_fmu(system, folder / "unit.fmu", tunable=tunable).path) as archive:
            (target / "model.lti").write_bytes(archive.read("resources/model.lti"))
        for seed in seeds:
            ran = subprocess.run([str(program), str(target), str(rounds), str(seed)], capture_output=True, text=True)
            assert ran.returncode == 0, ran.stderr[-3000:]
            taken += int(ran.stdout.split()[0])
    return taken


@pytest.mark.slow
def test_spoilt_files_and_calls_in_any_order(quick_folder):
    if not compilers():
        pytest.skip("no gcc or clang here")
    program, ran = compiled(compilers()[0], ("-O0",), quick_folder)
    assert ran.returncode == 0, ran.stderr
    # most are refused; enough get through for what comes behind the reader to be tried
    assert 0.1 < survived(program, quick_folder, 500, (1,)) / 1000 < 0.6


@pytest.mark.slow
@pytest.mark.parametrize("compiler", ["gcc", "clang"])
def test_sanitizers_find_nothing(compiler, quick_folder):
    if not shutil.which(compiler):
        pytest.skip(f"no {compiler} here")
    empty = quick_folder / "empty.c"
    empty.write_text("int main(void) { return 0; }\n")
    probe = subprocess.run([compiler, *SANITIZERS, str(empty), "-o", str(quick_folder / "empty")], capture_output=True)
    if probe.returncode or subprocess.run([str(quick_folder / "empty")], capture_output=True).returncode:
        pytest.skip(f"{compiler} has no sanitizers here")
    program, ran = compiled(compiler, SANITIZERS, quick_folder)
    assert ran.returncode == 0, ran.stderr
    assert survived(program, quick_folder, 20_000, (2, 3)) > 10_000


def test_signatures_are_those_of_the_standards():
    """The same source with the official headers, which fmpy brings: every function is declared there."""
    if not compilers():
        pytest.skip("no gcc or clang here")
    import fmpy

    headers = Path(fmpy.__file__).parent / "c-code"
    command = [compilers()[0], "-std=c11", "-DOFFICIAL_HEADERS", "-Wall", "-Wextra", "-Werror", "-Wno-enum-conversion",
               "-fsyntax-only", f"-I{headers}", str(SOURCE / "fmi2.c"), str(SOURCE / "fmi3.c")]  # fmt: skip
    ran = subprocess.run(command, capture_output=True, text=True)
    assert ran.returncode == 0, ran.stderr
