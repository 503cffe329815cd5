"""Frequency and time grids."""

import numpy as np
import pytest

import mbsvib as mv
from mbsvib.plots import frequency_grid, time_grid
from tests.plots.conftest import MASS, STIFFNESS

NATURAL = np.sqrt(STIFFNESS / MASS) / (2 * np.pi)


def test_default_span_goes_a_decade_below_and_half_a_decade_above(slider):
    grid = frequency_grid(slider(damping=0.2))
    assert grid[0] == pytest.approx(0.5)  # 7.96 Hz / 10, rounded down to 1, 2 or 5
    assert grid[-1] == pytest.approx(50.0)  # 7.96 Hz * 3, rounded up
    assert (np.diff(grid) > 0).all()


@pytest.mark.parametrize("ratio", [1e-6, 1e-4, 1e-2, 0.3])
def test_no_peak_is_clipped(slider, ratio):
    system = slider(damping=2 * ratio * np.sqrt(STIFFNESS * MASS))
    grid = frequency_grid(system)
    peak = np.abs(system.frequency_response(2 * np.pi * grid)[0, 0]).max()
    exact = 1 / (STIFFNESS * 2 * ratio * np.sqrt(1 - ratio**2))
    assert peak == pytest.approx(exact, rel=1e-9)


def test_half_power_points_are_in_the_grid(slider):
    ratio = 0.01
    grid = frequency_grid(slider(damping=2 * ratio * np.sqrt(STIFFNESS * MASS)))
    for frequency in (NATURAL * (1 - ratio), NATURAL, NATURAL * (1 + ratio)):
        assert np.abs(grid / frequency - 1).min() < 1e-12


def test_an_undamped_pole_is_left_out(slider):
    system = slider()
    grid = frequency_grid(system, (NATURAL, 10.0))
    assert grid[0] > NATURAL
    assert np.isfinite(system.frequency_response(2 * np.pi * grid)).all()


def test_the_span_can_be_half_given(slider):
    grid = frequency_grid(slider(damping=1.0), (0.01, None))
    assert grid[0] == 0.01
    grid = frequency_grid(slider(damping=1.0), (None, 0.02))
    assert grid[-1] == pytest.approx(0.02)
    assert grid[0] == pytest.approx(0.0002)
    grid = frequency_grid(slider(damping=1.0), (1000.0, None))
    assert grid[-1] == pytest.approx(100_000.0)


@pytest.mark.parametrize("span", [(10.0, 1.0), (0.0, 1.0), (-1.0, 1.0), (1.0, np.inf), (np.nan, 1.0)])
def test_an_impossible_span_is_refused(slider, span):
    with pytest.raises(mv.ResponseError, match="expected 0 < first < last"):
        frequency_grid(slider(damping=1.0), span)


def test_a_free_body_has_some_range(slider):
    grid = frequency_grid(slider(stiffness=0.0))
    assert 0 < grid[0] < 1 < grid[-1]


def test_times_reach_until_the_slowest_mode_has_settled(slider):
    ratio = 0.2
    t = time_grid(slider(damping=2 * ratio * np.sqrt(STIFFNESS * MASS)))
    assert t[0] == 0
    assert t[-1] == pytest.approx(5 / (ratio * 2 * np.pi * NATURAL))


def test_times_of_a_lightly_damped_mode_end_after_25_periods(slider):
    assert time_grid(slider())[-1] == pytest.approx(25 / NATURAL)
    assert time_grid(slider(damping=1e-3))[-1] == pytest.approx(25 / NATURAL)


def test_times_follow_the_fastest_mode_within_reason(slider):
    fast, slow = slider(stiffness=100 * STIFFNESS), slider()
    t = time_grid([fast, slow])
    assert t[-1] == pytest.approx(25 / NATURAL)
    assert t[1] == pytest.approx(1 / (20 * 10 * NATURAL), rel=1e-3)
    assert len(time_grid([slider(stiffness=5e13), slow])) == 20_001


def test_rigid_body_and_given_durations(slider):
    assert time_grid(slider(stiffness=0.0))[-1] == 1.0
    assert time_grid(slider(), 3.0)[-1] == 3.0
    for wrong in (0.0, -1.0, np.inf, np.nan):
        with pytest.raises(mv.ResponseError, match="duration"):
            time_grid(slider(), wrong)
