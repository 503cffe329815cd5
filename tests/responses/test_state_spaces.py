"""State spaces of matrices that come from elsewhere: modes, responses, zeros and norms."""

from pathlib import Path

import control
import mpmath
import numpy as np
import pytest
from numpy.testing import assert_allclose

import mbsvib as mv
from mbsvib import library
from tests.support import fast_digits

DATA = Path(__file__).parents[1] / "data" / "slicot.npz"


def random(n=8, seed=0, inputs=2, outputs=3, span=6):
    """Stable equations whose states have units that differ by twelve decades."""
    rng = np.random.default_rng(seed)
    a = rng.normal(size=(n, n)) - 4.0 * np.eye(n)
    size = 10.0 ** rng.uniform(-span, span, n)
    return mv.StateSpace.from_arrays(size[:, None] * a / size, size[:, None] * rng.normal(size=(n, inputs)),
                                     rng.normal(size=(outputs, n)) / size, 0)  # fmt: skip


def test_responses_in_40_digits():
    space = random()
    w = np.array([0.0, 0.3, 4.0, 100.0])
    with mpmath.workdps(40):
        a, b, c = (mpmath.matrix(x.tolist()) for x in (space.A, space.B, space.C))
        exact = [(c * fast_digits.solve(mpmath.mpc(0, x) * mpmath.eye(8) - a, b)).tolist() for x in w]
        truth = np.array(exact, dtype=complex).transpose(1, 2, 0)
        poles = np.array([complex(v) for v in fast_digits.eigenvalues(a)])
    assert_allclose(space.frequency_response(w), truth, rtol=1e-13)
    assert max(np.abs(space.poles() - p).min() / abs(p) for p in poles) < 1e-13
    assert (space.modes().errors < 1e-12).all()


@pytest.mark.parametrize("hold", ["zero", "first"])
def test_time_responses_against_python_control(hold):
    space = random()
    t = np.linspace(0.0, 3.0, 400)
    u = np.array([np.ones(400), np.sin(7.0 * t)])
    x0 = np.ldexp(1.0, np.round(np.log2(np.abs(space.B[:, 0]))).astype(int))
    found = space.time_response(t, u, hold, initial=x0)
    if hold == "first":
        theirs = control.forced_response(control.ss(space.A, space.B, space.C, space.D), t, u, x0).outputs
    else:
        step = control.c2d(control.ss(space.A, space.B, space.C, space.D), t[1] - t[0])
        theirs = control.forced_response(step, t, u, x0).outputs
    assert_allclose(found, theirs, rtol=1e-7, atol=1e-8 * np.abs(theirs).max())
    uneven = np.delete(t, [50, 51, 200])
    part = space.time_response(uneven, np.ones((2, 397)), initial=x0)
    assert_allclose(part, np.delete(space.time_response(t, np.ones((2, 400)), initial=x0), [50, 51, 200], axis=1),
                    rtol=1e-9, atol=1e-10 * np.abs(part).max())  # fmt: skip


def test_zeros_are_those_of_the_mechanism():
    system = library.stewart().linearize()
    for realization in ("physical", "modal", "balanced"):
        space = system.state_space(realization)
        exact = system.transmission_zeros("x", "Fx")
        found = space.transmission_zeros("x", "Fx")
        assert max(np.abs(found - z).min() / abs(z) for z in exact) < 1e-7
    even = random(inputs=2, outputs=2, span=0)
    theirs, zeros = control.ss(even.A, even.B, even.C, even.D).zeros(), random(inputs=2, outputs=2).transmission_zeros()
    assert len(zeros) == len(theirs) == 6
    for zero in zeros:  # whatever the units of the states
        assert np.abs(theirs - zero).min() < 1e-9 * abs(zero)


@pytest.mark.parametrize("unit", [1e-3, 1.0, 1e4])
@pytest.mark.parametrize("ports", [1, 2, 3])
def test_zeros_with_feedthrough(ports, unit):
    """D of the size of C A^-1 B, in any unit of time."""
    rng = np.random.default_rng(ports)
    a, b = unit * rng.normal(size=(5, 5)), unit * rng.normal(size=(5, ports))
    c, d = rng.normal(size=(ports, 5)), rng.normal(size=(ports, ports))
    expected = np.linalg.eigvals(a - b @ np.linalg.solve(d, c))
    zeros = mv.StateSpace.from_arrays(a, b, c, d).transmission_zeros()
    assert_allclose(np.sort_complex(zeros), np.sort_complex(expected), rtol=1e-9)


@pytest.mark.parametrize(("name", "value", "omega"), [
    ("build", 5.27633376e-3, 5.20607628), pytest.param("iss", 0.115555127, 0.775093, marks=pytest.mark.slow),
])  # fmt: skip
def test_peaks_of_the_slicot_benchmarks(name, value, omega):
    """Chahlaoui and Van Dooren (2002): the building and the space station."""
    data = np.load(DATA)
    size = len(data[f"{name}_B"])
    a = np.zeros((size, size))
    a[data[f"{name}_rows"], data[f"{name}_columns"]] = data[f"{name}_values"]
    space = mv.StateSpace.from_arrays(a, data[f"{name}_B"], data[f"{name}_C"], 0, name=name)
    norm = space.hinf_norm()
    assert norm.value == pytest.approx(value, rel=1e-7)
    assert norm.omega == pytest.approx(omega, rel=1e-5)
    grid = space.frequency_grid(space.outputs[0], space.inputs[0])
    assert np.abs(space.frequency_response(grid)).max() <= value * (1.0 + 1e-9)


def test_norms_in_closed_form():
    """1 / (s^2 + 2 z s + 1)."""
    z = 0.1
    space = mv.StateSpace.from_arrays([[0.0, 1.0], [-1.0, -2.0 * z]], [[0.0], [1.0]], [[1.0, 0.0]], 0)
    assert space.h2_norm().value == pytest.approx(np.sqrt(1.0 / (4.0 * z)), rel=1e-13)
    assert space.hinf_norm().value == pytest.approx(1.0 / (2.0 * z * np.sqrt(1.0 - z * z)), rel=1e-12)
    assert space.hinf_norm().omega == pytest.approx(np.sqrt(1.0 - 2.0 * z * z), rel=1e-7)
    assert space.modes().frequencies[0] == pytest.approx(0.5 / np.pi)
    assert space.modes().damping_ratios[0] == pytest.approx(z)


def test_names():
    space = random()
    assert (space.inputs, space.outputs[2], space.states[7]) == (("u1", "u2"), "y3", "x8")
    part = space["y[13]", "u2"]
    assert (part.outputs, part.inputs, part.B.shape, part.C.shape) == (("y1", "y3"), ("u2",), (8, 1), (2, 8))
    w = [1.0, 2.0]
    assert_allclose(part.frequency_response(w), space.frequency_response(w, ["y1", "y3"], "u2"))
    assert "8 states" in str(space.modes())
    theirs = control.ss([[-1.0]], [[1.0]], [[2.0]], [[0.0]], inputs=["force"], outputs=["way"], name="plant")
    taken = mv.StateSpace.from_control(theirs)
    assert (taken.name, taken.inputs, taken.outputs, taken.frequency_response([0.0])[0, 0, 0]) == (
        "plant", ("force",), ("way",), 2.0)  # fmt: skip
    system = library.stewart().linearize()
    assert type(system.state_space()) is mv.StateSpace
    assert system.state_space()["x", "Fx"].state_units == system.state_space().state_units


@pytest.mark.parametrize("empty", [[], [[]], np.zeros((0, 3))])
def test_a_static_gain_however_its_empty_matrices_are_written(empty):
    """Such as ``[]``, which files of JSON have for matrices without rows."""
    gain = mv.StateSpace.from_arrays(empty, [], empty, [[-6.0, 2.0]])
    assert (gain.A.shape, gain.B.shape, gain.C.shape, gain.states) == ((0, 0), (0, 2), (1, 0), ())
    assert_allclose(gain.frequency_response([3.0])[0, :, 0], [-6.0, 2.0])


DOUBLE = ([[0.0, 1.0], [0.0, 0.0]], [[0.0], [1.0]], [[1.0, 0.0]], 0)
REFUSALS = [
    (lambda: mv.StateSpace.from_arrays(np.eye(2), np.eye(3), np.eye(2), 0), r"A has shape \(2, 2\), B \(3, 3\)"),
    (lambda: mv.StateSpace.from_arrays(np.eye(2), np.eye(2), np.eye(2), 1.0), r"D has shape \(1, 1\); expected \(2, 2"),
    (lambda: mv.StateSpace.from_arrays([[1.0]], [[1.0]], [[1.0]], [[1.0], [2.0, 3.0]]), r"D = \[\[1.0\], \[2.0"),
    (lambda: mv.StateSpace.from_arrays([[np.inf]], [[1.0]], [[1.0]], 0), "A has shape .*finite"),
    (lambda: mv.StateSpace.from_arrays(*DOUBLE, inputs=["a", "b"]), "expected 1 name"),
    (lambda: mv.StateSpace.from_arrays(*DOUBLE).frequency_response([1.0, 0.0]), r"omega\[1\] = 0 rad/s is a pole"),
    (lambda: mv.StateSpace.from_arrays(*DOUBLE).hinf_norm(), "does not decay"),
    (lambda: mv.StateSpace.from_arrays(*DOUBLE).time_response([0, 1], [1, 1], initial=[1.0]), "expected 2 finite"),
    (lambda: mv.StateSpace.from_arrays([[-1.0]], [[1.0]], [[1.0]], [[2.0]]).h2_norm(), "'u1' acts directly on .*'y1'"),
    (lambda: mv.StateSpace.from_control(np.eye(2)), "expected a control.StateSpace"),
    (lambda: mv.StateSpace.from_arrays(*DOUBLE).state_space("modal"), "states are 'given'"),
]  # fmt: skip


def test_the_peak_may_be_at_infinite_frequency():
    norm = mv.StateSpace.from_arrays([[-1.0]], [[-3.0]], [[1.0]], [[2.0]]).hinf_norm()  # (2 s - 1) / (s + 1)
    assert (norm.value, norm.omega) == (2.0, np.inf)


@pytest.mark.parametrize(("ask", "message"), REFUSALS, ids=[message for _, message in REFUSALS])
def test_refusals(ask, message):
    with pytest.raises(mv.ResponseError, match=message):
        ask()


def test_a_pole_of_badly_scaled_states_is_recognized():
    """Free motion of a platform: rounding must not make a finite response of it."""
    model = mv.Model("free")
    model.add_body("b", 3.0, (1e-3, 1e-3, 1e-3))
    model.add_input("F", "b", "x")
    model.add_output("x", "b", "x")
    space = model.linearize().state_space()
    with pytest.raises(mv.ResponseError, match="is a pole"):
        space.frequency_response([0.0])


@pytest.mark.parametrize("realization", ["physical", "modal", "balanced"])
def test_what_acts_at_once_does_not_depend_on_the_states(realization):
    """A force moves its own mass at once and no other one; rounding of modes must not pass for a feedthrough."""
    model = mv.Model("five masses")
    for i in range(5):
        model.add_body(f"m{i}", 1.0 + 0.3 * i, (1, 1, 1), (0, 0, i))
        model.add_joint(f"guide{i}", "prismatic", "ground", f"m{i}", axis=(0, 0, 1))
        below = f"m{i - 1}" if i else "ground"
        model.add_spring(f"k{i}", below, f"m{i}", (0, 0, i - 1), (0, 0, i), 1e4 * 3**i, 2.0 * i)
        model.add_output(f"a{i}", f"m{i}", "z", quantity="acceleration")
    model.add_input("f", "m1", "z")
    model.add_base_motion("floor", "z")
    space = model.linearize().state_space(realization)
    expected = np.zeros((5, 2))
    expected[1, 0] = 1 / 1.3
    np.testing.assert_allclose(space.D, expected, rtol=1e-14, atol=0)


def test_a_gain_without_states_has_responses():
    gain = mv.StateSpace.from_arrays(np.zeros((0, 0)), np.zeros((0, 2)), np.zeros((1, 0)), [[2.0, 3.0]])
    assert gain.frequency_response([0.0, 5.0]).tolist() == [[[2.0, 2.0], [3.0, 3.0]]]
