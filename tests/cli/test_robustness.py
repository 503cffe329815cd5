"""``mbsvib robust`` and ``mbsvib tune``: limits, structures and goals on the command line."""

import json
from pathlib import Path

import numpy as np
import pytest
from numpy.testing import assert_allclose

import mbsvib as mv

MASS, DAMPING, STIFFNESS = 2.0, 10.0, 5000.0  # of the slider


@pytest.mark.slow
def test_limits_of_damping_and_the_worst_gain(run):
    """The damper vanishes at 10 / 8 of its distance; the largest peak has the least of both."""
    result = run("robust slider.yaml -l k.damping=2:18 --limits k.stiffness=0.2 --gain x F --noise F=0.5 --json")
    data = json.loads(result.stdout)
    assert result.exit_code == 0
    assert data["parameters"]["k.damping"] == {"unit": "N s/m", "low": 2.0, "nominal": 10.0, "high": 18.0,
                                               "repetitions": 1}  # fmt: skip
    assert data["stable"]
    assert_allclose(data["stability"]["upper"], 1.25, rtol=1e-6)
    ratio = 0.5 * 2.0 / np.sqrt(0.8 * STIFFNESS * MASS)
    assert_allclose(data["gains"][0]["lower"], 1.0 / (2.0 * ratio * np.sqrt(1.0 - ratio**2) * 0.8 * STIFFNESS))
    assert_allclose(data["rms"]["lower"]["x"], np.sqrt(0.5 / (4.0 * 2.0 * 0.8 * STIFFNESS)), rtol=1e-9)


@pytest.mark.slow
def test_a_controller_that_is_not_robust(run, tmp_path):
    """A gain g that takes away stiffness: k - g > 0 up to (k - g) / (0.4 k) of the distances; exit status 1."""
    law = {"A": [[-1.0]], "B": [[0.0]], "C": [[0.0]], "D": [[4000.0]], "inputs": ["x"], "outputs": ["F"]}
    (tmp_path / "law.json").write_text(json.dumps(law))
    result = run("robust slider.yaml -l k.stiffness=0.4 --controller law.json")
    assert result.exit_code == 1
    assert "Not stable at all values within the limits." in result.stdout
    assert "0.5 times as far" in result.stdout


@pytest.mark.slow
def test_tuned_gain_goes_to_a_file_that_loop_reads(run):
    """The file closes a stable loop, and the objective is the largest weighted goal."""
    result = run("tune slider.yaml --pid F x --hinf x F=1000 --hinf x x.noise=0.05 --margin 0.3 --starts 1 -o law.json "
                 "--json")  # fmt: skip
    data = json.loads(result.stdout)
    assert result.exit_code == 0, result.stderr
    assert data["success"]
    assert set(data["values"]) == {"F/x.kp", "F/x.ki", "F/x.kd", "F/x.tau"}
    assert data["objective"] == max(1000 * data["achieved"]["hinf x / F"], 0.05 * data["achieved"]["hinf x / x.noise"])
    assert json.loads(run("loop slider.yaml law.json --json").stdout)["stable"]


@pytest.mark.slow
def test_rms_of_several_variants_with_a_parameter(run):
    """S / (4 c k) is least at the largest damping; the values are those of a loop that is closed anew."""
    line = ("tune slider.yaml --gain F x --rms x=2 --noise F=0.5 --noise x.noise=1e-9 --parameter "
            "k.damping=5:20 --variant mass.mass=3 --variant mass.mass=1,k.stiffness=4e3 --starts 1 --json")  # fmt: skip
    data = json.loads(run(line).stdout)
    assert_allclose(data["values"]["k.damping"], 20.0, rtol=1e-3)
    assert len(data["by_plant"]["rms x"]) == 3
    law = mv.StateSpace.from_arrays(*(np.reshape(data["controller"][key], shape) for key, shape in
                                      zip("ABCD", ((0, 0), (0, 1), (1, 0), (1, 1)), strict=True)), ["x"], ["F"])
    loop = mv.load("slider.yaml").with_values({"k.damping": data["values"]["k.damping"]}).linearize().feedback(
        law, noise=True)  # fmt: skip
    assert_allclose(loop.rms("x", {"F": 0.5, "x.noise": 1e-9})["x"], data["by_plant"]["rms x"][0], rtol=1e-9)


@pytest.mark.slow
def test_limits_roll_off_and_weights_over_frequency(run):
    """The same design as by goals in Python; a limit that nothing reaches is said by the exit status."""
    Path("weight.csv").write_text("frequency, gain\n0.1, 3.0\n200, 0.5\n")
    line = ("tune slider.yaml --gain F x --hinf x F=weight.csv --rms-limit x=1 --noise F=0.5 --hinf-limit x F=1 "
            "--roll-off 1e3:10 --starts 1 --workers 1 --json")  # fmt: skip
    result = run(line)
    data, g = json.loads(result.stdout), mv.goals
    assert result.exit_code == 0, result.stderr
    goals = [g.hinf("x", "F", [(0.1, 3.0), (200.0, 0.5)]), g.hinf("x", "F", most=1.0),
             g.rms("x", {"F": 0.5}, most=1.0), g.rolloff(1e3, 10.0)]  # fmt: skip
    assert list(data["achieved"]) == [goal.label for goal in goals]
    design = mv.tune(mv.load("slider.yaml"), mv.tunable.gain("F", "x"), goals, starts=1)
    assert data["values"] == design.values
    assert data["objective"] == design.objective > 0.0
    missed = run("tune slider.yaml --gain F x --hinf-limit x F=1e-9 --hinf-limit x x.noise=1e-3 --starts 1 --json")
    assert missed.exit_code == 1
    assert not all(json.loads(missed.stdout)["reached"].values())


def test_pairs_of_patterns(run):
    """Six legs with one controller each, or with one for all."""
    line = "tune cubic_hexapod --gain F? ? --damping-ratio 0.001 --starts 1 --json"
    assert set(json.loads(run(f"{line} --each").stdout)["values"]) == {"Fx/x.gain", "Fy/y.gain", "Fz/z.gain"}
    assert set(json.loads(run(f"{line} --shared").stdout)["values"]) == {"F?/?.gain"}


@pytest.mark.parametrize(("line", "words"), [
    ("robust slider.yaml -l k.stiffness", "expected PARAMETER=SHARE"),
    ("robust slider.yaml -l k.stiffness=1:2:3", "expected PARAMETER=SHARE"),
    ("robust slider.yaml -l k.stiffness=0.1 -l k.stiffness=0.2", "is there already"),
    ("robust slider.yaml -l k.stifness=0.1", "did you mean 'k.stiffness'"),
    ("robust slider.yaml -l k.stiffness=0.1 --output x", "--noise INPUT=DENSITY"),
    ("robust slider.yaml", "--limits"),
    ("tune slider.yaml --hinf x F", "no controller"),
    ("tune slider.yaml --pid F x", "no goal"),
    ("tune slider.yaml --pid F x --rms x", "belong together"),
    ("tune slider.yaml --pid F x --rms-limit x=1", "belong together"),
    ("tune slider.yaml --pid F x --rms-limit x --noise F=1", "NAME=LIMIT"),
    ("tune slider.yaml --pid F x --hinf-limit x F=much", "NAME=LIMIT"),
    ("tune slider.yaml --pid F x --roll-off fast", "HERTZ:DECIBELS"),
    ("tune slider.yaml --pid F x --hinf x F=many", "NAME=WEIGHT"),
    ("tune slider.yaml --pid F y --hinf x F", "'y'"),
    ("tune slider.yaml --pid F x --hinf x F -o law.txt", "controllers end in"),
    ("tune slider.yaml --states two F x --hinf x F", "number of states"),
    ("tune slider.yaml --pid F x --hinf x F --parameter k.damping=3", "PARAMETER=LOW:HIGH"),
    ("tune slider.yaml --pid F x --hinf x F --variant k.damping", "PARAMETER=VALUE"),
    ("tune cubic_hexapod --pid F? x --each --hinf x Fx", "one controller each"),
])  # fmt: skip
def test_refusals(run, line, words):
    result = run(line)
    assert result.exit_code in (1, 2)
    assert words.lower() in result.stderr.lower()
