"""Loops at and beside poles of the plant, where responses with open loops cancel: closed forms and many digits."""

from contextlib import nullcontext

import control
import numpy as np
import pytest

import mbsvib as mv
from mbsvib import isolation, library
from tests.feedback.test_closed_loops import slider
from tests.support import closed_loops as reference
from tests.support import sampled_loops

BESIDE = [20.0, np.nextafter(20.0, 30.0), *(20.0 * (1.0 + x) for x in (1e-15, -1e-15, 1e-12, 1e-8, -1e-5))]
FILTER = control.ss([[-300.0]], [[1.0]], [[-900.0]], [[0.0]])
SERVO = control.tf2ss([30.0, 800.0], [1e-3, 1.0]) * -1.0
PORTS = np.array([[0.0, 0.0], [0.5, 0.5]])


def pair():
    """Two masses on springs, velocities fed back to both; M, C, K and A, B, C."""
    k, b = np.array([[500.0, -100.0], [-100.0, 300.0]]), np.array([[1.0, 0.0, 1.0], [0.0, 1.0, 0.0]])
    zero, one = np.zeros((2, 2)), np.eye(2)
    system = mv.System.from_matrices(one, zero, k, b, [[0, 0], [0, 0], [1, 0]], [[1, 0], [0, 1], [0, 0]],
                                     inputs=["a", "b", "d"], outputs=["v", "w", "x"])  # fmt: skip
    shown = np.vstack((np.eye(4)[2:], np.eye(4)[:1]))
    law = control.ss(np.diag([-30.0, -50.0]), one, -np.array([[90.0, 20.0], [10.0, 60.0]]), zero)
    space = np.block([[zero, one], [-k, zero]]), np.vstack((np.zeros((2, 3)), b)), shown
    return system.feedback(law, ["v", "w"], ["a", "b"]), space, law


def test_filtered_velocity_feedback_at_the_natural_frequency():
    """x = 1 / (k - m w^2 + i w 900 / (i w + 300)): smooth where the plant has a pole, which made it 20 % wrong."""
    loop, w = slider(800.0).feedback(FILTER, "v", "F"), np.array(BESIDE)
    stiff = 2.0 * (20.0 - w) * (20.0 + w)
    exact = 1.0 / (stiff + 900j * w / (1j * w + 300.0))
    for each in (w, *w[:, None]):  # all at once, and one by one
        value = loop.frequency_response(each, "x", "disturbance")[0, 0]
        np.testing.assert_allclose(value, exact[np.isin(w, each)], rtol=1e-11)
    assert loop.frequency_response([20.0], "x", "F")[0, 0, 0] == pytest.approx(0.00111 - 0.01667j, abs=6e-6)
    s = stiff / (stiff + 900j * w / (1j * w + 300.0))
    np.testing.assert_allclose(loop.sensitivity(w)[0, 0], s, rtol=1e-11, atol=1e-14)


@pytest.mark.few(3)
@pytest.mark.parametrize(("rate", "delay"), [(1000.0, 0.0), (300.0, 0.0085), (5.0, 0.07)])
@pytest.mark.parametrize("w", [BESIDE[0], BESIDE[1], BESIDE[-2]])
def test_sampled_filtered_velocity_feedback(rate, delay, w):
    """At one rounding beside the pole the response was 7e5 in place of 0.017, and on it refused."""
    loop = slider(800.0).feedback(FILTER, "v", "F").sampled(rate, delay)
    space = np.array([[0.0, 1.0], [-400.0, 0.0]]), PORTS, np.array([[0.0, 1.0], [1.0, 0.0]])
    exact, s = sampled_loops.response(space, FILTER, rate, delay, w)
    np.testing.assert_allclose(loop.response(np.array([w]))[[1, 0], :, 0], exact, rtol=1e-12)
    np.testing.assert_allclose(loop.sensitivity([w])[..., 0], s, atol=1e-12)


@pytest.mark.few(1)
@pytest.mark.parametrize("rate", [1000.0, 2.0])
def test_two_actuators_sampled(rate):
    """Next to poles of the plant, and where sampling folds them to."""
    loop, space, law = pair()
    at = np.abs(loop.open_loop.poles()[0]) * np.array([1.0, 1.0 + 1e-9])
    sampled = loop.sampled(rate, 1e-4)
    for w in (*at, abs(at[0] - 2.0 * np.pi * rate)):
        exact, s = sampled_loops.response(space, law, rate, 1e-4, w)
        np.testing.assert_allclose(sampled.response(np.array([w]))[..., 0], exact, rtol=1e-11)
        np.testing.assert_allclose(sampled.sensitivity([w])[..., 0], s, atol=1e-11)


def test_sensitivity_of_two_actuators_on_a_pole():
    """(1 - K G)^-1 with a G that is infinite in one direction only: as 1 plus a closed-loop response."""
    loop, (a, b, c), law = pair()
    for w in np.abs(loop.open_loop.poles()[[0, 2]]) * [1.0, 1.0 + 1e-11]:
        closed = np.block([[a, b[:, :2] @ law.C], [law.B @ c[:2], law.A]])
        into = np.vstack((b[:, :2], np.zeros((2, 2))))
        exact = np.eye(2) + law.C @ np.linalg.solve(1j * w * np.eye(6) - closed, into)[4:]
        np.testing.assert_allclose(loop.sensitivity([w])[..., 0], exact, atol=1e-11)


@pytest.mark.parametrize("w", [1e-8, 1e-4, 1.0])
def test_a_free_mass_under_its_servo_at_low_frequencies(w):
    """x = 1 / (800 ...): at 1e-8 rad/s it was 0, and its imaginary part 5e4 sampled."""
    loop = slider().feedback(SERVO, "x", "F")
    exact = 1.0 / ((30j * w + 800.0) / (1e-3j * w + 1.0) - 2.0 * w**2)
    value = loop.frequency_response([w], "x", "disturbance")[0, 0, 0]
    assert value == pytest.approx(exact, rel=1e-12)
    assert value.imag == pytest.approx(exact.imag, rel=1e-7)
    sampled = loop.sampled(1000.0, 3e-4)
    space = np.array([[0.0, 1.0], [0.0, 0.0]]), PORTS, np.eye(2)
    exact = sampled_loops.response(space, SERVO, 1000.0, 3e-4, w)[0][0, 1]
    value = sampled.frequency_response([w], "x", "disturbance")[0, 0, 0]
    assert value == pytest.approx(exact, rel=1e-11)
    assert value.imag == pytest.approx(exact.imag, rel=1e-6)


@pytest.mark.slow
def test_hexapod_without_damping_under_force_feedback():
    """At its lowest natural frequency, which three modes share, in 40 digits; it was 15 % wrong."""
    plant = isolation.actuated(library.cubic_hexapod(damping=0.0), "platform")
    loop = plant.with_gains(isolation.force_feedback(plant, 300.0, 1.0))
    w = float(plant.system.poles().imag[0]) * (1.0 + 3e-15)
    exact = np.array(reference.response(plant.system, loop.law, loop.sensors, loop.actuators, w), dtype=complex)
    value = loop.response(np.array([w]))[..., 0]
    large = np.abs(exact) > 1e-6 * np.abs(exact).max()
    np.testing.assert_allclose(value[large], exact[large], rtol=1e-10)


@pytest.mark.few(2)
@pytest.mark.parametrize("proportional", [0.0, 30.0, 300.0])
@pytest.mark.parametrize("rate", [100.0, 1e4])
def test_sampled_pi_on_a_velocity_at_rest(proportional, rate):
    """The pole at z = 1 is in no response: that at 0 Hz was refused, and 1e-9 rad/s had lost half of the digits."""
    law = control.ss([[0.0]], [[1.0]], [[-9.0]], [[-proportional]])
    loop = slider(800.0, 4.0).feedback(law, "v", "F").sampled(rate)
    space = np.array([[0.0, 1.0], [-400.0, -2.0]]), PORTS, np.array([[0.0, 1.0], [1.0, 0.0]])
    for w in (0.0, 1e-9, 1e-3):
        exact, s = sampled_loops.response(space, law, rate, 0.0, w or 1e-25)
        value = loop.frequency_response([w], "x", "disturbance")[0, 0, 0]
        assert value == pytest.approx(exact[1, 1], rel=1e-11)
        assert value.imag == pytest.approx(exact[1, 1].imag, rel=1e-5, abs=1e-18)
        assert loop.sensitivity([w])[0, 0, 0] == pytest.approx(s[0, 0], rel=1e-7)


def free_pair():
    """Two free masses of 2 kg, a spring between them that a controller adds to, force and distance between them."""
    k = np.array([[100.0, -100.0], [-100.0, 100.0]])
    system = mv.System.from_matrices(2.0 * np.eye(2), 0.02 * k, k, [[-1.0, 1.0], [1.0, 0.0]], [[-1.0, 1.0], [1.0, 0.0]],
                                     inputs=["F", "push"], outputs=["d", "x"])  # fmt: skip
    return system.feedback([[-30.0]], "d", "F")


def test_sampled_loop_of_free_masses_between_them():
    """d'' + 2 d' + 100 d = F - 30 d at samples; the masses drift together at z = 1, which d does not show."""
    loop = free_pair().sampled(1e3, 2e-4)
    alone = mv.System.from_matrices([[1.0]], [[2.0]], [[100.0]], [[1.0]], [[1.0]], inputs=["F"], outputs=["d"])
    alone = alone.feedback([[-30.0]], "d", "F").sampled(1e3, 2e-4)
    w = np.array([0.0, 1e-9, 1.0, 20.0])
    np.testing.assert_allclose(loop.frequency_response(w, "d", "F"), alone.frequency_response(w), rtol=1e-11)
    np.testing.assert_allclose(loop.frequency_response(w, "x", "F"), -0.5 * alone.frequency_response(w), rtol=1e-11)
    np.testing.assert_allclose(loop.sensitivity(w), alone.sensitivity(w), rtol=1e-7)
    assert loop.h2_norm("d", "F").value == pytest.approx(alone.h2_norm().value, rel=1e-11)
    for output, source in (("x", "push"), ("d", "push")):
        with pytest.raises(mv.ResponseError, match="the norm is infinite") if output == "x" else nullcontext():
            loop.h2_norm(output, source)
    with pytest.raises(mv.ResponseError, match="0 rad/s equals a pole of"):
        loop.response(np.array([0.0]))


def static():
    return mv.StateSpace.from_arrays(np.zeros((0, 0)), np.zeros((0, 1)), np.zeros((1, 0)), [[2.0]])


@pytest.mark.few(1)
@pytest.mark.parametrize("rate", [None, 50.0])
def test_margins_without_dynamics(rate):
    """A static plant and an integrator that is not fed back have no pole that tells a band; both ended in errors."""
    integrator = mv.StateSpace.from_arrays([[0.0]], [[1.0]], [[1.0]], 0)
    for plant, gain, modulus in ((static(), -0.2, None), (integrator, 0.0, 1.0)):
        loop = plant.feedback([[gain]], "y1", "u1")
        margins = (loop if rate is None else loop.sampled(rate)).margins()
        if modulus is not None:
            assert margins.modulus == pytest.approx(modulus, rel=1e-9)
        elif rate is None:
            assert margins.modulus == pytest.approx(1.4, rel=1e-9)
            assert margins.gain[0] == np.inf


@pytest.mark.parametrize("w", [0.0, 1e-300])
def test_loop_gain_at_a_pole_of_a_sampled_plant(w):
    """A chain of three integrators: so close to 0 numbers overflowed with a warning of numpy."""
    plant = mv.StateSpace.from_arrays(np.triu(np.ones((3, 3)), 1), [[1.0], [2.0], [3.0]], [[1.0, 2.0, 3.0]], 0)
    with pytest.raises(mv.ResponseError, match="has a pole at one of the frequencies"):
        plant.feedback([[-0.5]], "y1", "u1").sampled(10.0).loop_gain([w])


def test_frequencies_whose_phase_at_samples_is_not_known_are_refused():
    """They overflowed with a warning of numpy; a list ended in TypeError."""
    loop = pair()[0].sampled(10.0)
    assert loop.response([2.0, 1e16]).shape == (3, 3, 2)
    with pytest.raises(mv.ResponseError, match=r"omega = 1e\+18 .* at 10 Hz, and beyond 4\.5.*e\+16 rad/s"):
        loop.response([2.0, 1e18])


def test_margins_of_a_loop_at_the_limit_of_stability():
    """A pole of the closed loop on the imaginary axis leaves no margin; meeting it ended in LinAlgError."""
    for loop, hertz in ((slider().feedback([[-800.0]], "x", "F"), 20.0 / (2.0 * np.pi)),
                        (static().feedback([[-0.5]], "y1", "u1").sampled(50.0), None)):  # fmt: skip
        margins = loop.margins()
        assert margins.modulus < 1e-9
        assert margins.phase[0] < 1e-9
        if hertz is not None:
            assert margins.frequency == pytest.approx(hertz, rel=1e-9)
            assert (margins.lower[0], margins.gain[0], margins.delay[0]) == (1.0, 1.0, 0.0)
    with pytest.raises(mv.ResponseError, match="20 rad/s is a pole of 'slider with controller'"):
        slider().feedback([[-800.0]], "x", "F").sensitivity([20.0])


@pytest.mark.parametrize(("integral", "proportional"), [(10.0, 0.0), (37.0, 5.0), (100.0, 5.0)])
def test_step_of_a_loop_with_pi_on_a_relative_rate(integral, proportional):
    """The integral of a rate is a displacement: its gain is a spring, and the pole at 0 in no response."""
    k = np.array([[1300.0, -500.0], [-500.0, 500.0]])
    system = mv.System.from_matrices(2.0 * np.eye(2), 0.006 * k, k, [[-1.0], [1.0]], [[-1.0, 1.0], [0.0, 0.0]],
                                     [[0.0, 0.0], [-1.0, 1.0]], inputs=["F"], outputs=["x", "v"])  # fmt: skip
    loop = system.feedback(control.ss([[0.0]], [[1.0]], [[-integral]], [[-proportional]]), "v", "F")
    exact = 1.0 / (500.0 + integral)
    assert loop.step_info("x", "F").final[0, 0] == pytest.approx(exact, rel=1e-10)
    assert loop.frequency_response([0.0], "x", "F")[0, 0, 0] == pytest.approx(exact, rel=1e-10)
