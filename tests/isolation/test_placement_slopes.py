"""Gradients of what sets are judged by, on which bounds rest, against differences of the losses of other weights."""

import numpy as np
import pytest

from mbsvib.isolation.placement_criteria import BestControl, Experiments, Gramians, Information, Weighted

SENSORS, ACTUATORS = 3, 2
RNG = np.random.default_rng(4)


def information(count):
    """Matrices without symmetry in their order, each of full rank."""
    roots = RNG.standard_normal((count, 3, 3)) + 1j * RNG.standard_normal((count, 3, 3))
    return Information(roots @ roots.conj().swapaxes(-1, -2), {"all": [0, 1, 2]}, 0.3)


def weighted():
    a = RNG.standard_normal((4, 4)) - 4.0 * np.eye(4)
    b1, c1 = RNG.standard_normal((4, 2)), RNG.standard_normal((2, 4))
    b2, c2 = RNG.standard_normal((4, ACTUATORS)), RNG.standard_normal((SENSORS, 4))
    d12, d21 = 0.3 * RNG.standard_normal((2, ACTUATORS)), 0.3 * RNG.standard_normal((SENSORS, 2))
    return Weighted(a, b1, b2, c1, d12, c2, d21, np.array([0.1, 0.2, 0.3]), np.array([0.2, 0.5]))


ROOTS = RNG.standard_normal((SENSORS, ACTUATORS, 3, 3))
CRITERIA = {
    "Gramians": Gramians(information(SENSORS), information(ACTUATORS)),
    "sensors": Gramians(information(SENSORS), None),
    "experiments": Experiments(ROOTS @ ROOTS.swapaxes(-1, -2), {"all": [0, 1, 2]}, 0.3),
    "control": BestControl(weighted(), True, True),
    "estimates": BestControl(weighted(), True, False),
    "states known": BestControl(weighted(), False, True),
}


@pytest.mark.parametrize("name", CRITERIA)
def test_gradients_are_those_of_the_losses(name):
    criterion = CRITERIA[name]
    weights = np.array([0.7, 1.3, 0.4]), np.array([0.9, 0.6])
    loss, slopes = criterion.slopes(*weights)

    def at(side, k, step):
        moved = [w.copy() for w in weights]
        moved[side][k] += step
        return criterion.losses(moved[0][None], moved[1][None])[0, 0]

    assert loss == at(0, 0, 0.0)
    for side, count in ((0, SENSORS), (1, ACTUATORS)):
        expected = [(8 * (at(side, k, 1e-3) - at(side, k, -1e-3)) - at(side, k, 2e-3) + at(side, k, -2e-3)) / 12e-3
                    for k in range(count)]
        np.testing.assert_allclose(slopes[side], expected, rtol=0, atol=1e-8 * np.abs(expected).max(initial=1e-3))


def test_what_is_left_out_has_no_gradient():
    sensors, actuators = np.array([0.7, 0.0, 0.4]), np.array([0.0, 0.6])
    _, (first, second) = CRITERIA["control"].slopes(sensors, actuators)
    assert (first == 0.0).tolist() == [False, True, False]
    assert (second == 0.0).tolist() == [True, False]
