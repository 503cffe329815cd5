"""``mbsvib loop`` and feedback of ``mbsvib isolation``: controllers of files, poles, margins, exit status."""

import json

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.io import savemat

import mbsvib as mv
from mbsvib import isolation, library

# u = -g x / (T s + 1) on the slider: m (T s + 1) s^2 + d ... in closed form below
GAIN, LAG = 2000.0, 0.01
LAW = {"A": [[-1 / LAG]], "B": [[1 / LAG]], "C": [[-GAIN]], "D": [[0.0]]}
NAMES = {"inputs": ["x"], "outputs": ["F"]}


@pytest.fixture
def files(run, tmp_path):
    (tmp_path / "law.json").write_text(json.dumps(LAW | NAMES))
    np.savez(tmp_path / "law.npz", **LAW, **NAMES)
    savemat(tmp_path / "law.mat", LAW)
    return run


@pytest.mark.parametrize("line", ["law.json", "law.npz", "law.mat --sensor x --actuator F"])
def test_poles_are_those_of_the_characteristic_polynomial(files, line):
    result = files(f"loop slider.yaml {line} --json")
    data = json.loads(result.stdout)
    poles = np.array(data["poles"]["real"]) + 1j * np.array(data["poles"]["imag"])
    exact = np.roots(np.polyadd(np.polymul([2.0, 10.0, 5000.0], [LAG, 1.0]), [GAIN]))
    assert_allclose(np.sort_complex(poles), np.sort_complex(exact), rtol=1e-9)
    assert data["stable"] == bool((exact.real < 0).all())
    assert result.exit_code == (0 if data["stable"] else 1)


def test_a_stable_loop_has_margins_and_a_figure(files, tmp_path):
    (tmp_path / "damper.json").write_text(json.dumps(LAW | NAMES | {"C": [[GAIN]]}))
    result = files("loop slider.yaml damper.json -o open-closed.png")
    assert result.exit_code == 0
    assert "Stability margins: damper" in result.stdout
    assert result.stdout.endswith("Written: open-closed.png\n")
    assert (tmp_path / "open-closed.png").stat().st_size > 10_000
    sampled = json.loads(files("loop slider.yaml damper.json --rate 1000 --delay 1e-4 --json").stdout)
    assert sampled["discrete"]
    assert sampled["stable"]
    assert files("loop slider.yaml damper.json --rate 1000 -o sampled.png").exit_code == 2


def test_an_unstable_loop_fails_and_is_named(files):
    result = files("loop slider.yaml law.json")
    assert result.exit_code == 1
    assert "Unstable: " in result.stdout
    assert "mode 1" in result.stdout
    drawn = files("loop slider.yaml law.json -o open-closed.png --json")
    assert drawn.exit_code == 1
    assert not json.loads(drawn.stdout)["stable"]
    assert drawn.stderr == "Not written: open-closed.png, as an unstable loop has no frequency response.\n"


@pytest.mark.parametrize(
    ("name", "content", "words"),
    [
        ("bad.json", "{", ["bad.json", "cannot be read"]),
        ("bad.json", json.dumps({"A": [[1.0]]} | NAMES), ["B, C, D missing"]),
        ("bad.json", json.dumps(LAW), ["names no signals", "--sensor"]),
        ("bad.json", json.dumps(LAW | {"inputs": ["y"], "outputs": ["F"]}), ["'y'"]),
    ],
)
def test_a_faulty_controller_is_refused(files, tmp_path, name, content, words):
    (tmp_path / name).write_text(content)
    result = files(f"loop slider.yaml {name}")
    assert result.exit_code in (1, 2)
    assert result.stderr.startswith("error: ")
    for word in words:
        assert word in result.stderr


def test_delay_needs_a_rate(files):
    assert "give --rate too" in files("loop slider.yaml law.json --delay 1e-3").stderr


def test_a_state_space_that_mbsvib_wrote(files, tmp_path):
    """Its JSON has the state space in a field of its own, and signals with units."""
    signals = {key: [{"name": name, "unit": "-"} for name in names] for key, names in NAMES.items()}
    (tmp_path / "own.json").write_text(json.dumps({"format": "mbsvib-system", "state_space": LAW, **signals}))
    assert files("loop slider.yaml own.json --json").stdout.replace("own", "law") == files(
        "loop slider.yaml law.json --json").stdout


@pytest.mark.parametrize(("kind", "gain"), [("force", 60.0), ("velocity", 200.0), ("skyhook", 100.0)])
def test_isolation_with_feedback(run, kind, gain):
    model = library.stewart_isolator()
    plant = isolation.actuated(model, "platform")
    laws = {"force": isolation.force_feedback, "velocity": isolation.velocity_feedback, "skyhook": isolation.skyhook}
    loop = plant.with_gains(laws[kind](plant, gain))
    data = json.loads(run(f"isolation stewart_isolator platform --feedback {kind} --gain {gain} --json").stdout)
    assert_allclose(data["closed_loop"]["damping_ratios"], loop.damping_ratios, rtol=1e-9)
    assert data["closed_loop"]["amplification"] == pytest.approx(loop.isolation().amplification, rel=1e-9)
    assert data["amplification"] == pytest.approx(isolation.study(model, "platform").amplification, rel=1e-12)


def test_isolation_prints_and_draws_open_against_closed(run, tmp_path):
    result = run("isolation stewart_isolator platform --feedback force --gain 60 --leak 1 -o isolation.png")
    assert result.exit_code == 0
    assert result.stdout.count("Isolation of platform from ground") == 2
    assert "Stability margins: IFF" in result.stdout
    assert (tmp_path / "isolation.png").stat().st_size > 10_000
    assert mv.library.stewart_isolator().linearize().dof == 12
    refused = run("isolation stewart_isolator platform --feedback velocity --gain 60 --leak 1")
    assert (refused.exit_code, "leave --leak out" in refused.stderr) == (2, True)
