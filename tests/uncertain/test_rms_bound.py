"""Proven bounds of root mean squares: closed forms, samples of parameters, units."""

import itertools
from dataclasses import replace

import numpy as np
import pytest

from mbsvib import isolation, library
from mbsvib.feedback.closing import transfer
from mbsvib.uncertain import rms_bound
from mbsvib.uncertain.scalings import Channels
from mbsvib.uncertain.search import perturbed
from tests.random.scenes import oscillator


@pytest.fixture(autouse=True)
def _no_energy_bound(monkeypatch):
    """Bounds by energy and dissipation would be taken first."""
    monkeypatch.setattr("mbsvib.uncertain.certain.energy_bound", lambda *_: np.inf)


@pytest.mark.slow
def test_bound_of_a_loop_against_samples_and_in_other_units():
    stage = library.cubic_hexapod(stiffness=2e5, damping=20.0)
    active = isolation.actuated(stage, "platform")
    plant = active.system.uncertain({"leg*.k.stiffness": 0.1, "platform.mass": (9.0, 12.0)})
    loop = plant.feedback(isolation.force_feedback(active, 120.0, leak=0.6))
    floor = {"base.z": isolation.shaped([600.0], [1.0, 600.0], 1e-6)}
    worst = loop.worst_rms("acceleration.z", floor)
    assert worst.lower["acceleration.z"] < worst.upper["acceleration.z"] < 1.1 * worst.lower["acceleration.z"]
    for case in loop.sample(8, seed=2):
        assert case.rms("acceleration.z", floor)["acceleration.z"] < worst.upper["acceleration.z"]
    strong = {"base.z": isolation.shaped([600.0], [1.0, 600.0], 1e6)}
    ratio = loop.worst_rms("acceleration.z", strong).upper["acceleration.z"] / worst.upper["acceleration.z"]
    assert np.isclose(ratio, 1e6, rtol=1e-3)


@pytest.mark.slow
def test_bands_serve_where_polynomials_do_not():
    """Six legs of a lightly damped platform: modes that coincide, and cross within the limits."""
    plant = library.cubic_hexapod(stiffness=2e5, damping=20.0).linearize().uncertain({"leg*.k.stiffness": 0.1})
    worst = plant.worst_rms("z", {"Fz": 1.0})
    softest = plant.at(dict.fromkeys(plant.limits, 1.8e5)).rms("z", {"Fz": 1.0})["z"]
    assert worst.lower["z"] == pytest.approx(softest, rel=1e-9)
    assert 1.05 * softest < worst.upper["z"] < 2.3 * softest


@pytest.mark.slow
def test_no_bound_where_values_make_it_unstable():
    worst = oscillator(c=0.5).linearize().uncertain({"s.damping": (-0.1, 2.0)}).worst_rms("x", {"F": 1.0})
    assert worst.lower["x"] == worst.upper["x"] == np.inf

def channels(damping=0.3, d=0.0):
    """x'' + c x' + k x = u with c and k uncertain, beside a filter of first order; parameters twice and once."""
    a = np.array([[0.0, 1.0, 0.0], [-1.0, -damping, 0.6], [0.0, 0.0, -2.0]])
    into = np.array([[0.0, 0.0, 0.0, 0.0], [-0.05, -0.05, -0.04, 0.2], [0.0, 0.0, 0.0, 1.0]])
    out = np.array([[0.0, 1.0, 0.0], [0.0, 0.5, 0.0], [1.0, 0.0, 0.0], [3.0, 0.0, 0.0]])
    return Channels(a, into, out, np.diag([0.0, 0.0, 0.0, d]), (2, 1), 1)


def closed(c, delta, w, unit=1.0):
    """Gains at frequencies with the changes of both parameters closed."""
    a, turn = c.a, np.repeat(delta, c.sizes)
    n = c.count
    inner = np.eye(n) - turn[:, None] * c.d[:n, :n]
    a = a + c.b[:, :n] @ np.linalg.solve(inner, turn[:, None] * c.c[:n])
    s = 1j * np.asarray(w)[:, None, None] * np.eye(len(a)) - a
    return np.abs(c.c[n:] @ np.linalg.solve(s, c.b[:, n:].astype(complex)) + c.d[n:, n:])[:, 0, 0] * unit


def worst(c, w):
    """The largest gains of a fine grid of both parameters."""
    return np.max([closed(c, delta, w) for delta in itertools.product(np.linspace(-1.0, 1.0, 11), repeat=2)], axis=0)


def test_gains_of_samples_are_those_of_closed_equations():
    c, w = channels(), np.array([0.0, 0.4, 1.1, 7.0])
    deltas = rms_bound._samples(c)
    assert {tuple(row) for row in itertools.product((-1.0, 1.0), repeat=2)} <= set(map(tuple, deltas[:, [0, 2]]))
    np.testing.assert_array_equal(deltas[:, 0], deltas[:, 1])
    assert (deltas == 0.0).all(axis=1).any()
    assert np.abs(deltas).max() == 1.0
    expected = np.max([closed(c, row[[0, 2]], w) for row in deltas], axis=0)
    np.testing.assert_allclose(rms_bound._reached(c, deltas, w), expected, rtol=1e-12)
    level = c.over(7.0)
    np.testing.assert_allclose(rms_bound._reached(level, deltas, w), expected / 7.0, rtol=1e-12)
    many = rms_bound._samples(replace(c, sizes=(1,) * 7))
    assert many.shape[1] == 7
    vertices = many[(np.abs(many) == 1.0).all(axis=1)]
    assert len(vertices) == rms_bound.INSIDE
    assert np.abs(vertices.mean(axis=0)).max() < 0.5


@pytest.mark.slow
@pytest.mark.parametrize("band", [(0.0, 0.3), (0.8, 1.3), (3.0, 40.0)])
def test_bounds_over_bands_are_above_the_integral_of_the_worst_gains(band):
    c = channels()
    w = np.linspace(*band, 401)
    exact = np.trapezoid(worst(c, w) ** 2, w)
    bound = rms_bound._over_band(c, rms_bound._samples(c), band, 1e-9)
    flat = (band[1] - band[0]) * worst(c, w).max() ** 2
    assert exact < bound <= 1.2 * flat


@pytest.mark.slow
def test_bands_are_adjacent_and_narrow_where_gains_vary():
    c = channels(0.12)
    deltas = rms_bound._samples(c)
    bands, highest = rms_bound._bands(c, deltas, 60.0)
    bands = sorted(bands)
    assert bands[0][0] == 0.0
    assert bands[-1][1] == 60.0
    assert all(first[1] == second[0] for first, second in itertools.pairwise(bands))
    w = np.linspace(0.0, 4.0, 2001)
    assert highest == pytest.approx(rms_bound._reached(c, deltas, w).max(), rel=2e-2)
    total = 0.0
    for low, high in bands:
        inside = rms_bound._reached(c, deltas, np.linspace(low, high, 9))
        total += inside.max() ** 2 * (high - low)
    w = np.concatenate((w, np.geomspace(4.0, 60.0, 400)[1:]))
    exact = np.trapezoid(rms_bound._reached(c, deltas, w) ** 2, w)
    assert exact < total < 1.15 * exact
    assert len(bands) < 150


@pytest.mark.parametrize("unit", [1.0, 1e-4])
def test_beyond_the_last_band_gains_fall(unit):
    c = replace(channels(), c=channels().c * np.array([1.0, 1.0, 1.0, unit])[:, None])
    last, bound = rms_bound._tail(c, rms_bound._samples(c))
    w = np.geomspace(last, 1e5, 300)
    reached = (w * worst(c, w)).max()
    assert reached < bound < 1.3 * reached
    fastest = np.abs(np.linalg.eigvals(c.a)).max()
    assert 20.0 * fastest < last < 400.0 * fastest
    still = replace(c, c=c.c * np.array([1.0, 1.0, 1.0, 0.0])[:, None])
    assert rms_bound._tail(still, rms_bound._samples(c))[1] == 0.0


@pytest.mark.slow
@pytest.mark.parametrize("size", [1.0, 1e4])
def test_a_mean_square_is_near_the_closed_form(size):
    """1 / (s + 2 + 0.5 d) is worst at d = -1 for all frequencies: 1 / (2 1.5); bands add 10 %."""
    c = Channels(np.array([[-2.0]]), np.array([[1.0, size]]), np.array([[-0.5], [1.0]]), np.zeros((2, 2)), (1,), 1)
    exact = size**2 / 3.0
    assert exact < rms_bound.mean_square_bound(c, c) < 1.12 * exact
    assert rms_bound.mean_square_bound(c, replace(c, d=np.diag([0.0, 1.0]))) == np.inf
    assert rms_bound.mean_square_bound(replace(c, d=np.diag([0.0, size])), c) > 1.2 * exact
    still = replace(c, c=c.c * np.array([[1.0], [0.0]]))
    assert rms_bound.mean_square_bound(still, still) == 0.0


def test_filters_stand_before_the_sources():
    """White noise of intensity 1 through filters of first order, one of them at a source that comes through."""
    plant = oscillator().linearize().uncertain({"s.stiffness": 0.2})
    problem = perturbed(plant, ["x", "a"], ["F", "base"])
    filters = [isolation.shaped([3.0], [1.0, 5.0], 0.7), isolation.shaped([2.0, 1.0], [1.0, 9.0], 1.3)]
    white, w = rms_bound.behind_filters(problem, filters), np.array([0.3, 4.0, 21.0])
    assert white.sources == [1, 2]
    before, after = (transfer(part.space, 1j * w) for part in (problem, white))
    np.testing.assert_allclose(after[:, :, 0], before[:, :, 0], rtol=1e-10)
    for k, f in enumerate(filters):
        gain = f.response(1j * w) * np.sqrt(0.5 * f.level)
        np.testing.assert_allclose(after[:, :, 1 + k], before[:, :, 1 + k] * gain[:, None], rtol=1e-10)
