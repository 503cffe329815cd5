"""Chains of thousands of bodies against closed forms and, where there are none, transfer matrices in 60 digits."""

import numpy as np
import pytest
from mpmath import mp, mpf
from numpy.testing import assert_allclose

import mbsvib as mv
from tests.sparse import scenes
from tests.support import fast_digits
from tests.support.sizes import few
from tests.support.sliding_chain import chain_response, sliding_chain
from tests.support.transfer_matrix import off_by_less, root

HONEST = 1.05  # errors are estimates to a few per cent


def torsional(n, stiffness=1e4, inertia=0.5, damping=0.0):
    """Equal discs on a shaft: theta'' (mbsvib's revolute joints about the line of the chain)."""
    model = mv.Model(f"shaft{n}")
    for i in range(n):
        below, name = f"b{i - 1}" if i else "ground", f"b{i}"
        model.add_body(name, 1.0, (inertia,) * 3, (0.0, 0.0, 0.1 * i))
        model.add_joint(f"j{i}", "revolute", below, name, (0.0, 0.0, 0.1 * i - 0.05))
        model.add_bushing(f"s{i}", below, name, (0.0, 0.0, 0.1 * i - 0.05), (0, 0, 0, 0, 0, stiffness),
                          (0, 0, 0, 0, 0, damping))  # fmt: skip
    model.add_input("M", f"b{n - 1}", "rz")
    model.add_output("rz", f"b{n - 1}", "rz")
    return model


def shaft_frequencies(n, numbers, stiffness=1e4, inertia=0.5):
    """omega_i = 2 sqrt(k / J) sin((2 i - 1) pi / (2 (2 n + 1))), [Hz]."""
    with mp.workdps(40):
        two = 2 * mp.sqrt(mpf(stiffness) / mpf(inertia))
        return np.array([float(two * mp.sin((2 * i - 1) * mp.pi / (2 * (2 * n + 1))) / (2 * mp.pi)) for i in numbers])


@pytest.mark.parametrize("n", few([1000, 10_000], 1))
def test_lowest_modes_of_a_shaft(n):
    modes = torsional(n).linearize().modes(10)
    error = np.abs(modes.frequencies / shaft_frequencies(n, range(1, 11)) - 1)
    assert error.max() <= 3e-14
    assert (error <= HONEST * modes.errors[0::2] + 4e-16).all()
    assert modes.errors.max() <= 1e-13
    assert modes.missed == 0
    shape = np.array([modes.body_shapes[f"b{i}"][5] for i in range(n)])
    i = np.arange(n) + 1.0
    exact = np.sin(np.outer(i, 2 * np.arange(10) + 1.0) * np.pi / (2 * n + 1))
    exact *= np.sign(shape[-1] / exact[-1]) / np.sqrt(0.5 * (exact**2).sum(axis=0))
    assert_allclose(shape, exact, atol=1e-8 * np.abs(exact).max())


@pytest.mark.slow
@pytest.mark.parametrize("share", [0.02, 0.3, 0.8, 0.999])
def test_modes_around_a_frequency(share):
    """The count of eigenvalues says that none is missed: each is the mode with the number that it should have."""
    n = 2000
    number = int(share * n)
    exact = shaft_frequencies(n, range(number - 6, min(number + 7, n + 1)))
    near = float(exact[6]) * (1 + 1e-9)
    modes = torsional(n).linearize().modes(5, near=near)
    nearest = np.sort(np.argsort(np.abs(exact - near))[:5])
    assert_allclose(modes.frequencies, exact[nearest], rtol=2e-13)
    assert modes.missed == 0
    assert (np.abs(modes.frequencies / exact[nearest] - 1) <= HONEST * modes.errors[0::2] + 4e-16).all()


@pytest.mark.slow
@pytest.mark.parametrize("near", few([46.0, 1e5], 1))
def test_beyond_the_highest_mode(near):
    modes = torsional(1000).linearize().modes(3, near=near)
    assert_allclose(modes.frequencies, shaft_frequencies(1000, (998, 999, 1000)), rtol=2e-13)


@pytest.mark.slow
@pytest.mark.parametrize("n", few([100, 1000], 1))
def test_a_beam_of_links_against_transfer_matrices(n):
    """Revolute joints across the line: frequencies fall with n^-2, the lowest is 1e-6 of a single link's."""
    model = mv.library.chain(n, line=(0, 1, 0))
    modes = model.linearize(method="sparse").modes(6)
    omega = modes.frequencies * 2 * np.pi
    for w, error in zip(omega, modes.errors[0::2], strict=True):
        assert error <= 1e-12
        assert off_by_less(model, w, HONEST * error + 4e-16)
        assert off_by_less(model, w, 5e-14)


@pytest.mark.slow
def test_ten_thousand_links_against_transfer_matrices():
    model = mv.library.chain(10_000, line=(0, 1, 0))
    modes = model.linearize().modes(6)
    for w, error in zip(modes.frequencies * 2 * np.pi, modes.errors[0::2], strict=True):
        assert off_by_less(model, w, HONEST * error + 4e-16)
        assert off_by_less(model, w, 2e-13)


def uneven(n, seed=0):
    rng = np.random.default_rng(seed)
    k, m = 10.0 ** (4 + rng.uniform(0, 2, n)), 10.0 ** rng.uniform(-1, 1, n)
    return m, k, rng.uniform(0, 1, n) * 1e-4 * np.sqrt(k * m)  # damping ratios from 3e-8


@pytest.mark.slow
@pytest.mark.parametrize("n", few([700, 1500], 1))
def test_response_of_an_uneven_chain(n):
    """Every output quantity, at, between and far from resonances, base motion included."""
    data = uneven(n)
    inputs, outputs = (0, n - 1), [("displacement", n - 1), ("velocity", n // 2), ("acceleration", 0)]
    system = sliding_chain(*data, inputs, outputs, base=True).linearize()
    assert isinstance(system, mv.api.sparse_system.SparseSystem)
    modes = system.modes(4)
    peaks = 2 * np.pi * modes.frequencies
    omega = np.concatenate((peaks, 1.1 * peaks, [0.3 * peaks[0], 30.0, 3000.0]))
    expected = np.stack([chain_response(*data, 1j * w, inputs, outputs, base=True) for w in omega], axis=-1)
    error = np.abs(system.frequency_response(omega) - expected) / np.abs(expected).max(axis=1, keepdims=True)
    assert (error[:, :, :4] * modes.damping_ratios).max() <= 1e-15
    assert error[:, :, 4:].max() <= 5e-14


@pytest.mark.slow
def test_static_compliance_of_a_shaft():
    """Equal springs in a row: n / k."""
    n = 5000
    assert_allclose(torsional(n).linearize().static_compliance(), [[n / 1e4]], rtol=1e-12)


@pytest.mark.slow
@pytest.mark.parametrize("case", few([(250, 0.0), (800, 0.0), (800, 5.0)], 1))
def test_coupled_damping_against_transfer_matrices(case):
    """A damper at every seventh joint: eigenvalues that no undamped mode has, each a root in 40 digits."""
    n, near = case
    modes = scenes.dashed(n).linearize(method="sparse").modes(6, near=near)
    assert not modes.classical
    assert np.array_equal(modes.errors[0::2], modes.errors[1::2])  # conjugate eigenvalues have the same error
    damping = [0.0 if i % 7 else 30.0 for i in range(n)]
    for value, error in zip(modes.eigenvalues[0::2], modes.errors[0::2], strict=True):
        exact = root(n, damping, 1e4, _about_joint(), value)
        assert abs(complex(exact - value)) <= HONEST * (error + 1e-15) * abs(value)
        assert error <= 1e-11


def _about_joint():
    """Mass, inertia and half length of a link of ``scenes.dashed``."""
    return 1.0, 1.0, 0.125


@pytest.mark.slow
@pytest.mark.parametrize("off", few([0.0, 1e-12, 1e-15, 1e-9, 1e-6], 2))
def test_around_a_mode_itself(off):
    """On an eigenvalue nothing but its own mode is left of a solve: its neighbours keep their digits nevertheless."""
    system = torsional(1500).linearize()
    exact = shaft_frequencies(1500, range(1, 12))
    for number in (0, 3, 6):
        modes = system.modes(4, near=float(exact[number]) * (1 + off))
        nearest = np.sort(np.argsort(np.abs(exact - exact[number] * (1 + 1e-9)))[:4])
        assert_allclose(modes.frequencies, exact[nearest], rtol=3e-14)
        assert modes.errors.max() <= 1e-10


@pytest.mark.slow
def test_around_a_frequency_that_all_modes_share():
    """The matrix at this shift is zero exactly."""
    model = scenes.pendulums(700)
    frequency = float(model.linearize().modes(1).frequencies[0])
    modes = model.linearize().modes(6, near=frequency)
    assert_allclose(modes.frequencies, frequency, rtol=1e-14)


@pytest.mark.parametrize("seed", [0, 1])
def test_error_bounds_of_a_chain_whose_springs_span_twelve_decades(seed):
    """Against 40 digits: rounding of the solves is part of the bounds."""
    rng, n = np.random.default_rng(seed), 40
    k, m = 10.0 ** rng.uniform(0, 12, n), rng.uniform(0.5, 2, n)
    model = mv.Model("chain")
    for i in range(n):
        model.add_body(f"b{i}", m[i], (1, 1, 1), (0, 0, i))
        model.add_joint(f"j{i}", "prismatic", "ground", f"b{i}", axis=(0, 0, 1))
        model.add_bushing(f"k{i}", f"b{i - 1}" if i else "ground", f"b{i}", (0, 0, i), (0, 0, k[i], 0, 0, 0))
    modes = model.linearize(method="sparse").modes(4)
    with mp.workdps(40):
        matrix = mp.zeros(n)
        for i in range(n):
            for j in (i, i + 1) if i + 1 < n else (i,):
                matrix[i, i] += mpf(k[j]) / mpf(m[i])
            if i + 1 < n:
                matrix[i, i + 1] = -mpf(k[i + 1]) / mpf(m[i])
                matrix[i + 1, i] = -mpf(k[i + 1]) / mpf(m[i + 1])
        exact = np.sort([float(mp.sqrt(value.real)) for value in fast_digits.eigenvalues(matrix)])[:4]
    assert (np.abs(modes.natural / exact - 1.0) <= modes.errors[::2]).all()
    assert modes.errors.max() < 1e-6
