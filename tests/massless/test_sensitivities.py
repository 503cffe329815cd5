"""Sensitivities of eigenvalues where motions are condensed or of first order, against differences."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from tests.massless.scenes import along_z
from tests.massless.test_maxwell import isolator
from tests.massless.test_random_networks import network


def differences(model, name):
    value = model.parameters[name]
    step = 2e-4 * abs(value)
    poles = [model.with_values({name: value + k * step}).linearize().modes().eigenvalues for k in (-2, -1, 1, 2)]
    return (poles[0] - 8 * poles[1] + 8 * poles[2] - poles[3]) / (12 * step)


def test_springs_in_series():
    """d ln omega / d ln k1 = k / (2 k1) with 1/k = 1/k1 + 1/k2."""
    k1, k2 = 3.0, 5.0
    springs = {"k1": ("ground", "node", k1, 0), "k2": ("node", "b", k2, 0)}
    system = along_z({"node": 0.0, "b": 2.0}, springs).linearize()
    result = system.eigenvalue_sensitivities(["k1.stiffness", "k2.stiffness", "b.mass"])
    k = 1 / (1 / k1 + 1 / k2)
    expected = np.array([k / (2 * k1**2), k / (2 * k2**2), -1 / 4])[:, None] * system.modes().eigenvalues
    assert_allclose(result, expected, rtol=1e-12)


@pytest.mark.few(2)
@pytest.mark.parametrize("name", ["s3.stiffness", "s11.stiffness", "s13.stiffness", "s5.damping", "b.mass",
                                  "s13.start.x", "s7.start.x", "a.position.x"])  # fmt: skip
def test_a_network_with_both_kinds(name):
    model = network(1)
    system = model.linearize()
    result = system.eigenvalue_sensitivities([name])[0]
    size = np.abs(system.modes().eigenvalues) / abs(model.parameters[name])
    assert_allclose(result / size, differences(model, name) / size, rtol=1e-6, atol=1e-9)


@pytest.mark.parametrize("name", ["leg.stiffness", "leg.damping", "leg.static_stiffness", "m.mass"])
def test_maxwell_elements(name):
    model = isolator()
    system = model.linearize()
    result = system.eigenvalue_sensitivities([name])[0]
    assert_allclose(result, differences(model, name), rtol=1e-8)
