"""``mbsvib loop`` and feedback of ``mbsvib isolation``: controllers of files, poles, margins, exit status."""

import json
from io import BytesIO
from zipfile import ZipFile

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.io import savemat
from scipy.linalg import expm

import mbsvib as mv
import mbsvib_export as mx
from mbsvib import isolation, library
from tests.support.sizes import few

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


@pytest.mark.slow
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
    assert files("loop slider.yaml damper.json --rate 1000 -o sampled.png").exit_code == 0
    assert (tmp_path / "sampled.png").stat().st_size > 10_000


def test_an_unstable_loop_fails_and_is_named(files):
    result = files("loop slider.yaml law.json")
    assert result.exit_code == 1
    assert "Unstable: " in result.stdout
    assert "mode 1" in result.stdout
    written = files("loop slider.yaml law.json -o open-closed.csv --json")
    assert written.exit_code == 1
    assert not json.loads(written.stdout)["stable"]
    assert "No steady vibration has its frequency response" in written.stderr


@pytest.mark.parametrize("gain", [GAIN, -GAIN])
def test_responses_of_both_loops_as_a_table(files, tmp_path, gain):
    """x / F = 1 / (m s^2 + c s + k), and with the lag of the law, x / w = 1 / (m s^2 + c s + k - K(s))."""
    (tmp_path / "damper.json").write_text(json.dumps(LAW | NAMES | {"C": [[gain]]}))
    files("loop slider.yaml damper.json -o loops.csv")
    table = np.genfromtxt(tmp_path / "loops.csv", delimiter=",", names=True, deletechars="")
    s = 2j * np.pi * table["frequency_hz"]
    stiffness, law = np.polyval([2.0, 10.0, 5000.0], s), gain / (LAG * s + 1.0)
    for label, exact in (("open", 1.0 / stiffness), ("closed", 1.0 / (stiffness - law))):
        assert_allclose(table[f"{label}:x/F_re"] + 1j * table[f"{label}:x/F_im"], exact, rtol=1e-9)


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


@pytest.mark.parametrize("name", ["law.json", "law.npz", "law.mat", "plant.json"])
def test_a_controller_in_place_of_a_model_is_named(files, tmp_path, name):
    mx.to_json(mv.load(tmp_path / "slider.yaml").linearize(), tmp_path / "plant.json")
    result = files(f"bode {name}")
    assert (result.exit_code, result.stdout) == (2, "")
    assert result.stderr.startswith(f"error: {name} holds a controller or another state space, and no model.")
    assert f"'mbsvib loop MODEL {name}'" in result.stderr


def test_a_controller_without_names_is_exported_once_it_has_some(files, tmp_path):
    result = files("export law.mat -o law.c")
    assert result.exit_code == 2
    assert "law.mat names no signals: add lists of names to the file" in result.stderr


def test_a_state_space_that_mbsvib_wrote(files, tmp_path):
    law = mv.StateSpace.from_arrays(*LAW.values(), **NAMES)
    for suffix, write in ((".json", mx.to_json), (".npz", mx.to_npz), (".mat", mx.to_mat)):
        write(law, tmp_path / f"own{suffix}")
        assert files(f"loop slider.yaml own{suffix} --json").stdout.replace("own", "law") == files(
            "loop slider.yaml law.json --json").stdout


def discrete(period):
    """Zero-order hold of the law, as another program would write it."""
    pole = float(np.exp(-period / LAG))
    return {"A": [[pole]], "B": [[1 - pole]], "C": [[GAIN]], "D": [[0.0]], "dt": period}


def discrete_poles(period):
    """z of slider and controller: both are exact with a zero-order hold, x' = A x + B u of the slider by expm."""
    plant = np.array([[0.0, 1.0, 0.0], [-2500.0, -5.0, 0.5], [0.0, 0.0, 0.0]])
    step = expm(plant * period)
    law = discrete(period)
    step[:, 2] *= law["C"][0][0]
    step[2] = law["B"][0][0], 0.0, law["A"][0][0]
    return np.linalg.eigvals(step)


@pytest.mark.few(1)
@pytest.mark.parametrize("suffix", [".json", ".npz", ".mat"])
def test_a_discrete_controller_runs_at_its_sample_time(files, tmp_path, suffix):
    """Its matrices were taken as those of continuous time: z = 0.9 as a pole of +0.9 1/s."""
    period = 0.001
    law, path = discrete(period), tmp_path / f"discrete{suffix}"
    if suffix == ".json":
        path.write_text(json.dumps(law | NAMES))
    elif suffix == ".npz":
        np.savez(path, **law, **NAMES)
    else:
        savemat(path, {key: value for key, value in law.items() if key != "dt"} | {"Ts": period})
    result = files(f"loop slider.yaml {path.name} --json --sensor x --actuator F")
    data = json.loads(result.stdout)
    assert data["discrete"]
    poles = np.array(data["poles"]["real"]) + 1j * np.array(data["poles"]["imag"])
    found = np.exp(poles * period)
    assert_allclose(np.sort_complex(found), np.sort_complex(discrete_poles(period)), rtol=1e-9)
    assert files(f"loop slider.yaml {path.name} --json --sensor x --actuator F --rate 1000").stdout == result.stdout
    wrong = files(f"loop slider.yaml {path.name} --sensor x --actuator F --rate 500")
    assert (wrong.exit_code, "which is 1000 Hz" in wrong.stderr) == (2, True)


@pytest.mark.parametrize(
    ("extra", "words"),
    [
        ({"dt": True}, "without a sample time"),
        ({"Ts": -1}, "without a sample time"),
        ({"dt": 0.01, "Ts": 0.02}, "expected one sample time"),
        ({"dt": "0.01"}, "expected one sample time"),
        ({"dt": -0.5}, "expected a sample time [s] above 0"),
        ({"E": [[2.0]]}, "it has a matrix E"),
        ({"A": [["1_0"]]}, "expected a matrix of real numbers"),
        ({"inputs": [3]}, "expected texts"),
    ],
)
def test_what_does_not_describe_one_controller(files, tmp_path, extra, words):
    (tmp_path / "odd.json").write_text(json.dumps(LAW | NAMES | extra))
    result = files("loop slider.yaml odd.json")
    assert result.exit_code in (1, 2)
    assert words in result.stderr


HUGE = (b"\x93NUMPY\x01\x00v\x00" + b"{'descr': '<f8', 'fortran_order': False, 'shape': (1000000, 1000000), }"
        .ljust(117) + b"\n")  # fmt: skip


def damaged(tmp_path):
    """Names and bytes of files of controllers that are empty, cut, or lie about what they hold."""
    np.savez(tmp_path / "law.npz", **LAW, **NAMES)
    savemat(tmp_path / "law.mat", LAW)
    for name in ("law.npz", "law.mat"):
        content = (tmp_path / name).read_bytes()
        for k, part in enumerate((b"", content[:1], content[:130], content[: len(content) // 2], content[:-1])):
            yield f"{k}{name}", part
    stream = BytesIO()
    with ZipFile(stream, "w") as archive:
        for name in "ABCD":
            archive.writestr(f"{name}.npy", HUGE)
    yield "huge.npz", stream.getvalue()
    yield "deep.json", b"[" * 100_000
    yield "twice.json", json.dumps(LAW | NAMES).encode()[:-1] + b', "A": [[1]]}'
    yield "list.json", b"[1, 2]"
    yield "bytes.json", b"\xff\xfe{"
    yield "text.npz", b"no archive"


def test_damaged_controllers_are_refused(files, tmp_path):
    """None of them ends in a traceback, nor fills the memory."""
    for name, content in damaged(tmp_path):
        (tmp_path / name).write_bytes(content)
        result = files(f"loop slider.yaml {name} --sensor x --actuator F")
        assert result.exit_code == 1, name
        assert result.stderr.startswith(f"error: {name}: "), name
        assert result.stderr.count("\n") == 1, name


@pytest.mark.slow
@pytest.mark.parametrize("kind", few(["force", "velocity", "skyhook"], 1))
def test_isolation_with_feedback(run, kind):
    model = library.stewart_isolator()
    plant = isolation.actuated(model, "platform")
    law, gain = {"force": (isolation.force_feedback, 60.0), "velocity": (isolation.velocity_feedback, 200.0),
                 "skyhook": (isolation.skyhook, 100.0)}[kind]  # fmt: skip
    loop = plant.with_gains(law(plant, gain))
    data = json.loads(run(f"isolation stewart_isolator platform --feedback {kind} --gain {gain} --json").stdout)
    assert_allclose(data["closed_loop"]["damping_ratios"], loop.damping_ratios, rtol=1e-9)
    assert data["closed_loop"]["amplification"] == pytest.approx(loop.isolation().amplification, rel=1e-9)
    assert data["amplification"] == pytest.approx(isolation.study(model, "platform").amplification, rel=1e-12)


@pytest.mark.slow
def test_isolation_prints_and_draws_open_against_closed(run, tmp_path):
    result = run("isolation stewart_isolator platform --feedback force --gain 60 --leak 1 -o isolation.png")
    assert result.exit_code == 0
    assert result.stdout.count("Isolation of platform from ground") == 2
    assert "Stability margins: IFF" in result.stdout
    assert (tmp_path / "isolation.png").stat().st_size > 10_000
    assert mv.library.stewart_isolator().linearize().dof == 12
    refused = run("isolation stewart_isolator platform --feedback velocity --gain 60 --leak 1")
    assert (refused.exit_code, "leave --leak out" in refused.stderr) == (2, True)
