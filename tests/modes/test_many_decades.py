"""Modes of chains whose stiffness and mass span many decades: digits, error estimates, accuracy asked for."""

from types import SimpleNamespace

import numpy as np
import pytest
from numpy.testing import assert_allclose

import mbsvib as mv
from tests.support.chains import stiff_chain
from tests.support.compare import assert_same_eigenvalues
from tests.support.exact import Exact
from tests.support.sizes import few
from tests.support.unsymmetric import chain_model, eigenvalues, worst


@pytest.mark.few(1)
@pytest.mark.parametrize("seed", few(range(6), 3))
def test_frequencies_over_many_decades(seed):
    """Stiffness over 12 and mass over 8 decades: ten digits of every frequency, where eigh(K, M) has none."""
    model = stiff_chain(12, 12, 8, seed)
    reference = Exact(model)
    omega = np.sqrt(reference.squares)
    assert omega[-1] / omega[0] > 1e6
    modes = model.linearize().modes()
    error = np.abs(modes.frequencies * 2 * np.pi / omega - 1)
    assert error.max() < 1e-10
    assert (error <= 10 * modes.errors[0::2] + 4e-16).all()
    assert modes.errors.max() <= 1e-10


@pytest.mark.parametrize("seed", range(3))
def test_damped_eigenvalues_over_many_decades(seed):
    model = stiff_chain(6, 8, 4, seed, damped=True)
    assert_same_eigenvalues(model.linearize().modes().eigenvalues, Exact(model).eigenvalues, rtol=1e-9)


@pytest.mark.few(2)
@pytest.mark.parametrize("chain", [
    {"n": 2, "span": 5.0, "damp": 4120.7, "seed": 525102}, {"n": 3, "span": 8.0, "damp": 793.57, "seed": 710107},
    {"n": 5, "span": 8.0, "damp": 0.10767, "seed": 349513},
    {"n": 8, "span": 7.0, "damp": 0.40563, "seed": 182451, "ground": False},
    {"n": 6, "span": 5.0, "damp": 0.0862, "seed": 869025}, {"n": 3, "span": 4.0, "damp": 0.1689, "seed": 643828},
], ids=lambda chain: f"{chain['n']} bodies, {chain['span']:g} decades, {chain['damp']:g} N s/m")  # fmt: skip
def test_error_estimates_hold_over_many_decades(chain):
    """Eigenvalues for which one Newton step is too few, and lightly damped ones, which are as good as their basis."""
    model = chain_model(**chain)
    batch = model.linearize(values={"b0.mass": model.bodies["b0"].mass * np.array([1.0, 1.3])})
    modes = batch.modes()
    for i, system in enumerate(batch):
        exact = eigenvalues(system)
        for result in (system.modes(), SimpleNamespace(eigenvalues=modes.eigenvalues[i], errors=modes.errors[i])):
            error, ratio = worst(result, exact)
            assert error <= 1e-12
            assert ratio <= 1.0
            assert result.errors.max() <= 1e-10  # rtol
            assert (result.errors[result.eigenvalues != 0.0] > 0.0).all()


@pytest.mark.parametrize("rtol", [1e-4, 1e-10, 1e-13])
def test_accuracy_that_is_asked_for(rtol):
    model = stiff_chain(10, 10, 6, seed=9)
    omega = np.sqrt(Exact(model).squares)
    modes = model.linearize().modes(rtol=rtol)
    assert modes.errors.max() <= rtol
    assert_allclose(modes.frequencies * 2 * np.pi, omega, rtol=rtol)


def test_accuracy_that_no_double_has_is_warned_of():
    with pytest.warns(mv.AccuracyWarning, match=r"modes of 'stress'.*exceeds rtol = 1e-18 in modes 1, 2"):
        stiff_chain(4, 2, 2).linearize().modes(rtol=1e-18)
