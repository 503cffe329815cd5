"""Poles that do not decay: which responses contain them, in any states and units."""

import numpy as np
import pytest

from mbsvib.linalg.lasting import separated

POINT = 0.7 + 0.3j  # right of all poles


def two_masses(force, shown):
    """Masses of 1 and 3 kg, free, joined by 100 N/m and 1 N s/m; states x1, x2, v1, v2."""
    a = np.zeros((4, 4))
    a[:2, 2:] = np.eye(2)
    a[2:, :2] = [[-100.0, 100.0], [100.0 / 3.0, -100.0 / 3.0]]
    a[2:, 2:] = a[2:, :2] / 100.0
    b = np.concatenate((np.zeros(2), np.array(force) / [1.0, 3.0]))[:, None]
    return a, b, np.concatenate((shown, np.zeros(2)))[None]


CASES = {
    "integral of velocity": (([[0, 1, 0], [-400, -2, -7], [0, 1, 0]], [[0], [1], [0]], [[1, 0, 0]]), [(1, False)]),
    "integrator": ((np.diag([0.0, -1.0, -2.0]), np.ones((3, 1)), np.ones((1, 3))), [(1, True)]),
    "undamped mode seen": (([[0, 1, 0], [-9, 0, 0], [0, 0, -1]], [[0], [1], [1]], [[0, 1, 1]]), [(2, True)]),
    "not driven": (([[0, 1, 0], [-9, 0, 0], [0, 0, -1]], [[0], [0], [1]], [[0, 1, 1]]), [(2, False)]),
    "not seen": (([[0, 1, 0], [-9, 0, 0], [0, 0, -1]], [[0], [1], [1]], [[0, 0, 1]]), [(2, False)]),
    "relative": (two_masses([1, -1], [1, -1]), [(2, False)]),
    "relative displacement": (two_masses([1, 0], [1, -1]), [(2, False)]),
    "absolute": (two_masses([1, 0], [1, 0]), [(2, True)]),
    "two integrators that cancel": ((np.zeros((2, 2)), [[1], [1]], [[1, -1]]), [(2, False)]),
    "two that do not": ((np.zeros((2, 2)), [[1], [1]], [[1, -2]]), [(2, True)]),
    "two modes, one driven, one seen": ((np.kron(np.eye(2), [[0, 1], [-4, 0]]), [[0], [1], [0], [0]], [[0, 0, 1, 0]]),
                                        [(4, False)]),
}


@pytest.mark.few(11)
@pytest.mark.parametrize("case", CASES)
@pytest.mark.parametrize("seed", range(4))
def test_groups_are_judged_alike_in_any_states(case, seed):
    """Seed 0: the states as they are; 1: other units by 1e24; else turned states of a condition of about 10."""
    (a, b, c), expected = CASES[case]
    a, b, c = (np.array(x, dtype=float) for x in (a, b, c))
    n = len(a)
    rng = np.random.default_rng(seed)
    turn = (np.eye(n), np.diag(10.0 ** (12 - 24 * np.arange(n) / max(1, n - 1))))[seed] if seed < 2 else (
        rng.standard_normal((n, n)))
    back = np.linalg.inv(turn)
    parts = separated(turn @ a @ back, turn @ b, c @ back)
    assert [(len(group.part.a), bool(group.shown.any())) for group in parts.lasting] == expected
    rest = parts.minimal
    exact = c @ np.linalg.solve(POINT * np.eye(n) - a, b)
    value = rest.c @ np.linalg.solve(POINT * np.eye(len(rest.a)) - rest.a, rest.b)
    assert value == pytest.approx(exact, rel=1e-9, abs=1e-13)
    assert rest.left @ rest.right == pytest.approx(np.eye(len(rest.a)), abs=1e-11)


def test_each_response_is_judged_by_itself():
    """One integrator that the first input drives and the second output shows."""
    parts = separated(np.diag([0.0, -1.0]), np.array([[1.0, 0.0], [1.0, 1.0]]), np.array([[0.0, 1.0], [1.0, 1.0]]))
    (group,) = parts.lasting
    assert group.shown.tolist() == [[False, False], [True, False]]
    assert group.pole == 0.0


def test_what_is_weak_but_known_is_shown():
    """States that do not act on each other have no common size: rounding of one is not that of another."""
    (group,) = separated(np.diag([0.0, -1.0]), np.array([[1e-20], [1.0]]), np.array([[1e20, 1.0]])).lasting
    assert group.shown.all()


def test_equal_poles_of_parts_that_are_close_by_rounding_are_one_group():
    parts = separated(np.kron(np.eye(3), [[0.0, 1.0], [-4.0, 0.0]]), np.ones((6, 1)), np.ones((1, 6)))
    assert [len(group.part.a) for group in parts.lasting] == [6]
    assert abs(parts.lasting[0].pole) == pytest.approx(2.0)
