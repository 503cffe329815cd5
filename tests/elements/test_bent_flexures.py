"""Flexures that bend: equilibrium, runs, the warning of far bending, strain on the surface."""

import warnings

import numpy as np
import pytest
from numpy.testing import assert_allclose

import mbsvib as mv
from tests.elements.test_flexure import LEAF, NOTCH, STEEL, B, E, L, T, guide, held


@pytest.mark.slow
def test_equilibrium_and_run_of_a_guide():
    """A guide lowers its stage by 3 x^2 / 5 L, 1.2 is the integral of squared slopes; released, it returns."""
    model = guide()
    soft = E * B * T**3 / 12
    force = 24 * soft / L**3 * 1e-3
    model.add_load("push", "stage", (force, 0, 0))
    bent = model.equilibrium()
    x, _, z = np.array(bent.bodies["stage"].position) - model.bodies["stage"].position
    assert_allclose(x, 1e-3, rtol=2e-3)
    assert_allclose(z, -0.6 * x**2 / L, rtol=2e-3)
    there = bent.linearize().modes().frequencies
    assert_allclose(there[0], model.linearize().modes().frequencies[0], rtol=2e-2)
    back = bent.with_parts(loads={}).equilibrium()
    assert_allclose(back.bodies["stage"].position, model.bodies["stage"].position, atol=1e-12)
    assert_allclose(back.beams["left"].points, model.beams["left"].points, atol=1e-12)
    run = model.simulate(np.linspace(0.0, 0.05, 101))          # the force at once: twice as far, and back
    assert run["x"].max() == pytest.approx(2 * x, rel=1e-2)
    assert_allclose(run["z"], -0.6 * run["x"] ** 2 / L, atol=0.02 * np.abs(run["z"]).max())
    assert np.abs(run.energy.balance).max() < 1e-6 * force * x


def test_bending_far_is_warned_of():
    model = mv.Model("strip")
    model.add_body("tip", 0.1, (1e-4, 1e-4, 1e-4), (0, 0, L / 2))
    model.add_flexure("f", "ground", "tip", LEAF, STEEL)
    moment = E * B * T**3 / 12 / L * 0.2
    model.add_load("turn", "tip", torque=(0, moment, 0))
    with pytest.warns(mv.LargeDisplacementWarning, match=r"flexure 'f' bends by 0.2 rad"):
        model.equilibrium()
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        model.with_values({"turn.torque.y": 0.5 * moment}).equilibrium()


def test_strain_of_a_leaf():
    """On its surface E eps = M t / 2 I; of a notch it is refused."""
    model = held(LEAF)
    model.add_strain_output("gauge", "f.e1", "middle", "z")
    response = model.linearize().frequency_response([0.0])[-1, 4, 0].real
    assert_allclose(abs(response), T / 2 / (E * B * T**3 / 12), rtol=1e-10)
    other = held(NOTCH)
    other.add_strain_output("gauge", "f.e1", "middle", "z")
    with pytest.raises(mv.ModelError, match="flexure 'f' is not constant"):
        other.linearize()
