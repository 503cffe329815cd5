"""Balanced states: powers of two that lose no bit, even out A, and lead back to the bodies."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.linalg import hessenberg

from mbsvib import library
from mbsvib.feedback.participation import eigen
from mbsvib.linalg.balancing import balanced, exponents, matrix_exponents
from mbsvib.linalg.spectrum import spectrum
from tests.export.plants import block_error, resonances, same_bits, stewart, stiff_model
from tests.massless.scenes import along_z
from tests.support.compare import linearized
from tests.support.random_models import closed_loops, open_trees
from tests.support.sizes import examples

TREES = open_trees(damped=st.booleans())
ANY = st.one_of(TREES, open_trees(floating=st.just(True)), closed_loops(damped=st.booleans()))


def powers(space):
    """The exponents in the units of the states."""
    return np.array([int(unit.split()[0][2:]) if unit.startswith("2^") else 0 for unit in space.state_units], dtype=int)


@pytest.mark.slow
@examples(20, slow=20)
@given(ANY)
def test_every_bit_comes_back(model):
    system = linearized(model)
    plain, even = system.state_space(), system.state_space("balanced")
    k = powers(even)
    assert even.states == plain.states
    assert even.realization == "balanced"
    assert same_bits(np.ldexp(even.A, k[:, None] - k[None, :]), plain.A)
    assert same_bits(np.ldexp(even.B, k[:, None]), plain.B)
    assert same_bits(np.ldexp(even.C, -k), plain.C)
    assert same_bits(np.ldexp(even.transform, -k), plain.transform)
    assert same_bits(even.D, plain.D)


@pytest.mark.parametrize("system", [stewart(), stiff_model().linearize(), library.quadruped().linearize()], ids=repr)
def test_rows_and_columns_are_of_like_size(system):
    a = np.abs(system.state_space("balanced").A)
    np.fill_diagonal(a, 0.0)
    ratio = np.linalg.norm(a, axis=0) / np.linalg.norm(a, axis=1)
    assert ratio.max() < 4.0
    assert ratio.min() > 0.25
    assert np.abs(system.state_space().A).max() / a.max() > 30


def test_orthogonal_transformations_keep_the_resonances():
    system = stewart()
    omega, errors = resonances(system), {}
    truth = system.frequency_response(omega)
    for realization in ("physical", "balanced"):
        space = system.state_space(realization)
        a, turn = hessenberg(space.A, calc_q=True)
        result = [space.C @ turn @ np.linalg.solve(1j * w * np.eye(12) - a, turn.T @ space.B) + space.D for w in omega]
        errors[realization] = block_error(np.stack(result, axis=2), truth, system)
    assert errors["physical"] > 1e-9
    assert errors["balanced"] < 2e-12


def test_parts_that_nothing_connects_are_scaled_by_their_ports():
    """A cannot tell how large a part is beside another: inputs and outputs can."""
    a = np.array([[0.0, 1, 0, 0], [-1, 0, 0, 0], [0, 0, 0, 1], [0, 0, -1, 0]])
    b, c = np.array([[0.0], [1], [0], [2.0**40]]), np.array([[1.0, 0, 2.0**-40, 0]])
    k = exponents(a, b, c)
    assert k[2] - k[0] == pytest.approx(40, abs=2)


def test_extreme_entries_are_scaled_less_rather_than_lost():
    space = stewart().state_space()
    a = np.zeros_like(space.A)
    a[0, 1], a[1, 0] = 1e300, 5e-324
    even, _, _, _, k = balanced(a, space.B, space.C, space.transform)
    assert same_bits(np.ldexp(even, k[:, None] - k[None, :]), a)
    # the transformation may leave the range where A does not: numpy warned
    even, _, _, wide, k = balanced(a, space.B, space.C, 1e300 * space.transform)
    assert same_bits(np.ldexp(wide, -k), 1e300 * space.transform)


def test_massless_motions():
    springs = {"k": ("ground", "b", 2.0, 0), "k1": ("b", "node", 3e6, 0), "c": ("node", "ground", 0, 5.0)}
    system = along_z({"node": 0.0, "b": 7.0}, springs, relative=True).linearize()
    plain, even = system.state_space(), system.state_space("balanced")
    assert same_bits(even.through, plain.through)
    assert np.linalg.eigvals(even.A) == pytest.approx(np.linalg.eigvals(plain.A), rel=1e-9)


def test_a_chain_that_runs_one_way_stays_in_range():
    """Three equal lags in series: A is triangular, and scaling alone could make its entries as small as it likes."""
    a, b, c = np.eye(3, k=1) - np.eye(3), np.eye(3)[:, 2:], np.eye(3)[:1]
    scaled, *_, power = balanced(a, b, c, np.eye(3))
    assert np.abs(power).max() < 64
    assert scaled[[0, 1], [1, 2]].min() > 1e-7


def scaled_matrix(a):
    power = matrix_exponents(a)
    return np.ldexp(a, power[None, :] - power[:, None])


@pytest.mark.parametrize("coupling", [1.0, 1e10])
def test_chains_that_act_one_way_stay_in_range(coupling):
    """LAPACK's scaling of such a chain has no end: it leaves the range of floating point."""
    a = np.diag(-np.arange(1.0, 61.0)) + np.diag(np.full(59, coupling), 1)
    even = scaled_matrix(a)
    assert np.isfinite(even).all()
    assert np.array_equal(even.diagonal(), a.diagonal())
    assert np.array_equal(np.frexp(even[a != 0.0])[0], np.frexp(a[a != 0.0])[0])
    assert np.abs(even).max() <= 60.0


def test_slow_parts_beside_fast_ones_are_balanced():
    slow, fast = np.array([[0.0, 1.0], [-1e-12, 0.0]]), np.array([[0.0, 1.0], [-1e12, 0.0]])
    a = np.block([[slow, np.zeros((2, 2))], [1e3 * np.ones((2, 2)), fast]])
    even = np.abs(scaled_matrix(a))
    for i in (0, 2):
        assert 0.25 < even[i, i + 1] / even[i + 1, i] < 4.0


def test_participation_of_a_chain_that_acts_one_way():
    a = np.diag(-np.arange(1.0, 61.0)) + np.diag(np.full(59, 1e10), 1)
    poles, _, share = eigen(spectrum(a))
    assert poles == pytest.approx(-np.arange(1.0, 61.0))
    assert share.sum(axis=0) == pytest.approx(1.0)
