"""Modes keep their numbers through crossings, also where a station lies on one."""

import numpy as np
import pytest

from mbsvib.linalg.matching import Station, is_simple, mac, track_modes, upper

RNG = np.random.default_rng(7)
BASIS = np.linalg.qr(RNG.standard_normal((6, 4)))[0]


def crossing(at):
    """Four modes of fixed shapes whose eigenvalues cross at 0 and 0.5; in ascending order, repeated ones mixed."""
    squares = np.array([1.0 + at, 1.0 - at, 1.5 - 0.2 * at, 4.0])
    order = np.argsort(squares, kind="stable")
    vectors = BASIS[:, order] * np.exp(1j * RNG.uniform(0, 6.0, 4))
    if at == 0.0:
        vectors[:, :2] = vectors[:, :2] @ np.linalg.qr(RNG.standard_normal((2, 2)))[0]
    return Station(at, 1j * np.sqrt(squares[order]), vectors)


@pytest.mark.parametrize("points", [(-0.9, 0.9), (-0.5, -0.1, 0.0, 0.1, 0.8), (-0.3, 0.0, 0.7)])
def test_numbers_are_kept_through_crossings(points):
    stations = [crossing(at) for at in points]
    order = track_modes(stations)
    first = np.sort([1.0 + points[0], 1.0 - points[0], 1.5 - 0.2 * points[0], 4.0])
    start = [int(np.argmin(abs(first - s))) for s in (1.0 + points[0], 1.0 - points[0])]
    last = stations[-1].values[order[-1]].imag ** 2
    assert np.allclose(last[start], [1.0 + points[-1], 1.0 - points[-1]])


def test_ways_are_halved_where_shapes_turn():
    def turning(at):
        c, s = np.cos(at), np.sin(at)
        shapes = np.array([[c, -s], [s, c]])
        return Station(at, 1j * np.array([1.0, 2.0]), shapes)

    far = [turning(0.0), turning(0.9)]  # by then each looks rather like the other
    assert track_modes(far)[-1].tolist() == [1, 0]
    assert track_modes(far, turning)[-1].tolist() == [0, 1]


def test_pairs_that_stay_together_are_not_halved_in_vain():
    asked = []

    def pair(at):
        asked.append(at)
        basis = np.linalg.qr(RNG.standard_normal((2, 2)))[0]
        return Station(at, 1j * np.ones(2), basis)

    order = track_modes([pair(float(i)) for i in range(5)], pair)
    assert len(asked) == 5
    assert all(sorted(row.tolist()) == [0, 1] for row in order)


def test_mac_is_that_of_the_definition():
    a, b = RNG.standard_normal((2, 5, 3)) + 1j * RNG.standard_normal((2, 5, 3))
    expected = abs(a[:, 0].conj() @ b[:, 1]) ** 2 / ((a[:, 0].conj() @ a[:, 0]) * (b[:, 1].conj() @ b[:, 1])).real
    assert mac(a, b)[0, 1] == pytest.approx(expected, rel=1e-14)
    assert mac(np.zeros((5, 1)), b).max() == 0.0


def test_of_real_pairs_the_one_nearer_to_instability_stands_for_the_mode():
    pairs = np.array([[-1 + 2j, -1 - 2j], [-3.0, -0.5], [0.0, 0.0]], dtype=complex)
    assert upper(pairs).tolist() == [-1 + 2j, -0.5, 0.0]


def test_slow_modes_stay_apart_beside_a_fast_one():
    """A strong damper has an eigenvalue many decades above the others."""
    assert is_simple(np.array([1j, 1.0005j, 1e4j, -1e10])).all()
    assert is_simple(np.array([1j, 1j, 1e4j, 0.0])).tolist() == [False, False, True, True]
