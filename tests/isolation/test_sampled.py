"""Sampled controllers of platforms: slow limits, and the sources of poles."""

import control
import numpy as np
import pytest

import mbsvib as mv
from mbsvib import isolation, library
from tests.isolation.scenes import active_strut, stiff_isolator

GAIN = 1500.0


def plant():
    return isolation.actuated(active_strut(damping=60.0), "payload", "leg", directions="z")


def loop(law=isolation.velocity_feedback, gain=GAIN):
    p = plant()
    return p.with_gains(law(p, gain))





def test_fast_sampling_is_the_continuous_law():
    p = isolation.actuated(library.stewart(), "platform")
    full = p.with_gains(isolation.force_feedback(p, 3000.0, leak=100.0))
    sampled = full.sampled(2e6)
    assert np.allclose(sampled.damping_ratios, full.damping_ratios, rtol=1e-2)
    assert np.allclose(np.abs(sampled.vibrating), np.abs(full.vibrating), rtol=1e-3)
    w = 2 * np.pi * np.array([200.0, 900.0, 3000.0])
    assert np.allclose(sampled.isolation(w).index, full.isolation(w).index, rtol=2e-2)


def test_delay_makes_unstable_and_is_told():
    late = loop().sampled(1000.0, 0.02)
    assert not late.stable
    with pytest.raises(mv.ResponseError, match=r"not stable with DVF: .*mode 1 \(15\.92 Hz, payload z\)"):
        late.isolation([1.0])


def told(loop):
    """Rows of the table, natural frequency, damping and source, and the notes on what is unstable."""
    table = loop.table()
    notes = [note for note in table["notes"] if not note.startswith("Not listed: ")]
    return [(float(f), float(ratio), source) for _, f, ratio, source in table["rows"]], notes


@pytest.mark.few(3)
@pytest.mark.parametrize("law", [isolation.force_feedback, isolation.velocity_feedback, isolation.skyhook])
@pytest.mark.parametrize("rate", [20e3, 5e3, 3e3])
def test_unstable_poles_come_from_one_source_each(law, rate):
    """The platform's six modes grow, two of them in pairs; what the delay adds is the controller's, and decays."""
    p = isolation.actuated(stiff_isolator(torsion_stiffness=20.0), "platform", length=0.1)
    loop = p.with_gains(law(p, 3000.0)).sampled(rate, delay=1 / rate)
    rows, notes = told(loop)
    modes = [source for _, _, source in rows if source != "controller"]
    assert len(set(modes)) == len(modes) == 12
    unstable = [(f, ratio, source) for f, ratio, source in rows if -100.0 < ratio < 0.0]
    assert all(source == "controller" for _, ratio, source in rows if ratio == -100.0)  # real ones, told as such
    assert bool(unstable) is (rate < 20e3)
    assert all(source.startswith("mode") for _, _, source in unstable)
    vibrating = [note for note in notes if "-100 %" not in note]
    assert len(vibrating) == len(unstable)
    for note, (f, _, source) in zip(vibrating, unstable, strict=True):
        assert note.startswith(f"Unstable: {source} at {f:.4g} Hz")
    for note in set(notes) - set(vibrating):
        assert note.startswith("Unstable: controller")
    assert f"{rate:g} Hz, delay {1e3 / rate:.3g} ms" in loop.table()["title"]


@pytest.mark.parametrize("seed", range(5))
def test_poles_of_weak_loops_come_from_the_nearest_modes(seed):
    """A loop that hardly acts leaves every pole where it was, of modes and of a filter."""
    rng = np.random.default_rng(seed)
    p = isolation.actuated(library.cubic_hexapod(damping=20.0, inertia=(0.05, 0.06, 0.08)), "platform")
    w = 2 * np.pi * rng.uniform(200.0, 400.0)
    filters = control.ss([[0, 1], [-(w**2), -0.1 * w]], [[0], [1]], [[1e-3, 0]], [[0]])
    weak = isolation.controller(filters, ["leg1.k.stroke"], ["leg1.k.actuator"])
    for loop in (p.with_gains(weak), p.with_gains(weak).sampled(5e4, 3e-5)):
        modes = p.system.modes()
        for f, _, source in told(loop)[0]:
            if abs(f - w / (2 * np.pi)) < 0.01 * f:
                assert source == "controller"
            else:
                number = int(source.split()[1])
                assert f == pytest.approx(modes.frequencies[number - 1], rel=1e-3)


def test_white_noise_of_a_base_is_that_of_the_continuous_loop_where_sampling_is_fast():
    closed, fast = (each.isolation([1.0]).under({"z": 1e-6}) for each in (loop(), loop().sampled(1e5)))
    assert 0.0 < closed.acceleration[2] < np.inf
    np.testing.assert_allclose(fast.acceleration[2], closed.acceleration[2], rtol=1e-3)


def test_what_is_refused():
    closed = loop()
    for rate in (0.0, np.inf, "50", np.array([50.0]), None):
        with pytest.raises(mv.ResponseError, match=r"sampled: rate = .*; expected a number \[Hz\], above 0"):
            closed.sampled(rate)
    for delay in (-1.0, None, np.nan):
        with pytest.raises(mv.ResponseError, match=r"sampled: delay = .*; expected a number \[s\] that is not neg"):
            closed.sampled(100.0, delay)
    assert closed.sampled(1e4).isolation([1.0]).under({"z": 1e-6}, band=(1.0, 50.0)).acceleration[2] > 0
    with pytest.raises(mv.ResponseError, match=r"band from 1 to 1e\+12 Hz .* a sampled response changes; give a narr"):
        closed.sampled(1e4).isolation([1.0]).under({"z": 1e-6}, band=(1.0, 1e12))
