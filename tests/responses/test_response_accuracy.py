"""Responses at their hardest: light damping, many modes, far above resonance, long records, dependent eigenvectors."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

import mbsvib as mv
from mbsvib.responses.frequency_response import conditions, direct_solutions, refined_solutions, trusted
from mbsvib.responses.rounding import ROUNDING, Noise
from mbsvib.responses.time_response import _by_exponential
from tests.responses.test_time_response import exact_time_response
from tests.support.exact import Exact
from tests.support.sliding_chain import chain_response, sliding_chain

CHUNK = 1024  # samples: a quarter of what is held otherwise


def random_chain(n, ratio, classical, seed=0):
    """Masses and stiffness over a decade each; the lowest damping ratio is ``ratio``."""
    rng = np.random.default_rng(seed)
    k, m = 10.0 ** (4 + rng.uniform(0, 1, n)), 10.0 ** rng.uniform(0, 1, n)
    c = k if classical else rng.uniform(0, 1, n) * np.sqrt(k * m)
    lowest = sliding_chain(m, k, 1e-6 * c).linearize().modes().damping_ratios.min()
    return m, k, c * 1e-6 * ratio / lowest


@pytest.mark.slow
@pytest.mark.parametrize("classical", [True, False])
def test_ten_digits_at_resonances_of_two_hundred_modes(classical):
    """Damping ratios from 5e-5: an error of a frequency counts ten thousand times at its resonance."""
    data = random_chain(200, 5e-5, classical)
    inputs, outputs = (0, 100, 199), [("displacement", 199), ("velocity", 100), ("acceleration", 0)]
    system = sliding_chain(*data, inputs, outputs).linearize()
    modes = system.modes()
    assert bool(modes.classical) == classical
    assert modes.damping_ratios.min() == pytest.approx(5e-5, rel=1e-6)
    turn = 2 * np.pi * modes.damped_frequencies
    low = np.argsort(modes.damping_ratios)[:3]
    omega = np.concatenate((turn[low], turn[low] * (1 + 5e-5), turn[[5, 50, 120, 199]], turn[0] * np.array([1e-3, 30])))
    expected = np.stack([chain_response(*data, 1j * w, inputs, outputs) for w in omega], axis=-1)
    error = np.abs(system.frequency_response(omega) - expected) / np.abs(expected).max(axis=1, keepdims=True)
    assert error[:, :, :6].max() < 2e-11
    assert error[:, :, 6:].max() < 1e-12
    if not classical:
        assert trusted(system.basis.modal, system.basis.modal.shapes.T @ system.B, omega)


@pytest.mark.parametrize("classical", [True, False])
@pytest.mark.parametrize("free", [True, False])
def test_digits_far_above_the_modes(classical, free):
    """Sums over modes that cancel there: what decides is taken out of them beforehand, and nothing is lost."""
    m, k, c = [2.0, 1.0, 3.0, 0.5], [800.0, 300.0, 200.0, 900.0], [4.0, 1.5, 1.0, 4.5]
    c = [0.005 * v for v in k] if classical else c
    inputs = (0, 2)
    outputs = [("displacement", 0), ("velocity", 2), ("acceleration", 2), ("acceleration", 1), ("acceleration", 0)]
    system = sliding_chain(m, k, c, inputs, outputs, free=free).linearize()
    omega = np.geomspace(1e-2 if free else 1e-6, 1e8, 60)
    expected = np.stack([chain_response(m, k, c, 1j * w, inputs, outputs, free=free) for w in omega], axis=-1)
    result = system.frequency_response(omega)
    assert_allclose(result[[0, 4], 0], expected[[0, 4], 0], rtol=1e-12)  # where it is pushed
    assert_allclose(result[[1, 2], 1], expected[[1, 2], 1], rtol=1e-12)
    # the neighbour, by the damper between them: inertia alone would give nothing
    assert_allclose(result[3], expected[3], rtol=1e-10)


@pytest.mark.parametrize("classical", [True, False])
def test_absolute_acceleration_is_the_response_of_springs_and_dampers_alone(classical):
    """Far above resonance it is 1 minus nearly 1: to 1e8 times the highest frequency, and beside the base."""
    m, k = [2.0, 1.0], [800.0, 300.0]
    c = [0.005 * v for v in k] if classical else [4.0, 0.1]
    outputs = [("acceleration", 0), ("acceleration", 1), ("displacement", 1)]
    system = sliding_chain(m, k, c, outputs=outputs, base=True).linearize()
    omega = np.geomspace(1e-3, 1e9, 80)
    expected = np.stack([chain_response(m, k, c, 1j * w, (), outputs, base=True) for w in omega], axis=-1)
    result = system.frequency_response(omega)
    assert_allclose(result[0, 0], expected[0, 0], rtol=1e-12)
    # the upper mass answers by one power of frequency less: in the sum over modes that is a second cancellation
    near = omega < 1e5
    assert_allclose(result[1, 0][near], expected[1, 0][near], rtol=1e-9)
    assert_allclose(result[2, 0], expected[2, 0], rtol=1e-10)


def floating(brake, coupled=True):
    """Two masses with a spring between them; the ground brakes them by ``brake``."""
    model = mv.Model("floating")
    for i, m in enumerate((2.0, 3.0)):
        model.add_body(f"b{i}", m, (1, 1, 1), position=(0, 0, i))
        model.add_joint(f"j{i}", "prismatic", "ground", f"b{i}", position=(0, 0, i))
        if brake:
            model.add_spring(f"c{i}", "ground", f"b{i}", (0, 0, i - 1), (0, 0, i), damping=brake * (1 + coupled * i))
        model.add_input(f"f{i}", f"b{i}", "z")
        for quantity in ("displacement", "velocity", "acceleration"):
            model.add_output(f"{quantity}{i}", f"b{i}", "z", quantity=quantity)
    model.add_spring("k", "b0", "b1", (0, 0, 0), (0, 0, 1), stiffness=50.0, damping=0.3)
    return model


@pytest.mark.parametrize("brake", [0.0, 1e-9, 0.7, 40.0, 1e6])
@pytest.mark.parametrize("coupled", [True, False])
def test_rigid_modes_free_or_braked(brake, coupled):
    model = floating(brake, coupled)
    system, omega = model.linearize(), np.geomspace(1e-9, 1e7, 33)
    assert system.modes().rigid == 1
    expected = Exact(model).frequency_response(omega)
    result = system.frequency_response(omega)
    for i in (0, 1):  # where each mass is pushed, and the other one below the modes
        own = slice(3 * i, 3 * i + 3)
        assert_allclose(result[own, i], expected[own, i], rtol=1e-10)
    low = omega < 1.0
    assert_allclose(result[:, :, low], expected[:, :, low], rtol=1e-10)


@pytest.mark.parametrize("stiffness", [1e12, 2e12, 3e12, 5e12, 7e12, 1e13, 3e13, 1e14])
def test_what_damping_couples_far_above_a_slow_mode(stiffness):
    """The residues of both modes cancel in 1 / s: that of the fast one is known to more digits."""
    mass, springs, dampers = [1.0, 1.0], [1e2, stiffness], [0.02, 1e4]
    chain = sliding_chain(mass, springs, dampers, (1,), [("displacement", 1)])
    omega = np.sqrt(stiffness) * np.array([0.1, 0.5, 0.9, 0.9995])  # the last one beside the zero
    expected = [chain_response(mass, springs, dampers, 1j * w, (1,), [("displacement", 1)])[0, 0] for w in omega]
    assert_allclose(chain.linearize().frequency_response(omega)[0, 0], expected, rtol=1e-12)


def defective(detune):
    """Two masses whose modes all but merge: frequencies, damping and shapes, near ``detune`` 1e-5.

    s^2 = -100 - i solves (s^2 + c s + 100 + d) (s^2 + 100) = 1 where c s + d = 2 i, next to a double root.
    """
    model = mv.Model("defective")
    root = 1j * np.sqrt(100 + 1j)
    damper = 2 / root.imag
    stiffness = 99.0 - damper * root.real, 99.0
    for i in (1, 2):
        model.add_body(f"b{i}", 1.0, (1, 1, 1))
        model.add_joint(f"j{i}", "prismatic", "ground", f"b{i}", axis=(1, 0, 0))
        model.add_input(f"f{i}", f"b{i}", "x")
        model.add_output(f"x{i}", f"b{i}", "x")
        model.add_spring(f"k{i}", "ground", f"b{i}", (-1, 0, 0), (0, 0, 0), stiffness=stiffness[i - 1])
    model.add_spring("c", "ground", "b1", (-1, 0, 0), (0, 0, 0), damping=damper * (1 + detune))
    model.add_spring("k", "b1", "b2", (0, 0, 0), (1, 0, 0), stiffness=1.0)
    return model


@pytest.mark.parametrize("detune", [0.0, 1e-8, 3e-6, 1e-5, 1.3e-5, 1e-4, 1e-2])
def test_nearly_dependent_eigenvectors(detune):
    """Whatever road is taken, the answer is right; the sum over modes is left where it is not."""
    model = defective(detune)
    system, omega = model.linearize(), np.array([1.0, 9.0, 9.9, 9.99, 10.0, 10.1, 40.0])
    result, expected = system.frequency_response(omega), Exact(model).frequency_response(omega)
    assert (np.abs(result - expected) <= 1e-12 * np.abs(expected).max(axis=(0, 1))).all()


def test_the_residual_tells_when_eigenvectors_are_not_trusted():
    modal = [defective(detune).linearize().basis.modal for detune in (1.0, 1e-5)]
    assert conditions(modal[0]).max() < 2 < 300 < conditions(modal[1]).max()
    omega = np.linspace(1, 20, 50)
    assert [trusted(item, item.shapes.T, omega) for item in modal] == [True, False]


@pytest.mark.parametrize("seed", range(4))
def test_the_three_roads_agree(seed):
    """Sum over modes, Schur form and one factorisation a frequency, on systems that need none of the latter."""
    n = 12
    rng = np.random.default_rng(seed)
    data = 10.0 ** rng.uniform(-1, 1, n), 10.0 ** rng.uniform(2, 6, n), 10.0 ** rng.uniform(-1, 2, n)
    system = sliding_chain(*data, (0, 5), [("displacement", 5)]).linearize()
    modal, omega = system.basis.modal, np.geomspace(0.1, 1e4, 70)
    b = modal.shapes.T @ system.B
    schur = refined_solutions(system.basis, modal, b, 1j * omega)
    direct = direct_solutions(modal, b, omega, np.arange(len(omega)))
    size = np.abs(direct).max(axis=0)
    assert (np.abs(schur - direct) <= 1e-13 * size).all()
    through = np.einsum("om,min->oin", system.Cq @ modal.shapes, direct)
    result = system.frequency_response(omega)
    assert (np.abs(result - through) <= 1e-12 * np.abs(through).max(axis=1, keepdims=True)).all()


def locked_by_dampers(seed):
    """Dampers from far below critical to a million times critical, side by side; the lightest modes at 1e-5 or so."""
    rng = np.random.default_rng(seed)
    n = int(rng.integers(4, 10))
    m, k = 10.0 ** rng.uniform(-0.5, 0.5, n), 10.0 ** rng.uniform(3, 5, n)
    return m, k, np.sqrt(k * m) * 10.0 ** rng.uniform(-2, 6, n)


@pytest.mark.few(2)
@pytest.mark.parametrize("seed", range(6))
def test_strong_dampers(seed):
    """Rounding in Gamma is more than all that locked motions feel: what dampers feel is told from what they do not."""
    data = locked_by_dampers(seed)
    last = len(data[0]) - 1
    inputs = (0, last // 2, last)
    outputs = [("displacement", 0), ("velocity", last // 2), ("acceleration", last)]
    system = sliding_chain(*data, inputs, outputs).linearize()
    assert system.basis.strong_dampers is not None
    natural = 2 * np.pi * system.modes().frequencies
    omega = np.concatenate((natural, np.geomspace(natural[0] / 100, natural[-1] * 100, 40)))
    expected = np.stack([chain_response(*data, 1j * w, inputs, outputs) for w in omega], axis=-1)
    error = np.abs(system.frequency_response(omega) - expected) / np.abs(expected).max(axis=1, keepdims=True)
    assert error.max() < 1e-10
    # at rest all forces pass the first spring
    assert_allclose(system.frequency_response([0.0])[0, :, 0], 1 / data[1][0], rtol=1e-12)


def test_a_critically_damped_mode_beside_coupled_ones():
    """Its two eigenvalues are equal and its eigenvector is one: no sum over modes at all."""
    model = floating(0.7)
    model.add_body("lone", 1.0, (1, 1, 1), position=(5, 0, 0))
    model.add_joint("jl", "prismatic", "ground", "lone", position=(5, 0, 0))
    model.add_spring("sl", "ground", "lone", (5, 0, -1), (5, 0, 0), stiffness=100.0, damping=20.0)
    model.add_input("fl", "lone", "z")
    model.add_output("xl", "lone", "z")
    omega = np.array([0.5, 9.0, 10.0, 11.0, 300.0])
    result, expected = model.linearize().frequency_response(omega), Exact(model).frequency_response(omega)
    assert_allclose(result, expected, rtol=1e-11, atol=1e-16)


def three_masses(c, free=False):
    m, k = [2.0, 1.0, 3.0], [800.0, 300.0, 200.0]
    outputs = [("displacement", 2), ("velocity", 1), ("acceleration", 0)]
    return sliding_chain(m, k, c, (0, 2), outputs, free=free)


@pytest.mark.few(2)
@pytest.mark.parametrize("free", [True, False])
@pytest.mark.parametrize("c", [[0.0, 0.0, 0.0], [1.6, 0.6, 0.4], [4.0, 60.0, 0.1], [800.0, 3.0, 1.0]])
@pytest.mark.parametrize("hold", ["zero", "first"])
def test_records_longer_than_a_chunk(c, hold, free, monkeypatch):
    """Even steps in segments side by side, uneven ones one by one, and the exponential of the whole state: the same."""
    monkeypatch.setattr("mbsvib.responses.time_response.CHUNK", CHUNK)
    system = three_masses(c, free).linearize()
    rng = np.random.default_rng(0)
    n = 2 * CHUNK + 77
    t, u = 0.01 * np.arange(n), rng.normal(size=(2, n))
    initial = rng.normal(size=(2, 3))
    even = system.time_response(t, u, hold=hold, initial=initial)
    more = np.concatenate((t, [t[-1] + 0.003]))
    uneven = system.time_response(more, np.c_[u, [0, 0]], hold=hold, initial=initial)[:, :-1]
    modal = system.basis.modal
    if modal.vectors is not None:
        start = modal.shapes.T @ system.M @ initial.T
        full = _by_exponential(system, modal, (t, u, start, hold == "first"))
        assert_allclose(even, full, rtol=0, atol=2e-12 * np.abs(even).max())
    assert_allclose(even, uneven, rtol=0, atol=2e-12 * np.abs(even).max())


@pytest.mark.parametrize("detune", [0.0, 1e-5, 0.1])
def test_time_response_where_eigenvectors_are_nearly_dependent(detune):
    model = defective(detune)
    t = np.array([0.0, 0.013, 0.4, 0.41, 2.0])
    u = np.array([[1.0, 0.3, -0.5, 2.0, 0.0], [0.0, 1.0, 1.0, 1.0, -1.0]])
    expected = exact_time_response(Exact(model), t, u)
    assert_allclose(model.linearize().time_response(t, u), expected, rtol=0, atol=1e-12 * np.abs(expected).max())


@pytest.mark.slow
def test_two_hundred_coupled_modes_in_time():
    """Against the exponential of the whole state matrix, which knows nothing of modes."""
    data = random_chain(200, 5e-5, classical=False)
    system = sliding_chain(*data, (0, 100), [("displacement", 199), ("acceleration", 0)]).linearize()
    t = np.linspace(0, 4, 201)
    u = np.random.default_rng(1).normal(size=(2, 201))
    full = _by_exponential(system, system.basis.modal, (t, u, np.zeros((200, 2)), True))
    result = system.time_response(t, u)
    assert (np.abs(result - full) <= 1e-11 * np.abs(full).max(axis=1, keepdims=True)).all()


@pytest.mark.parametrize("displaced", [0.0, 1.0])
@pytest.mark.parametrize("seed", [0, 3])
def test_strong_dampers_in_time(seed, displaced):
    """What starts displaced creeps back: fast decays have a share in it that springs make, not dampers."""
    m, k, c = (part[:4] for part in locked_by_dampers(seed))
    model = sliding_chain(m, k, c, (0, 3), [("displacement", 3), ("velocity", 1), ("acceleration", 0)])
    t = np.array([0.0, 0.02, 0.3, 1.0])
    u = np.array([[1.0, 0.3, -0.5, 2.0], [0.0, 1.0, 1.0, -1.0]])
    system, initial = model.linearize(), (displaced * np.arange(1.0, 5.0), np.zeros(4))
    expected = exact_time_response(Exact(model), t, u, initial=initial, names=system.coordinates)
    error = np.abs(system.time_response(t, u, initial=initial) - expected) / np.abs(expected).max(axis=1, keepdims=True)
    assert error.max() < 1e-11


@pytest.mark.parametrize("unit", [1e-12, 1e9, 1e20])
def test_the_unit_of_an_input_does_not_change_the_digits_in_time(unit):
    """Newtons on masses of nanograms, or tenths of meganewtons: the exponential squares no more often for it."""
    model = defective(1e-5)
    model.add_input("f3", "b1", (unit, 0, 0))
    t, u = np.linspace(0.0, 4.0, 41), np.zeros((3, 41))
    u[0] = np.cos(t)
    plain = model.linearize().time_response(t, u)
    scaled = model.linearize().time_response(t, np.stack((u[2], u[2], u[0] / unit)))
    assert_allclose(scaled, plain, rtol=0, atol=1e-12 * np.abs(plain).max())


def test_rounding_of_sums_over_modes_term_by_term():
    """Below a mode its term, above it the term's remainder and the known sums: the smaller one, from below or above."""
    m, k = np.array([1.0, 4.0, 2.0, 7.0]), np.array([3e4, 1e4, 5e4, 2e4])
    system = sliding_chain(m, k, 1e-4 * k, (0, 2), [("displacement", 3), ("velocity", 1), ("acceleration", 0)])
    system = system.linearize()
    modal, w = system.basis.modal, np.array([20.0, 90.0, 150.0, 1e3])
    bound = Noise.of(system, modal).at(w, True)
    square, gamma, b = modal.square, modal.gamma, modal.shapes.T @ system.B
    sizes = np.sqrt(square)
    for row, (order, c) in enumerate(((0, system.Cq[0]), (1, system.Cv[1]), (2, system.Ca[2]))):
        c = c @ modal.shapes
        for i in range(2):
            terms = np.linalg.norm(c) * np.abs(b[:, i]) + np.abs(c) * np.linalg.norm(b[:, i])
            direct = abs(system.D[row, i]) if order == 2 else 0.0
            for n, there in enumerate(w):
                apart = np.maximum(np.abs(square - there**2), gamma * there)
                above = sizes < there
                fade = np.where(above, (square + gamma * there) / there**2, 1.0)
                known = min(terms[above].sum() + direct, terms[~above].sum())
                expected = np.finfo(float).eps * ROUNDING * ((terms / apart * fade).sum() + known / there**2)
                assert_allclose(bound[row, i, n], expected * there**order, rtol=1e-12)
