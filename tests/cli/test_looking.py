"""Commands that print, for people and for scripts."""

import csv
import io
import json
import math

import pytest
from jsonschema import Draft202012Validator

import mbsvib as mv


def test_version(run):
    result = run("--version")
    assert (result.exit_code, result.stdout) == (0, f"mbsvib {mv.__version__}\n")


def test_help_lists_the_commands(run):
    result = run("--help")
    assert result.exit_code == 0
    for command in ("demo", "models", "modes", "bode", "step", "check", "export", "schema"):
        assert f" {command} " in result.stdout


def test_models_lists_the_library(run):
    lines = run("models").stdout.splitlines()
    for name, (_, words) in mv.library.models().items():
        assert any(line.split()[:1] == [name] and words in line for line in lines)


def test_modes_prints_the_table(run):
    result = run("modes stewart")
    assert result.exit_code == 0
    assert result.stdout == str(mv.library.stewart().linearize().modes()) + "\n"
    assert "780.601788" in result.stdout
    assert "\x1b" not in result.stdout


def test_modes_of_a_file_and_of_a_family(run):
    assert "7.957747" in run("modes slider.yaml").stdout  # sqrt(5000/2)/2 pi
    assert "C20RF1: 20 DOF" in run("modes C20RF1").stdout


def test_modes_as_json_keep_every_digit(run):
    data = json.loads(run("modes slider.yaml --json").stdout)
    assert (data["name"], data["dof"]) == ("slider", 1)
    (mode,) = data["modes"]
    assert mode["natural_hz"] == pytest.approx(50 / (2 * math.pi), rel=1e-14)
    assert mode["damping_ratio"] == pytest.approx(10 / (2 * 2 * 50), rel=1e-14)
    assert mode["real_1"] == pytest.approx(-2.5, rel=1e-14)
    assert abs(mode["imag_1"]) == pytest.approx(math.sqrt(2500 - 6.25), rel=1e-14)
    assert mode["imag_2"] == -mode["imag_1"]
    assert mode["largest_motion"] == "mass x"


def test_modes_as_csv(run):
    rows = list(csv.DictReader(io.StringIO(run("modes stewart --csv").stdout)))
    frequencies = mv.library.stewart().linearize().modes().frequencies
    assert [float(row["natural_hz"]) for row in rows] == frequencies.tolist()
    assert [row["mode"] for row in rows] == ["1", "2", "3", "4", "5", "6"]


def test_an_infinite_damping_ratio_is_null_in_json(run, tmp_path):
    words = (tmp_path / "slider.yaml").read_text(encoding="utf-8").replace("stiffness: 5000, ", "")
    (tmp_path / "braked.yaml").write_text(words, encoding="utf-8")
    assert json.loads(run("modes braked.yaml --json").stdout)["modes"][0]["damping_ratio"] is None
    assert ",inf," in run("modes braked.yaml --csv").stdout


def test_csv_and_json_together_are_refused(run):
    result = run("modes stewart --csv --json")
    assert result.exit_code == 2
    assert "choose one" in result.stderr


@pytest.mark.slow
def test_check_explains(run):
    result = run("check stewart")
    assert result.exit_code == 0
    assert result.stdout.startswith(mv.library.stewart().linearize().explain())
    assert "6, 780.602 to 1269.66 Hz" in result.stdout
    one = mv.library.four_bar().linearize().modes().frequencies[0]
    assert f"  1, {one:.6g} Hz\n" in run("check four_bar").stdout


def test_check_of_a_locked_mechanism(run, tmp_path):
    words = (tmp_path / "slider.yaml").read_text(encoding="utf-8")
    words = words.replace("prismatic", "fixed").replace(", axis: [1, 0, 0]", "")
    (tmp_path / "locked.yaml").write_text(words, encoding="utf-8")
    result = run("check locked.yaml")
    assert result.exit_code == 0
    assert "fully locked" in result.stdout


@pytest.mark.slow
def test_schema_is_one(run):
    schema = json.loads(run("schema").stdout)
    Draft202012Validator.check_schema(schema)


@pytest.mark.slow
def test_axes_are_aligned_on_request(run, tmp_path):
    mv.save(mv.library.four_bar().replace("C", axis=(2e-5, 1, 0)), tmp_path / "drawn.yaml")
    assert "four_bar: 0 DOF" in run(f"check {tmp_path / 'drawn.yaml'}").stdout
    result = run(f"check {tmp_path / 'drawn.yaml'} --align 1e-4")
    assert result.exit_code == 0
    assert "four_bar: 1 DOF" in result.stdout
    assert "C: turned by 1.5e-05 rad" in result.stdout


def test_a_tolerance_that_is_none_is_misuse(run):
    result = run("modes four_bar --align 1")
    assert result.exit_code == 2
    assert "align = 1; expected an angle [rad] above 0, at most 0.05" in result.stderr


def test_certify_is_for_ci(run, tmp_path):
    file = tmp_path / "certificate.json"
    result = run(f"certify quarter_car -o {file}")
    assert result.exit_code == 0
    assert "Certificate of quarter_car: passed" in result.stdout
    assert json.loads(file.read_text())["verdict"] == "passed"
    mv.save(mv.library.four_bar().with_values({"coupler.mass": 3.0}), tmp_path / "off.yaml")
    failed = run(f"certify {tmp_path / 'off.yaml'} --json")
    assert failed.exit_code == 1
    assert json.loads(failed.stdout)["failed"] == ["equilibrium.residual"]


def test_some_of_the_modes(run):
    every = json.loads(run("modes stewart --json").stdout)["modes"]
    assert json.loads(run("modes stewart --count 2 --json").stdout)["modes"] == every[:2]
    near = every[3]["natural_hz"] * 1.0001
    assert json.loads(run(f"modes stewart --count 1 --near {near} --json").stdout)["modes"][0]["natural_hz"] == \
        pytest.approx(every[3]["natural_hz"], rel=1e-3)  # fmt: skip
    assert "--count" in run("modes stewart --near 3").stderr
    assert "--count 0" in run("modes stewart --count 0").stderr


def test_models_of_many_bodies(run, monkeypatch):
    """They are held sparse, and all of their modes are not computed unasked."""
    monkeypatch.setattr("mbsvib.cli._looking.system_of", lambda model: mv.library.chain(40).linearize(method="sparse"))
    result = run("modes chain")
    assert result.exit_code == 2
    assert "--count 10, or --count 10 --near HZ" in result.stderr
    assert len(json.loads(run("modes chain --count 3 --json").stdout)["modes"]) == 3
    assert run("check chain").exit_code == run("check chain --json").exit_code == 0
