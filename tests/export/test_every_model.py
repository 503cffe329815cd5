"""Every importer accepts every model of the library, and answers as the model does."""

import json
import shutil
import subprocess
from functools import cache

import numpy as np
import pytest

import mbsvib_export as mx
from mbsvib import library
from mbsvib_export.responses import check_points, response_error

MODELS = library.models()
# the cantilever has 120 coordinates, whose files take most of the time
SMALL_FIRST = [pytest.param(name, marks=pytest.mark.slow if name == "cantilever" else ()) for name in MODELS]
OCTAVE = shutil.which("octave-cli")


@cache
def system_of(name):
    return library.build(name).linearize()


@cache
def truth_of(name):
    system = system_of(name)
    omega = check_points(system.poles())[[0, -2, -1]]
    return omega, system.frequency_response(omega)


def error(name, response):
    omega, truth = truth_of(name)
    return response_error(response, truth, system_of(name), omega)


WRITERS = {"json": mx.to_json, "npz": mx.to_npz, "mat": mx.to_mat, "h5": mx.to_hdf5, "pch": mx.to_dmig,
           "op4": mx.to_op4, "fmu": mx.to_fmu}  # fmt: skip
NEEDS = {"h5": "h5py", "fmu": "fmpy"}


@pytest.mark.few(7)
@pytest.mark.parametrize("suffix", WRITERS)
@pytest.mark.parametrize("name", SMALL_FIRST)
def test_files_are_read_again(name, suffix, tmp_path):
    if suffix in NEEDS:
        pytest.importorskip(NEEDS[suffix])
    path = tmp_path / f"x.{suffix}"
    WRITERS[suffix](system_of(name), path)
    result = mx.check_export(path, system_of(name))
    assert result.passed, str(result)


@pytest.mark.few(7)
@pytest.mark.parametrize("name", MODELS)
def test_universal_files(name, tmp_path):
    omega, truth = truth_of(name)
    points, places = np.unique(omega, return_inverse=True)
    measured = mx.from_uff(mx.to_uff(system_of(name), tmp_path / "x.uff", points))
    assert error(name, measured.responses[..., places]) < 1e-9
    assert measured.outputs == system_of(name).outputs
    assert truth.any()


@pytest.mark.few(1)
@pytest.mark.parametrize("name", SMALL_FIRST)
def test_schema(name):
    import jsonschema

    jsonschema.validate(json.loads(mx.to_json(system_of(name))), mx.json_schema())


@pytest.mark.few(10)
@pytest.mark.parametrize("name", MODELS)
def test_python_control_and_scipy(name):
    omega, _ = truth_of(name)
    plant = mx.to_control(system_of(name), "modal")
    assert error(name, plant(1j * omega, squeeze=False)) < 1e-8
    assert [mx.SignalNames.to_mbsvib(item) for item in plant.input_labels] == list(system_of(name).inputs)
    other = mx.to_scipy(system_of(name), "modal")
    assert np.array_equal(other.A, plant.A)


@pytest.mark.few(10)
@pytest.mark.parametrize("name", MODELS)
def test_casadi(name):
    casadi = pytest.importorskip("casadi")
    system = system_of(name)
    made, space = mx.to_casadi(system, 1e-3), system.state_space()
    x, u = casadi.MX.sym("x", len(space.states)), casadi.MX.sym("u", len(space.inputs))
    rates, y = made.rates(x, u, [])
    result = casadi.Function("ABCD", [x, u], [casadi.jacobian(item, of) for item in (rates, y) for of in (x, u)])(0, 0)
    for label, item in zip("ABCD", result, strict=True):
        assert np.array_equal(item.full(), getattr(space, label)), label
    assert np.isfinite(made.step(np.ones(len(space.states)), 1.0, [])[0].full()).all()


@pytest.mark.skipif(OCTAVE is None, reason="octave-cli is not installed (apt-get install octave)")
def test_octave(tmp_path):
    for name in MODELS:
        mx.to_mat(system_of(name), tmp_path / f"{name}.mat")
    code = "".join(f"[p, m, w] = load_{name}(); printf('{name} %.3g %d\\n', w, size(p.A, 1)); " for name in MODELS)
    done = subprocess.run([OCTAVE, "--norc", "--eval", code], cwd=tmp_path, capture_output=True, text=True, check=False)
    result = {line.split()[0]: line.split()[1:] for line in done.stdout.splitlines()}
    assert list(result) == list(MODELS), done.stderr
    for name, (worst, states) in result.items():
        assert float(worst) < 1e-6
        assert int(states) == len(system_of(name).state_space().states)
