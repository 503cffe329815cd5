"""Profiles of roads over distance and time against the density of their class."""

import numpy as np
import pytest

from mbsvib import isolation
from mbsvib.errors import ResponseError


def test_a_profile_has_the_mean_square_of_its_class_and_is_periodic():
    profile = isolation.road_profile("C", length=200.0, seed=3)
    x = np.arange(2048) * 200.0 / 2048
    square = 256e-6 * 0.1**2 * (1.0 / 0.011 - 1.0 / 2.83)
    np.testing.assert_allclose(np.mean(profile.at(x) ** 2), square, rtol=1e-10)
    np.testing.assert_allclose(profile.at(x + 200.0), profile.at(x), atol=1e-12)


@pytest.mark.slow
def test_densities_over_time_are_those_of_the_spectrum():
    """Of one period each line is the mean of the density over its band."""
    speed, length, n = 20.0, 400.0, 8192
    t = np.arange(n) * length / speed / n
    profile = isolation.road_profile("B", length, seed=1)
    for quantity in ("displacement", "velocity", "acceleration"):
        lines = np.abs(np.fft.rfft(profile.under(t, speed, quantity=quantity)) / n) ** 2 * 2.0 * t[-1] * n / (n - 1)
        f = np.arange(len(lines)) / (t[-1] * n / (n - 1))
        inside = (f > 2.0) & (f < 50.0)
        expected = isolation.road_spectrum("B", speed, quantity).at(f[inside])
        np.testing.assert_allclose(lines[inside], expected, rtol=1e-3)


def test_rates_are_derivatives_and_rear_wheels_follow_later():
    profile, t = isolation.road_profile("D", seed=5), np.linspace(0.0, 3.0, 50)
    h = 1e-6
    for lower, upper in (("displacement", "velocity"), ("velocity", "acceleration")):
        slope = (profile.under(t + h, 12.0, quantity=lower) - profile.under(t - h, 12.0, quantity=lower)) / (2.0 * h)
        rate = profile.under(t, 12.0, quantity=upper)
        np.testing.assert_allclose(slope, rate, atol=1e-5 * np.abs(rate).max())
    np.testing.assert_allclose(profile.under(t, 12.0, behind=2.4), profile.under(t - 0.2, 12.0), atol=1e-12)


def test_a_bump_is_a_cosine_and_nothing_else():
    for start in (10.0, 0.17, -3.3):  # whole lengths and others
        bump = isolation.road_bump(0.1, 0.5, start=start)
        x = start + np.array([-0.1, 1e-9, 0.125, 0.25, 0.5 - 1e-9, 0.6])
        np.testing.assert_allclose(bump.at(x), [0, 0, 0.05, 0.1, 0, 0], atol=1e-14)
        assert bump.under([(start + 0.25) / 5.0], 5.0, quantity="velocity")[0] == pytest.approx(0.0, abs=1e-12)
        np.testing.assert_allclose(bump.at(start + 0.125, 1), 0.1 * np.pi / 0.5, rtol=1e-12)


def test_phases_are_uniform_over_a_turn():
    phases = np.sort(isolation.road_profile("A", length=2000.0, seed=4).phases)
    share = (np.arange(len(phases)) + 0.5) / len(phases)
    assert len(phases) > 5000
    np.testing.assert_allclose(phases / (2.0 * np.pi), share, atol=0.03)


def test_seeds_repeat_and_differ():
    first, same, other = (isolation.road_profile("A", seed=seed).at([1.0, 7.0]) for seed in (1, 1, 2))
    np.testing.assert_array_equal(first, same)
    assert np.abs(first - other).max() > 0.0


@pytest.mark.parametrize(("call", "words"), [
    (lambda: isolation.road_profile("Z"), "road_profile: name = 'Z'"),
    (lambda: isolation.road_profile("A", length=50.0), "length = 50 m; expected at least 90.9 m"),
    (lambda: isolation.road_profile("A", length=np.inf), "length = inf"),
    (lambda: isolation.road_bump(0.1, 0.0), "road_bump: length = 0.0"),
    (lambda: isolation.road_bump("high", 1.0), "road_bump: height"),  # type: ignore[arg-type]
    (lambda: isolation.road_profile("A").under([0.0], -1.0), "under: speed"),
    (lambda: isolation.road_profile("A").under([0.0], 1.0, quantity="height"), "under: quantity"),
])  # fmt: skip
def test_what_is_no_road_is_refused(call, words):
    with pytest.raises(ResponseError, match=words):
        call()
