"""The command line as a process of its own."""

import json
import runpy
import subprocess
import sys

import pytest

import mbsvib as mv


def mbsvib(*words, code=None):
    command = [sys.executable, "-c", code, *words] if code else [sys.executable, "-m", "mbsvib", *words]
    return subprocess.run(command, capture_output=True, text=True, encoding="utf-8", check=False)


@pytest.mark.slow
def test_a_table_in_a_pipe_is_neither_coloured_nor_wrapped():
    result = mbsvib("modes", "stewart")
    assert result.returncode == 0
    assert result.stderr == ""
    assert "\x1b" not in result.stdout
    assert any("780.601788" in line and "platform" in line for line in result.stdout.splitlines())


@pytest.mark.slow
def test_an_error_is_one_line_and_a_status():
    result = mbsvib("check", "stewrt")
    assert (result.returncode, result.stdout) == (2, "")
    assert result.stderr.startswith("error: there is no model 'stewrt'")


@pytest.mark.slow
def test_debug_shows_the_traceback():
    result = mbsvib("check", "stewrt", "--debug")
    assert result.returncode == 1
    assert "Traceback" in result.stderr


def test_help_imports_nothing_heavy():
    code = (
        "import sys, json\n"
        "from mbsvib.cli import main\n"
        "try: main()\n"
        "except SystemExit: pass\n"
        "print(json.dumps(sorted(m for m in sys.modules if '.' not in m)))\n"
    )
    modules = set(json.loads(mbsvib("--help", code=code).stdout.splitlines()[-1]))
    assert not modules & {"matplotlib", "control", "scipy", "numpy", "ruamel"}


@pytest.mark.slow
def test_modes_import_only_what_they_need():
    """The command starts in less than 1.9 times the CPU time of importing scipy.linalg: benchmarks/start.py."""
    code = (
        "import sys, json\n"
        "from mbsvib.cli import main\n"
        "try: main()\n"
        "except SystemExit: pass\n"
        "print(json.dumps(sorted(sys.modules)))\n"
    )
    modules = set(json.loads(mbsvib("modes", "stewart", code=code).stdout.splitlines()[-1]))
    assert not modules & {"matplotlib", "control", "ruamel", "mbsvib_export", "typing_extensions", "rich",
                          "mbsvib.plots", "mbsvib.files", "mbsvib.modes.general_spectrum", "mbsvib.library._families",
                          "mbsvib.cli._drawing", "mbsvib.cli._completion"}  # fmt: skip


@pytest.mark.parametrize(("given", "used"), [(None, "1"), ("4", "4")])
def test_one_thread_of_blas_unless_the_user_says_otherwise(monkeypatch, given, used):
    monkeypatch.delenv("OPENBLAS_NUM_THREADS", raising=False)
    if given:
        monkeypatch.setenv("OPENBLAS_NUM_THREADS", given)
    code = (
        "import os\n"
        "from mbsvib.cli import main\n"
        "try: main()\n"
        "except SystemExit: pass\n"
        "print(os.environ['OPENBLAS_NUM_THREADS'])\n"
    )
    assert mbsvib("--version", code=code).stdout.splitlines()[-1] == used


@pytest.mark.slow
def test_a_reader_that_has_seen_enough_is_not_an_error():
    command = f"{sys.executable} -m mbsvib params stewart | head -1"
    result = subprocess.run(["bash", "-c", command], capture_output=True, text=True, check=True)
    assert (result.stdout, result.stderr) == ("Parameters\n", "")


def test_the_module_runs_the_command_line(monkeypatch, capsys):
    monkeypatch.setattr(sys, "argv", ["mbsvib", "--version"])
    with pytest.raises(SystemExit) as status:
        runpy.run_module("mbsvib", run_name="__main__")
    assert status.value.code == 0
    assert capsys.readouterr().out == f"mbsvib {mv.__version__}\n"
