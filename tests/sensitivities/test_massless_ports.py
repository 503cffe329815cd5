"""Ports on a body without mass, whose rows depend on the stiffnesses that hold it: two springs in series."""

import numpy as np
import pytest

import mbsvib as mv

MASS, UPPER, LOWER = 2.0, 3000.0, 5000.0
PARAMETERS = ["upper.stiffness.z", "lower.stiffness.z"]
STEP = 1e-30


def series(carrier, massive=True):
    """A mass on two springs in series, the upper joint from ground or from the node between the springs."""
    model = mv.Model()
    model.add_body("node", 0.0, (0.0, 0.0, 0.0), (0.0, 0.0, 0.5))
    model.add_body("mass", MASS, (1.0, 1.0, 1.0), (0.0, 0.0, 1.0))
    model.add_joint("below", "prismatic", "ground", "node", axis=(0, 0, 1))
    model.add_joint("above", "prismatic", carrier, "mass", axis=(0, 0, 1))
    model.add_bushing("lower", "ground", "node", (0, 0, 0), (0, 0, LOWER, 0, 0, 0))
    model.add_bushing("upper", "node", "mass", (0, 0, 0.75), (0, 0, UPPER, 0, 0, 0))
    model.add_input("F", "mass", (0, 0, 1))
    if massive:
        model.add_input("push", "node", (0, 0, 1))
    model.add_output("x", "node", (0, 0, 1))
    model.add_output("y", "mass", (0, 0, 1))
    return model.linearize()


def complex_steps(function):
    """The derivatives of a function of both stiffnesses."""
    return np.array([np.imag(function(UPPER + a * 1j * STEP, LOWER + b * 1j * STEP)) / STEP
                     for a, b in ((1, 0), (0, 1))])  # fmt: skip


def response(upper, lower, w):
    """[node, mass] by [force on the mass, force on the node], at w [rad/s]."""
    inertia = MASS * w**2
    det = upper * lower - inertia * (upper + lower)
    return np.array([[upper, upper - inertia], [upper + lower, upper]]) / det


@pytest.mark.few(2)
@pytest.mark.parametrize("carrier", ["ground", "node"])
@pytest.mark.parametrize("w", [0.0, 10.0, 50.0])
def test_frequency_responses_at_a_massless_node(carrier, w):
    system, expected = series(carrier), complex_steps(lambda a, b: response(a, b, w))
    slopes = system.frequency_response_sensitivities([w], PARAMETERS)[..., 0]
    assert np.allclose(slopes, expected, rtol=1e-8, atol=1e-14)
    alone = series(carrier, massive=False).frequency_response_sensitivities([w], PARAMETERS, "x")[..., 0]
    assert np.allclose(alone, expected[:, :1, :1], rtol=1e-8, atol=1e-14)
    of_mass = system.frequency_response_sensitivities([w], PARAMETERS, "y", "F")[..., 0]
    assert np.allclose(of_mass, expected[:, 1:, :1], rtol=1e-12, atol=0.0)


@pytest.mark.parametrize("carrier", ["ground", "node"])
def test_time_responses_at_a_massless_node(carrier):
    time = np.linspace(0.0, 0.4, 5)

    def steps(upper, lower):
        """[node, mass] after a unit step of the force on the mass."""
        stiffness = upper * lower / (upper + lower)
        mass = (1.0 - np.cos(np.sqrt(stiffness / MASS) * time)) / stiffness
        return np.array([upper / (upper + lower) * mass, mass])

    expected = complex_steps(steps)
    slopes = series(carrier, massive=False).time_response_sensitivities(time, np.ones(5), PARAMETERS)
    assert np.allclose(slopes, expected, rtol=0, atol=1e-9 * np.abs(expected).max())


@pytest.mark.parametrize("carrier", ["ground", "node"])
def test_rows_of_a_massless_node(carrier):
    slopes = series(carrier).matrix_derivatives(PARAMETERS)
    # coordinates of the mass: its displacement, or that against the node
    unit = (lambda a, b: 1.0) if carrier == "ground" else (lambda a, b: (a + b) / b)
    row = complex_steps(lambda a, b: a / (a + b) * unit(a, b))
    assert np.allclose(slopes.Cq[:, 0, 0], row, rtol=0, atol=1e-12)
    assert np.allclose(slopes.B[:, 0, 1], row, rtol=0, atol=1e-12)
    assert np.allclose(slopes.D[:, 0, 1], complex_steps(lambda a, b: 1.0 / (a + b)), rtol=1e-8, atol=0.0)
