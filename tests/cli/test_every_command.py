"""What all commands have in common: help, ``--json``, a list that is complete."""

import json

import numpy as np
import pytest

import mbsvib as mv
from mbsvib.cli._commands import HOMES, command_of
from mbsvib.cli._lookup import ROBOTS
from tests.cli.test_loops import LAW, NAMES

LINES = {
    "demo": None,  # tests/cli/test_demo.py
    "models": "models", "modes": "modes slider.yaml", "check": "check slider.yaml", "schema": "schema",
    "bode": "bode slider.yaml", "nyquist": "nyquist slider.yaml", "sigma": "sigma slider.yaml",
    "step": "step slider.yaml --duration 1", "draw": "draw slider.yaml", "animate": "animate slider.yaml",
    "compare": "compare slider.yaml slider.yaml",
    "params": "params slider.yaml", "sweep": "sweep slider.yaml k.stiffness=1e3:1e4:3",
    "equilibrium": "equilibrium slider.yaml", "path": "path slider.yaml rail.z=0:0.1:3",
    "isolation": "isolation quarter_car body",
    "loop": "loop slider.yaml law.json", "budget": "budget slider.yaml --noise F=1",
    "robust": "robust slider.yaml -l k.stiffness=0.1",
    "tune": "tune slider.yaml --gain F x --hinf x F --starts 1",
    "certify": "certify slider.yaml",
    "export": "export slider.yaml -o slider.npz",
    "check-export": "check-export slider.npz slider.yaml", "report": "report slider.yaml",
    "cosim": None,  # tests/cli/test_cosim.py
}  # fmt: skip


def test_each_command_is_tried():
    assert set(LINES) == set(HOMES)


def test_options_of_robots_are_no_command_s_own():
    own = {argument.settings.get("dest") for name in HOMES for argument in command_of(name).arguments}
    assert not own & {argument.settings["dest"] for argument in ROBOTS}


@pytest.mark.parametrize("name", HOMES)
def test_help_says_what_each_argument_is(run, name):
    result = run(f"{name} --help")
    assert (result.exit_code, result.stderr) == (0, "")
    command = command_of(name)
    words = "".join(result.stdout.split())  # lines break at blanks and hyphens
    assert command.summary.replace(" ", "") in words
    assert command.summary.endswith(".") or command.summary.endswith(")")
    for argument in command.arguments + (ROBOTS if command.models else ()):
        assert argument.settings["help"].replace(" ", "") in words
        assert argument.names[0] in words or argument.settings["metavar"] in words


@pytest.mark.slow
def test_every_command_prints_json(run, tmp_path):
    (tmp_path / "law.json").write_text(json.dumps(LAW | NAMES))
    for name, line in LINES.items():
        if line is None or (name == "report" and not pytest.importorskip("plotly")):
            continue
        result = run(f"{line} --json")
        assert result.stderr == "", name
        assert json.loads(result.stdout), name


@pytest.mark.slow
@pytest.mark.parametrize("line", [
    "sweep slider.yaml k.stiffness=1e3:1e4:3 -o t.csv", "sweep slider.yaml k.stiffness=1e3:1e4:3 -o t.svg",
    "equilibrium slider.yaml -o t.yaml", "path slider.yaml rail.z=0:0.1:3 -o t.svg",
    pytest.param("isolation quarter_car body -o t.svg", marks=pytest.mark.slow),
    "loop slider.yaml law.json -o t.svg", "draw slider.yaml -o t.svg", "bode slider.yaml -o t.svg",
])  # fmt: skip
def test_json_with_a_file_is_nothing_but_json(run, tmp_path, line):
    """A sweep into a file printed which file it wrote after its JSON."""
    damper = {"C": [[-LAW["C"][0][0]]]}
    (tmp_path / "law.json").write_text(json.dumps(LAW | NAMES | damper))
    result = run(f"{line} --json")
    assert (result.exit_code, result.stderr) == (0, "")
    assert json.loads(result.stdout)
    assert (tmp_path / line.split()[-1]).stat().st_size > 0


@pytest.mark.slow
def test_curves_as_json_are_those_of_the_library(run):
    system = mv.load("slider.yaml").linearize()
    data = json.loads(run("bode slider.yaml --from 1 --to 50 --json").stdout)
    f = np.array(data["frequencies_hz"])
    assert (f[0], f[-1]) == pytest.approx((1.0, 50.0))
    response = data["responses"]["x"]["F"]
    s = 2j * np.pi * f
    exact = 1.0 / (2.0 * s**2 + 10.0 * s + 5000.0)
    np.testing.assert_allclose(np.array(response["real"]) + 1j * np.array(response["imag"]), exact, rtol=1e-9)
    largest = json.loads(run("sigma slider.yaml --from 1 --to 50 --json").stdout)
    (group,) = largest["groups"]
    assert (group["outputs"], group["inputs"], group["unit"]) == (["x"], ["F"], "m/N")
    np.testing.assert_allclose(group["singular_values"][0], abs(exact), rtol=1e-9)
    platform = json.loads(run("sigma stewart --from 100 --to 2000 --json").stdout)["groups"]
    assert [(len(one["outputs"]), one["inputs"][0], one["unit"]) for one in platform] == [
        (3, "Fx", "m/N"), (3, "Mx", "m/(N m)"), (3, "Fx", "rad/N"), (3, "Mx", "rad/(N m)")]  # fmt: skip
    step = json.loads(run("step slider.yaml --duration 10 --json").stdout)
    assert step["responses"]["x"]["F"][-1] == pytest.approx(1.0 / 5000.0, rel=1e-9)
    assert (step["inputs"], step["output_units"]) == (["F"], list(system.output_units))


@pytest.mark.parametrize(("line", "columns"), [
    ("bode slider.yaml --from 1 --to 50", ["frequency_hz", "x/F_re", "x/F_im"]),
    ("nyquist slider.yaml", ["frequency_hz", "x/F_re", "x/F_im"]),
    ("sigma slider.yaml", ["frequency_hz", "singular_value_1_m/N"]), ("step slider.yaml", ["time_s", "x/F"]),
    ("sweep slider.yaml k.stiffness=1e3:1e4:3 --modes 1", ["k.stiffness", "mode 1 [Hz]"]),
    ("budget slider.yaml --noise F=1", ["frequency_hz"]), ("path slider.yaml rail.z=0:0.1:3", ["rail.z"]),
    pytest.param("isolation quarter_car body", ["frequency_hz", "index"], marks=pytest.mark.slow),
])  # fmt: skip
def test_curves_and_tables_as_files_of_comma_separated_values(run, tmp_path, line, columns):
    result = run(f"{line} -o t.csv")
    assert (result.exit_code, result.stderr) == (0, "")
    assert result.stdout.splitlines()[-1] == "Written: t.csv"
    head, *rows = (tmp_path / "t.csv").read_text().splitlines()
    assert head.split(",")[: len(columns)] == columns
    assert len(rows) > 0
    if line.startswith("bode"):
        f, real, imaginary = np.array([row.split(",") for row in rows], dtype=float).T
        s = 2j * np.pi * f
        np.testing.assert_allclose(real + 1j * imaginary, 1.0 / (2.0 * s**2 + 10.0 * s + 5000.0), rtol=1e-9)
