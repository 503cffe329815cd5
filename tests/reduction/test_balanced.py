"""Balanced truncation against benchmark models whose Hankel singular values and norms are published."""

from pathlib import Path

import flint
import numpy as np
import pytest
from numpy.testing import assert_allclose

import mbsvib as mv
from mbsvib.reduction.reduced import balanced, gramian_factors, reduced_space
from mbsvib.responses.state_space import StateSpace

DATA = Path(__file__).parent.parent / "data" / "slicot.npz"


def space(a, b, c, name="plant"):
    n, i, o = len(a), b.shape[1], len(c)
    return StateSpace(name, "given", a, b, c, np.zeros((o, i)), np.zeros((0, n)), tuple(f"x{k}" for k in range(n)),
                      ("",) * n, tuple(f"u{k}" for k in range(i)), ("",) * i, tuple(f"y{k}" for k in range(o)),
                      ("",) * o)  # fmt: skip


def benchmark(name):
    data = np.load(DATA)
    n = len(data[f"{name}_B"])
    a = np.zeros((n, n))
    a[data[f"{name}_rows"], data[f"{name}_columns"]] = data[f"{name}_values"]
    return space(a, data[f"{name}_B"], data[f"{name}_C"], name)


def response(plant, omega):
    """C (i w - A)^-1 B + D by the eigenvectors of A."""
    values, vectors = np.linalg.eig(plant.A)
    left, right = plant.C @ vectors, np.linalg.solve(vectors, plant.B)
    return np.einsum("ok,wk,ki->woi", left, 1.0 / (1j * omega[:, None] - values), right) + plant.D


def frequencies(*plants):
    poles = np.concatenate([np.linalg.eigvals(plant.A) for plant in plants])
    size = np.abs(poles)
    grid = np.geomspace(0.1 * size.min(), 10.0 * size.max(), 1500)
    return np.sort(np.concatenate((grid, np.abs(poles.imag), np.sqrt(np.abs(size**2 - 2.0 * poles.real**2)))))


def error(plant, small):
    omega = frequencies(plant, small)
    return np.linalg.norm(response(plant, omega) - response(small, omega), ord=2, axis=(1, 2)).max()


def exact_error(plant, small, omega):
    """The same at one frequency in 120 bits: where poles are far apart, rounding of eigenvectors can be larger than the
    smallest Hankel singular value.
    """
    with flint.ctx.workprec(120):
        responses = []
        for system in (plant, small):
            a, b, c, d = (flint.acb_mat(matrix.tolist()) for matrix in (system.A, system.B, system.C, system.D))
            shifted = flint.acb_mat(len(system.A), len(system.A), 0) - a
            for k in range(len(system.A)):
                shifted[k, k] += flint.acb(0, omega)
            responses.append(c * shifted.solve(b) + d)
        difference = responses[0] - responses[1]
        return np.linalg.norm([[complex(entry) for entry in row] for row in difference.tolist()], ord=2)


def test_the_hankel_singular_values_of_the_building():
    """48 states; all of them, down to 1e-6 of the first, as the collection has them."""
    plant = benchmark("build")
    made = balanced(plant.A, plant.B, plant.C)
    assert made.lasting == 0
    assert_allclose(made.hankel, np.load(DATA)["build_hankel"], rtol=1e-6)
    assert_allclose(made.left @ made.right, np.eye(48), atol=1e-6)


@pytest.mark.few(2)
@pytest.mark.parametrize("order", [2, 6, 10, 20, 30, 46])
def test_the_bound_holds_on_the_building(order):
    plant = benchmark("build")
    assert_allclose(np.abs(response(plant, np.array([5.20607628]))).max(), 5.27633376e-3, rtol=1e-8)
    small = reduced_space(plant, order)
    assert len(small.states) == order
    assert (np.linalg.eigvals(small.A).real < 0.0).all()
    assert 0.1 * small.error_bound < error(plant, small) <= small.error_bound or order == 2
    assert error(plant, small) <= small.error_bound


@pytest.mark.slow
@pytest.mark.parametrize("order", [4, 20, 40])
def test_the_bound_holds_on_the_space_station(order):
    plant = benchmark("iss")
    made = balanced(plant.A, plant.B, plant.C)
    assert_allclose(made.hankel[:2], [0.0577767, 0.0577740], rtol=1e-5)
    small = reduced_space(plant, order)
    assert error(plant, small) <= small.error_bound


def test_an_error_gives_the_smallest_order():
    plant = benchmark("build")
    small = reduced_space(plant, error=1e-3)
    n = len(small.states)
    assert small.error_bound <= 1e-3 < reduced_space(plant, n - 1).error_bound
    assert error(plant, small) <= 1e-3


def test_factors_of_gramians_in_closed_form():
    """Of diagonal A: P_ij = -b_i b_j / (a_i + a_j), also where decays span twelve decades."""
    rates = -np.geomspace(1e-6, 1e6, 7)
    b, c = np.ones((7, 1)), np.arange(1.0, 8.0)[None]
    reach, see = gramian_factors(np.diag(rates), b, c)
    assert_allclose(reach @ reach.T, -(b @ b.T) / (rates[:, None] + rates), rtol=1e-9)
    assert_allclose(see @ see.T, -(c.T @ c) / (rates[:, None] + rates), rtol=1e-9)


def test_states_that_do_not_decay_stay():
    """An integrator beside, and coupled into, decaying states."""
    a = np.array([[0.0, 1.0, 0.3], [0.0, -1.0, 2.0], [0.0, 0.0, -30.0]])
    plant = space(a, np.array([[0.0], [1.0], [1.0]]), np.array([[1.0, 0.0, 0.2]]))
    whole, small = reduced_space(plant, 3), reduced_space(plant, 2)
    assert whole.states == ("lasting1", "hankel1", "hankel2")
    assert_allclose(response(whole, np.array([0.3, 5.0])), response(plant, np.array([0.3, 5.0])), rtol=1e-12)
    assert small.states == ("lasting1", "hankel1")
    assert_allclose(np.linalg.eigvals(small.A).max(), 0.0, atol=1e-14)
    omega = np.geomspace(1e-3, 1e4, 2000)
    off = np.abs(response(plant, omega) - response(small, omega)).max()
    assert 0.0 < off <= small.error_bound < 0.1
    with pytest.raises(mv.ResponseError, match="1 of the 3 states of 'plant' do not decay"):
        reduced_space(plant, 0)


def test_states_that_nothing_reaches_go_without_error():
    a = np.diag([-1.0, -2.0, -3.0, -4.0])
    plant = space(a, np.array([[1.0], [0.0], [1.0], [1.0]]), np.array([[1.0, 1.0, 0.0, 1.0]]))
    small = reduced_space(plant, error=1e-9)
    assert len(small.states) == 2
    assert error(plant, small) < 1e-14


@pytest.mark.few(1)
@pytest.mark.parametrize("seed", [*range(8), *[pytest.param(seed, marks=pytest.mark.slow) for seed in range(8, 208)]])
def test_the_bound_holds_on_random_plants(seed):
    rng = np.random.default_rng(seed)
    n, i, o = rng.integers(2, 12), rng.integers(1, 4), rng.integers(1, 4)
    omega, zeta = 10.0 ** rng.uniform(-1, 3, n), 10.0 ** rng.uniform(-3, 0.3, n)
    a = np.zeros((2 * n, 2 * n))
    even = 2 * np.arange(n)
    a[even, even + 1], a[even + 1, even], a[even + 1, even + 1] = 1.0, -(omega**2), -2.0 * zeta * omega
    mix = np.linalg.qr(rng.normal(size=(2 * n, 2 * n)))[0]
    plant = space(mix @ a @ mix.T, mix @ rng.normal(size=(2 * n, i)), rng.normal(size=(o, 2 * n)) @ mix.T)
    for order in (1, n, 2 * n - 1):
        small = reduced_space(plant, order)
        omega = frequencies(plant, small)
        size = np.linalg.norm(response(plant, omega), ord=2, axis=(1, 2)).max()
        errors = np.linalg.norm(response(plant, omega) - response(small, omega), ord=2, axis=(1, 2))
        assert errors.max() <= small.error_bound + 1e-6 * size
        for k in np.argsort(errors)[-3:]:
            assert exact_error(plant, small, omega[k]) <= small.error_bound + 1e-10 * size


@pytest.mark.parametrize(("words", "message"), [
    ({}, "expected one of both"), ({"order": 2, "error": 1.0}, "expected one of both"),
    ({"order": 49}, "whole number up to 48"), ({"order": 2.0}, "whole number"), ({"error": -1.0}, "positive number"),
])  # fmt: skip
def test_refusals(words, message):
    with pytest.raises(mv.ResponseError, match=message):
        reduced_space(benchmark("build"), **words)
