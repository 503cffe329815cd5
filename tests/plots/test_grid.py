"""Time grids."""

import numpy as np
import pytest

import mbsvib as mv
from mbsvib.plots import time_grid
from tests.plots.conftest import MASS, STIFFNESS

NATURAL = np.sqrt(STIFFNESS / MASS) / (2 * np.pi)


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
