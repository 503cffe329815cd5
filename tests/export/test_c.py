"""Source text in C: compiled, it gives the responses of the system; its test vectors find a wrong coefficient."""

import ctypes
import re
import shutil
import subprocess

import control
import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.signal import lfilter

import mbsvib as mv
import mbsvib_export as mx
from mbsvib.isolation import controller

FLAGS = ("-std=c99", "-O2", "-Wall", "-Wextra", "-Wconversion", "-Wpedantic", "-Werror")
pytestmark = pytest.mark.skipif(shutil.which("gcc") is None, reason="needs gcc")


def compiled(files, *flags, output="program"):
    program = files.source.with_name(output)
    subprocess.run(["gcc", *FLAGS, *flags, files.source, files.test, "-o", program], check=True, capture_output=True)
    return program


def library(files, real):
    """The compiled functions, called sample by sample."""
    shared = files.source.with_suffix(".so")
    subprocess.run(["gcc", *FLAGS, "-shared", "-fPIC", files.source, "-o", shared], check=True, capture_output=True)
    code, prefix = ctypes.CDLL(str(shared)), files.source.stem

    def run(u, outputs, states):
        kind = np.dtype(real)
        state, y = np.full(max(states, 1), np.nan, kind), np.zeros(outputs, kind)
        getattr(code, f"{prefix}_reset")(state.ctypes)
        result = np.empty((outputs, u.shape[1]))
        for k in range(u.shape[1]):
            sample = np.ascontiguousarray(u[:, k], kind)
            getattr(code, f"{prefix}_outputs")(state.ctypes, sample.ctypes, y.ctypes)
            early = y.copy()
            getattr(code, f"{prefix}_step")(state.ctypes, sample.ctypes, y.ctypes)
            assert (early == y).all()
            result[:, k] = y
        return result

    return run


@pytest.mark.few(1)
@pytest.mark.parametrize("name", ["stewart_isolator", "quarter_car", "cantilever", "rotor_stator", "wafer_stage"])
def test_the_compiled_code_gives_the_response(name, tmp_path):
    """Held inputs: the exact response of the mechanism, as the core computes it mode by mode."""
    system = getattr(mv.library, name)().linearize()
    modes = system.modes()
    step = 0.2 / max(abs(modes.eigenvalues).min(), 1.0)
    files = mx.to_c(system, tmp_path, step)
    done = subprocess.run([compiled(files)], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout
    u = np.random.default_rng(7).normal(size=(len(system.inputs), 400))
    y = library(files, float)(u, len(system.outputs), len(modes.eigenvalues))
    expected = system.time_response(step * np.arange(400), u, hold="zero")
    size = np.abs(expected).max(axis=1, keepdims=True)
    assert_allclose(y / size, expected / size, rtol=0, atol=1e-12)


def test_linear_inputs(tmp_path):
    system = mv.library.quarter_car().linearize()
    t = 2e-3 * np.arange(300)
    u = np.random.default_rng(3).normal(size=(len(system.inputs), 300))
    u[:, 0] = 0.0  # the states of a first-order hold begin at -slope u(0)
    y = library(mx.to_c(system, tmp_path, 2e-3, method="foh"), float)(u, len(system.outputs), 4)
    expected = system.time_response(t, u, hold="first")
    size = np.abs(expected).max(axis=1, keepdims=True)
    assert_allclose(y / size, expected / size, rtol=0, atol=1e-12)


@pytest.mark.few(1)
@pytest.mark.parametrize("realization", ["physical", "balanced"])
def test_other_states_give_the_same(realization, tmp_path):
    system = mv.library.quarter_car().linearize()
    u = np.random.default_rng(5).normal(size=(len(system.inputs), 50))
    one, two = (library(mx.to_c(system, tmp_path / kind, 1e-3, realization=kind), float)(u, len(system.outputs), 4)
                for kind in ("modal", realization))  # fmt: skip
    assert_allclose(one, two, rtol=0, atol=1e-11 * np.abs(one).max())


@pytest.mark.slow
def test_controllers_go_by_tustins_rule(tmp_path):
    """The frequency response of the code is that of the controller at 2/h tan(w h/2)."""
    a, b, c, d = np.array([[0.0, 1.0], [-900.0, -12.0]]), np.array([[0.0], [1.0]]), np.array([[40.0, 3.0]]), [[0.5]]
    law = controller(mv.StateSpace("k", "controller", a, b, c, np.array(d), np.zeros((0, 2)), ("a", "b"), ("", ""),
                                   ("y",), ("m",), ("u",), ("N",)), ["y"], ["u"], "notch filter")  # fmt: skip
    h, samples = 1e-2, 4096
    files = mx.to_c(law, tmp_path, h)
    assert files.source.name == "notch_filter.c"
    impulse = np.zeros((1, samples))
    impulse[0, 0] = 1.0
    y = library(files, float)(impulse, 1, 2)[0]
    omega = 2 * np.pi * np.fft.rfftfreq(samples, h)[1:-1]
    warped = 2 / h * np.tan(omega * h / 2)
    assert_allclose(np.fft.rfft(y)[1:-1], law.at(1j * warped)[:, 0, 0], rtol=1e-10)


def test_a_controller_with_chosen_ports_goes_by_tustins_rule(tmp_path):
    """Choosing ports does not make another kind of system of it, whose default would be inputs that are held."""
    law = controller([[2.0, 0.0], [0.0, -3.0]], ["a", "b"], ["f", "g"], "gain")
    assert "Tustin's rule; 0 states" in mx.to_c(law, tmp_path, outputs="f").header.read_text()


@pytest.mark.slow
def test_gains_have_no_states(tmp_path):
    files = mx.to_c(controller([[2.0, 0.0], [0.0, -3.0]], ["a.b", "a b"], ["f", "g"], "gain"), tmp_path)
    assert subprocess.run([compiled(files)], check=False).returncode == 0
    text = files.header.read_text()
    assert "#define GAIN_IN_A_B_0 0 /* a.b */" in text
    assert "#define GAIN_IN_A_B_1 1 /* a b */" in text
    assert_allclose(library(files, float)(np.array([[1.0], [1.0]]), 2, 0)[:, 0], [2.0, -3.0])


@pytest.mark.slow
def test_single_precision(tmp_path):
    system = mv.library.stewart_isolator().linearize()
    files = mx.to_c(system, tmp_path, 1e-3, precision="single")
    assert subprocess.run([compiled(files)], check=False).returncode == 0
    u = np.random.default_rng(7).normal(size=(len(system.inputs), 200))
    y = library(files, np.float32)(u, len(system.outputs), 2 * system.dof)
    expected = system.time_response(1e-3 * np.arange(200), u, hold="zero")
    size = np.abs(expected).max(axis=1, keepdims=True)
    assert 1e-9 < np.abs((y - expected) / size).max() < 1e-4


@pytest.mark.slow
def test_a_wrong_coefficient_is_found(tmp_path):
    files = mx.to_c(mv.library.quarter_car().linearize(), tmp_path, 1e-3)
    text = files.source.read_text()
    start = text.index("{", text.index("next_value")) + 1
    value = text[start : text.index(",", start)].strip()
    for wrong in (float(value) * (1 + 1e-9), -float(value)):
        files.source.write_text(text.replace(value, repr(wrong)))
        done = subprocess.run([compiled(files)], capture_output=True, text=True, check=False)
        assert done.returncode == 1
        assert "FAILED" in done.stdout


@pytest.mark.slow
@pytest.mark.skipif(shutil.which("g++") is None, reason="needs g++")
def test_the_header_serves_cpp(tmp_path):
    files = mx.to_c(mv.library.quarter_car().linearize(), tmp_path)
    (tmp_path / "main.cpp").write_text('#include "quarter_car.h"\nint main() { quarter_car_state s; '
                                       'quarter_car_reset(&s); return static_cast<int>(s.x[0]); }\n')
    subprocess.run(["gcc", "-c", files.source, "-o", tmp_path / "q.o"], check=True)
    subprocess.run(["g++", "-Wall", "-Werror", tmp_path / "main.cpp", tmp_path / "q.o", "-o", tmp_path / "m"],
                   check=True)  # fmt: skip
    assert subprocess.run([tmp_path / "m"], check=False).returncode == 0


@pytest.mark.parametrize(("precision", "real"), [("single", np.float32), ("double", np.float64)])
def test_the_tolerance_allows_the_rounding_of_right_code(precision, real, tmp_path):
    """x+ = 0.3 u, y = 0.7 x: each product rounds by half an eps; a tolerance far above that would pass wrong code."""
    one = np.eye(1)
    law = controller(mv.StateSpace("k", "controller", -1e6 * one, 0.3e6 * one, 0.7 * one, 0 * one, np.zeros((0, 1)),
                                   ("a",), ("",), ("y",), ("m",), ("u",), ("N",)), ["y"], ["u"], "fast")  # fmt: skip
    text = mx.to_c(law, tmp_path, 1e-4, method="zoh", precision=precision).test.read_text()
    tolerance = float(re.search(r"tolerance.*\{\s*([^f\s]+)", text)[1])
    u = np.array([float(word) for word in re.findall(r"\{([-0-9.]+)f?\}", text.partition("expected")[0])])
    size, eps = 0.21 * np.abs(u).max(), float(np.finfo(real).eps)
    assert 1.5 * eps * size < tolerance < 20 * eps * size


def tolerances_and_sizes(files):
    text = files.test.read_text()
    vectors = re.findall(r"\{([^{}]+)\}", text[text.index("expected[") : text.index("tolerance[")])
    expected = np.array([[float(word.rstrip("f")) for word in re.split(r",\s*", row)] for row in vectors])
    words = re.split(r",\s*", re.search(r"tolerance\[\w+\] = \{\s*([^}]*?)\s*\}", text)[1])
    return np.array([float(word.rstrip("f")) for word in words]), np.abs(expected).max(axis=0)


@pytest.mark.slow
@pytest.mark.parametrize(("name", "precision", "limit"), [
    ("cantilever", "double", 1e-7), ("stewart_isolator", "double", 1e-9), ("quarter_car", "double", 1e-11),
    ("stewart_isolator", "single", 1e-1),
])  # fmt: skip
@pytest.mark.parametrize("step", [1e-3, 1e-2])
def test_the_tolerance_stays_small_in_coupled_states(name, precision, limit, step, tmp_path):
    """The magnitudes of entries of A grow as powers, to 1e50 here; those of A^j do not where the system is stable."""
    system = getattr(mv.library, name)().linearize()
    files = mx.to_c(system, tmp_path, step, realization="physical", precision=precision)
    tolerance, size = tolerances_and_sizes(files)
    assert (tolerance < limit * size).all()
    assert subprocess.run([compiled(files)], check=False).returncode == 0


def oscillator(stiffness, damping, gain=1.0):
    a = [[0, 1], [-stiffness, -damping]]
    return mv.StateSpace.from_arrays(a, [[0], [1]], [[gain, 0]], [[0]], name="oscillator")


def test_coefficients_of_32_bits_that_change_the_response_are_named(tmp_path):
    """x'' + 2 zeta w x' + w^2 x = u, w h = 1e-4: 1 - w^2 h^2 / 2 = 1 - 5e-9 has no digits in 32 bits."""
    with pytest.warns(mv.errors.AccuracyWarning, match=r"'oscillator' by up to 0\.\d+ of its size. Take a longer step"):
        mx.to_c(oscillator(100.0, 0.02), tmp_path, 1e-5, precision="single")
    mx.to_c(oscillator(100.0, 0.02), tmp_path, 1e-2, precision="single")
    with pytest.warns(mv.errors.AccuracyWarning, match="by up to 1 of its size"):
        mx.to_c(oscillator(100.0, 2.0, 1e-50), tmp_path, 1e-2, precision="single")    # below all numbers of 32 bits


def test_coefficients_of_32_bits_that_grow_are_refused(tmp_path):
    """h = 10 us, decay 2.5e-4 1/s: e^(-2.5e-9) of each step is 1 in 32 bits, and the rounding of the rest decides."""
    with pytest.raises(mv.ExportError, match=r"'oscillator' is stable, and its coefficients of 32 bits grow, by 5e-09"):
        mx.to_c(oscillator(100.0, 5e-4), tmp_path, 1e-5, precision="single")
    assert not list(tmp_path.iterdir())


def test_files_of_others_stay(tmp_path):
    system = mv.library.quarter_car().linearize()
    mx.to_c(system, tmp_path)
    mx.to_c(system, tmp_path, 1e-3)
    (tmp_path / "quarter_car_test.c").write_text("int main(void) { return 0; }\n")
    before = (tmp_path / "quarter_car.c").read_text()
    with pytest.raises(mv.ExportError, match=r"quarter_car_test\.c: this file is there already"):
        mx.to_c(system, tmp_path)
    assert (tmp_path / "quarter_car.c").read_text() == before
    mx.to_c(mv.library.quarter_car().linearize(), tmp_path, name="other")


@pytest.mark.slow
def test_odd_names_compile(tmp_path):
    model = mv.Model('a*/ "b" \\ ü ??/')
    model.add_body("m", 1.0, (1, 1, 1))
    model.add_joint("j", "prismatic", "ground", "m", axis=(0, 0, 1))
    model.add_spring("k", "ground", "m", start=(0, 0, -1), end=(0, 0, 0), stiffness=10.0)
    model.add_input("*/ 1", "m", "z")
    model.add_output("ü", "m", "z")
    files = mx.to_c(model.linearize(), tmp_path, 0.01, name="plain")
    assert subprocess.run([compiled(files)], check=False).returncode == 0


@pytest.mark.parametrize("names", [["a b", "a_b", "a_b_0"], ["é", "0"],
                                   ["a", "A", "a_0", "A 0", "a_0_0", "a_0_2", "ü", "6"]])  # fmt: skip
def test_indices_have_names_of_their_own(names, tmp_path):
    """A name that is defined twice compiles with a warning, and leads to the signal of the last one."""
    gains = controller(np.ones((1, len(names))), names, ["f"], "gain")
    text = mx.to_c(gains, tmp_path).header.read_text()
    assert re.findall(r"#define GAIN_IN_\w+ (\d+) ", text) == [str(i) for i in range(len(names))]
    assert len(set(re.findall(r"#define (GAIN_IN_\w+)", text))) == len(names)


@pytest.mark.parametrize(("words", "message"), [
    ({"step": 0.0}, "step = 0.0; expected a positive number"), ({"method": "euler"}, "'zoh', 'foh' or 'tustin'"),
    ({"precision": "half"}, "expected 'double' or 'single'"), ({"name": "1a"}, "no digit first"),
    ({"folder": "/nowhere/deep/down"}, "Give a folder that exists"), ({"realization": "odd"}, "odd"),
])  # fmt: skip
def test_refusals(words, message, tmp_path):
    with pytest.raises(mv.MbsvibError, match=message):
        mx.to_c(mv.library.quarter_car().linearize(), **{"folder": tmp_path} | words)
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("kind", [control.ss, control.tf])
@pytest.mark.parametrize("precision", ["double", "single"])
def test_discrete_controllers_of_python_control_are_written_as_they_are(kind, precision, tmp_path):
    """A notch and an integrator at 2 kHz, by their difference equation."""
    numerator, denominator = [0.9, -1.6, 0.85], [1.0, -1.5, 0.5]
    law = kind(control.tf(numerator, denominator, 1.0 / 2000.0, inputs=["leg:x"], outputs=["leg:f"]), name="law")
    files = mx.to_c(law, tmp_path, precision=precision)
    assert "step 0.0005 s, as given in discrete time" in files.source.read_text()
    assert "LAW_IN_LEG_X 0 /* leg.x */" in files.header.read_text()
    subprocess.run([compiled(files)], check=True)
    u = np.random.default_rng(3).normal(size=(1, 200))
    y = library(files, float if precision == "double" else np.float32)(u, 1, 2)
    expected = lfilter(numerator, denominator, u[0])
    assert_allclose(y[0], expected, rtol=0.0, atol=(1e-13 if precision == "double" else 1e-4))
    assert mx.to_c(law, tmp_path, 1.0 / 2000.0, outputs="leg.f").source == files.source


def test_discrete_controllers_have_no_other_step_and_no_method(tmp_path):
    law = control.ss([[0.5]], [[1.0]], [[1.0]], [[0.0]], 1e-3, name="law")
    for words in ({"step": 1e-4}, {"method": "zoh"}, {"step": 0.0}):
        with pytest.raises(mv.ExportError, match=r"'law' is discrete, dt = 0.001 s, and written as it is; expected"):
            mx.to_c(law, tmp_path, **words)
    with pytest.raises(mv.ResponseError, match=r"discrete without a sample time; expected dt in seconds"):
        mx.to_c(control.ss(law, dt=True), tmp_path)


def test_a_system_without_inputs_is_refused(tmp_path):
    with pytest.raises(mv.ExportError, match=r"has no inputs \(model.add_input\)"):
        mx.to_c(mv.library.chain(3).with_parts(inputs={}).linearize(), tmp_path)
