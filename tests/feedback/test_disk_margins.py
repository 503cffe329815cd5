"""Disk margins of several actuators against optimisers, units, decoupled loops, and perturbations that destabilise."""

import numpy as np
import pytest
from scipy.optimize import minimize, minimize_scalar

import mbsvib as mv
from mbsvib.feedback.margins import modulus_margin


def system_of(count, seed, unit=1.0):
    """Eight coupled masses; ``unit`` of the forces."""
    rng = np.random.default_rng(seed)
    root = rng.normal(size=(8, 8))
    k = 50.0 * root @ root.T + np.diag(rng.uniform(100.0, 3000.0, 8))
    b = rng.normal(size=(8, count))
    return mv.System.from_matrices(np.eye(8), 3e-3 * k + 0.1 * np.eye(8), k, b * unit, b.T), rng


def loop_of(count, seed):
    """The first stable loop with random gains, its plant and gains."""
    system, rng = system_of(count, seed)
    while True:
        gain = 60.0 * rng.normal(size=(count, count))
        loop = system.feedback(gain, system.outputs, system.inputs)
        if loop.stable:
            return loop, system, gain


def least(matrix):
    """Min over D of sigma(D M D^-1) by BFGS on Schatten norms of growing order."""
    def scaled(x):
        return np.exp(x)[:, None] * matrix * np.exp(-x)

    def norm(x, order):
        u, s, vh = np.linalg.svd(scaled(x))
        power = (s / s[0]) ** order
        share = power / power.sum()
        return np.log(s[0]) + np.log(power.sum()) / order, (np.abs(u) ** 2 - np.abs(vh.T) ** 2) @ share

    x = np.zeros(len(matrix))
    for order in (2.0, 10.0, 50.0, 250.0, 1250.0):
        x = minimize(norm, x, (order,), jac=True, method="BFGS").x
    return np.linalg.norm(scaled(x), 2)


@pytest.mark.slow
@pytest.mark.parametrize("count", [2, 3, 6])
@pytest.mark.parametrize("seed", range(3))
def test_the_highest_bound_over_frequency(count, seed):
    loop, _, _ = loop_of(count, seed)
    got = loop.margins()
    w = 2.0 * np.pi * np.concatenate((np.geomspace(0.1, 100.0, 100), got.frequency * np.linspace(0.98, 1.02, 9)))
    bounds = np.array([least(s) for s in np.moveaxis(loop.sensitivity(w), 2, 0)])
    assert bounds.max() == pytest.approx(1.0 / got.modulus, rel=1e-3)
    assert bounds[104] == pytest.approx(1.0 / got.modulus, rel=2e-4)  # at the critical frequency
    assert bounds.max() <= (1.0 + 1e-3) / got.modulus
    assert got.modulus <= got.modulus_each.min() * (1.0 + 1e-9)


@pytest.mark.parametrize("count", [2, 3, pytest.param(6, marks=pytest.mark.slow)])
def test_units_of_actuators_change_nothing(count):
    loop, _, gain = loop_of(count, 1)
    units = np.resize([1.0, 1e3, 1e-6], count)
    other, _ = system_of(count, 1, units)
    again = other.feedback(gain / units[:, None], other.outputs, other.inputs)
    tolerance = 1e-9 if count == 2 else 2e-7
    assert modulus_margin(again)[0] == pytest.approx(modulus_margin(loop)[0], rel=tolerance)


@pytest.mark.parametrize("below", [0.0, 1.0])
def test_loops_that_act_on_each_other_one_way_have_the_least_margin(below):
    """S is triangular: the scalings of the bound lie at infinity."""
    rng = np.random.default_rng(4)
    system = mv.System.from_matrices(np.eye(3), np.diag([1.0, 2.0, 3.0]), np.diag([100.0, 400.0, 900.0]), np.eye(3),
                                     np.eye(3))  # fmt: skip
    gain = np.diag([60.0, -500.0, 200.0]) + below * 1e4 * np.tril(rng.normal(size=(3, 3)), -1)
    got = system.feedback(gain, system.outputs, system.inputs).margins()
    assert got.modulus == pytest.approx(got.modulus_each.min(), rel=1e-9)
    assert got.modulus < 0.5


@pytest.mark.parametrize("seed", [2, 5])
def test_gains_within_the_disk_keep_two_loops_stable_and_some_on_its_edge_do_not(seed):
    """Gains times 1 / (1 + delta): det(1 - K G + Delta) = 0 where 1 + d1 S11 + d2 S22 + d1 d2 det S = 0."""
    loop, system, gain = loop_of(2, seed)
    got = loop.margins()
    space = system.state_space("physical")

    def growth(deltas):
        return np.linalg.eigvals(space.A + space.B @ (gain / (1.0 + np.array(deltas)[:, None])) @ space.C).real.max()

    rng = np.random.default_rng(seed)
    for angles in rng.uniform(0.0, 2.0 * np.pi, (100, 2)):
        assert growth(0.9999 * got.modulus * np.exp(1j * angles)) < 0.0
    s = loop.sensitivity([2.0 * np.pi * got.frequency])[:, :, 0]

    def second(angle):
        first = got.modulus * np.exp(1j * angle)
        return -(1.0 + first * s[0, 0]) / (s[1, 1] + first * np.linalg.det(s))

    start = min(np.linspace(0.0, 2.0 * np.pi, 200), key=lambda angle: abs(second(angle)))
    near = start - 0.04, start + 0.04
    angle = minimize_scalar(lambda angle: abs(second(angle)), bounds=near, options={"xatol": 1e-9}).x
    deltas = np.array([got.modulus * np.exp(1j * angle), second(angle)])
    assert abs(deltas[1]) == pytest.approx(got.modulus, rel=1e-7)
    assert growth(0.9999 * deltas) < 0.0 < growth(1.0001 * deltas)


def test_one_actuator_has_its_own_modulus():
    loop, _, _ = loop_of(1, 0)
    got = loop.margins()
    assert got.modulus == pytest.approx(got.modulus_each[0], rel=1e-12)
