"""Figures of step responses against closed forms and python-control."""

import control
import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.linalg import block_diag
from scipy.optimize import brentq

import mbsvib as mv
from mbsvib import library
from mbsvib.responses import decaying_sum
from mbsvib.responses.decaying_sum import DecayingSum


def slider(damping, stiffness=100.0, quantity="displacement"):
    model = mv.Model("slider")
    model.add_body("mass", 1.0, (1, 1, 1))
    model.add_joint("rail", "prismatic", "ground", "mass", axis=(1, 0, 0))
    model.add_spring("spring", "ground", "mass", (-1, 0, 0), (0, 0, 0), stiffness, damping)
    model.add_input("F", "mass", "x")
    model.add_output("x", "mass", "x", quantity=quantity)
    return model.linearize()


@pytest.mark.parametrize("ratio", [1e-4, 0.05, 0.3, 0.7])
def test_one_mass_on_a_spring(ratio):
    info = slider(20.0 * ratio).step_info()
    damped = 10.0 * np.sqrt(1.0 - ratio**2)
    over = np.exp(-np.pi * ratio / np.sqrt(1.0 - ratio**2))
    assert_allclose(info.final, 0.01, rtol=1e-13)
    assert_allclose(info.overshoot, 100.0 * over, rtol=1e-9)
    assert_allclose(info.peak, 0.01 * (1.0 + over), rtol=1e-9)
    assert_allclose(info.peak_time, np.pi / damped, rtol=1e-6)
    assert_allclose(info.undershoot, 0.0, atol=1e-12)

    def off(t):
        return np.abs(np.exp(-10.0 * ratio * t) * np.cos(damped * t - np.arcsin(ratio))) / np.sqrt(1.0 - ratio**2)

    settled = float(info.settling_time[0, 0])
    assert_allclose(off(settled), 0.02, rtol=1e-6)
    later = settled + np.linspace(1e-6, 6.0 / (10.0 * ratio), 200_000)
    assert off(later).max() < 0.02 * (1.0 + 1e-5)


@pytest.mark.parametrize("unit", [1e-12, 1e12])
def test_units_of_an_output_change_nothing(unit):
    """Peaks between samples are found however small or large the numbers are."""
    def info(size):
        return mv.StateSpace.from_arrays([[-1.0, 10.0], [-10.0, -1.0]], [[0.0], [1.0]], [[size, 0.3 * size]], 0
                                         ).step_info()  # fmt: skip

    ours, same = info(unit), info(1.0)
    assert_allclose(ours.peak, unit * same.peak, rtol=1e-12)
    for name in ("overshoot", "undershoot", "peak_time", "settling_time", "rise_time"):
        assert_allclose(getattr(ours, name), getattr(same, name), rtol=1e-9, err_msg=name)


def test_a_slow_and_a_fast_real_pole():
    """1 / ((s + 1) (s + 1e6)) is that of the slow pole alone."""
    space = mv.StateSpace.from_arrays(np.diag([-1.0, -1e6]), [[1e6], [-1e6]], [[1.0, 1.0]], 0)
    info = space.step_info()
    assert_allclose(info.rise_time, np.log(9.0), rtol=1e-5)
    assert_allclose(info.settling_time, np.log(50.0), rtol=1e-5)
    assert_allclose(info.overshoot, 0.0, atol=1e-9)


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(4))
def test_python_control(seed):
    rng = np.random.default_rng(seed)
    model = library.chain(3)
    model.add_output("tip", "body3", "rz")
    system = model.linearize()[:, "Mz"]
    law = control.ss([[-rng.uniform(5, 50)]], [[1.0]], [[-rng.uniform(0, 20)]], [[-rng.uniform(0, 2)]])
    loop = system.feedback(law, "tip", "Mz")
    assert loop.stable
    space = loop.state_space()
    info = loop.step_info("tip", band=0.05)
    t = np.linspace(0.0, 1.2 * float(info.settling_time[0, 0]), 20_001)
    plant = control.ss(space.A, space.B, space.C, space.D)[space.outputs.index("tip"), 0]
    theirs = control.step_info(plant, T=t, SettlingTimeThreshold=0.05)
    assert_allclose(info.peak[0, 0], theirs["Peak"], rtol=1e-4)
    assert_allclose(info.overshoot[0, 0], theirs["Overshoot"], rtol=1e-3, atol=2e-2)
    assert_allclose(info.settling_time[0, 0], theirs["SettlingTime"], rtol=1e-3)
    assert_allclose(info.rise_time[0, 0], theirs["RiseTime"], rtol=1e-3)


def test_responses_that_end_at_zero():
    info = slider(6.0, quantity="velocity").step_info()
    damped = 10.0 * np.sqrt(1.0 - 0.3**2)
    at = np.arctan2(damped, 3.0) / damped
    assert_allclose(info.peak_time, at, rtol=1e-6)
    assert_allclose(info.peak, np.exp(-3.0 * at) * np.sin(damped * at) / damped, rtol=1e-9)
    assert np.isnan(info.rise_time).all()
    assert np.isnan(info.overshoot).all()
    assert info.settling_time[0, 0] > at


def test_a_step_at_once_and_no_step_at_all():
    space = mv.StateSpace.from_arrays([[-1.0]], [[1.0, 0.0]], [[0.0], [1.0]], [[2.0, 0.0], [0.0, 0.0]])
    info = space.step_info()
    assert_allclose(info.final, [[2.0, 0.0], [1.0, 0.0]])
    assert_allclose(info.settling_time[[0, 0, 1], [0, 1, 1]], 0.0)
    assert_allclose(info.peak[0], [2.0, 0.0])


@pytest.mark.slow
def test_ports_and_table():
    system = library.stewart_isolator(ports="platform").linearize()
    info = system.step_info(["z", "x"], "F*")
    assert info.final.shape == (2, 3)
    assert_allclose(info.final, system.frequency_response([0.0], ["z", "x"], "F*")[:, :, 0].real, atol=1e-18)
    alone = system["x", "Fx"].step_info()
    assert_allclose(alone.settling_time[0, 0], info.settling_time[1, 0], rtol=1e-9)
    text = str(info)
    for word in ("Step responses of stewart_isolator", "settling time [s]", "m/N", "settled within 2 %"):
        assert word in text


@pytest.mark.slow
def test_what_does_not_settle_is_refused(monkeypatch):
    with pytest.raises(mv.ResponseError, match="the pole 0 1/s does not decay"):
        mv.StateSpace.from_arrays([[0.0]], [[1]], [[1]], 0).step_info()
    free = mv.Model("free")                                              # two poles at 0: they coincide as well
    free.add_body("mass", 1.0, (1, 1, 1))
    free.add_input("F", "mass", "x")
    free.add_output("x", "mass", "x")
    with pytest.raises(mv.ResponseError, match="0 1/s does not decay and appears in the response of 'x' to 'F'"):
        free.linearize().step_info()
    with pytest.raises(mv.ResponseError, match="does not decay"):
        slider(0.0).step_info()
    modes = [np.sqrt(k) * np.array([[-1e-9, 1.0], [-1.0, -1e-9]]) for k in (2, 3, 5, 7, 11, 13)]  # which beat for ever
    beating = mv.StateSpace.from_arrays(block_diag(*modes), np.tile([[0.0], [1.0]], (6, 1)), [[1.0, 0.0] * 6], 0)
    monkeypatch.setattr(decaying_sum, "MOST_SAMPLES", 50_000)
    with pytest.raises(mv.ResponseError, match=r"damping ratio of 1\.0e-09: it takes more than 50,000"):
        beating.step_info()
    slower = np.array([[-1e-11, 1.0], [-1.0, -1e-11]])  # which the output hardly shows: it need not settle
    beside = mv.StateSpace.from_arrays(block_diag(slower, *modes), np.tile([[0.0], [1.0]], (7, 1)),
                                       [[1e-14, 0.0] + [1.0, 0.0] * 6], 0)  # fmt: skip
    with pytest.raises(mv.ResponseError, match=r"damping ratio of 1\.0e-09: it takes more than 50,000"):
        beside.step_info()
    with pytest.raises(mv.ResponseError, match=r"band = 2\.0; expected a share"):
        slider(1.0).step_info(band=2.0)
    with pytest.raises(mv.ResponseError, match="coincide"):
        mv.StateSpace.from_arrays(np.eye(3, k=1) - np.eye(3), np.eye(3)[:, 2:], np.eye(3)[:1], 0).step_info()


@pytest.mark.parametrize("ratio", [1.0 - 1e-12, 1.0, 1.0 + 1e-9])
def test_a_double_pole(ratio):
    """Critical damping, exactly or nearly: x = 1 - (1 + w t) exp(-w t)."""
    info = slider(20.0 * ratio).step_info()
    t = float(info.settling_time[0, 0])
    assert_allclose((1.0 + 10.0 * t) * np.exp(-10.0 * t), 0.02, rtol=1e-6)
    assert_allclose(info.overshoot, 0.0, atol=1e-4)


@pytest.mark.parametrize(("rate", "final"), [(1.0, 1e-5), (1.1, 1.0)])
def test_a_small_final_value_and_a_small_overshoot_of_a_double_pole(rate, final):
    """(rate s + final) / (s + 1)^2: y = final + ((rate - final) t - final) exp(-t)."""
    info = mv.StateSpace.from_arrays([[-1.0, 1.0], [0.0, -1.0]], [[rate], [final - rate]], [[1.0, 0.0]], 0).step_info()
    at = rate / (rate - final)
    assert_allclose(info.final, final, rtol=1e-10)
    assert_allclose(info.peak_time, at, rtol=1e-2)
    assert_allclose(info.overshoot, 100.0 * (rate - final) * np.exp(-at) / final, rtol=1e-2)


def test_double_poles_beside_others():
    """(2 / (s + 2))^2, twice 8 / (s + 2), and two poles that differ by 1e-5 of them: each keeps its own response."""
    blocks = [np.array([[-2.0, 1.0], [0.0, -2.0]]), *(np.array([[pole]]) for pole in (-2.0, -2.0, -5.0, -5.00005))]
    a = block_diag(*blocks)
    b, c = block_diag([[0.0], [4.0]], *[[[8.0]]] * 4), block_diag([[1.0, 0.0]], *[[[1.0]]] * 4)
    settling = np.diag(mv.StateSpace.from_arrays(a, b, c, 0).step_info().settling_time)
    assert_allclose((1.0 + 2.0 * settling[0]) * np.exp(-2.0 * settling[0]), 0.02, rtol=1e-6)
    assert_allclose(settling[1:], np.log(50.0) / [2.0, 2.0, 5.0, 5.00005], rtol=2e-7)


@pytest.mark.few(2)
@pytest.mark.parametrize("beyond", [1e-2, 1e-4, 1e-6, 1e-8])
@pytest.mark.parametrize("swing", [3, 8, 21])
def test_an_excursion_between_samples_counts_for_the_settling_time(swing, beyond):
    """Swing number n ends at exp(-n pi z / sqrt(1 - z^2)): a band a little below it is left once more."""
    ratio = 0.05
    damped = 10.0 * np.sqrt(1.0 - ratio**2)
    band = float(np.exp(-np.pi * swing * 10.0 * ratio / damped)) * (1.0 - beyond)

    def off(t):
        return np.exp(-10.0 * ratio * t) * np.cos(damped * t - np.arcsin(ratio)) / np.sqrt(1.0 - ratio**2)

    top = np.pi * swing / damped
    exact = brentq(lambda t: abs(off(t)) - band, top, top + 0.5 * np.pi / damped, xtol=1e-15)
    assert_allclose(slider(20.0 * ratio).step_info(band=band).settling_time, exact, rtol=1e-9)
    above = float(np.exp(-np.pi * swing * 10.0 * ratio / damped)) * (1.0 + beyond)
    assert slider(20.0 * ratio).step_info(band=above).settling_time[0, 0] < top - 0.5 * np.pi / damped


def test_a_vibration_of_a_billion_periods():
    """The envelope tells where to look for the last excursion: no samples until then."""
    info = slider(20e-9).step_info()
    assert_allclose(info.settling_time, np.log(50.0) / 1e-8, rtol=1e-7)
    assert_allclose(info.overshoot, 100.0, rtol=1e-7)


def test_an_overshoot_after_all_terms_are_within_the_band():
    """y = 1 - 0.02 exp(-t) + 0.008 exp(-0.1 t) starts at 0.988, by feedthrough, and never leaves the band of 2 %."""
    space = mv.StateSpace.from_arrays(np.diag([-1.0, -0.1]), [[1.0], [1.0]], [[0.02, -0.0008]], 0.988)
    info = space.step_info()
    at = np.log(25.0) / 0.9
    assert_allclose(info.final, 1.0, rtol=1e-12)
    assert_allclose(info.settling_time, 0.0)
    assert_allclose(info.overshoot, 100.0 * (0.008 * np.exp(-0.1 * at) - 0.02 * np.exp(-at)), rtol=1e-9)
    assert_allclose(info.peak_time, at, rtol=1e-9)


def test_a_response_that_only_approaches_its_final_value():
    info = mv.StateSpace.from_arrays([[-2.0]], [[2.0]], [[-3.0]], 0).step_info()
    assert_allclose([info.final, info.peak], [[[-3.0]], [[3.0]]])
    assert np.isinf(info.peak_time).all()
    assert_allclose([info.overshoot, info.undershoot], 0.0, atol=1e-12)


@pytest.mark.few(2)
@pytest.mark.parametrize("seed", range(6))
def test_sums_against_a_dense_grid(seed):
    rng = np.random.default_rng(seed)
    values = -np.exp(rng.uniform(-2, 1, 5)) + 1j * rng.uniform(0, 30, 5) * (rng.random(5) < 0.8)
    residues = rng.normal(size=5) + 1j * rng.normal(size=5)
    if seed % 3 == 2:  # neighbours whose terms cancel
        values[1], residues[1] = values[0] * (1.0 + 1e-6), -residues[0] * (1.0 - 1e-7)
    motion = DecayingSum("sum", residues, values)
    level = 0.03 * motion.envelope(0.0) if seed % 3 < 2 else 1e-2
    t = np.linspace(0.0, motion.until(1e-3 * level), 400_001)
    f = motion.at(t)
    step = t[1]
    outside = t[np.abs(f) > level]
    assert outside[-1] - 1e-12 <= motion.last(level) <= outside[-1] + step
    for sign in (1.0, -1.0):
        top, at = motion.highest(sign, 1e-6 * level)
        if np.isinf(at):
            assert (sign * f).max() <= 1e-6 * level
            continue
        assert sign * f[np.argmax(sign * f)] <= top * (1.0 + 1e-12)
        assert_allclose(sign * motion.at(np.array([at])), top, rtol=1e-9)
        assert abs(at - t[np.argmax(sign * f)]) <= step
    late = np.array([motion.envelope(time) for time in t[::4000]])
    largest = np.maximum.accumulate(np.abs(f)[::-1])[::-1][::4000]
    assert (largest <= late * (1.0 + 1e-12)).all()


def test_outputs_that_feel_nothing():
    """Forces that symmetry makes zero are 1e-17 N: no overshoot of them is told."""
    system = library.stewart_isolator(ports="platform").linearize()
    alone = system["z", "Fx"]  # without others to compare with
    assert 0.0 < np.abs(alone.frequency_response([100.0])).max() < 1e-15
    info = alone.step_info()
    for value in (info.final, info.peak, info.settling_time):
        assert (value == 0.0).all()
    assert np.isnan([info.overshoot, info.rise_time]).all()


def test_outputs_that_feel_nothing_beside_motions_without_mass():
    """A body on springs that are alike in all directions does not move across the force; it was 3e-19 m in 0.14 s."""
    across, _ = np.linalg.qr(np.random.default_rng(3).normal(size=(3, 3)))
    model = mv.Model()
    model.add_body("a", 2.0, (0.1, 0.1, 0.1))
    model.add_body("node", 0.0, (0, 0, 0))
    model.add_bushing("k", "ground", "a", (0, 0, 0), (1e3, 1e3, 1e3, 10, 10, 10))
    model.add_bushing("l", "a", "node", (0, 0, 0), (5e2, 5e2, 5e2, 5, 5, 5))
    model.add_bushing("c", "node", "ground", (0, 0, 0), damping=(20, 20, 20, 1, 1, 1))
    model.add_input("F", "a", across[:, 0])
    model.add_output("across", "a", across[:, 1])
    model.add_output("along", "a", across[:, 0])
    info = model.linearize().step_info()
    assert info.final[0] == info.peak[0] == info.settling_time[0] == 0.0
    assert np.isnan(info.rise_time[0])
    assert info.final[1] == pytest.approx(1e-3)


@pytest.mark.parametrize("count", [171, 300])
def test_hundreds_of_neighbouring_poles(count):
    """Factorials above 170! are no floating-point numbers."""
    values = -1.0 - 1e-5 * np.arange(count) + 0j
    decaying = DecayingSum("many", np.full(count, 1.0 / count) + 0j, values)
    t = decaying.until(0.01)
    exact = float(np.exp(values.real * t).mean())
    assert exact <= decaying.envelope(t) * (1.0 + 1e-12) <= 0.01 * (1.0 + 1e-9)
    assert exact == pytest.approx(0.01, rel=0.02)
