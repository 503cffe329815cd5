"""``mbsvib demo``: the whole job, from the mechanism to FMUs and a report."""

import json
import sys
import tomllib
from pathlib import Path

import numpy as np
import pytest
from matplotlib.figure import Figure

import mbsvib as mv
import mbsvib_export as mx
from mbsvib import isolation, library
from mbsvib.cli import _demo_stages as stages
from mbsvib.cli._demo import command_line
from tests.support.sizes import few

PNG = b"\x89PNG"
FIGURES = ("mechanism", "modes", "mode-shapes", "bode", "step", "root-locus", "loop-gain", "sensitivity", "open-closed",
           "isolation", "co-simulation")  # fmt: skip


@pytest.fixture
def without_figures(monkeypatch):
    """Figures are drawn empty: what is tested is elsewhere."""
    names = ("bode", "step", "modes", "mode_strips", "mechanism", "root_locus", "isolation", "loop_gain", "sensitivity")
    for name in names:
        monkeypatch.setattr(f"mbsvib.plots.{name}", lambda *_, **__: Figure())


def lacking(monkeypatch, *packages):
    """Let packages be missing."""
    present = stages.find_spec
    monkeypatch.setattr(stages, "find_spec", lambda name: None if name in packages else present(name))


@pytest.mark.slow
def test_the_whole_job(run, tmp_path):
    pytest.importorskip("fmpy")
    pytest.importorskip("plotly")
    (tmp_path / "mbsvib-demo").mkdir()
    (tmp_path / "mbsvib-demo" / "step.png").write_bytes(b"old")
    result = run("demo")
    assert (result.exit_code, result.stderr) == (0, "")
    for number, stage in enumerate(stages.STAGES, 1):
        assert f"{number}/{len(stages.STAGES)}  {stage.title}\n" in result.stdout
    assert "What needs an extra" not in result.stdout
    folder = tmp_path / "mbsvib-demo"
    table = result.stdout.split("Written to mbsvib-demo")[1].split("Next: ")[0]
    listed = {line.split()[0] for line in table.splitlines() if line.startswith("  ")} - {"file"}
    assert listed == {path.name for path in folder.iterdir()}
    for name in FIGURES:
        content = (folder / f"{name}.png").read_bytes()
        assert content.startswith(PNG)
        assert len(content) > 10_000
    model = mv.load(folder / "isolator.yaml")
    assert run("modes mbsvib-demo/isolator.yaml").stdout == str(model.linearize().modes()) + "\n"
    assert (folder / "report.html").read_text(encoding="utf-8").startswith("<!doctype html>")
    assert mx.check_export(folder / "isolator.mat", model.linearize()).passed
    assert "CONTROLLER_STEP 0.001" in (folder / "controller.h").read_text()


@pytest.mark.slow
def test_its_numbers_are_those_of_the_library(run, without_figures, monkeypatch):
    """And the controller damps, isolates and is stable when sampled, as the text claims."""
    pytest.importorskip("fmpy")
    lacking(monkeypatch, "plotly")
    numbers = json.loads(run("demo --json").stdout)["figures"]
    model = library.stewart_isolator()
    np.testing.assert_allclose(numbers["natural_hz"], model.linearize().modes().frequencies, rtol=1e-12)
    plant = isolation.actuated(model, "platform")
    loop = plant.with_gains(isolation.force_feedback(plant, stages.GAIN, stages.LEAK))
    closed = numbers["closed_loop"]
    np.testing.assert_allclose(closed["damping_ratios"], loop.damping_ratios, rtol=1e-9)
    assert min(closed["damping_ratios"]) > 0.3 > max(model.linearize().modes().damping_ratios[:6])
    assert closed["amplification"] < 1.3 < 3.5 < numbers["amplification"]
    assert closed["phase_margin_deg"] > 55.0
    assert numbers["sampled"]["stable"]
    assert numbers["python_control_difference"] < 1e-9
    jacobi, iteration = (numbers["co_simulation"][name] for name in ("jacobi", "iteration"))
    slope = np.diff(np.log(jacobi["errors"])) / np.diff(np.log(jacobi["steps"]))
    np.testing.assert_allclose(slope, 1.0, atol=0.1)
    slope = np.diff(np.log(iteration["errors"])) / np.diff(np.log(iteration["steps"]))
    np.testing.assert_allclose(slope, 2.0, atol=0.1)


@pytest.mark.slow
@pytest.mark.parametrize("by_uv", few([True, False], 1))
def test_what_an_extra_would_add_is_said_with_its_command(run, tmp_path, monkeypatch, without_figures, by_uv):
    monkeypatch.setenv("UV", "uv") if by_uv else monkeypatch.delenv("UV", raising=False)
    lacking(monkeypatch, "plotly", "fmpy")
    result = run("demo -o there/below")
    assert result.exit_code == 0
    begin = "uv run --no-dev mbsvib" if by_uv else "mbsvib"
    assert f"Next: {begin} modes there/below/isolator.yaml\n" in result.stdout
    table = result.stdout.split("What needs an extra")[1]
    for extra, command in (("report", "report stewart_isolator"), ("fmu", "demo")):
        assert "Skipped: " in result.stdout
        assert (f"--extra {extra} mbsvib {command}" if by_uv else f'"mbsvib[{extra}]" && mbsvib {command}') in table
    assert "Written to there/below" in result.stdout
    assert not (tmp_path / "there" / "below" / "report.html").exists()
    assert not (tmp_path / "mbsvib-demo").exists()


@pytest.mark.slow
def test_fmus_are_left_out_where_nothing_compiles_them(run, monkeypatch, without_figures):
    def refuse(*_, **__):
        raise mv.ExportError("to_fmu: there is no compiler.")

    lacking(monkeypatch, "plotly")
    monkeypatch.setattr(mx, "to_fmu", refuse)
    result = run("demo")
    assert result.exit_code == 0
    assert "Skipped: to_fmu: there is no compiler." in result.stdout
    assert "plant and controller as FMUs" in result.stdout.split("What needs an extra")[1]
    assert "plant.fmu" not in result.stdout


def test_extras_of_the_demo_are_those_of_the_package(monkeypatch):
    project = tomllib.loads((Path(mv.__file__).parents[1] / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    assert {"fmu", "report"} <= set(project["optional-dependencies"])
    monkeypatch.delenv("UV", raising=False)
    assert command_line("fmu", "demo") == 'pip install "mbsvib[fmu]" && mbsvib demo'
    assert "fmpy" in " ".join(project["optional-dependencies"]["fmu"])
    assert "plotly" in " ".join(project["optional-dependencies"]["report"])
    assert "mbsvib.cli._demo_stages" in sys.modules
