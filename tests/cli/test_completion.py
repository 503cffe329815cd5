"""Completion of words in the shell: candidates, and the scripts in real shells."""

import os
import shutil
import subprocess
import sys

import pytest

import mbsvib as mv
from mbsvib.cli._commands import HOMES, command_of
from tests.support.cli import invoke


def candidates(run, *words):
    return invoke(["--complete", *words]).stdout.split("\n")[:-1]


def test_commands_and_options(run):
    assert candidates(run, "mo") == ["models", "modes"]
    assert candidates(run, "check") == ["check", "check-export"]
    assert candidates(run, "cert") == ["certify"]
    assert "--install-completion" in candidates(run, "--")
    assert candidates(run, "modes", "stewart", "--") == ["--csv", "--json", "--align", "--help"]
    assert candidates(run, "--debug", "mod") == ["models", "modes"]
    assert candidates(run, "isolation", "stewart", "platform", "--feedback", "") == ["force", "velocity", "skyhook"]
    assert candidates(run, "--show-completion", "") == ["bash", "zsh", "fish"]
    assert candidates(run, "nonsense", "") == [""]


def test_models_are_names_and_files(run, tmp_path):
    (tmp_path / "models").mkdir()
    (tmp_path / "notes.txt").write_text("")
    assert candidates(run, "modes", "st") == [name for name in mv.library.models() if name.startswith("st")]
    everything = candidates(run, "modes", "")
    assert {"slider.yaml", "faulty.yaml", "models/", "chain"} <= set(everything)
    assert "notes.txt" not in everything
    assert candidates(run, "bode", "quarter_car", "-o", "no") == ["notes.txt"]
    (tmp_path / "models" / "arm.json").write_text("{}")
    assert candidates(run, "modes", "models/") == ["models/arm.json"]
    assert candidates(run, "modes", "stewart", "") == [""]


def test_names_of_the_model_in_question(run):
    assert candidates(run, "bode", "slider.yaml", "--input", "") == ["F"]
    assert candidates(run, "bode", "--json", "slider.yaml", "--output", "") == ["x"]
    assert candidates(run, "isolation", "slider.yaml", "") == ["mass", "ground"]
    assert candidates(run, "sweep", "slider.yaml", "k.sti") == ["k.stiffness"]
    assert candidates(run, "sweep", "slider.yaml", "mass.mass=1:2", "k.d") == ["k.damping"]
    assert candidates(run, "path", "slider.yaml", "") == ["rail.z"]
    assert candidates(run, "export", "slider.yaml", "--tunable", "k.d") == ["k.damping"]
    assert candidates(run, "equilibrium", "slider.yaml", "--preload", "") == ["k"]
    assert candidates(run, "bode", "faulty.yaml", "--input", "") == [""]


def test_words_of_options(run):
    """Numbers to choose from ended completion in a traceback."""
    assert candidates(run, "path", "toggle", "elbow.rz=0:1", "--switch", "") == ["-1", "0", "1"]
    assert candidates(run, "export", "stewart", "--realization", "m") == ["modal"]
    assert candidates(run, "export", "stewart", "--fmi", "") == ["2.0", "3.0"]
    assert candidates(run, "export", "stewart", "--method", "") == ["zoh", "foh", "tustin"]
    assert candidates(run, "draw", "stewart", "--view", "3") == ["3-D"]


def test_every_argument_can_be_completed(run):
    """Whatever option of whatever command stands before the cursor, completion answers."""
    for name in HOMES:
        for argument in command_of(name).arguments:
            if argument.optional:
                assert candidates(run, name, "slider.yaml", argument.names[0], "") is not None


@pytest.fixture
def program(tmp_path, monkeypatch):
    """``mbsvib`` on the path, and home in a temporary folder."""
    folder = tmp_path / "bin"
    folder.mkdir()
    script = folder / "mbsvib"
    script.write_text(f'#!/bin/sh\nexec "{sys.executable}" -m mbsvib "$@"\n')
    script.chmod(0o755)
    monkeypatch.setenv("PATH", f"{folder}{os.pathsep}{os.environ['PATH']}")
    monkeypatch.setenv("PYTHONPATH", os.pathsep.join(sys.path))
    monkeypatch.setenv("HOME", str(tmp_path))
    for name in ("XDG_DATA_HOME", "XDG_CONFIG_HOME"):
        monkeypatch.delenv(name, raising=False)
    return tmp_path


@pytest.mark.slow
@pytest.mark.skipif(shutil.which("bash") is None, reason="bash is not installed")
def test_bash(run, program):
    assert str(program) in run("--install-completion bash").stdout
    script = program / ".local/share/bash-completion/completions/mbsvib"
    typed = f'source "{script}"; COMP_WORDS=(mbsvib modes quarter); COMP_CWORD=2; _mbsvib; echo "${{COMPREPLY[@]}}"'
    done = subprocess.run(["bash", "-c", typed], capture_output=True, text=True, check=True)
    assert (done.stdout, done.stderr) == ("quarter_car\n", "")


@pytest.mark.parametrize(("name", "place"), [("zsh", ".local/share/zsh/site-functions/_mbsvib"),
                                              ("fish", ".config/fish/completions/mbsvib.fish")])  # fmt: skip
def test_zsh_and_fish(run, program, name, place):
    assert run(f"--install-completion {name}").exit_code == 0
    script = (program / place).read_text()
    assert script == run(f"--show-completion {name}").stdout
    assert "mbsvib --complete" in script
    if shutil.which(name):
        subprocess.run([name, "-n", str(program / place)], check=True, capture_output=True)


def test_the_shell_is_that_of_the_user(run, monkeypatch):
    monkeypatch.setenv("SHELL", "/usr/bin/fish")
    assert run("--show-completion").stdout.startswith("complete -c mbsvib")
    monkeypatch.delenv("SHELL")
    result = run("--show-completion")
    assert result.exit_code == 2
    assert "which shell is not known" in result.stderr
