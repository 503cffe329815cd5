"""Time response: exact for inputs that are held or linear between the samples, whatever the step."""

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st
from numpy.testing import assert_allclose

import mbsvib as mv
from tests.modes.test_modes import oscillator
from tests.support import fast_digits
from tests.support.chains import stiff_chain
from tests.support.compare import linearized
from tests.support.digits import mp, product, solve
from tests.support.exact import Exact
from tests.support.random_models import closed_loops, open_trees, planar_loops, rebuilt, seeds, spatial
from tests.support.sizes import examples

SMALL = st.one_of(
    open_trees(kinds=st.just(("revolute", "universal", "prismatic", "screw"))),
    open_trees(kinds=st.just(("revolute", "universal", "prismatic", "screw")), damped=st.just(False)),
    closed_loops(), planar_loops(), planar_loops(damped=st.just(False)),
)  # fmt: skip


def exact_time_response(reference, t, u, hold="first", initial=None, names=None):
    """Step by step with matrix exponentials in 50 digits."""
    m, n = reference.dof, len(u)
    zero, single = mp.zeros(m, m).tolist(), mp.eye(m).tolist()
    right = solve(reference.M, [[*(-v for v in k), *(-v for v in c), *b] for k, c, b in
                                zip(reference.K, reference.C, reference.B, strict=True)])  # fmt: skip
    state = [mp.mpf(0)] * (2 * m)
    if initial is not None:
        change = reference.change(names)
        state = [row[0] for part in initial for row in product(change, [[mp.mpf(float(v))] for v in part])]
    top = [[*zero[i], *single[i], *[mp.mpf(0)] * (2 * n)] for i in range(m)]
    middle = [[*row, *[mp.mpf(0)] * n] for row in right]
    ramp = [[mp.mpf(j == 2 * m + n + i) for j in range(2 * m + 2 * n)] for i in range(n)]
    generator = mp.matrix(top + middle + ramp + mp.zeros(n, 2 * m + 2 * n).tolist())
    result = []
    for k, time in enumerate(t):
        if k:
            h = mp.mpf(float(time)) - mp.mpf(float(t[k - 1]))
            slope = [(mp.mpf(float(b)) - mp.mpf(float(a))) / h if hold == "first" else mp.mpf(0)
                     for a, b in zip(u[:, k - 1], u[:, k], strict=True)]  # fmt: skip
            full = mp.matrix([*state, *map(mp.mpf, map(float, u[:, k - 1])), *slope])
            state = list(fast_digits.exponential(generator * h) * full)[: 2 * m]
        now = [mp.mpf(float(v)) for v in u[:, k]]
        rate = product(right, [[v] for v in (*state, *now)]) if m else []
        columns = [[[v] for v in state[:m]], [[v] for v in state[m:]], rate, [[v] for v in now]]
        matrices = (reference.Cq, reference.Cv, reference.Ca, reference.D)
        parts = [product(a, b) for a, b in zip(matrices, columns, strict=True) if b]
        result.append([float(sum(part[i][0] for part in parts)) for i in range(len(reference.Cq))])
    return np.array(result).T


def close(result, expected, rtol=1e-10):
    size = np.abs(expected).max(axis=1, keepdims=True)
    assert (np.abs(result - expected) <= rtol * np.maximum(size, 1e-4 * size.max(initial=0))).all()


@pytest.mark.slow
@examples(10, slow=20)
@given(SMALL, seeds(), st.sampled_from(["first", "zero"]), st.booleans())
def test_against_the_reference(model, seed, hold, moving):
    """Uneven steps, all inputs at once, base motion included, at rest or moving at the start."""
    system, reference = linearized(model), Exact(model)
    assume(0 < system.dof <= 4)
    rng = np.random.default_rng(seed)
    t = 0.3 + np.cumsum(rng.uniform(0.001, 0.1, size=5))
    u = rng.normal(size=(len(system.inputs), len(t)))
    initial = rng.normal(size=(2, system.dof)) if moving else None
    expected = exact_time_response(reference, t, u, hold, initial, system.coordinates)
    close(system.time_response(t, u, hold=hold, initial=initial), expected)


def spring(ratio, m=2.0, omega=10.0):
    model = oscillator(m, 2 * ratio * m * omega, m * omega**2)
    return model, mp.mpf(model.springs["s"].damping) / (2 * m), mp.mpf(model.springs["s"].stiffness) / m


def impulse_integrals(half, square, m, t):
    """Step and ramp response of m (q'' + 2 half q' + square q) = u, by the complex roots in 50 digits."""
    root = mp.sqrt(half**2 - square)
    first, second = -half + root, -half - root
    if root == 0:
        step = (1 - mp.exp(first * t) * (1 - first * t)) / square
        ramp = t / square - (2 * half / square) / square + mp.exp(first * t) * (t + 2 / half) / square
    else:
        step = (1 - (first * mp.exp(second * t) - second * mp.exp(first * t)) / (first - second)) / square
        shape = (first**2 * mp.exp(second * t) - second**2 * mp.exp(first * t)) / (first - second)
        ramp = (t - 2 * half / square - shape / square) / square
    return float((step / m).real), float((ramp / m).real)


@pytest.mark.parametrize("ratio", [0.0, 1e-6, 0.05, 1 - 1e-9, 1.0, 1 + 1e-9, 4.0, 1e4])
def test_step_and_ramp_of_one_degree_of_freedom(ratio):
    model, half, square = spring(ratio)
    system = model.linearize()
    t = np.linspace(0, 3, 13)
    expected = np.array([impulse_integrals(half, square, 2, mp.mpf(float(x))) for x in t]).T
    rtol = 2e-14 if ratio < 10 else 1e-11  # the exponential of a step much longer than the fast root's time
    for hold in ("first", "zero"):
        step = system.time_response(t, np.ones_like(t), hold=hold)[0]
        assert_allclose(step, expected[0], rtol=0, atol=rtol * np.abs(expected[0]).max())
    ramp = system.time_response(t, t)[0]
    assert_allclose(ramp, expected[1], rtol=0, atol=rtol * np.abs(expected[1]).max())


def test_free_vibration_at_critical_damping():
    """q = (q0 + (v0 + omega q0) t) exp(-omega t)."""
    system = spring(1.0)[0].linearize()
    t = np.linspace(0, 2, 21)
    q = system.time_response(t, np.zeros_like(t), initial=([0.3], [-1.0]))
    assert_allclose(q[0], (0.3 + (-1.0 + 3.0) * t) * np.exp(-10 * t), rtol=0, atol=1e-15)


def test_rigid_mode():
    """A free mass under a constant force, and under one that grows."""
    system = oscillator(m=2.0).linearize()
    t = np.array([0.0, 0.5, 3.0, 1000.0])
    q, v, a = system.time_response(t, np.ones_like(t))
    assert_allclose((q, v, a), (t**2 / 4, t / 2, 0.5 + 0 * t), rtol=1e-15)
    q, v, a = system.time_response(t, t)
    assert_allclose((q, v, a), (t**3 / 12, t**2 / 4, t / 2), rtol=1e-15)
    q, v, _ = system.time_response(t, 0 * t, initial=([1.0], [2.0]))
    assert_allclose((q, v), (1 + 2 * t, 2 + 0 * t), rtol=1e-15)


def test_a_braked_mass_drifts_to_its_terminal_velocity():
    system = oscillator(m=2.0, c=4.0).linearize()
    t = np.array([0.0, 0.1, 1.0, 50.0])
    q, v, _ = system.time_response(t, np.ones_like(t))
    assert_allclose(v, -np.expm1(-2 * t) / 4, rtol=1e-13, atol=1e-17)
    assert_allclose(q, (t + np.expm1(-2 * t) / 2) / 4, rtol=1e-13, atol=1e-17)


def test_a_diverging_mode_grows_as_it_should():
    system = oscillator(m=2.0, k=-8.0).linearize()
    t = np.linspace(0, 5, 6)
    assert_allclose(system.time_response(t, 0 * t, initial=([1.0], [0.0]))[0], np.cosh(2 * t), rtol=1e-12)


@pytest.mark.slow
@examples(15, slow=25)
@given(SMALL, seeds())
def test_finer_samples_of_the_same_input_change_nothing(model, seed):
    """Exact for what is linear between the samples: a step of half the length gives the same."""
    system = linearized(model)
    rng = np.random.default_rng(seed)
    t = np.cumsum(rng.uniform(0.01, 0.3, size=12))
    u = rng.normal(size=(len(system.inputs), 12))
    fine = np.unique(np.concatenate((t, np.linspace(t[0], t[-1], 100), (t[1:] + t[:-1]) / 2)))
    between = np.array([np.interp(fine, t, row) for row in u])
    coarse = system.time_response(t, u)
    close(system.time_response(fine, between)[:, np.isin(fine, t)], coarse, rtol=1e-9)


@pytest.mark.parametrize("seed", range(5))
def test_a_sine_settles_on_the_frequency_response(seed):
    """After the transient, a finely sampled sine gives the amplitude and phase of G(i w)."""
    model = spatial(seed, bodies=2, kinds=("revolute", "universal"), damped=False)
    model = rebuilt(model, lambda part, words: words | {"damping": 0.02 * np.array(words["stiffness"])}
                    if "stiffness" in words else words)  # fmt: skip
    system = model.linearize()
    values = system.modes().eigenvalues
    w = 1.1 * np.abs(values).min()
    t = np.arange(0, 20 / -values.real.max() + 2 * np.pi / w, 2 * np.pi / w / 128)
    u = np.zeros((len(system.inputs), len(t)))
    u[0] = np.sin(w * t)
    y = system.time_response(t, u)[:, -128:]
    g = system.frequency_response([w])[:, 0]
    # between its samples a sine is linear to (w h)^2 / 8 only, and the kinks are answered at all higher frequencies
    gain = np.abs(system.frequency_response(np.geomspace(w, 1e3 * w, 500))[:, 0]).max(axis=1)
    error = np.abs(y - (g * np.exp(1j * w * t[-128:])).imag).max(axis=1)
    assert (error <= (2 * np.pi / 128) ** 2 / 8 * gain + 1e-8 * np.abs(g).max()).all()


@pytest.mark.slow
@examples(12, slow=28)
@given(SMALL, seeds())
def test_superposition_and_shift_of_time(model, seed):
    system = linearized(model)
    rng = np.random.default_rng(seed)
    t = np.linspace(0, 1, 9)
    u = rng.normal(size=(2, len(system.inputs), 9))
    first, second = (system.time_response(t, part) for part in u)
    close(system.time_response(t, 2 * u[0] - 3 * u[1]), 2 * first - 3 * second, rtol=1e-11)
    close(system.time_response(t + 8.0, u[0]), first, rtol=1e-10)


@pytest.mark.parametrize("start", [0.0, 1e3, 1e5])
def test_time_stamps_far_from_zero_do_not_drift(start):
    """Each stamp is rounded by itself; taken for one length, 20 000 rounded steps must not add up."""
    system = spring(0.001)[0].linearize()
    t = start + np.arange(20_001) * 1e-3
    q = system.time_response(t, 0 * t, initial=([1.0], [0.0]))[0]
    value = system.modes().eigenvalues[0]
    exact = (np.exp(value * (t - start)) * (1 + 1j * value.real / value.imag)).real
    assert np.abs(q - exact).max() < 1e-12 + 1e-13 * start  # 10 rad/s, and the rounding of one stamp


def test_many_decades():
    model = stiff_chain(4, 8, 4, damped=True)
    model.add_input("f", "b3", "z")
    model.add_output("x", "b0", "z")
    system, reference = model.linearize(), Exact(model)
    slow = 2 * np.pi / np.sqrt(reference.squares[0])
    t = np.linspace(0, slow, 4)
    u = np.ones((1, 4))
    close(system.time_response(t, u), exact_time_response(reference, t, u), rtol=1e-9)


def test_shapes_and_kinds_of_input():
    system = oscillator(k=2.0).linearize()
    expected = system.time_response(np.arange(4.0), np.ones((1, 4)))
    assert expected.shape == (3, 4)
    for t, u in (([0, 1, 2, 3], [1, 1, 1, 1]), (range(4), [[1, 1, 1, 1]]), ((0, 1, 2, 3), np.ones(4, int))):
        assert_allclose(system.time_response(t, u), expected, atol=0)
    assert system.time_response([5.0], [1.0]).shape == (3, 1)


@pytest.mark.parametrize(("t", "u"), [
    ([0, 1, 1], [0, 0, 0]), ([0, 2, 1], [0, 0, 0]), ([0, np.nan], [0, 0]), ([0, np.inf], [0, 0]), ([], []),
    ([[0, 1]], [0, 0]), ([0, 1], [0, 0, 0]), ([0, 1], [[0, 0], [0, 0]]), ([0, 1], [0, np.nan]), (1.0, [0]),
    ([0, 1], 3.0), ("ab", [0, 0]), ([0, 1], "ab"), ([0, 1], None),
])  # fmt: skip
def test_bad_times_and_inputs_are_refused(t, u):
    with pytest.raises(mv.ResponseError, match=r"time_response: [tu] "):
        oscillator(k=1.0).linearize().time_response(t, u)


@pytest.mark.parametrize("initial", [([0.0],), ([0.0, 1.0], [0.0, 1.0]), ([0.0], [np.nan]), 3.0, "rest",
                                     ([0.0], [0.0], [0.0])])  # fmt: skip
def test_bad_initial_states_are_refused(initial):
    with pytest.raises(mv.ResponseError, match="time_response: initial"):
        oscillator(k=1.0).linearize().time_response([0, 1], [0, 0], initial=initial)


@pytest.mark.parametrize("hold", ["linear", None, 1, "First"])
def test_unknown_holds_are_refused(hold):
    with pytest.raises(mv.ResponseError, match=r"hold = .*'zero' or 'first'"):
        oscillator(k=1.0).linearize().time_response([0, 1], [0, 0], hold=hold)
