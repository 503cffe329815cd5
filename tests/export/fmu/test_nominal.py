"""Nominal values of states and times of the default experiment, in closed form for an oscillator."""

from dataclasses import replace

import numpy as np
import pytest

import mbsvib as mv
from mbsvib_export.fmu_.plant import experiment_times, nominal_values

MASS, RATE, DECAY = 4.0, 6.0, 0.2  # m x'' + 2 D w m x' + w^2 m x = F
LOW, HIGH = RATE / 3.0, 3.0 * RATE  # real s in the range of which outputs and states are looked at


def oscillator(outputs, through, units=("m", "m/s"), mass=MASS):
    a = [[0.0, 1.0], [-(RATE**2), -2.0 * DECAY * RATE]]
    space = mv.StateSpace.from_arrays(a, [[0.0], [1.0 / mass]], outputs, through)
    return replace(space, state_units=units)


def below(s):
    """s^2 + 2 D w s + w^2."""
    return s * s + 2.0 * DECAY * RATE * s + RATE**2


def nominal(space):
    return nominal_values(space, np.linalg.eigvals(space.A).astype(complex))


# what an initial position and an initial speed of 1 do to the position at most, and a force to position and speed
OF_POSITION, OF_SPEED = HIGH * (HIGH + 2.0 * DECAY * RATE) / below(HIGH), RATE / below(RATE)
POSITION, SPEED = 1.0 / MASS / below(LOW), RATE / MASS / below(RATE)


@pytest.mark.parametrize("gain", [1.0, 1e3])
@pytest.mark.parametrize("through", [0.0, -0.002, 0.05])
def test_an_oscillator_of_which_the_position_is_seen(gain, through):
    """A tenth of the change of a state that changes the output as a force does, but of what a force makes at most."""
    seen = POSITION + through
    expected = 0.1 * np.array([min(seen / OF_POSITION, POSITION), min(seen / OF_SPEED, SPEED)])
    np.testing.assert_allclose(nominal(oscillator([[gain, 0.0]], [[gain * through]])), expected, rtol=0.05)


def test_the_output_that_needs_most_digits_decides():
    """The position times -0.3, and a combination in which the same position is a twentieth of the force's part."""
    both = oscillator([[-0.3, 0.0], [0.05, 0.0]], [[0.0], [1.0]])
    np.testing.assert_allclose(nominal(both), nominal(oscillator([[1.0, 0.0]], [[0.0]])), rtol=1e-12)
    alone = oscillator([[0.05, 0.0]], [[1.0]])
    np.testing.assert_allclose(nominal(alone), 0.1 * np.array([POSITION, SPEED]), rtol=0.05)


def test_states_that_no_output_sees_have_the_size_of_their_unit():
    """Of one unit the larger amplitude of both; without any unit in common each its own."""
    hidden = np.zeros((1, 2)), [[1.0]]
    np.testing.assert_allclose(nominal(oscillator(*hidden)), 0.1 * np.array([POSITION, SPEED]), rtol=0.05)
    larger = max(POSITION, SPEED)
    np.testing.assert_allclose(nominal(oscillator(*hidden, units=("", ""))), 0.1 * larger, rtol=0.05)
    assert len(nominal(mv.StateSpace.from_arrays(np.zeros((0, 0)), np.zeros((0, 1)), np.zeros((1, 0)), [[1.0]]))) == 0


def test_without_inputs_forces_on_everything_stand_for_them():
    """A unit rate on each state: what x' = A x + e makes of the position, the larger of both."""
    free = replace(oscillator([[1.0, 0.0]], [[0.0]]), B=np.zeros((2, 0)), D=np.zeros((1, 0)), inputs=(), input_units=())
    parts = (LOW + 2.0 * DECAY * RATE) / below(LOW), 1.0 / below(LOW)  # the position's answers to both
    seen = max(min(parts), 0.1 * max(parts))
    speeds = max(RATE**2 / below(LOW), RATE / below(RATE))
    expected = 0.1 * np.array([min(seen / OF_POSITION, max(parts)), min(seen / OF_SPEED, speeds)])
    np.testing.assert_allclose(nominal(free), expected, rtol=0.05)


def test_what_symmetry_hides_counts_a_tenth():
    """Two oscillators, each with its own force and output: the other one's answer is none, or rounding."""
    one = oscillator([[1.0, 0.0]], [[0.0]])
    eye = np.eye(2)
    both = mv.StateSpace.from_arrays(*(np.kron(eye, getattr(one, key)) for key in "ABCD"))
    both = replace(both, state_units=one.state_units * 2)
    expected = 0.01 * POSITION / np.array([OF_POSITION, OF_SPEED] * 2)
    np.testing.assert_allclose(nominal(both), expected, rtol=0.05)
    heavy = oscillator([[1.0, 0.0]], [[0.0]], mass=1e3 * MASS)  # a force that does little everywhere counts as little
    np.testing.assert_allclose(nominal(heavy), nominal(one) / 1e3, rtol=0.1)


def test_a_growing_motion_is_looked_at_beyond_its_rate():
    """x' = 2 x + u, y = x at s = 2 + r, r from 2/3 to 6: 1/r for steps, (2 + r)/r for initial states, at r = 2/3 both.
    """
    space = mv.StateSpace.from_arrays([[2.0]], [[1.0]], [[1.0]], [[0.0]])
    np.testing.assert_allclose(nominal(space), 0.1 * 1.5 / 4.0, rtol=0.05)


@pytest.mark.parametrize(("values", "stop"), [
    ([], 1.0), ([0.0, 0.0], 1.0), ([-2.0], 50.0), ([-2.0, -3000.0], 50.0), ([-2.0, 1e-10], 50.0),
    ([2j, -2j, -0.01 + 5j], 50.0), ([-2.0, -1.0 + 4000j], 2.0), ([-2.0, -4000.0 + 600j], 50.0),
    ([-20.0], 5.0), ([-2.0 * np.pi / 5.0], 100.0),
])  # fmt: skip
def test_times_of_the_default_experiment(values, stop):
    """20 periods of the slowest rate, or 2000 of the fastest oscillation that does not decay within one."""
    assert experiment_times(np.array(values, dtype=complex)) == (stop, pytest.approx(stop / 1000.0, rel=1e-12))
