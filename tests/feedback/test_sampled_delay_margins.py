"""Delay margins of sampled loops: closed forms, and the delay at which poles of the loop leave the circle."""

import control
import numpy as np
import pytest

import mbsvib as mv
from tests.feedback.test_closed_loops import slider


def carts(*masses):
    """Carts that nothing holds, each with a force and its velocity."""
    model = mv.Model("carts")
    for name, mass in zip("ab", masses, strict=False):
        model.add_body(name, mass, (1, 1, 1))
        model.add_joint(f"rail.{name}", "prismatic", "ground", name, axis=(1, 0, 0))
        model.add_input(f"F{name}", name, "x")
        model.add_output(f"v{name}", name, "x", quantity="velocity")
    return model.linearize()


def test_a_fast_rate_is_a_hold_that_is_late_by_half_a_period():
    """pi m / 2 g - T / 2 up to the square of T."""
    margins = carts(2.0).feedback([[-60.0]], ["va"], ["Fa"]).sampled(2000.0).margins()
    assert margins.delay[0] == pytest.approx(0.5 * np.pi * 2.0 / 60.0 - 0.25e-3, abs=1e-6)


@pytest.mark.slow
def test_a_band_beyond_half_the_rate_ends_there():
    loop = carts(2.0).feedback([[-60.0]], ["va"], ["Fa"]).sampled(200.0)
    assert loop.margins([0.1, 1e3]).delay == pytest.approx(loop.margins().delay, rel=1e-9)
    assert loop.margins([0.1, 1.0]).delay[0] == np.inf


@pytest.mark.slow
def test_carts_whose_velocities_are_fed_back():
    """z^2 - (1 - a (1 - d)) z + a d = 0 with a = g T / m and the delay d T: at a d = 1 for 1 < a < 2, abs(z) = 1.

    The phase at the samples gave 0.0213 and 0.0080 s in place of 0.0333 and 0.0269 s.
    """
    masses, gains, period = np.array([2.0, 0.7]), np.array([-60.0, -26.0]), 0.05
    margins = carts(*masses).feedback(np.diag(gains), ["va", "vb"], ["Fa", "Fb"]).sampled(1.0 / period).margins()
    np.testing.assert_allclose(margins.delay, -masses / gains, rtol=1e-9)
    turn = np.arccos(1.0 + 0.5 * gains * period / masses)
    np.testing.assert_allclose(margins.delay_at, turn / (2.0 * np.pi * period), rtol=1e-9)


@pytest.mark.slow
@pytest.mark.parametrize(("sensor", "pole", "gain", "rate", "delay", "kind"), [
    ("v", None, -60.0, 50.0, 0.004, "between"), ("v", None, -30.0, 30.0, 0.0, "between"),
    ("x", 300.0, 300.0, 60.0, 0.02, "between"), ("a", None, -1.9, 50.0, 0.013, "between"),
    ("a", 60.0, -1.7, 20.0, 0.0, "jump"), ("a", 20.0, -2.6, 50.0, 0.008, "jump"),
    ("a", 5.0, -4.0, 30.0, 0.0, "jump"),
])  # fmt: skip
def test_poles_leave_the_circle_at_the_delay_margin(sensor, pole, gain, rate, delay, kind):
    """At a whole number of periods the loop gain of an acceleration jumps, and poles with it."""
    law = control.ss([], [], [], [[gain]]) if pole is None else control.tf([gain * pole], [1.0, pole])
    loop = slider(800.0, 4.0).feedback(law, [sensor], ["F"])
    margin = loop.sampled(rate, delay).margins().delay[0]
    late = np.concatenate((np.linspace(0.0, 1.0, 40)[:-1], [1.0 - 1e-6]))
    assert all(loop.sampled(rate, delay + share * margin).stable for share in late)
    assert not loop.sampled(rate, delay + (1.0 + 1e-6) * margin).stable
    whole = (delay + margin) * rate
    assert ("jump" if abs(whole - round(whole)) < 1e-9 else "between") == kind


@pytest.mark.slow
@pytest.mark.parametrize(("k", "kb", "c", "gain", "pole", "rate"), [
    (523.0, 7048.0, 2.76, -2.56, 39.6, 48.85), (421.3, 5628.0, 4.41, -2.397, 9.433, 42.79),
])  # fmt: skip
def test_a_pole_that_leaves_the_circle_at_half_the_rate(k, kb, c, gain, pole, rate):
    plant = mv.System.from_matrices(np.diag([2.0, 0.5]), [[4.0 + c, -c], [-c, c]], [[k + kb, -kb], [-kb, kb]],
                                    [[1.0], [0.0]], Ca=[[1.0, 0.0]])  # fmt: skip
    loop = plant.feedback(control.tf([0.5 * gain, gain * pole], [1.0, pole]), plant.outputs, plant.inputs)
    margins = loop.sampled(rate).margins()
    assert margins.delay_at[0] == 0.5 * rate
    assert loop.sampled(rate, (1.0 - 1e-6) * margins.delay[0]).stable
    assert not loop.sampled(rate, (1.0 + 1e-6) * margins.delay[0]).stable


@pytest.mark.slow
def test_a_delay_of_one_period_is_a_whole_one():
    """1 / rate * rate is below 1 by rounding, which made the margin 0: the jump at one period is no longer ahead."""
    rate = 19.399517543228704
    assert 1.0 / rate * rate < 1.0
    plant = mv.System.from_matrices(np.diag([1.0, 2.6257]), [[7.76, -7.76], [-7.76, 7.76]],
                                    [[980.0, -150.7], [-150.7, 150.7]], [[1.0], [0.0]], Ca=[[1.0, 0.0]])  # fmt: skip
    loop = plant.feedback([[-0.80686]], plant.outputs, plant.inputs)
    margin = loop.sampled(rate, 1.0 / rate).margins().delay[0]
    assert margin > 0.01 / rate
    assert loop.sampled(rate, 1.0 / rate + (1.0 - 1e-6) * margin).stable
    assert not loop.sampled(rate, 1.0 / rate + (1.0 + 1e-6) * margin).stable
    assert margin == pytest.approx(loop.sampled(rate, (1.0 + 1e-12) / rate).margins().delay[0], abs=1e-11 / rate)


@pytest.mark.slow
@pytest.mark.parametrize(("sensor", "k", "c", "pole", "gain", "periods"), [
    ("Ca", 72554.7, 5.387, None, -0.0267259, 5.8860), ("Cv", 50724.9, 4.504, 252.88, -10.8163, 3.2154),
    ("Ca", 56243.8, 4.743, None, -0.0249655, 35.9017), ("Ca", 9631.8, 1.963, 14.3, 0.155538, 242.9907),
    ("Cq", 43615.3, 125.306, None, 26996.0, 8.8465), ("Ca", 44422.1, 126.459, None, 0.423586, 2.8772),
    ("Ca", 66088.7, 154.246, None, -0.444564, 0.7707), ("Cv", 35480.6, 37.673, None, 42.7374, 6.1415),
])  # fmt: skip
def test_a_loop_gain_that_is_above_1_at_some_remainders_only(sensor, k, c, pole, gain, periods):
    """Most of these had no delay margin, the others one at which poles had left the circle long ago."""
    plant = mv.System.from_matrices(np.eye(1), [[c]], [[k]], [[1.0]], **{sensor: [[1.0]]})
    law = control.ss([], [], [], [[gain]]) if pole is None else control.tf([gain * pole], [1.0, pole])
    loop, rate = plant.feedback(law, plant.outputs, plant.inputs), 100.0
    margin = loop.sampled(rate).margins().delay[0]
    assert margin * rate == pytest.approx(periods, abs=1e-4)
    late = np.concatenate((np.linspace(0.0, 1.0, 12)[:-1], [1.0 - 1e-6]))
    assert all(loop.sampled(rate, share * margin).stable for share in late)
    assert not loop.sampled(rate, (1.0 + 1e-6) * margin).stable


def test_delays_that_were_not_looked_at_are_warned_of(monkeypatch):
    monkeypatch.setattr("mbsvib.feedback.sampled_delay.TURNS", 100)
    plant = mv.System.from_matrices(np.eye(1), [[1.963]], [[9631.8]], [[1.0]], Ca=[[1.0]])
    loop = plant.feedback(control.tf([0.155538 * 14.3], [1.0, 14.3]), plant.outputs, plant.inputs).sampled(100.0)
    assert loop.margins().delay[0] == pytest.approx(2.429907, abs=1e-6)
    monkeypatch.setattr("mbsvib.feedback.sampled_delay.TURNS", 20)
    with pytest.warns(mv.AccuracyWarning, match=r"'u1' stays stable with delays up to 1\.\d* s; not all of the longer"):
        assert loop.margins().delay[0] == pytest.approx(2.43, abs=1e-6)  # of the jump


@pytest.mark.parametrize(("mass", "hertz", "title", "unit"), [
    (1e-12, 1e7, "at 400 MHz, delay 1.25 ns", "[ns]"), (2.0, 50.0, "at 2000 Hz, delay 0.25 ms", "[ms]"),
    (1e7, 1e-2, "at 0.4 Hz, delay 1.25 s", "[s]")])  # fmt: skip
def test_delays_are_told_in_units_of_their_size(mass, hertz, title, unit):
    w = 2.0 * np.pi * hertz
    plant = mv.System.from_matrices([[mass]], [[0.01 * w * mass]], [[w * w * mass]], B=[[1.0]], Cv=[[1.0]],
                                    inputs=["F"], outputs=["v"])  # fmt: skip
    loop = plant.feedback([[-w * mass]], ["v"], ["F"]).sampled(40.0 * hertz, 0.05 / hertz / 4.0)
    assert loop.title.endswith(title)
    table = loop.margins().table()
    assert table["columns"][3][0] == f"delay margin {unit}"
    assert 0.1 < float(table["rows"][0][3]) < 1e3
