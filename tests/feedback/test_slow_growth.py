"""Loops that grow slowly beside fast or delayed poles: each pole has its own error."""

import control
import numpy as np
import pytest
from scipy.linalg import block_diag

import mbsvib as mv
from mbsvib.feedback.pole_track import Track
from tests.feedback.test_closed_loops import slider


def slow_beside_fast(gain):
    """s^2 - gain s + 1e-5 beside a mode of 1e6 rad/s, which a filter on the velocity couples to nothing."""
    zero = np.zeros((2, 2))
    system = mv.System.from_matrices(np.eye(2), zero, np.diag([1e12, 1e-5]), np.eye(2), zero, np.eye(2),
                                     inputs=["fast", "slow"], outputs=["v", "w"])  # fmt: skip
    law = control.ss([[-1e8]], [[1e8]], [[gain]], [[0.0]])
    return system.feedback(law, "w", "slow")


def test_a_slow_mode_grows_beside_a_fast_one():
    """1e-3 +- 3e-3 j beside 1e6 rad/s was below a share of the largest pole, and so at rest."""
    loop = slow_beside_fast(2e-3)
    assert not loop.stable
    assert "damping ratio -31.6 %" in loop.growing[0]
    assert not loop.margins().stable
    with pytest.warns(mv.UnstableWarning, match="not stable"):
        loop.frequency_response([1.0])
    assert slow_beside_fast(-2e-3).stable
    assert slow_beside_fast(0.0).stable
    ratios = {round(ratio, 3) for ratio in slow_beside_fast(-2e-3).damping_ratios}
    assert 0.316 in ratios


@pytest.mark.parametrize("delay", [0.0, 3e-4, 7.3e-4])
def test_a_slow_pole_grows_beside_those_of_a_delay(delay):
    """s = 1e-3 exp(-s T) is 1e-3 but for a rounding; poles of the delay, a root of rounding, made it one too."""
    plant = mv.StateSpace.from_arrays([[0.0]], [[1.0]], [[1.0]], 0)
    for gain in (1e-3, -1e-3):
        loop = plant.feedback([[gain]], "y1", "u1").sampled(1e4, delay)
        assert loop.poles()[0] == pytest.approx(gain, rel=1e-4)
        assert loop.stable == (gain < 0.0)
        assert loop.margins().stable == (gain < 0.0)


def test_integrators_at_rest_are_stable():
    """A double pole at 0 is known to the root of a rounding only; a lag of 1 ms makes a soft spring grow."""
    for loop in (slider().feedback([[0.0]], "x", "F"), slider().feedback(control.ss(-2.0, 1.0, 0.0, 0.0), "x", "F")):
        assert loop.stable
        assert loop.sampled(100.0, 0.03).stable
    growing = slider().feedback(control.tf([-1.0], [1.0, 1e3]), "x", "F")
    assert growing.poles()[0].real == pytest.approx(0.5 * 5e-4 / 1e3, rel=1e-3)  # w^2 / 2 times the lag
    assert not growing.stable


def test_tracks_tell_growth_beside_a_fast_pole():
    def matrix(gain):
        return block_diag([[0.0, 1e6], [-1e6, -1.0]], [[1e-3 * gain, 3e-3], [-3e-3, 1e-3 * gain]])

    track = Track(matrix, np.array([-1.0, 0.0, 1.0]))
    assert [track.stable(gain) for gain in (-1.0, 0.0, 1.0)] == [True, True, False]


def test_margins_of_a_slow_integrator_beside_fast_poles():
    """A pole at -1e-5 1/s, where the loop gain is 1, was at rest beside a filter of 1e6 rad/s: all margins infinite."""
    system = mv.System.from_matrices([[1.0]], [[20.0]], [[1e4]], [[1.0]], inputs=["u"], outputs=["y"])
    fast = 1e6
    law = mv.StateSpace.from_arrays([[0.0, 0.0], [fast, -fast]], [[-0.1], [0.0]], [[0.0, 1.0]], 0)
    margins = system.feedback(law, "y", "u").margins()
    assert margins.phase[0] == pytest.approx(90.0, abs=1e-4)
    assert margins.delay[0] == pytest.approx(0.5 * np.pi / 1e-5, rel=1e-6)


def test_margins_of_two_slow_integrators_that_nearly_cancel():
    """At 0 Hz L1 = 1 / 0.02 and L2 = -0.98 L1: gains may change by 2 %, at 2e-12 rad/s beside a mode of 100 rad/s."""
    system = mv.System.from_matrices([[1.0]], [[20.0]], [[1e4]], [[1.0, 0.98]], inputs=["a", "b"], outputs=["y"])
    law = mv.StateSpace.from_arrays([[0.0]], [[1e-6]], [[-1.0], [1.0]], 0)
    margins = system.feedback(law, "y", ["a", "b"]).margins()
    assert margins.lower[0] == pytest.approx(0.98, rel=1e-6)
    assert margins.gain[1] == pytest.approx(1.0 / 0.98, rel=1e-6)


def test_a_mode_that_rounding_cannot_tell_from_an_undamped_one_has_no_margins():
    """7.3e-3 rad/s beside 3e4 rad/s without damping: phase and delay margins were infinite, the modulus margin 0."""
    shapes = np.array([[0.8, 0.6], [-0.6, 0.8]])
    fast, seen = np.diag([0.0, 3e4]), block_diag([[1.0, 0.7]], [[1.0]])
    k, c = (block_diag(shapes.T @ part @ shapes, [[last]]) for part, last in ((fast**2, 100.0), (0.01 * fast, 10.0)))
    system = mv.System.from_matrices(np.eye(3), c, k, seen.T, seen, inputs=["a", "b"], outputs=["x", "y"])
    margins = system.feedback(np.diag([-3.6e-5, -50.0]), ["x", "y"], ["a", "b"]).margins()
    assert margins.modulus == 0.0
    assert margins.phase[0] == margins.delay[0] == 0.0
    assert margins.gain[0] == margins.lower[0] == 1.0
    assert margins.modulus_each[1] > 0.5  # of another part, which does not vibrate with it
    assert np.isinf(margins.gain[1])
