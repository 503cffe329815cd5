"""Bounds of mean squares by polynomials: closed forms, samples of parameters, and their algebra."""

import itertools

import numpy as np
import pytest

import mbsvib as mv
from mbsvib.uncertain import moment_bound
from mbsvib.uncertain.moment_bound import basis, largest, times
from tests.random.scenes import oscillator, two_masses

SYSTEM = oscillator().linearize()
K, M = SYSTEM.K[0, 0], SYSTEM.M[0, 0]
RNG = np.random.default_rng(5)


@pytest.fixture(autouse=True)
def _no_energy_bound(monkeypatch):
    """Bounds by energy and dissipation would be taken first."""
    monkeypatch.setattr("mbsvib.uncertain.certain.energy_bound", lambda *_: np.inf)


def value(coefficients, own, x):
    """A polynomial by Chebyshev's definition, cos(n arccos x)."""
    products = np.prod(np.cos(np.array(own.powers) * np.arccos(x)), axis=1)
    return np.tensordot(products, coefficients, axes=1)


@pytest.mark.slow
@pytest.mark.parametrize(("limits", "exact"), [
    ({"s.damping": (2.0, 5.0)}, 1.0 / (4.0 * 2.0 * K)),
    ({"s.stiffness": 0.2, "s.damping": (2.0, 5.0)}, 1.0 / (4.0 * 2.0 * 0.8 * K)),
    ({"b.mass": (1.2, 3.0), "s.stiffness": 0.1}, 1.0 / (4.0 * 3.0 * 0.9 * K)),
    ({"b.mass": (1.2, 3.0)}, 1.0 / (4.0 * 3.0 * K)),
])  # fmt: skip
def test_it_is_near_the_closed_form(limits, exact):
    """S / (4 c k), whatever the mass, although resonances move by many times their width."""
    worst = SYSTEM.uncertain(limits).worst_rms("x", {"F": 1.0})
    assert np.sqrt(exact) * (1.0 - 1e-9) <= worst.lower["x"] <= worst.upper["x"] < np.sqrt(exact) * 1.001


@pytest.mark.slow
def test_lightly_damped_boxes_are_halved():
    """A damping ratio of 5e-4 and a frequency that moves by 20 %: one polynomial of degree 12 does not suffice."""
    system = oscillator(c=0.04).linearize()
    worst = system.uncertain({"s.stiffness": 0.2}).worst_rms("x", {"F": 1.0})
    exact = np.sqrt(1.0 / (4.0 * 0.04 * 0.8 * K))
    assert exact * (1.0 - 1e-9) <= worst.lower["x"] <= worst.upper["x"] < 1.001 * exact


@pytest.mark.slow
def test_outputs_whose_rows_vary():
    """The force of a spring-damper, k x + c v, whose row varies with both."""
    model = oscillator()
    model.add_force_output("force", "s")
    system = model.linearize()
    noise = {"F": mv.isolation.shaped([400.0], [1.0, 400.0], 1.0)}
    worst = system.uncertain({"s.stiffness": 0.2, "s.damping": 0.3}).worst_rms("force", noise)
    grid = itertools.product((0.8, 1.0, 1.2), (2.1, 3.0, 3.9))
    values = [model.with_values({"s.stiffness": r * 800.0, "s.damping": c}).linearize().rms("force", noise)["force"]
              for r, c in grid]  # fmt: skip
    assert max(values) * (1.0 - 1e-9) <= worst.lower["force"] <= worst.upper["force"] < 1.001 * max(values)


@pytest.mark.slow
def test_no_sample_exceeds_it():
    """Two masses with four uncertain numbers under two noises, one of them filtered."""
    plant = two_masses(3.0, 4.0).linearize().uncertain(
        {"k1.stiffness": 0.2, "k2.stiffness": 0.2, "m2.mass": 0.2, "k1.damping": 0.3})  # fmt: skip
    noise = {"F1": 1.0, "F2": mv.isolation.shaped([20.0], [1.0, 20.0], 4.0)}
    worst = plant.worst_rms(["x2", "v2"], noise)
    for name in ("x2", "v2"):
        assert worst.lower[name] <= worst.upper[name] < 1.03 * worst.lower[name]
    for corner in itertools.product(*plant.limits.values()):
        values = plant.at(dict(zip(plant.limits, corner, strict=True))).rms(["x2", "v2"], noise)
        assert all(values[name] <= worst.upper[name] for name in values)


def test_no_bound_where_it_becomes_unstable_or_singular():
    equations = moment_bound.Affine(*[np.array(part) for part in (
        [np.eye(1), [[0.0]]], [[[-1.0]], [[1.5]]], [[[1.0]], [[0.0]]], [[[1.0]], [[0.0]]])])  # fmt: skip
    assert moment_bound.moment_bound(equations, 1.0) == np.inf
    singular = moment_bound.Affine(np.array([np.eye(1), [[1.5]]]), np.array([[[-1.0]], [[0.0]]]), equations.b,
                                   equations.c)  # fmt: skip
    assert moment_bound.moment_bound(singular, 1.0) == np.inf


@pytest.mark.slow
def test_bound_of_a_first_order_equation():
    """x' (1 + 0.3 p) = -(1 + 0.5 q) x + (1 + 0.2 p) u: variance b^2 / (2 e a)."""
    e, a, b = ([[1.0, 0.3, 0.0], [-1.0, 0.0, -0.5], [1.0, 0.2, 0.0]])
    equations = moment_bound.Affine(*[np.reshape(part, (3, 1, 1)) for part in (e, a, b, [2.0, 0.0, 0.5])])
    p, q = np.meshgrid(np.linspace(-1, 1, 81), np.linspace(-1, 1, 81))
    exact = ((2.0 + 0.5 * q) ** 2 * (1.0 + 0.2 * p) ** 2 / (2.0 * (1.0 + 0.3 * p) * (1.0 + 0.5 * q))).max()
    assert exact <= moment_bound.moment_bound(equations, exact) < 1.001 * exact
    assert exact <= moment_bound.moment_bound(equations, 0.0) < 1.003 * exact


def test_polynomials_multiply():
    own = basis(3, 2)
    f, g = RNG.normal(size=(len(own.powers), 2, 3)), RNG.normal(size=(4, 4, 3))
    product = times(f, own, g)
    for x in RNG.uniform(-1.0, 1.0, (5, 3)):
        exact = value(f, own, x) @ (g[0] + np.tensordot(x, g[1:], axes=1)).T
        np.testing.assert_allclose(value(product, basis(3, 3), x), exact, atol=1e-12)


def test_polynomials_by_values_and_on_halves():
    own = basis(2, 4)
    f = RNG.normal(size=len(own.powers))
    x = RNG.uniform(-1.0, 1.0, (6, 2))
    exact = [value(f, own, point) for point in x]
    np.testing.assert_allclose(own.at(x) @ f, exact, atol=1e-12)
    np.testing.assert_allclose(own.fitted(own.at(own.nodes) @ f), f, atol=1e-12)
    for j, side in itertools.product((0, 1), (0, 1)):
        whole = x.copy()
        whole[:, j] = 0.5 * (x[:, j] + (-1.0, 1.0)[side])
        np.testing.assert_allclose(own.at(x) @ (own.halves[j, side] @ f), own.at(whole) @ f, atol=1e-12)


def test_largest_value_of_a_polynomial():
    own = basis(2, 4)
    grid = np.stack(np.meshgrid(np.linspace(-1, 1, 201), np.linspace(-1, 1, 201)), axis=-1).reshape(-1, 2)
    for _ in range(5):
        f = RNG.normal(size=len(own.powers))
        f[0] += 6.0
        highest = (own.at(grid) @ f).max()
        assert highest <= largest(f, own, 0.0, 1e-3, 400) < 1.0015 * highest
