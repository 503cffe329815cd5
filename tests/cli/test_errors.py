"""Errors: one readable message on standard error, the exit status, and no traceback unless it is asked for."""

import io
import sys
import warnings

import pytest

import mbsvib as mv
from mbsvib.cli import _shell as shell
from mbsvib.errors import NearSingularWarning


@pytest.mark.parametrize(
    ("line", "status", "words"),
    [
        ("modes stewrt", 2, ["no model 'stewrt'", "Did you mean 'stewart'?", "quarter_car"]),
        ("modes slider", 2, ["no model 'slider'", "Did you mean 'slider.yaml'?"]),
        ("modes slidr.yaml", 2, ["no file 'slidr.yaml'", "Did you mean 'slider.yaml'?"]),
        ("modes nowhere/slider.yaml", 2, ["no file 'nowhere/slider.yaml'"]),
        ("check faulty.yaml", 1, ["faulty.yaml", "line 5", "mas", "Did you mean 'mass'?"]),
        ("modes faulty.yaml", 1, ["no body 'mas'"]),
        ("modes C0RF1", 2, ["no model 'C0RF1'"]),
        ("bode slider.yaml -i f", 2, ["input 'f'", "Did you mean 'F'?"]),
        ("bode slider.yaml --output y", 2, ["output 'y'", "It has x."]),
        ("step quarter_car -i rod", 2, ["input 'rod'", "Did you mean 'road'?"]),
        ("bode slider.yaml --from 10 --to 1", 2, ["10 to 1 Hz"]),
        ("bode slider.yaml -o bode.gif", 2, ["bode.gif", ".png, .pdf, .svg"]),
        ("bode slider.yaml -o nowhere/bode.png", 1, ["nowhere/bode.png", "cannot be written"]),
        ("step slider.yaml --duration 0", 2, ["duration"]),
        ("bode stewart -i Fx -i Fy -i Fz -i Mx --output x --output y --output z --output rx", 2, ["16 panels"]),
        ("export slider.yaml -o slider.csv", 2, ["'.csv'", ".json: ", ".npz: ", ".yaml: "]),
        ("export slider.yaml -o slider.npy", 2, ["Did you mean '.npz'?"]),
        ("export slider.yaml -o nowhere/slider.json", 1, ["nowhere/slider.json", "cannot be written"]),
        ("export slider.yaml -o slider.json --realization modl", 2, ["'modl'", "Did you mean 'modal'?"]),
        ("demo -o slider.yaml", 2, ["'slider.yaml'", "another folder"]),
        ("demo -o slider.yaml/below", 2, ["'slider.yaml/below'"]),
    ],
)
def test_message_and_status(run, line, status, words):
    result = run(line)
    assert result.exit_code == status
    assert result.stdout == ""
    assert result.stderr.startswith("error: ")
    assert result.stderr.count("\n") == 1
    assert "Traceback" not in result.stderr
    for word in words:
        assert word in result.stderr


@pytest.mark.parametrize(
    ("line", "words"),
    [
        ("modes", ["modes: ", "required: MODEL", "mbsvib modes --help"]),
        ("modes stewart --jsom", ["no option '--jsom'", "Did you mean '--json'?"]),
        ("loop slider.yaml --controller c.json", ["no option '--controller'", "CONTROLLER is given by its value"]),
        ("modes --model=slider.yaml stewart", ["no option '--model=slider.yaml'", "MODEL is given by its value alone"]),
        ("modes stewart quarter_car", ["no argument 'quarter_car'"]),
        ("modez", ["no command 'modez'", "Did you mean 'modes'?"]),
        ("--versoin", ["no option '--versoin'", "Did you mean '--version'?"]),
        ("export slider.yaml", ["required: --file/-o"]),
        ("step slider.yaml --duration long", ["--duration", "expected a number", "'long'"]),
        ("animate slider.yaml --mode 1.5", ["--mode", "expected a whole number", "'1.5'"]),
        ("bode slider.yaml --from", ["--from", "expected one argument"]),
        ("export slider.yaml -o slider.npz --fmi 2.0", ["--fmi", "'slider.npz'", "ends in .fmu"]),
        ("export slider.yaml -o other.yaml --input F", ["--input", "'other.yaml'"]),
        ("isolation stewart platform --gain 3", ["--feedback and --gain belong together"]),
        ("isolation stewart platform --feedback magic --gain 3", ["'magic'", "'force', 'velocity', 'skyhook'"]),
        ("loop slider.yaml law.txt", ["'law.txt'", ".json, .npz, .mat"]),
        ("loop slider.yaml law.npz", ["no file 'law.npz'"]),
        ("sweep slider.yaml k.stifness=1:2", ["fits 'k.stifness'", "'k.stiffness'?", "mbsvib params slider.yaml"]),
        ("sweep slider.yaml k=1:2", ["fits 'k'. 'k' has k.stiffness, k.damping, k.start.x,"]),
        ("sweep slider.yaml k.stiffness", ["expected PARAMETER=FROM:TO"]),
        ("sweep slider.yaml k.stiffness=1:2 --modes 0", ["--modes 0", "1 or more"]),
        ("sweep slider.yaml k.stiffness=1:2 k.stiffness=3:4", ["'k.stiffness' is given twice"]),
        ("path slider.yaml rial.z=0:1", ["'rial.z'", "Did you mean 'rail.z'?"]),
        ("isolation stewart plattform", ["'plattform'", "Did you mean 'platform'?"]),
        ("isolation stewart platform --base bse", ["'bse'", "expected a body"]),
        ("export slider.yaml -o slider.fmu --fmi 4", ["--fmi", "'4'", "'2.0', '3.0'"]),
        ("--show-completion tcsh", ["no completion for 'tcsh'", "bash, zsh, fish"]),
    ],
)
def test_misuse_of_the_command_line_has_status_2(run, line, words):
    result = run(line)
    assert (result.exit_code, result.stdout) == (2, "")
    assert result.stderr.startswith("error: ")
    assert result.stderr.count("\n") == 1
    for word in words:
        assert word in result.stderr


@pytest.mark.parametrize("line", ["--debug modes stewrt", "modes stewrt --debug"])
def test_debug_lets_the_error_through(run, line):
    with pytest.raises(shell.UsageProblem, match="stewrt"):
        run(line)


def test_errors_of_the_library_itself_are_not_hidden(run, monkeypatch):
    def broken(name):
        raise mv.ModelError("part 'x' is wrong.", element="x")

    monkeypatch.setattr("mbsvib.library.build", broken)
    result = run("modes stewart")
    assert result.exit_code == 1
    assert "part 'x' is wrong" in result.stderr


def test_warnings_are_messages(run, monkeypatch):
    def warn(model):
        warnings.warn("near a singular pose", NearSingularWarning, stacklevel=1)
        return mv.library.build(model.word).linearize()

    monkeypatch.setattr("mbsvib.cli._looking.system_of", warn)
    result = run("modes stewart")
    assert result.exit_code == 0
    assert result.stderr == "warning: near a singular pose\n"


def test_each_warning_of_the_library_is_a_message(capsys):
    warned = [name for name in mv.__all__ if name.endswith("Warning")]
    with shell.as_messages(debug=False):
        for name in warned:
            warnings.warn(name, getattr(mv, name), stacklevel=1)
    assert capsys.readouterr().err.splitlines() == [f"warning: {name}" for name in warned]


def test_a_closed_pipe_ends_it_quietly(run, monkeypatch):
    def closed(word):
        raise BrokenPipeError

    monkeypatch.setattr("mbsvib.cli._looking.system_of", closed)
    result = run("modes stewart")
    assert result.exit_code == 1
    assert result.output == ""


def test_interruption_is_told_and_has_its_own_status(run, monkeypatch):
    def interrupted(word):
        raise KeyboardInterrupt

    monkeypatch.setattr("mbsvib.cli._looking.system_of", interrupted)
    assert run("modes stewart")[::2] == (130, "interrupted\n")


def test_ascii_where_the_terminal_knows_nothing_else(monkeypatch):
    stream = io.TextIOWrapper(io.BytesIO(), encoding="ascii", write_through=True)
    monkeypatch.setattr(sys, "stdout", stream)
    shell.say("Fx → x")
    assert stream.buffer.getvalue() == b"Fx -> x\n"
    monkeypatch.setattr(sys, "stderr", io.TextIOWrapper(io.BytesIO(), encoding="ascii", write_through=True))
    shell.complain("90°")
    assert sys.stderr.buffer.getvalue() == b"90 deg\n"


def test_errors_name_commands_and_not_calls(run, tmp_path):
    model = mv.Model("falling", gravity=(0, 0, -9.81))
    model.add_body("b", 1.0, (1, 1, 1), position=(0, 0, 1))
    model.add_joint("r", "revolute", "ground", "b", position=(0.3, 0, 0), axis=(0, 1, 0))
    mv.save(model, tmp_path / "falling.yaml")
    result = run("modes falling.yaml")
    assert result.exit_code == 1
    assert "Find the pose with 'mbsvib equilibrium MODEL -o FILE.yaml'" in result.stderr
    assert "()" not in result.stderr
