"""Frequency grids: no peak and no dip between the points, whatever the damping."""

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.optimize import minimize_scalar

import mbsvib as mv
from mbsvib.responses.frequency_grid import CLOSEST, EXCLUDED, SHARE, roots
from tests.modes.test_modes import oscillator
from tests.support.sizes import few
from tests.support.sliding_chain import sliding_chain

NATURAL = 10.0 / (2 * np.pi)


def hertz(system, *names, **words):
    """The grid in Hz."""
    return system.frequency_grid(*names, **words) / (2 * np.pi)


def slider(ratio):
    return oscillator(m=2.0, c=40.0 * ratio, k=200.0).linearize()


def lightly_damped(ratio, n=9, seed=0):
    """A chain with resonances and dips of very different depth; the lowest damping ratio is ``ratio``."""
    rng = np.random.default_rng(seed)
    m, k = rng.uniform(0.5, 2, n), rng.uniform(1e3, 1e4, n)
    c = rng.uniform(0.2, 1, n) * k
    lowest = sliding_chain(m, k, 1e-6 * c).linearize().modes().damping_ratios.min()
    outputs = [("displacement", 2), ("acceleration", n - 1), ("velocity", 0)]
    return sliding_chain(m, k, 1e-6 * c * ratio / lowest, (0, 2), outputs).linearize()


@pytest.mark.slow
@pytest.mark.parametrize("ratio", few([1e-6, 0.1, 1e-4, 1e-2], 2))
@pytest.mark.parametrize("seed", few(range(2), 1))
def test_no_peak_and_no_dip_is_missed(ratio, seed):
    """Searched for between the points with all the digits there are, each extremum exceeds its neighbours by 1 %."""
    system = lightly_damped(ratio, seed=seed)
    grid = hertz(system)
    magnitude = np.abs(system.frequency_response(2 * np.pi * grid))
    result = 0
    for o in range(3):
        for i in range(2):
            for sign in (1, -1):
                value = sign * np.log(magnitude[o, i])
                tops = np.nonzero((value[1:-1] >= value[:-2]) & (value[1:-1] >= value[2:]))[0] + 1
                result += len(tops)
                for k in tops:
                    def height(x, k=k, o=o, i=i, sign=sign):
                        f = grid[k] + x * (grid[k + 1] - grid[k - 1])
                        return -sign * np.log(abs(system.frequency_response([2 * np.pi * f])[o, i, 0]))

                    best = minimize_scalar(height, bounds=(-1, 1), method="bounded", options={"xatol": 1e-3})
                    assert -best.fun - value[k] < 0.01
    assert result > (60 if ratio < 1e-3 else 15)


@pytest.mark.few(1)
@pytest.mark.parametrize("ratio", [1e-6, 1e-3, 0.3])
def test_every_root_near_the_axis_has_its_extremum(ratio):
    """Between neighbouring points no distance to a pole or zero changes by more than the promised share."""
    system = lightly_damped(ratio)
    w = system.frequency_grid()
    gap, middle = np.diff(w), 1j * w
    for root in roots(system, system.poles()):
        distance = np.abs(middle - root)
        assert (gap <= SHARE * 1.05 * np.maximum(distance[1:], distance[:-1])).all()
        inside = np.maximum(distance[1:], distance[:-1]) < np.sqrt(2) * abs(root.real)
        assert (gap[inside] <= 0.3 * abs(root.real)).all()


@pytest.mark.parametrize("ratio", [1e-6, 1e-4, 1e-2, 0.3])
def test_the_top_of_a_single_mode_is_a_point(ratio):
    system = slider(ratio)
    peak = np.abs(system.frequency_response(system.frequency_grid())[0, 0]).max()
    assert peak == pytest.approx(1 / (200 * 2 * ratio * np.sqrt(1 - ratio**2)), rel=1e-9)


def test_half_power_points_are_in_the_grid():
    ratio = 0.01
    grid = hertz(slider(ratio))
    damped = NATURAL * np.sqrt(1 - ratio**2)
    for frequency in (damped - ratio * NATURAL, NATURAL, damped, damped + ratio * NATURAL):
        assert np.abs(grid / frequency - 1).min() < 1e-12


def test_undamped_roots_are_approached_and_not_hit():
    rng = np.random.default_rng(5)
    k = rng.uniform(1e3, 1e4, 5)
    system = sliding_chain(np.ones(5), k, 0 * k, (2,), [("displacement", 2)]).linearize()
    w = system.frequency_grid()
    magnitude = np.abs(system.frequency_response(w))[0, 0]
    assert np.isfinite(magnitude).all()
    for root in roots(system, system.poles()):
        distance = np.abs(w / abs(root) - 1)
        assert distance.min() < 1.01 * CLOSEST
    for pole in system.poles():
        assert np.abs(w / abs(pole) - 1).min() > EXCLUDED
    within = SHARE * 1.05
    gap = np.diff(w)
    for root in roots(system, system.poles()):
        distance = np.abs(1j * w - root)
        assert (gap <= within * np.maximum(distance[1:], distance[:-1]) + 4 * CLOSEST * w[1:]).all()


def test_a_pole_at_the_end_of_the_range_is_left_out():
    system = slider(0.0)
    grid = hertz(system, f_min=NATURAL, f_max=10.0)
    assert grid[0] > NATURAL
    assert np.isfinite(system.frequency_response(2 * np.pi * grid)).all()


def test_a_choice_of_names_saves_points():
    system = lightly_damped(1e-4)
    single, more = hertz(system, "y0", "f0"), hertz(system)
    assert len(single) < len(more)
    with pytest.raises(mv.ResponseError, match="no such output"):
        hertz(system, outputs="y9")


def test_default_range():
    grid = hertz(slider(0.2))
    assert grid[0] == pytest.approx(0.1)  # 1.59 Hz / 10, rounded down to 1, 2 or 5
    assert grid[-1] == pytest.approx(5.0)  # 1.59 Hz * 3, rounded up
    assert (np.diff(grid) > 0).all()


def test_number_of_points():
    system = oscillator(m=2.0, c=1e4, k=200.0).linearize()  # creeps: no root turns
    assert_allclose(hertz(system, f_min=1.0, f_max=10.0, n=50), np.geomspace(1, 10, 50))
    assert len(hertz(system, f_min=1.0, f_max=100.0)) == 301
    few = hertz(system, f_min=1.0, f_max=100.0, n=2)
    assert_allclose(few[[0, -1]], [1, 100], rtol=1e-15)
    assert (few[1:] / few[:-1] <= 1 + SHARE).all()
    with pytest.raises(mv.ResponseError, match="n = 1; expected at least 2"):
        hertz(system, n=1)


def test_the_range_can_be_half_given():
    system = slider(0.01)
    assert hertz(system, f_min=0.01)[0] == pytest.approx(0.01, rel=1e-15)
    grid = hertz(system, f_max=0.02)
    assert_allclose(grid[[0, -1]], [0.0002, 0.02])
    assert hertz(system, f_min=1000.0)[-1] == pytest.approx(100_000.0)


@pytest.mark.parametrize("ends", [(10.0, 1.0), (0.0, 1.0), (-1.0, 1.0), (1.0, np.inf), (np.nan, 1.0)])
def test_an_impossible_range_is_refused(ends):
    with pytest.raises(mv.ResponseError, match="expected 0 < first < last"):
        hertz(slider(0.01), f_min=ends[0], f_max=ends[1])


def test_a_free_body_has_some_range():
    grid = hertz(oscillator().linearize())
    assert 0 < grid[0] < 1 < grid[-1]


def test_limits_that_are_too_far_apart_for_a_quotient_are_taken():
    """Their quotient is more than the largest number."""
    grid = hertz(slider(0.1), f_min=1e-160, f_max=1e160)
    assert len(grid) > 150 * 320
    assert (grid[0], grid[-1]) == (pytest.approx(1e-160), pytest.approx(1e160))
