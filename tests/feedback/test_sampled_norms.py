"""Norms and zeros of sampled loops: closed forms, slow limits and python-control."""

import control
import numpy as np
import pytest
from scipy.linalg import block_diag

import mbsvib as mv
from tests.feedback.test_closed_loops import slider

LAW = control.ss([[-5.0, 0.0], [0.0, -300.0]], [[1.0, 0.3], [0.0, 1.0]], [[-3e2, -40.0]], [[-20.0, -9.0]])


def loop():
    return slider(800.0, 4.0).feedback(LAW, ["x", "v"], "F", name="law")["x", "disturbance"]


@pytest.mark.parametrize(("gain", "rate"), [(1.0, 10.0), (3.0, 2.0), (0.01, 1000.0), (1.9, 1.0)])
def test_h2_norm_of_an_integrator_in_closed_form(gain, rate):
    """x' = w - k x(sample): the variance at samples is 1 / (k (2 - k h)), and x is (1 - k t) x(sample) + noise."""
    plant = mv.StateSpace.from_arrays([[0.0]], [[1.0]], [[1.0]], [[0.0]], inputs=["w"], outputs=["x"])
    h = 1.0 / rate
    exact = (1.0 - gain * h + (gain * h) ** 2 / 3.0) / (gain * (2.0 - gain * h)) + 0.5 * h
    sampled = plant.feedback([[-gain]], "x", "w").sampled(rate)
    assert sampled.h2_norm().value == pytest.approx(exact**0.5, rel=1e-14 + 1e-16 / (gain * h))


def test_poles_on_the_unit_circle_that_are_not_in_the_norm():
    """Vibrations without damping that the input does not excite: rounding puts some of them outside the circle."""
    turns = [np.array([[0.0, w], [-w, 0.0]]) for w in (0.1, 0.7, 1.9, 3.1, 5.3, 7.7)]
    t = np.linalg.qr(np.random.default_rng(0).normal(size=(13, 13)))[0]
    a, b = t @ block_diag([[0.0]], *turns) @ t.T, t[:, :1]
    hidden = mv.StateSpace.from_arrays(a, b, b.T, 0, inputs=["w"], outputs=["x"])
    alone = mv.StateSpace.from_arrays([[0.0]], [[1.0]], [[1.0]], 0, inputs=["w"], outputs=["x"])
    norms = [plant.feedback([[-3.0]], "x", "w").sampled(10.0).h2_norm().value for plant in (hidden, alone)]
    assert norms[0] == pytest.approx(norms[1], rel=1e-13)


def test_h2_norm_of_fast_samples_is_that_in_continuous_time():
    exact = loop().h2_norm().value
    errors = [abs(loop().sampled(rate).h2_norm().value / exact - 1.0) for rate in (1e4, 1e6)]
    assert errors[1] < 0.02 * errors[0] < 1e-3


@pytest.mark.slow
def test_h2_norm_has_what_sampling_folds():
    """The components at the frequency of the excitation alone have less variance than the outputs."""
    sampled = loop().sampled(12.0)
    w = np.linspace(0.0, 2e4, 400_001)
    direct = np.trapezoid(np.abs(sampled.frequency_response(w)[0, 0]) ** 2, w) / np.pi
    assert direct**0.5 < 0.999 * sampled.h2_norm().value


@pytest.mark.parametrize("delay", [0.0, 2.0])
def test_zeros_and_poles_against_python_control(delay):
    rate = 150.0
    sampled = slider(800.0, 4.0).feedback(LAW, ["x", "v"], "F").sampled(rate, delay / rate)
    space = sampled.plant.space
    plant = control.c2d(control.ss(space.A, space.B, space.C, space.D), 1.0 / rate)
    shift = control.ss([[0, 1], [0, 0]], [[0], [1]], [[1, 0]], 0, 1.0 / rate) if delay else control.ss(
        [], [], [], [[1.0]], 1.0 / rate)  # fmt: skip
    names, force = space.outputs, space.inputs.index("F")
    rows = [names.index("x"), names.index("v")]
    law = shift * control.c2d(LAW, 1.0 / rate, "tustin")
    select = np.zeros((len(space.inputs), 1))
    select[force] = 1.0
    closed = control.feedback(plant, control.ss([], [], [], select, 1.0 / rate) * law * control.ss(
        [], [], [], np.eye(len(names))[rows], 1.0 / rate), sign=1)  # fmt: skip
    for source in space.inputs:
        part = closed[names.index("x"), space.inputs.index(source)]
        exact = rate * np.log(part.zeros().astype(complex))
        exact = exact[np.abs(np.exp(exact / rate)) > 1e-5]
        zeros = sampled.transmission_zeros("x", source)
        assert len(zeros) == len(exact)
        made, expected = (np.sort_complex(np.exp(values / rate)) for values in (zeros, exact))
        np.testing.assert_allclose(made, expected, atol=1e-8)


@pytest.mark.parametrize(("ask", "message"), [
    (lambda: slider(800.0, 4.0).feedback([[-0.3]], "a", "F")["x", "disturbance"].sampled(100.0).h2_norm(),
     "'disturbance' acts directly on what the controller samples, 'a'"),
    (lambda: slider(800.0, 4.0).feedback(LAW, ["x", "v"], "F")["a", "disturbance"].sampled(1e3).h2_norm(),
     "'disturbance' acts directly on output 'a'"),
    (lambda: loop().sampled(100.0, 0.1).h2_norm(), "does not decay"),
    (lambda: loop().sampled(100.0).hinf_norm(), r"ask loop\.continuous"),
])  # fmt: skip
def test_infinite_and_missing_norms_are_refused(ask, message):
    with pytest.raises(mv.ResponseError, match=message):
        ask()
