"""Bounds of modes whose stiffness nearly cancels: a chain of inverted pendulums, with the softest spring near buckling.

All lengths are exact in binary, so that the reference has the numbers of the model.
"""

import numpy as np
import pytest
from mpmath import mp

import mbsvib as mv

MASS, INERTIA, SPRING, DAMPER, GRAVITY = 1.3, 0.07, 90.0, 0.2, 9.81
LENGTH, CENTRE = 1.0, 0.625
SOFT = "one.k.stiffness.ry"
# Stiffness that is left, as a share of that of the spring.
SHARES = (1e-1, 1e-3, 1e-5, 1e-9)


def pendulums():
    model = mv.Model("inverted", gravity=(0, 0, -GRAVITY))
    for i, (name, first) in enumerate((("one", "ground"), ("two", "one"), ("three", "two"))):
        at = (0, 0, LENGTH * i)
        model.add_body(name, MASS, (0.1, INERTIA, 0.1), position=(0, 0, LENGTH * i + CENTRE))
        model.add_joint(f"{name}.hinge", "revolute", first, name, at, axis=(0, 1, 0))
        model.add_bushing(f"{name}.k", first, name, at, (0, 0, 0, 0, SPRING, 0), (0, 0, 0, 0, DAMPER * (i != 1), 0))
    return model


def exact(soft):
    """Matrices in absolute angles, and the eigenvalues, with 40 digits."""
    mass, damping, stiffness = (mp.zeros(3) for _ in range(3))
    for i in range(3):
        arm = [mp.mpf(LENGTH) * (j < i) + mp.mpf(CENTRE) * (j == i) for j in range(3)]
        between = [(j == i) - (j == i - 1) for j in range(3)]
        mass[i, i] += mp.mpf(INERTIA)
        for p in range(3):
            stiffness[p, p] -= mp.mpf(MASS) * mp.mpf(GRAVITY) * arm[p]
            for q in range(3):
                both = between[p] * between[q]
                mass[p, q] += mp.mpf(MASS) * arm[p] * arm[q]
                stiffness[p, q] += mp.mpf(SPRING if i else soft) * both
                damping[p, q] += mp.mpf(DAMPER) * (i != 1) * both
    state, inverse = mp.zeros(6), mass**-1
    state[:3, 3:], state[3:, :3], state[3:, 3:] = mp.eye(3), -inverse * stiffness, -inverse * damping
    return mp.det(stiffness), mp.eig(state)[0]


def values():
    """Stiffness of the soft spring at which shares of it are left."""
    with mp.workdps(40):  # the determinant of K is linear in it
        at_one, at_two = exact(1.0)[0], exact(2.0)[0]
        limit = 1 - at_one / (at_two - at_one)
    return float(limit) * (1.0 + np.array(SHARES))


def off(eigenvalues, soft):
    with mp.workdps(40):
        known = exact(float(soft))[1]
        return np.array([float(min(abs(mp.mpc(value) / one - 1) for one in known)) for value in eigenvalues])


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore::mbsvib.AccuracyWarning")
def test_errors_are_below_their_bounds():
    model, soft = pendulums(), values()
    together = model.linearize(values={SOFT: soft}).modes()
    for i, value in enumerate(soft):
        one = model.with_values({SOFT: float(value)})
        for modes in (together[i], one.linearize().modes(), one.linearize(method="sparse").modes(3)):
            bound, error = np.repeat(modes.errors, 6 // len(modes.errors)), off(modes.eigenvalues, value)
            assert (error <= bound).all()
            assert bound.max() < 1e-14 / SHARES[i]


def test_variants_under_loads_are_solved_together():
    """Stiffness of loads, which is negative here, is no reason to solve each variant by itself."""
    model, soft = pendulums(), [100.0, 150.0, 200.0]
    modes = model.linearize(values={SOFT: soft}).modes()
    assert not modes._separate_modes
    for i, value in enumerate(soft):
        alone = model.with_values({SOFT: value}).linearize().modes()
        np.testing.assert_allclose(modes.eigenvalues[i], alone.eigenvalues, rtol=1e-14)
