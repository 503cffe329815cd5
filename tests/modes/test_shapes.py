"""Shapes and eigenvalues to the rounding of the equations, where a correction, or another solver, decides."""

from types import SimpleNamespace

import numpy as np
import pytest

import mbsvib as mv
from tests.modes.test_general import FAMILIES
from tests.support.unsymmetric import eigenvalues, worst


@pytest.mark.parametrize("brake", [1e-6, 1e-2, 1.0, 1e2])
@pytest.mark.parametrize("span", [1, 3])
def test_shapes_of_a_free_chain_that_the_ground_brakes_solve_the_equations(span, brake):
    """Free motions that weak dampers slow take part in all shapes: (lambda^2 M + lambda C + K) phi = 0."""
    rng, n = np.random.default_rng(1), 5
    model = mv.Model("chain")
    for i in range(n):
        at = (0, 0, i + 0.5)
        model.add_body(f"b{i}", 10 ** rng.uniform(-span, span), (1, 1, 1), position=(0, 0, i + 1.0))
        model.add_joint(f"j{i}", "prismatic", "ground", f"b{i}", axis=(1, 0, 0))
        if i:
            stiffness, damping = 10 ** rng.uniform(2, 2 + span), 10 ** rng.uniform(0, 1)
            model.add_bushing(f"k{i}", f"b{i - 1}", f"b{i}", at, (stiffness, 0, 0, 0, 0, 0), (damping, 0, 0, 0, 0, 0))
        damping = brake * 10 ** rng.uniform(0, 1)
        model.add_bushing(f"g{i}", "ground", f"b{i}", at, damping=(damping, 0, 0, 0, 0, 0))
    system = model.linearize()
    modes = system.modes()
    moving = modes.pairs[:, 0] != 0.0
    assert moving.sum() == n - 1
    for value, shape in zip(modes.pairs[moving, 0], modes.shapes.T[moving], strict=True):
        terms = [value**2 * system.M @ shape, value * system.C @ shape, system.K @ shape]
        assert np.abs(sum(terms)).max() <= 1e-13 * max(np.abs(term).max() for term in terms)


@pytest.mark.parametrize("name", ["spin and dampers", "follower loads", "massless and all", "free"])
def test_shapes_without_symmetry_have_unit_inertia_and_no_phase(name):
    """phi^H M phi = 1, and the largest displacement is real and positive."""
    system = FAMILIES[name](2)
    shapes = system.modes().shapes
    np.testing.assert_allclose(np.einsum("ik,ij,jk->k", shapes.conj(), system.M, shapes), 1.0, rtol=1e-12)
    largest = shapes[np.abs(shapes).argmax(axis=0), np.arange(shapes.shape[1])]
    np.testing.assert_allclose(largest, np.abs(largest), rtol=1e-14)


@pytest.mark.parametrize("strength", [1e3, 1e6, 1e9])
def test_a_batch_with_strong_dampers_against_many_digits(strength):
    """Variants whose weak motions lose their digits beside strong dampers are solved each by itself."""
    rng, n = np.random.default_rng(0), 5
    model = mv.Model("braked")
    for i in range(n):
        model.add_body(f"b{i}", rng.uniform(0.5, 2.0), (0.1, 0.1, 0.1), position=(0, 0, i + 1.0))
        model.add_joint(f"j{i}", "prismatic", "ground", f"b{i}", axis=(1, 0, 0))
        damping = strength * 200.0 * rng.uniform(0.1, 1.0) if i % 2 == 0 else rng.uniform(0.0, 1.0)
        stiffness = 1e4 * rng.uniform(0.5, 2.0)
        model.add_bushing(f"k{i}", f"b{i - 1}" if i else "ground", f"b{i}", (0, 0, i + 0.5),
                          (stiffness, 0, 0, 0, 0, 0), (damping, 0, 0, 0, 0, 0))  # fmt: skip
    batch = model.linearize(values={"b1.mass": np.array([1.0, 1.3])})
    modes = batch.modes(rtol=1e-11)
    for i, system in enumerate(batch):
        variant = SimpleNamespace(eigenvalues=modes.eigenvalues[i], errors=modes.errors[i])
        error, ratio = worst(variant, eigenvalues(system))
        assert error <= 1e-11
        assert ratio <= 1.0
