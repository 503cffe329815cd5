"""Sampled loops in time and in figures, against a simulation from event to event."""

import control
import numpy as np
import pytest
from scipy.linalg import expm

import mbsvib as mv
from mbsvib import plots
from tests.feedback.test_closed_loops import slider
from tests.support import sampled_loops

LAW = control.ss([[-5.0, 0.0], [0.0, -300.0]], [[1.0, 0.3], [0.0, 1.0]], [[-3e3, -40.0]], [[-200.0, -0.3]])


def loop():
    return slider(800.0, 4.0).feedback(LAW, ["x", "a"], "F", name="law")


def events(plant, rate, delay, t, record, linear):
    """Outputs at times t: the state advances by matrix exponentials from one event to the next."""
    space = plant.state_space()
    law, states, inputs = control.c2d(LAW, 1.0 / rate, "tustin"), len(space.A), len(space.inputs)
    sensors, actuator = [space.outputs.index(name) for name in ("x", "a")], space.inputs.index("F")
    samples = np.arange(int(t[-1] * rate + 1e-9) + 1) / rate
    instants = samples, samples + delay, t
    queue = [(time, kind, i) for kind, times in enumerate(instants) for i, time in enumerate(times)]
    x, z, force, waiting, now = np.zeros(states), np.zeros(2), 0.0, {}, 0.0
    result = np.zeros((len(space.outputs), len(t)))

    def given(time):
        if linear:
            return np.array([np.interp(time, t, row) for row in record])
        return record[:, np.searchsorted(t, time + 1e-12, side="right") - 1]

    for time, kind, i in sorted((round(time, 13), kind, i) for time, kind, i in queue if time <= t[-1] + 1e-12):
        if time > now:
            start = given(now)
            slope = given(time) - start if linear else 0.0 * start
            start = start.copy()
            start[actuator] += force
            block = np.zeros((states + 2 * inputs,) * 2)
            block[:states, :states], block[:states, states : states + inputs] = space.A, space.B
            block[states : states + inputs, states + inputs :] = np.eye(inputs) / (time - now)
            x = (expm(block * (time - now)) @ np.concatenate((x, start, slope)))[:states]
            now = time
        u = given(time).copy()
        u[actuator] += force
        y = space.C @ x + space.D @ u
        if kind == 0:
            waiting[i] = (law.C @ z + law.D @ y[sensors])[0]
            z = law.A @ z + law.B @ y[sensors]
        elif kind == 1:
            force = waiting[i]
        else:
            result[:, i] = y
    return result


@pytest.mark.parametrize(("rate", "delay", "hold"), [
    (200.0, 0.0, "first"), (200.0, 1.3e-3, "zero"), (50.0, 0.031, "first"), (333.0, 0.002, "zero"),
])  # fmt: skip
def test_time_response_between_samples(rate, delay, hold):
    sampled, t = loop().sampled(rate, delay), np.linspace(0.0, 0.3, 301)
    u = np.random.default_rng(3).normal(size=(2, len(t)))
    exact = events(slider(800.0, 4.0), rate, delay, t, u, hold == "first")
    error = np.abs(sampled.time_response(t, u, hold) - exact).max(axis=1)
    assert (error < 1e-8 * np.abs(exact).max(axis=1)).all()
    part = sampled.time_response(t, u[1], hold, outputs="v", inputs="disturbance")
    both = np.vstack((0.0 * u[0], u[1]))
    np.testing.assert_allclose(part[0], sampled.time_response(t, both, hold)[1], atol=1e-12)


@pytest.mark.parametrize(("stiffness", "law", "sensor", "rate", "samples"), [
    (800.0, control.ss([[-300.0]], [[1.0]], [[-900.0]], [[0.0]]), "v", 200.0, [1, 600, 19999, 20000]),
    (0.0, control.tf2ss([30.0, 800.0], [1e-3, 1.0]) * -1.0, "x", 200.0, [50, 20000]),
    (-800.0, control.tf2ss([40.0, 2000.0], [1e-4, 1.0]) * -1.0, "x", 1000.0, [50, 10000]),
])  # fmt: skip
def test_long_records_of_plants_that_do_not_decay(stiffness, law, sensor, rate, samples):
    """Without control these oscillate on, drift away or grow; what cancelled left 7 digits of the first after 100 s."""
    loop = slider(stiffness).feedback(law, sensor, "F").sampled(rate)
    t = np.array([0, *samples]) / rate
    value = loop.time_response(t, np.ones((1, len(t))), "zero", outputs="x", inputs="disturbance")[0, 1:]
    seen, force = [[1.0, 0.0]] if sensor == "x" else [[0.0, 1.0]], [[0.0], [0.5]]
    plant = [[0.0, 1.0], [-0.5 * stiffness, 0.0]], force, seen, force
    np.testing.assert_allclose(value, sampled_loops.step_response(plant, law, rate, samples), rtol=1e-12)


@pytest.mark.slow
def test_uneven_times_over_thousands_of_samples():
    """All at once, or asked for again from the tenth of them: states go on from one batch of periods to the next."""
    sampled, rng = loop().sampled(2e3, 1.3e-4), np.random.default_rng(7)
    t = np.cumsum(rng.uniform(1e-6, 6e-3, 1500))
    u = rng.normal(size=(2, len(t)))
    value = sampled.time_response(t, u)
    some = np.sort(rng.choice(len(t), 20, replace=False))
    for k in some[some > 0].tolist():
        np.testing.assert_allclose(sampled.time_response(t[: k + 1], u[:, : k + 1])[:, k], value[:, k],
                                   atol=1e-11 * np.abs(value).max())  # fmt: skip


def test_fast_samples_tend_to_continuous_time():
    t = np.linspace(0.0, 0.5, 101)
    u = np.vstack((np.zeros(101), np.ones(101)))
    exact = loop().time_response(t, u, "zero", outputs="x")
    errors = [np.abs(loop().sampled(rate).time_response(t, u, "zero", outputs="x") - exact).max()
              for rate in (2e3, 8e3)]  # fmt: skip
    assert errors[1] < 0.3 * errors[0] < 0.03 * np.abs(exact).max()


def test_modes_are_the_poles():
    sampled = loop().sampled(400.0, 1e-3)
    values, poles = np.sort_complex(sampled.modes().eigenvalues), np.sort_complex(sampled.poles())
    np.testing.assert_allclose(values, poles, rtol=1e-9)
    assert "Modes of slider with law at 400 Hz, delay 1 ms" in str(sampled.modes())


def test_the_continuous_loop_is_kept():
    sampled = loop()["x", "disturbance"].sampled(400.0)
    again = sampled.sampled(800.0).continuous
    assert (again.outputs, again.inputs) == (("x",), ("disturbance",))
    np.testing.assert_allclose(again.poles(), loop().poles(), rtol=1e-12)


@pytest.mark.slow
def test_continuous_and_sampled_loops_in_one_figure():
    continuous = loop()
    sampled = continuous.sampled(500.0, 0.5 / 500.0)
    bode = plots.bode([continuous, sampled], "x", "disturbance")
    line = bode.axes[0].lines[1]
    f = line.get_xdata()
    exact = np.abs(sampled.frequency_response(2.0 * np.pi * f, "x", "disturbance")[0, 0])
    np.testing.assert_allclose(line.get_ydata(), exact, rtol=1e-12)
    step = plots.step([continuous, sampled], "x", "disturbance", 0.5)
    assert len(step.axes[0].lines) == 4
    for draw in (plots.bode, plots.step, plots.nyquist, plots.singular_values):
        assert draw(sampled, "x", "disturbance").axes
    assert sampled.frequency_grid("x", "disturbance")[-1] <= np.pi * 500.0 * (1.0 + 1e-12)


@pytest.mark.parametrize(("ask", "message"), [
    (lambda: loop().sampled(100.0).step_info(), r"ask loop\.continuous"),
    (lambda: loop().sampled(100.0).time_response([0.0, 1.0], np.zeros((2, 2)), initial=np.zeros(2)), "starts at rest"),
    (lambda: loop().sampled(1e9).time_response([0.0, 1.0], np.zeros((2, 2))), r"1e\+09 samples at 1e\+09 Hz"),
    (lambda: slider().feedback([[-40.0]], "v", "F").sampled(100.0).frequency_response([0.0]),
     "0 rad/s equals a pole of"),
])  # fmt: skip
def test_refusals(ask, message):
    with pytest.raises(mv.ResponseError, match=message):
        ask()


def test_records_that_begin_late():
    """Only the length of a record counts, not when it begins."""
    loop = slider(800.0, 4.0).feedback([[-30.0]], "v", "F").sampled(1024.0)
    time, force = np.arange(21) / 1024.0, np.ones((2, 21))
    late = loop.time_response(time + 4096.0, force)
    np.testing.assert_allclose(late, loop.time_response(time, force), rtol=1e-9, atol=1e-14)
