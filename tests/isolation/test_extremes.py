"""Resonance, amplification, crossover and roll-off against closed forms, however sharp the peaks are."""

import math

import numpy as np
import pytest
from scipy.optimize import minimize_scalar

import mbsvib as mv
from mbsvib import isolation, library
from tests.isolation.scenes import FREQUENCY, MASS, OMEGA, active_strut, one_axis, stiff_isolator, two_masses
from tests.support.digits import mp
from tests.support.sliding_chain import chain_response, sliding_chain

EDGE, K, M, INERTIA = 0.2, 1e6, 10.0, (0.05, 0.05, 0.08)


def six_isolators(f, damping):
    """Index of the cubic hexapod, whose six directions are isolators of their own, in fifty digits."""
    s = 2j * mp.pi * mp.mpf(f)
    total = mp.mpf(0)
    for k, m in zip((2, 2, 2, EDGE**2 / 2, EDGE**2 / 2, 2 * EDGE**2), (M, M, M, *INERTIA), strict=True):
        spring = mp.mpf(K) * mp.mpf(k) * (1 + s * mp.mpf(damping) / mp.mpf(K))
        total += abs(spring / (spring + mp.mpf(m) * s**2)) ** 2
    return mp.sqrt(total / 6)


def chain_index(data, f):
    """Transmissibility of a chain's last mass, acceleration over acceleration."""
    s = 2j * np.pi * f
    return abs(chain_response(*data, s, (), [("acceleration", len(data[0]) - 1)], base=True)[0, 0])


@pytest.mark.parametrize("damping", [200.0, 2.0, 1e-3, 1e-6])
def test_amplification_of_the_hexapod_is_that_of_its_translations(damping):
    """Three directions at 71 Hz make more than one at 159 Hz, though that is damped more."""
    result = isolation.study(library.cubic_hexapod(edge=EDGE, stiffness=K, damping=damping, mass=M, inertia=INERTIA),
                             "platform")  # fmt: skip
    natural = math.sqrt(2 * K / M) / (2 * math.pi)
    half = natural * damping / K * math.pi * natural
    best = minimize_scalar(lambda x: -float(six_isolators(natural + x * half, damping)), bounds=(-1, 1),
                           method="bounded", options={"xatol": 1e-9})  # fmt: skip
    assert result.amplification == pytest.approx(-best.fun, rel=1e-13 + 4e-16 * natural / half)
    assert result.resonance == pytest.approx(natural + best.x * half, rel=1e-7 * half / natural + 1e-15)
    assert result.index.max() > 0.99 * result.amplification  # so that curves and files show it


def test_amplification_of_the_isolator_is_that_of_its_first_modes():
    result = isolation.study(stiff_isolator(), "platform")
    space = result.linear.state_space("balanced")
    out = [space.outputs.index(f"acceleration.{d}") for d in ("x", "y", "z", "rx", "ry", "rz")]
    into = [space.inputs.index(name) for name in result.scene.inputs]
    scale = np.array([1, 1, 1, *[result.scene.length] * 3])
    poles = np.linalg.eigvals(space.A)
    f = np.concatenate([p.imag + abs(p.real) * np.linspace(-1, 1, 51) for p in poles[poles.imag > 0]]) / (2 * np.pi)
    states = np.linalg.solve(2j * np.pi * f[:, None, None] * np.eye(len(space.A)) - space.A, space.B[:, into])
    t = scale[:, None] * (space.C[out] @ states + space.D[np.ix_(out, into)]) / scale
    highest = np.sqrt((np.abs(t) ** 2).sum(axis=(1, 2)) / 6).max()
    assert highest * (1 - 1e-9) <= result.amplification <= highest * 1.001
    assert result.amplification == pytest.approx(129.302, rel=1e-5)
    assert result.resonance == pytest.approx(780.64, rel=1e-5)


@pytest.mark.few(1)
@pytest.mark.parametrize("ratio", [1e-4, 1e-6, 1e-8])
def test_many_sharp_peaks(ratio):
    rng = np.random.default_rng(3)
    n = 6
    m, k = rng.uniform(0.5, 2, n), rng.uniform(1e3, 1e4, n)
    c = 1e-2 * ratio * rng.uniform(0.2, 1, n) * k
    data = m, k, c
    result = isolation.study(sliding_chain(*data), f"b{n - 1}", directions="z")
    poles = result.linear.poles()
    highest = 0.0
    for pole in poles[poles.imag > 0] / (2 * np.pi):
        best = minimize_scalar(lambda x, pole=pole: -chain_index(data, pole.imag + x * pole.real), bounds=(-1, 1),
                               method="bounded", options={"xatol": 1e-7})  # fmt: skip
        highest = max(highest, -best.fun)
    widest = np.abs(poles.real / poles).min()
    assert result.amplification == pytest.approx(highest, rel=1e-11 + 2e-14 / widest)
    below = chain_index(data, result.crossover * (1 - 1e-9)), chain_index(data, result.crossover * (1 + 1e-9))
    assert below[0] > 1 > below[1]


@pytest.mark.slow
def test_frequencies_that_miss_every_peak_change_no_figure():
    first, second = (isolation.study(two_masses(c1=1e-3, c2=1e-3), "payload", directions="z", frequencies=f)
                  for f in (None, [0.1, 1e3]))  # fmt: skip
    assert second.amplification == pytest.approx(first.amplification, rel=1e-12)
    assert second.resonance == pytest.approx(first.resonance, rel=1e-12)
    assert second.crossover == pytest.approx(first.crossover, rel=1e-12)
    above = isolation.study(two_masses(c1=1e-3, c2=1e-3), "payload", directions="z", frequencies=[8.0, 1e3])
    assert 8.0 < above.resonance < 30.0  # the second mode is the highest there
    assert above.amplification < first.amplification


def test_a_sharp_peak_above_1_far_above_the_others_is_no_isolation():
    """A stage of high frequency and no damping makes a peak that is 1e-6 of its frequency wide."""
    m1, m2, k1, k2, c = 0.05, 10.0, 4e5, 4e3, 1e-3
    result = isolation.study(two_masses(m1, m2, k1, k2, c, c), "payload", directions="z")
    matrix = np.array([[(k1 + k2) / m1, -k2 / m1], [-k2 / m2, k2 / m2]])
    second = math.sqrt(np.linalg.eigvals(matrix).real.max()) / (2 * math.pi)

    def index(f):
        s = 2j * np.pi * f
        first, upper = k1 + c * s, k2 + c * s
        return abs(first * upper / ((m1 * s**2 + first + upper) * (m2 * s**2 + upper) - upper**2))

    assert index(second) > 1 > index(second * 1.001)
    assert result.crossover == pytest.approx(second, rel=1e-3)
    assert index(result.crossover) == pytest.approx(1, rel=1e-8)
    assert index(result.crossover * (1 + 1e-7)) < 1


def test_an_undamped_mode_that_the_base_hardly_excites_is_infinite_too():
    """The spring of a small mass beside the payload: its residue is 1e-6 of the rest."""
    model = one_axis(0.1)
    model.add_body("absorber", 1e-5 * MASS, (0.1, 0.1, 0.1), (0, 0, 0.6))
    model.add_joint("rail", "prismatic", "ground", "absorber", axis=(0, 0, 1))
    model.add_spring("tie", "ground", "absorber", (0.1, 0, 0), (0.1, 0, 0.5), 1e-5 * MASS * (20 * OMEGA) ** 2)
    model.add_spring("touch", "payload", "absorber", (0, 0, 0.2), (0, 0, 0.5), 1e-6 * MASS * OMEGA**2)
    result = isolation.study(model, "payload", directions="z")
    assert result.amplification == math.inf
    with pytest.raises(mv.ResponseError, match="is not damped"):
        result.under({"z": [(1.0, 1e-6), (200.0, 1e-6)]})
    goal = isolation.passive(model, "payload", directions="z")
    with pytest.raises(mv.ResponseError, match="is not damped"):
        goal.peak((1.0, 500.0))(goal.scene.system)


def test_roll_off_of_a_spring_a_damper_and_both():
    """k / m w^2 falls by 40 dB a decade, c / m w by 20 from k / c on."""
    for ratio in (0.0, 1e-9, 1e-3, 0.3):
        result = isolation.study(one_axis(ratio), "payload", directions="z", frequencies=[1.0, 20.0])
        assert result.roll_off == (-20.0 if ratio else -40.0)
        assert result.plateau == 0.0
        if ratio:
            knee = FREQUENCY / (2 * ratio)
            assert result.roll_off_from == pytest.approx(knee, rel=1e-5 if ratio < 0.1 else 0.3)
            assert "-20 dB/decade above" in str(result)
        crossover = FREQUENCY * math.sqrt(2)
        r, twice = 10 * crossover / FREQUENCY, 20 * ratio * crossover / FREQUENCY
        exact = math.sqrt((1 + twice**2) / ((1 - r**2) ** 2 + twice**2))
        assert result.decade == pytest.approx(exact, rel=1e-12)


@pytest.mark.parametrize("n", [1, 2, 4, 6])
@pytest.mark.parametrize("damped", [False, True])
def test_roll_off_of_a_chain(n, damped):
    """Each spring falls by 40 dB a decade, each damper by 20."""
    rng = np.random.default_rng(n)
    m, k = rng.uniform(0.5, 2, n), rng.uniform(1e3, 1e4, n)
    c = 1e-4 * k * damped
    result = isolation.study(sliding_chain(m, k, c), f"b{n - 1}", directions="z", frequencies=[1.0, 1e3])
    assert result.roll_off == (-20.0 if damped else -40.0) * n
    far = 100 * result.roll_off_from
    slope = chain_index((m, k, c), 10 * far) / chain_index((m, k, c), far)
    assert 20 * math.log10(slope) == pytest.approx(result.roll_off, rel=1e-2)


@pytest.mark.few(1)
@pytest.mark.parametrize("massless", [False, True])
@pytest.mark.parametrize("body", ["payload", "top"])
def test_roll_off_of_bodies_that_equilibrium_has_turned(massless, body):
    """Entries of 1e-16, rounding of rotations, are no feedthrough: the index falls by 40 dB a decade."""
    model = mv.Model("stack", gravity=(0, 0, -9.81))
    model.add_body("payload", 20.0, (0.6, 0.7, 0.8), (0, 0, 0.2))
    model.add_body("top", 5.0, (0.6, 0.9, 0.7), (0.05, 0, 0.5))
    model.add_joint("pin", "revolute", "payload", "top", (0, 0, 0.35), axis=(0, 1, 0))
    model.add_torsion_spring("hold", "payload", "top", (0, 1, 0), 1e3)
    for k, (x, y) in enumerate([(0.3, 0.2), (-0.3, 0.2), (-0.3, -0.2), (0.3, -0.2)]):
        model.add_bushing(f"foot{k}", "ground", "payload", (x, y, 0), (1e4, 1e4, 3e4, 0, 0, 0), (0,) * 6)
    if massless:
        model.add_body("mid", 0.0, (0, 0, 0), (0.3, 0, 0.1))
        model.add_bushing("below", "ground", "mid", (0.3, 0, 0), (1e4,) * 6, (0.0,) * 6)
        model.add_bushing("above", "mid", "payload", (0.3, 0, 0.2), (1e4,) * 6, (10.0,) * 6)
    result = isolation.study(model.equilibrium(), body, frequencies=[1e4, 1e5])
    assert result.index[0] / result.index[1] == pytest.approx(100.0, rel=1e-3)
    assert result.roll_off == -40.0
    assert result.plateau == 0.0
    assert dict(result.table()["rows"])["roll-off"].startswith("-40 dB/decade above")


def test_roll_off_of_legs_with_masses_is_none():
    """What legs weigh carries vibration through: D, without a pole."""
    result = isolation.study(library.stewart(), "platform")
    assert result.roll_off == 0.0
    table = dict(result.table()["rows"])
    assert table["roll-off"].startswith("none: levels off at")
    assert not any("dB/decade" in str(value) for value in table.values())
    far = isolation.study(library.stewart(), "platform", frequencies=[1e7, 2e7])
    assert result.plateau == pytest.approx(far.index[-1], rel=1e-6)
    assert table["index one decade above crossover"].startswith(f"{result.decade:.3g}")


def test_a_hundred_times_stiffer_and_softer_legs_level_off_alike():
    first, second = (isolation.study(library.stewart(leg_stiffness=k, leg_damping=d), "platform")
                  for k, d in ((20e4, 1e-6), (20e8, 1e4)))  # fmt: skip
    assert first.plateau == pytest.approx(second.plateau, rel=1e-9)


@pytest.mark.slow
def test_roll_off_of_closed_loops():
    """Skyhook k / (m s^2 + g s + k); velocity feedback is a damper; a sampled law tells none but that of masses."""
    plant = isolation.actuated(active_strut(), "payload", "leg", directions="z")
    sky = plant.with_gains(isolation.skyhook(plant, 800.0))
    damper = plant.with_gains(isolation.velocity_feedback(plant, 800.0))
    assert sky.isolation().roll_off == -40.0
    assert damper.isolation().roll_off == -20.0
    assert damper.isolation().roll_off_from == pytest.approx(1.2e5 / 800 / (2 * math.pi), rel=0.3)
    hexapod = isolation.actuated(library.cubic_hexapod(damping=2.0), "platform")
    force = hexapod.with_gains(isolation.force_feedback(hexapod, 600.0, leak=6.0)).isolation([1.0, 100.0])
    assert (force.roll_off, force.plateau) == (-20.0, 0.0)
    sampled = damper.sampled(1e4).isolation([1.0, 100.0])
    assert math.isnan(sampled.roll_off)
    assert dict(sampled.table()["rows"])["roll-off"] == "none: the controller is sampled"
    stewart = isolation.actuated(library.stewart(), "platform")
    sampled = stewart.with_gains(isolation.velocity_feedback(stewart, 100.0)).sampled(1e5)
    assert sampled.isolation([1.0, 100.0]).roll_off == 0.0


def test_closed_loops_show_their_own_resonances():
    """Positive stroke feedback moves the mode to where the open loop has none."""
    plant = isolation.actuated(active_strut(damping=1e-2), "payload", "leg", directions="z")
    law = isolation.controller([[-9e5]], ["leg.stroke"], ["leg.actuator"])
    result = plant.with_gains(law).isolation()
    stiffness = 1.2e5 + 9e5
    w = np.sqrt(stiffness / MASS)
    exact = abs((stiffness + 1e-2j * w) / (1e-2j * w))
    assert result.amplification == pytest.approx(exact, rel=1e-6)
    assert result.index.max() > 0.99 * exact


@pytest.mark.slow
def test_sampled_loops_repeat_their_resonances():
    """Beside each multiple of the rate there is an image of a resonance, as far as the hold lets it through."""
    plant = isolation.actuated(active_strut(damping=1e3), "payload", "leg", directions="z")
    loop = plant.with_gains(isolation.controller([[-9e5]], ["leg.stroke"], ["leg.actuator"])).sampled(800.0)
    assert loop.stable
    pole = loop.vibrating[0] / (2 * np.pi)
    band = 800.0 - pole.imag + np.array([-20.0, 20.0])
    result = loop.isolation(band)
    f = np.linspace(*band, 4001)
    dense = loop.isolation(f).index
    assert result.resonance == pytest.approx(f[dense.argmax()], abs=0.02)
    assert dense.max() <= result.amplification * (1 + 1e-12) <= dense.max() * (1 + 1e-4)


@pytest.mark.parametrize("frequency", [1e-3, 5.0, 4e3])
def test_the_band_of_a_study_is_around_its_poles(frequency):
    """From a fiftieth of the lowest to twenty times the highest natural frequency, with the resonance itself."""
    f = isolation.study(one_axis(0.01, frequency), "payload").frequencies
    np.testing.assert_allclose(f[[0, -1]], frequency * np.array([0.02, 20.0]), rtol=1e-12)
    assert np.abs(f / (frequency * np.sqrt(1.0 - 0.01**2)) - 1.0).min() < 1e-12
