"""``mbsvib budget``: noise on the command line, and the noise of controllers of files."""

import json

import numpy as np
import pytest
from numpy.testing import assert_allclose

import mbsvib as mv
from mbsvib import isolation

MASS, DAMPING, STIFFNESS = 2.0, 10.0, 5000.0  # of the slider


def test_white_noise_in_closed_form(run):
    data = json.loads(run("budget slider.yaml --noise F=0.5 --json").stdout)
    assert_allclose(data["rms"]["x"], np.sqrt(0.5 / (4.0 * DAMPING * STIFFNESS)), rtol=1e-12)
    assert (data["units"], data["band"], data["error"]) == ({"x": "m"}, None, 0.0)


@pytest.mark.parametrize("title", ["frequency_hz,density\n", "# f S\n", ""])
def test_a_file_and_a_band(run, tmp_path, title):
    (tmp_path / "force.csv").write_text(title + "1, 1e-3\n100; 1e-5  # end\n\n")
    data = json.loads(run("budget slider.yaml --noise F=force.csv --band 2 20 --json").stdout)
    noise = {"F": [(1.0, 1e-3), (100.0, 1e-5)]}
    assert data["rms"] == mv.load("slider.yaml").linearize().rms(None, noise, (2.0, 20.0))


@pytest.mark.parametrize(("word", "curve"), [
    ("VC-C", isolation.vc_spectrum("VC-C")), ("NHNM", isolation.seismic_spectrum("NHNM")),
    ("ISO-B@15", isolation.road_spectrum("B", 15.0, "acceleration")),
])  # fmt: skip
def test_curves_are_of_the_quantity_of_the_input(run, word, curve):
    """The road of a quarter car is an acceleration."""
    line = f"budget quarter_car --noise road={word} --output body.az --band 3 10 --weighting Wk --json"
    data = json.loads(run(line).stdout)
    system = mv.library.quarter_car().linearize()
    assert data["contributions"]["body.az"] == system.budget(
        {"road": curve}, "body.az", (3.0, 10.0), weighting="Wk").contributions["body.az"]  # fmt: skip


def test_a_weighting_of_a_file(run, tmp_path):
    (tmp_path / "gain.txt").write_text("0.1 1\n100 10\n")
    line = "budget quarter_car --noise road=0.01 --output travel --band 3 10 --json --weighting"
    rms = mv.library.quarter_car().linearize().rms("travel", {"road": 0.01}, (3.0, 10.0),
                                                   weighting=lambda f: (f / 0.1) ** (1.0 / 3.0))  # fmt: skip
    assert json.loads(run(f"{line} gain.txt").stdout)["rms"]["travel"] == pytest.approx(rms["travel"], rel=1e-6)
    assert "expected Wk, Wd, or a file" in run(f"{line} Wz").stderr


@pytest.mark.slow
def test_controllers_add_their_noise(run, tmp_path):
    """Two static gains -g x: as one spring of 2 g more, whose sensor's noise acts as the force 2 g n."""
    gain = 300.0
    law = {"A": [[-1.0]], "B": [[0.0]], "C": [[0.0]], "D": [[-gain]], "inputs": ["x"], "outputs": ["F"]}
    for name in ("one", "two"):
        (tmp_path / f"{name}.json").write_text(json.dumps(law))
    result = run("budget slider.yaml --controller one.json --controller two.json --noise x.noise=1e-9 "
                 "--noise F.noise=4 -o budget.png --json")  # fmt: skip
    parts = json.loads(result.stdout)["contributions"]["x"]
    unit = np.sqrt(1.0 / (4.0 * DAMPING * (STIFFNESS + 2.0 * gain)))
    assert_allclose([parts["F.noise"], parts["x.noise"]], [2.0 * unit, 2.0 * gain * np.sqrt(1e-9) * unit], rtol=1e-10)
    assert (tmp_path / "budget.png").stat().st_size > 10_000
    sampled = json.loads(run("budget slider.yaml --controller one.json --rate 1000 --noise F=1 --json").stdout)
    assert sampled["name"].endswith("at 1000 Hz")


@pytest.mark.parametrize(("line", "words"), [
    ("--noise F", "expected INPUT=VALUE"),
    ("--noise F=1 --noise F=2", "is there already"),
    ("--noise F=VC-Z", "a file or a curve; curves: VC-A"),
    ("--noise F=VC-C", "one of m/s^2, yet the input has the unit N"),
    ("--noise F=ISO-C@fast", "class of roads and a speed"),
    ("--noise F=1 --rate 100", "give it by --controller"),
    ("--noise F=slider.yaml", "at least two pairs"),
    ("--noise F=faulty.csv", "faulty.csv, line 2: '2'"),
])  # fmt: skip
def test_refusals(run, tmp_path, line, words):
    (tmp_path / "faulty.csv").write_text("1,1\n2\n")
    result = run(f"budget slider.yaml {line}")
    assert result.exit_code in (1, 2)
    assert result.stderr.startswith("error: ")
    assert words in result.stderr
