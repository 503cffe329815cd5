"""Modes that dampers couple, of many variants: corrections of undamped modes find what an eigensolver finds."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

import mbsvib as mv
from mbsvib.modes import batch_damped
from mbsvib.modes.batch_damped import damped_batch, starts, undamped_batch
from tests.support.compare import nearest_pairs


def forms(size, n=40, m=7, seed=1):
    """Frequencies over two decades, and damping that couples all modes; ratios of ``size`` at most about."""
    rng = np.random.default_rng(seed)
    omega = np.sort(10.0 ** rng.uniform(0.0, 2.0, size=(n, m)), axis=1)
    rows = rng.normal(size=(n, 2 * m, m)) * np.sqrt(size * omega[:, None] / m)
    return rows.swapaxes(1, 2) @ rows, omega**2


def check(gamma, square, values, y):
    for i in range(len(gamma)):
        at = np.arange(len(square[i]))
        a = np.block([[np.zeros_like(gamma[i]), np.eye(len(at))], [-np.diag(square[i]), -gamma[i]]])
        result, expected = nearest_pairs(np.concatenate((values[i], values[i].conj())), np.linalg.eigvals(a))
        assert_allclose(result, expected, rtol=1e-10)
        residual = y[i] * values[i] ** 2 + gamma[i] @ y[i] * values[i] + square[i][:, None] * y[i]
        assert_allclose(residual, 0.0, atol=1e-11 * np.abs(y[i]).max() * square[i].max())


def oscillating(gamma, square):
    """All variants, of which all modes oscillate."""
    (start,) = starts(gamma, square)
    assert (start.complex_count, len(start.which)) == (square.shape[1], len(square))
    return start


@pytest.mark.parametrize("size", [1e-8, 1e-3, 0.03, 0.2])
def test_both_starts_find_the_same(size, monkeypatch):
    gamma, square = forms(size)
    first = oscillating(gamma, square)
    check(gamma, square, first.values, first.y)
    monkeypatch.setattr(batch_damped, "STEPS", 0)
    second = oscillating(gamma, square)
    assert_allclose(np.sort_complex(first.values), np.sort_complex(second.values), rtol=1e-9)


def test_no_eigensolver_is_needed_where_damping_is_light(monkeypatch):
    def none(*_):
        raise AssertionError

    monkeypatch.setattr(batch_damped, "_by_eigensolver", none)
    oscillating(*forms(1e-3))


def test_modes_of_one_frequency_and_modes_that_creep():
    """Two modes of one frequency that a damper couples; a third variant whose modes creep is told apart."""
    square = np.array([[4.0, 4.0, 9.0], [4.0, 4.0, 9.0], [4.0, 4.0, 9.0]])
    rows = np.array([[1.0, 2.0, 0.5], [1.0, -1.0, 2.0]])
    gamma = np.array([0.1 * np.outer(rows[0], rows[0]), 0.02 * rows.T @ rows, 50.0 * rows.T @ rows])
    first, second = starts(gamma, square)
    assert (first.which.tolist(), first.complex_count, second.which.tolist()) == ([0, 1], 3, [2])
    check(gamma[:2], square[:2], first.values, first.y)
    assert second.values.shape[1] == 6 - second.complex_count
    expected = np.linalg.eigvals(np.block([[np.zeros((3, 3)), np.eye(3)], [-np.diag(square[2]), -gamma[2]]]))
    assert_allclose(np.sort_complex(second.values[0]), np.sort_complex(expected[expected.imag >= 0.0]), rtol=1e-9)


@pytest.mark.parametrize(("span", "seed"), [(2, 0), (3, 2)])
def test_shapes_of_modes_that_creep_solve_the_equations(span, seed):
    """Real eigenvalues and pairs, over decades: (lambda^2 M + lambda C + K) phi = 0 to the rounding of its terms."""
    rng, n = np.random.default_rng(seed), 5
    model = mv.Model("chain")
    for i in range(n):
        model.add_body(f"b{i}", 10 ** rng.uniform(-span, span), (1, 1, 1), position=(0, 0, i + 1.0))
        model.add_joint(f"j{i}", "prismatic", "ground", f"b{i}", axis=(1, 0, 0))
        stiffness, damping = 10 ** rng.uniform(2, 2 + span), 10 ** rng.uniform(0, 2 + span)
        model.add_bushing(f"k{i}", f"b{i - 1}" if i else "ground", f"b{i}", position=(0, 0, i + 0.5),
                          stiffness=(stiffness, 0, 0, 0, 0, 0), damping=(damping, 0, 0, 0, 0, 0))  # fmt: skip
    batch = model.linearize(values={"b1.mass": model.bodies["b1"].mass * np.array([1.0, 1.1, 0.8])})
    modes = batch.modes()
    assert (modes.eigenvalues.imag == 0.0).any()
    for i, system in enumerate(batch):
        for value, shape in zip(modes.pairs[i, :, 0], modes.shapes[i].T, strict=True):
            terms = [value**2 * system.M @ shape, value * system.C @ shape, system.K @ shape]
            assert np.abs(sum(terms)).max() <= 1e-13 * max(np.abs(term).max() for term in terms)


def test_light_coupled_damping_needs_no_solver_for_each_variant():
    """M is the unit matrix in the forms and Gamma is small: no variant is left to the solver of single systems."""
    model = mv.Model("chain")
    for i, c in enumerate((3.0, 0.0, 1.0)):
        model.add_body(f"b{i}", 1.0 + i, (0.1, 0.1, 0.1), position=(0, 0, i))
        model.add_joint(f"j{i}", "prismatic", "ground", f"b{i}", axis=(1, 0, 0))
        model.add_bushing(f"k{i}", f"b{i - 1}" if i else "ground", f"b{i}", (0, 0, i), (1e3, 0, 0, 0, 0, 0),
                          (c, 0, 0, 0, 0, 0))  # fmt: skip
    batch = model.linearize(values={"b1.mass": np.array([1.0, 1.3, 2.0])})
    basis = undamped_batch(batch, 1e-12)
    result = damped_batch(batch, basis, 1e-12)
    assert result.classical == ("",) * 3
    assert result.accurate.all()
