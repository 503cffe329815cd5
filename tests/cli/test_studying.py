"""Commands on parameters, equilibria, isolation and curves: what they print and write."""

import json
from pathlib import Path

import numpy as np
import pytest
from numpy.testing import assert_allclose

import mbsvib as mv
from mbsvib import isolation

FOLDED = """
name: hanging
gravity: [0, 0, -9.81]
bodies:
  bob: {mass: 2.0, inertia: [0.1, 0.1, 0.1], position: [0.5, 0, 0]}
joints:
  hinge: {kind: revolute, first: ground, second: bob, position: [0, 0, 0], axis: [0, 1, 0]}
"""


def test_params(run):
    model = mv.library.quarter_car()
    listed = json.loads(run("params quarter_car --json").stdout)
    assert {row["name"]: row["value"] for row in listed} == dict(model.parameters)
    table = run("params quarter_car *.mass").stdout
    assert "wheel.mass" in table
    assert "kg" in table
    assert "stiffness" not in table
    result = run("params quarter_car tyre.stifness")
    assert result.exit_code == 2
    assert "Did you mean 'tyre.stiffness'?" in result.stderr


def test_params_of_names_with_brackets(run, tmp_path):
    model = mv.Model("two")
    for name in ("bob[1]", "bob1"):
        model.add_body(name, 2.0, (0.1, 0.1, 0.1))
    mv.save(model, tmp_path / "two.yaml")
    listed = json.loads(run(f"params {tmp_path / 'two.yaml'} bob[1].mass --json").stdout)
    assert [row["name"] for row in listed] == ["bob[1].mass"]


@pytest.mark.slow
def test_sweep(run, tmp_path):
    swept = json.loads(run("sweep quarter_car tyre.stiffness=1e5:4e5:3 --log --json").stdout)
    assert_allclose(swept["parameters"]["tyre.stiffness"], [1e5, 2e5, 4e5])
    model = mv.library.quarter_car()
    for i, value in enumerate(swept["parameters"]["tyre.stiffness"]):
        exact = model.with_values({"tyre.stiffness": value}).linearize().modes().frequencies
        assert_allclose([row[i] for row in swept["natural_hz"]], exact, rtol=1e-9)
    assert "mode 2 [Hz]" in run("sweep quarter_car tyre.stiffness=1e5:4e5").stdout
    assert run("sweep quarter_car tyre.stiffness=1e5:4e5 -o s.csv").exit_code == 0
    assert run("sweep quarter_car tyre.stiffness=1e5:4e5 -o s.png").exit_code == 0
    assert len((tmp_path / "s.csv").read_text().splitlines()) >= 12
    assert (tmp_path / "s.png").stat().st_size > 5000


@pytest.mark.parametrize(("modes", "label", "lines"), [
    (2, "natural frequency [Hz]", 2), (1, "natural frequency of mode 1 [Hz]", 1),
])
def test_the_figure_of_a_sweep_has_all_modes(run, monkeypatch, modes, label, lines):
    drawn = []
    monkeypatch.setattr("mbsvib.cli._drawing.write_figure", lambda figure, file: drawn.append(figure))
    assert run(f"sweep quarter_car tyre.stiffness=1e5:4e5:3 --modes {modes} -o s.png").exit_code == 0
    axes = drawn[0].axes[0]
    assert axes.get_ylabel() == label
    assert len(axes.lines) == lines
    exact = mv.library.quarter_car().with_values({"tyre.stiffness": 4e5}).linearize().modes().frequencies
    assert_allclose([line.get_ydata()[-1] for line in axes.lines], exact[:modes], rtol=1e-9)


@pytest.mark.parametrize(("line", "words"), [
    ("tyre.stiffness", "expected PARAMETER=FROM:TO"), ("tyre.stiffness=1:2:1", "expected PARAMETER=FROM:TO"),
    ("tyre.stiffness=1:b", "expected PARAMETER=FROM:TO"), ("tyre.stiffness=-1:2 --log", "--log needs positive ends"),
    ("tyre.stiffness=1:2 -o s.txt", "figures end in .png, .pdf, .svg, tables in .csv"),
    ("tyre.stifness=1:2", "Did you mean 'tyre.stiffness'?"),
])  # fmt: skip
def test_faulty_sweeps(run, line, words):
    result = run(f"sweep quarter_car {line}")
    assert result.exit_code in (1, 2)
    assert words in result.stderr


def test_equilibrium(run, tmp_path):
    Path("hanging.yaml").write_text(FOLDED)
    assert "stable" in run("equilibrium hanging.yaml -o there.yaml").stdout
    there = mv.load(tmp_path / "there.yaml")
    assert_allclose(there.bodies["bob"].position, (0.0, 0.0, -0.5), atol=1e-9)
    found = json.loads(run("equilibrium hanging.yaml --json").stdout)
    assert found["stable"]
    assert_allclose(found["displacements"]["bob"][:3], (-0.5, 0.0, -0.5), atol=1e-9)


TOGGLE = """
name: toggle
bodies:
  arm: {mass: 1.0, inertia: [0.1, 0.1, 0.1], position: [0.5, 0, 0.1]}
joints:
  hinge: {kind: revolute, first: ground, second: arm, position: [0, 0, 0], axis: [0, 1, 0]}
springs:
  k: {first: ground, second: arm, start: [2, 0, 0], end: [1, 0, 0.2], stiffness: 100.0}
"""


@pytest.mark.slow
def test_path(run, tmp_path):
    Path("toggle.yaml").write_text(TOGGLE)
    over = mv.load("toggle.yaml").path("hinge.rz", np.linspace(0.0, 0.5, 6))
    found = json.loads(run("path toggle.yaml hinge.rz=0:0.5:6 --json -o path.png").stdout)
    assert_allclose(found["forces"], over.forces, rtol=1e-12)
    assert (found["coordinate"], found["unit"]) == ("hinge.rz", "rad")
    assert [point["kind"] for point in found["points"]] == [point.kind for point in over.points] != []
    assert (tmp_path / "path.png").stat().st_size > 5000
    assert "limit" in run("path toggle.yaml hinge.rz=0:0.5:6").stdout
    assert "expected COORDINATE=FROM:TO" in run("path toggle.yaml hinge.rz").stderr
    assert "Did you mean 'hinge.rz'" in run("path toggle.yaml hing.rz=0:1").stderr


@pytest.mark.slow
def test_isolation(run, tmp_path):
    study = isolation.study(mv.library.stewart_isolator(), "platform")
    found = json.loads(run("isolation stewart_isolator platform --json -o t.svg").stdout)
    assert found["amplification"] == pytest.approx(study.amplification)
    assert_allclose(found["index"], study.index)
    assert (tmp_path / "t.svg").exists()
    assert "amplification at resonance" in run("isolation stewart_isolator platform").stdout
    assert run("isolation stewart_isolator platfrm").exit_code == 2


CURVES = ["sigma quarter_car", "nyquist quarter_car -i actuator --output travel --from 0.5 --to 20"]


@pytest.mark.slow
@pytest.mark.parametrize("line", CURVES)
def test_curves(run, line, tmp_path):
    result = run(line)
    assert result.exit_code == 0
    name = f"quarter_car-{line.split()[0]}.png"
    assert f"Written: {name}" in result.stdout
    assert (tmp_path / name).stat().st_size > 5000


def test_json_of_models_and_check(run):
    names = {row["name"] for row in json.loads(run("models --json").stdout)}
    assert names == set(mv.library.models())
    found = json.loads(run("check stewart --json").stdout)
    system = mv.library.stewart().linearize()
    assert found["dof"] == system.dof
    assert np.array_equal(found["natural_hz"], system.modes().frequencies)
