"""Sensitivities beside a reduced model, whose matrices no rule of a part holds."""

import numpy as np
import pytest

from tests.sensitivities.differences import assert_derivative, difference, eigenvalues, step_of
from tests.superelements.test_superelement import with_hub


@pytest.mark.slow
def test_what_hangs_on_a_reduced_pipe():
    model = with_hub(4)
    model.add_bushing("mount", "ground", "hub", (0, -0.25, 0.3), (1e5, 2e5, 3e5, 1e3, 2e3, 3e3),
                      damping=(10.0, 10.0, 10.0, 1.0, 1.0, 1.0))  # fmt: skip
    model.add_input("push", "pipe.right", "z")
    model.add_output("move", "pipe.right", "z")
    system = model.linearize()
    names = ["hub.mass", "hub.inertia.xx", "mount.stiffness.x", "mount.damping.z", "mount.position.x"]
    result, values = system.eigenvalue_sensitivities(names), system.modes().eigenvalues
    w = np.array([0.0, 300.0])
    responses = system.frequency_response_sensitivities(w, names)
    for k, name in enumerate(names):
        step = step_of(system.parameters, name)
        assert_derivative(result[k], difference(model, system, name, eigenvalues), values, step, 1e-6)
        expected = difference(model, system, name, lambda s: s.frequency_response(w))
        assert np.abs(responses[k] - expected).max() <= 1e-6 * np.abs(expected).max() + 1e-15
