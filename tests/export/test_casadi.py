"""Functions of CasADi: values, derivatives to parameters, and steps against the toolbox's own at other values."""

import shutil
import subprocess
import sys

import numpy as np
import pytest
from scipy.linalg import expm

import mbsvib as mv
import mbsvib_export as mx
from mbsvib import library
from tests.export.plants import same_bits, slider, stewart, stiff_model
from tests.export.test_massless import plant as massless

casadi = pytest.importorskip("casadi", reason="CasADi is not installed: pip install 'mbsvib[casadi]'")
PARAMETERS = ("leg*.k.stiffness", "leg1.k.damping", "platform.mass")


@pytest.fixture(scope="module")
def tuned():
    return mx.to_casadi(stewart(), 1e-3, PARAMETERS)


def place(n, i, seed=0):
    rng = np.random.default_rng(seed)
    return rng.standard_normal(n), rng.standard_normal(i)


def close(result, truth, rtol):
    result = result.full().ravel()
    assert np.abs(result - truth).max(initial=0.0) <= rtol * np.abs(truth).max(initial=0.0)


@pytest.mark.parametrize("realization", ["physical", "modal", "balanced"])
@pytest.mark.parametrize("make", [stewart, slider, massless, lambda: slider((), ()), lambda: slider(locked=True)])
def test_without_parameters_the_matrices_are_those_of_the_state_space(make, realization):
    system = make()
    space, made = system.state_space(realization), mx.to_casadi(system, 1e-3, realization=realization)
    n, i = space.B.shape
    x, u = place(n, i)
    rates, y = made.rates(x, u, np.zeros(0))
    close(rates, space.A @ x + space.B @ u, 1e-14)
    close(y, space.C @ x + space.D @ u, 1e-13)
    full = expm(np.block([[space.A, space.B], [np.zeros((i, n + i))]]) * 1e-3)
    close(made.step(x, u, np.zeros(0))[0], full[:n] @ np.concatenate([x, u]), 1e-10)
    assert (made.states, made.inputs, made.outputs) == (space.states, space.inputs, space.outputs)
    assert made.state_units == space.state_units


def test_names_of_functions():
    made = mx.to_casadi(stewart(), 1e-3)
    assert made.rates.name_in() == made.step.name_in() == ["x", "u", "p"]
    assert made.rates.name_out() == ["xdot", "y"]
    assert made.step.name_out() == ["x_next", "y"]
    assert made.rates.is_a("MXFunction")
    assert mx.to_casadi(stewart()).step is None
    assert "12 states, 15 inputs, 24 outputs, 0 parameters" in repr(made)


@pytest.mark.parametrize("factor", [1.0, 0.3, 4.0])
def test_other_parameters_give_the_system_of_these(tuned, factor):
    values = tuned.values * factor ** np.linspace(0.5, 1.0, 8)
    origin = library.stewart(ports="all")
    system = origin.with_values(dict(zip(tuned.parameters, values, strict=True))).linearize()
    for label, result in zip(tuned.matrices.name_out(), tuned.matrices(values), strict=True):
        truth = getattr(system, label)
        assert np.abs(result.full() - truth).max(initial=0.0) <= 1e-12 * np.abs(truth).max(initial=0.0), label
    space = system.state_space()
    x, u = place(12, 15)
    rates, y = tuned.rates(x, u, values)
    close(rates, space.A @ x + space.B @ u, 1e-13)
    close(y, space.C @ x + space.D @ u, 1e-13)
    t = np.array([0.0, 1e-3])
    modal = system.state_space("modal")
    complete = expm(np.block([[modal.A, modal.B], [np.zeros((15, 27))]]) * t[1])
    start = np.linalg.solve(modal.transform, x)
    close(tuned.step(x, u, values)[0], modal.transform @ (complete[:12] @ np.concatenate([start, u])), 1e-11)


def test_derivatives_to_parameters(tuned):
    """Of the step by central differences; those of K are constant."""
    x, u, p = (casadi.MX.sym(name, size) for name, size in (("x", 12), ("u", 15), ("p", 8)))
    slope = casadi.Function("slope", [x, u, p], [casadi.jacobian(tuned.step(x, u, p)[0], p)])
    at, given = place(12, 15)
    result = slope(at, given, tuned.values).full()
    for k in (0, 6, 7):
        h = 1e-4 * tuned.values[k]
        shift = h * np.eye(8)[k]
        ends = [tuned.step(at, given, tuned.values + sign * shift)[0].full().ravel() for sign in (1, -1)]
        assert np.abs(result[:, k] - (ends[0] - ends[1]) / (2 * h)).max() < 1e-6 * np.abs(result[:, k]).max()
    stiffness = casadi.Function("K", [p], [casadi.jacobian(tuned.matrices(p)[2], p)])
    np.testing.assert_array_equal(stiffness(tuned.values).full(), stiffness(3 * tuned.values).full())
    assert stiffness(0).full()[:, :6].any(axis=0).all()
    assert not stiffness(0).full()[:, 6:].any()


def test_units_and_values_of_parameters(tuned):
    assert tuned.parameters[0] == "leg1.k.stiffness"
    assert tuned.parameter_units == ("N/m",) * 6 + ("N s/m", "kg")
    assert tuned.values.tolist() == [20e6] * 6 + [20.0, 1.0]
    assert "8 parameters" in repr(tuned)


def test_badly_scaled_states_keep_their_digits():
    system = stiff_model().linearize()
    made = mx.to_casadi(system, 1e-4, "ka.stiffness")
    x, u = place(4, 1)
    close(made.step(x, u, 1e2)[0], mx.to_casadi(system, 1e-4).step(x, u, np.zeros(0))[0].full().ravel(), 1e-10)


@pytest.mark.parametrize(
    ("make", "options", "message"),
    [
        (stewart, {"parameters": "leg1.k.start.x"}, "'leg1.k.start.x' cannot be tuned, as the equations"),
        (stewart, {"parameters": "leg1.k.stiffness", "realization": "modal"}, "would change what the states are"),
        (stewart, {"parameters": "leg1.k.stiffness", "step": -1.0}, "step = -1.0; expected a positive number"),
        (stewart, {"parameters": 3}, "to_casadi: parameters = 3; expected a name, or a list of names"),
        (stewart, {"step": 0.0}, "to_casadi: step = 0.0; expected a positive number"),
        (massless, {"parameters": "*stiffness*"}, "motions that move no mass"),
        (lambda: stewart().state_space(), {"parameters": ["leg1.k.stiffness"]}, "StateSpace knows no parameters"),
        (lambda: library.stewart(), {}, "to_casadi: system = Model"),
    ],
)
def test_what_is_refused(make, options, message):
    with pytest.raises(mv.ExportError, match=message):
        mx.to_casadi(make(), **options)


def test_unknown_parameters_and_a_missing_package(monkeypatch):
    with pytest.raises(mv.ModelError, match=r"leg1\.k\.stiffnes"):
        mx.to_casadi(stewart(), parameters="leg1.k.stiffnes")
    monkeypatch.setitem(sys.modules, "casadi", None)
    with pytest.raises(mv.ExportError, match=r'pip install "mbsvib\[casadi\]"'):
        mx.to_casadi(stewart())


def test_files_go_on_to_casadi(tmp_path):
    system = stewart()
    made = mx.to_casadi(mx.from_npz(mx.to_npz(system, tmp_path / "x.npz")))
    x = casadi.MX.sym("x", 12)
    result = casadi.Function("A", [x], [casadi.jacobian(made.rates(x, np.zeros(15), np.zeros(0))[0], x)])(0).full()
    assert same_bits(result + 0.0, system.state_space().A + 0.0)


@pytest.mark.slow
@pytest.mark.skipif(shutil.which("gcc") is None, reason="gcc is not installed")
def test_c_code_steps_as_casadi_does(tmp_path, monkeypatch):
    made = mx.to_casadi(slider(), 1e-3, ["k.stiffness", "mass.mass"])
    monkeypatch.chdir(tmp_path)
    made.step.generate("step.c")
    subprocess.run(["gcc", "-shared", "-fPIC", "step.c", "-o", "step.so", "-lm"], check=True)
    result = casadi.external("step", str(tmp_path / "step.so"))([0.1, 0.2], 1.0, 1.1 * made.values)[0]
    close(result, made.step([0.1, 0.2], 1.0, 1.1 * made.values)[0].full().ravel(), 1e-14)


def test_batches_and_sparse_systems_are_refused_with_the_way_to_one():
    batch = library.stewart().linearize(values={"leg1.k.stiffness": [1e7, 2e7]})
    with pytest.raises(mv.ExportError, match=r"batch of 2 variants; export them one by one, to_casadi\(batch\[i\]\)"):
        mx.to_casadi(batch)
    with pytest.raises(mv.ExportError, match=r"held sparse; export some of its modes, to_casadi\("):
        mx.to_casadi(library.chain(3).linearize(method="sparse"), parameters="*.mass")
