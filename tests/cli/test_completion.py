"""Completion of words in the shell: candidates, and the scripts in real shells."""

import os
import shlex
import shutil
import subprocess
import sys

import pytest

import mbsvib as mv
from mbsvib.cli._commands import HOMES, command_of
from tests.support.cli import invoke
from tests.support.terminal import completed


def candidates(run, *words):
    return invoke(["--complete", *words]).stdout.split("\n")[:-1]


def test_commands_and_options(run):
    assert candidates(run, "mo") == ["models", "modes"]
    assert candidates(run, "check") == ["check", "check-export"]
    assert candidates(run, "cert") == ["certify"]
    assert "--install-completion" in candidates(run, "--")
    assert candidates(run, "modes", "stewart", "--") == ["--count", "--near", "--csv", "--json", "--align", "--help"]
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


@pytest.mark.slow
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


INSTALLED = {"bash": ".local/share/bash-completion/completions/mbsvib",
             "zsh": ".local/share/zsh/site-functions/_mbsvib",
             "fish": ".config/fish/completions/mbsvib.fish"}  # fmt: skip
TYPED = {  # a line, and what tab makes of it
    "mbsvib mo": "mbsvib mode",
    "mbsvib modes quart": "mbsvib modes quarter_car ",
    "mbsvib bode quarter_car --input ro": "mbsvib bode quarter_car --input road ",
    "mbsvib bode quarter_car --input=ro": "mbsvib bode quarter_car --input=road ",
    "mbsvib sweep quarter_car tyre.stiffness=1:2 tyre.d": "mbsvib sweep quarter_car tyre.stiffness=1:2 tyre.damping ",
    "mbsvib modes my\\ c": "mbsvib modes my\\ car.yaml ",
    "mbsvib modes 'my c": "mbsvib modes 'my car.yaml' ",
    "mbsvib bode my\\ car.yaml --input ro": "mbsvib bode my\\ car.yaml --input road ",
    "mbsvib modes fol": "mbsvib modes folder/",
    "mbsvib modes ~/a:": "mbsvib modes ~/a:b.yaml ",
    "mbsvib isolation quarter_car --legs nothing": "mbsvib isolation quarter_car --legs nothing",
}


@pytest.fixture
def installed(run, program):
    """Write the script of a shell, and return its path."""
    (program / "folder").mkdir()
    for name in ("my car.yaml", "a:b.yaml"):
        mv.save(mv.library.quarter_car(), program / name)

    def install(shell):
        assert str(program) in run(f"--install-completion {shell}").stdout
        assert (program / INSTALLED[shell]).read_text() == run(f"--show-completion {shell}").stdout
        return program / INSTALLED[shell]

    return install


@pytest.mark.slow
@pytest.mark.parametrize("shell", ["bash", "zsh"])
@pytest.mark.parametrize("typed", TYPED)
def test_tab_in_a_terminal(installed, program, shell, typed):
    if shutil.which(shell) is None:
        pytest.skip(f"{shell} is not installed")
    script = installed(shell)
    assert completed(shell, script, typed, program) == TYPED[typed]


@pytest.mark.slow
@pytest.mark.skipif(shutil.which("fish") is None, reason="fish is not installed")
@pytest.mark.parametrize("typed", TYPED)
def test_fish(installed, program, typed):
    """Its ``complete -C`` prints the words that fit."""
    script = installed("fish")
    done = subprocess.run(["fish", "-c", "source $argv[1]; complete -C $argv[2]", script, typed], cwd=program,
                          capture_output=True, text=True, check=True)  # fmt: skip
    words = done.stdout.split("\n")[:-1]
    assert done.stderr == ""
    whole = [] if TYPED[typed] == typed else [shlex.split(TYPED[typed])[-1]]
    assert words == (["models", "modes"] if whole == ["mode"] else whole)


@pytest.mark.parametrize("shell", INSTALLED)
def test_scripts_are_installed(installed, shell):
    script = installed(shell)
    assert "mbsvib --complete" in script.read_text()
    if shutil.which(shell):
        subprocess.run([shell, "-n", script], check=True, capture_output=True)


def test_lines_of_bash_are_parted_as_it_does(run, tmp_path):
    """Quotes, escapes, and what readline puts in place: the end of the word from the last break between words."""
    for name in ("my car.yaml", "a:b.yaml"):
        (tmp_path / name).write_text("")

    def of_line(line, breaks=" \"'=:"):
        return invoke(["--complete-line", line, breaks]).stdout.split("\n")[:-1]

    assert of_line("mbsvib mo") == ["models", "modes"]
    for word in ("my\\ ", "'my ", '"my '):
        assert of_line(f"mbsvib modes {word}") == ["my car.yaml"]
    assert of_line("mbsvib modes a:") == ["b.yaml"]
    assert of_line("mbsvib modes a:", " ") == of_line("mbsvib modes 'a:") == ["a:b.yaml"]
    assert of_line("mbsvib bode slider.yaml --input=") == ["F"]
    assert of_line("mbsvib bode slider.yaml --input ") == ["F"]


def test_the_shell_is_that_of_the_user(run, monkeypatch):
    monkeypatch.setenv("SHELL", "/usr/bin/fish")
    assert run("--show-completion").stdout.startswith("function __mbsvib")
    monkeypatch.delenv("SHELL")
    result = run("--show-completion")
    assert result.exit_code == 2
    assert "which shell is not known" in result.stderr
