"""Intervals of frequencies on which scalings are a proof, against the matrix Phi on fine grids; proofs over boxes."""

import itertools
from dataclasses import replace

import numpy as np
import pytest
from scipy.optimize import brentq

from mbsvib.uncertain.blocks import OFF_POLES
from mbsvib.uncertain.certain import Proof, by_velocities, even_gain
from mbsvib.uncertain.scalings import Channels, _beside, _candidates, _without, best_scalings, cover, interval, least

GRID = np.tan(np.linspace(0.0, 0.5 * np.pi, 3001)[:-1])


def made(seed, sizes=(1, 2), ports=(1, 2), size=0.3):
    """Channels of light modes in turned states, all of them coupled and with feedthrough; the gain has ``ports``."""
    rng, (inputs, outputs), r = np.random.default_rng(seed), ports, sum(sizes)
    a = np.zeros((5, 5))
    for k, (damping, w) in enumerate(((0.02, 0.7), (0.1, 1.6))):
        a[2 * k : 2 * k + 2, 2 * k : 2 * k + 2] = [[-damping * w, w], [-w, -damping * w]]
    a[4, 4] = -0.5
    turn = rng.normal(size=(5, 5)) + 2.0 * np.eye(5)
    b, c = rng.normal(size=(5, r + inputs)), size * rng.normal(size=(r + outputs, 5))
    d = 0.2 * rng.normal(size=(r + outputs, r + inputs))
    return Channels(turn @ a @ np.linalg.inv(turn), turn @ b, c @ np.linalg.inv(turn), d, sizes, inputs)


def response(channels, w):
    s = 1j * np.asarray(w)[..., None, None] * np.eye(len(channels.a)) - channels.a
    return channels.c @ np.linalg.solve(s, channels.b.astype(complex)) + channels.d


def positive(channels, scalings, w):
    """The least eigenvalue of P - M^H W M - i (G M - M^H G) at frequencies."""
    n, m = channels.count, response(channels, w)
    p, weight = np.eye(m.shape[-1], dtype=complex), np.eye(m.shape[-2], dtype=complex)
    p[:n, :n] = weight[:n, :n] = scalings.d
    g = np.zeros(m.shape[-1:-3:-1], dtype=complex)
    g[:n, :n] = scalings.g
    adjoint = m.conj().swapaxes(-1, -2)
    return np.linalg.eigvalsh(p - adjoint @ weight @ m - 1j * (g @ m - adjoint @ g.conj().T))[..., 0]


def closings(channels, w, count=8):
    """Responses from the inputs to the outputs of the gain for vertices and points of the parameters."""
    n, m = channels.count, response(channels, w)
    points = np.concatenate((list(itertools.product((-1.0, 1.0), repeat=len(channels.sizes))),
                             np.random.default_rng(1).uniform(-1.0, 1.0, (count, len(channels.sizes)))))  # fmt: skip
    for delta in np.repeat(points, channels.sizes, axis=1):
        turn = delta[:, None]
        yield m[n:, n:] + m[n:, :n] @ np.linalg.solve(np.eye(n) - turn * m[:n, :n], turn * m[:n, n:])


CASES = [(0, (1, 2), (1, 2), 0.2), (1, (2,), (2, 1), 0.25), (2, (1, 1), (0, 0), 0.3), (3, (2, 1), (1, 1), 0.1)]


@pytest.mark.few(2)
@pytest.mark.parametrize("case", CASES)
def test_an_interval_ends_where_phi_does(case):
    channels, ends = made(*case), 0
    for w0 in (0.0, 0.3, 0.69, 1.1, 3.0):
        scalings, s = best_scalings(channels.at(np.array([w0]))[0], channels.sizes, channels.inputs, 0.02)
        low, high = interval(channels, scalings, w0)
        assert (low <= w0 < high) is (s > 0.0)
        if s <= 0.0:
            assert (low, high) == (w0, w0)
            continue
        assert (positive(channels, scalings, GRID[(low <= GRID) & (high >= GRID)]) > 0.0).all()
        for end, side in ((low, -1.0), (high, 1.0)):
            if 0.0 < end < np.inf:
                beyond = end + side * np.linspace(0.0, 0.01, 40) * end
                assert positive(channels, scalings, beyond).min() < 0.0
                ends += 1
    assert ends


@pytest.mark.few(2)
@pytest.mark.parametrize("case", CASES)
def test_all_changes_of_sign_are_candidates(case):
    channels, found = made(*case), 0
    for w0 in (0.0, 0.3, 0.69, 1.1, 3.0):
        scalings = best_scalings(channels.at(np.array([w0]))[0], channels.sizes, channels.inputs, 0.02)[0]
        values = positive(channels, scalings, GRID)
        for k in np.flatnonzero(values[1:] * values[:-1] < 0.0):
            at = brentq(lambda w: positive(channels, scalings, w), GRID[k], GRID[k + 1], xtol=1e-12)  # noqa: B023
            assert np.abs(_candidates(channels, scalings) / at - 1.0).min() < 1e-6
            found += 1
    assert found


def test_units_of_channels_change_nothing_of_the_least_eigenvalue():
    channels, units = made(0), np.array([3.0, 0.2, 0.2])
    scalings = best_scalings(channels.at(np.array([0.8]))[0], channels.sizes, channels.inputs)[0]
    rows, columns = (np.append(units, np.ones(count - 3)) for count in channels.d.shape)
    other = Channels(channels.a, channels.b * columns, channels.c / rows[:, None],
                     channels.d / rows[:, None] * columns, channels.sizes, channels.inputs)  # fmt: skip
    turned = replace(scalings, d=scalings.d * np.outer(units, units), g=scalings.g * np.outer(units, units))
    np.testing.assert_allclose(least(other, turned, GRID[::100]), least(channels, scalings, GRID[::100]), rtol=1e-9)


def test_points_beside_poles_resolve_their_peaks():
    """On both sides, from a twentieth of the half width of a peak to twenty times it."""
    points = _beside(np.array([-0.1 + 5.0j, -0.1 - 5.0j, -3.0, -1e-3 + 0.5j]))
    assert (np.diff(points) > 0.0).all()
    assert points[0] > 0.0
    for middle, width in ((5.0, 0.1), (0.5, 1e-3), (0.0, 3.0)):
        for share in np.geomspace(0.06, 15.0, 40):
            for side in (-1.0, 1.0):
                if middle + side * share * width > 0.0:
                    away = side * (points - middle) / width
                    assert ((away > share / 1.8) & (away < share * 1.8)).any()


def test_what_is_covered_leaves_gaps():
    rng, x = np.random.default_rng(0), np.linspace(0.0, 12.0, 2401) + 1e-4
    for _ in range(20):
        covered = [tuple(sorted(pair)) for pair in rng.integers(0, 10, (4, 2)).tolist()]
        covered[0] = (covered[0][0], np.inf if rng.random() < 0.3 else covered[0][1])
        gaps = _without([(0.0, 4.0), (5.0, np.inf)], covered)
        free = np.array([any(low < p < high for low, high in gaps) for p in x])
        hit = np.array([any(low < p < high for low, high in covered) for p in x])
        np.testing.assert_array_equal(free, ((x < 4.0) | (x > 5.0)) & ~hit)
        assert all(low < high for low, high in gaps)


@pytest.mark.slow
@pytest.mark.parametrize("case", [(0, (1, 2), (1, 2), 0.01), (3, (2,), (1, 1), 0.01)])
def test_a_cover_is_a_proof_for_all_frequencies(case):
    """A gain well above the largest of samples is proven; one below it cannot be."""
    channels = made(*case)
    n, gains = channels.count, [max(np.linalg.norm(g, 2) for g in closings(channels, w)) for w in GRID[::10]]
    for factor, proven in ((1.3, True), (0.95, False)):
        unit = 1.0 / np.sqrt(factor * max(gains))
        rows, columns = (np.where(np.arange(count) < n, 1.0, unit) for count in channels.d.shape)
        level = replace(channels, b=channels.b * columns, c=channels.c * rows[:, None],
                        d=channels.d * rows[:, None] * columns)  # fmt: skip
        known = []
        w = cover(level, known)
        assert (w is None) is proven
        if proven:
            assert cover(level, list(known), most=2 * len(known)) is None
            assert (np.max([positive(level, part, GRID[::20]) for part in known], axis=0) > 0.0).all()
        else:
            assert max(np.linalg.norm(g, 2) for g in closings(channels, w)) > 0.8 * factor * max(gains)
            assert known
            assert all(cover(level, [], most=some) < np.inf for some in range(3))
            assert cover(level, list(known)) is not None  # what holds on intervals only proves no more than before


def plane(limits):
    """1 / (s + 2 + 0.5 d1 + 0.3 d2), the second parameter twice: as d2 / 4 and as d2 / 20."""
    a, one = np.array([[-2.0]]), np.ones((1, 1))
    into = np.hstack((one, one, one, one))
    out = np.vstack((-0.5 * one, -0.25 * one, -0.05 * one, one))
    worst = 1.0 / (2.0 + min(0.5 * x + 0.3 * y for x in limits[0] for y in limits[1]))
    return Proof((a, into, out, np.zeros((4, 4))), (1, 2), 1.0), worst


@pytest.mark.few(1)
@pytest.mark.parametrize("limits", [[(-1.0, 1.0), (-1.0, 1.0)], [(-0.3, 2.0), (-2.0, 0.1)], [(-1.7, 0.2), (-0.4, 3.0)]])
def test_gains_are_proven_over_boxes_of_any_sides(limits):
    proof, worst = plane(limits)
    assert proof.r == 3
    assert proof.holds(np.array(limits), [], 1.01 * worst)
    assert not proof.holds(np.array(limits), [], 0.99 * worst, most=20)


def test_stability_is_proven_over_boxes():
    """s + 2 + 0.5 d1 + 0.3 d2 has a pole at 0 as soon as the sum is -2."""
    proof, _ = plane([(-1.0, 1.0), (-1.0, 1.0)])
    for low, stable in ((-2.75, True), (-2.85, False)):
        box = np.array([[low, 1.0], [-2.0, 0.5]])
        assert proof.holds(box, [], 1e6, most=20) is stable


def test_channels_of_a_box_are_closed_in_its_middle():
    channels, w = made(0, size=0.02), 0.9
    proof = Proof((channels.a, channels.b, channels.c, channels.d), (1, 2), 1.0)
    box, g = np.array([[-0.1, 0.3], [0.05, 0.25]]), 4.0
    inside = proof.channels(box, g)
    assert inside.sizes == (1, 2)
    assert inside.inputs == 1
    m, n = response(channels, w), 3
    for delta in ((-1.0, 1.0), (0.3, 0.5), (1.0, -0.2)):
        there = np.repeat(box.mean(axis=1) + delta * np.diff(box, axis=1)[:, 0] / 2.0, (1, 2))
        expected = m[n:, n:] + m[n:, :n] @ np.linalg.solve(np.eye(n) - there[:, None] * m[:n, :n],
                                                           there[:, None] * m[:n, n:])  # fmt: skip
        scaled, d = response(inside, w), np.repeat(delta, (1, 2))
        got = scaled[n:, n:] + scaled[n:, :n] @ np.linalg.solve(np.eye(n) - d[:, None] * scaled[:n, :n],
                                                                d[:, None] * scaled[:n, n:])  # fmt: skip
        np.testing.assert_allclose(got, expected / g, rtol=1e-10)


def test_a_box_with_an_unstable_middle_has_no_channels():
    proof, _ = plane([(-1.0, 1.0), (-1.0, 1.0)])
    assert proof.channels(np.array([[-8.0, -2.0], [-1.0, 1.0]]), 1.0) is None
    assert proof.channels(np.array([[-8.0, 2.0], [-1.0, 1.0]]), 1.0) is not None


def test_the_parameter_that_does_most_is_halved():
    """Channels of one parameter alone couple to the others or are coupled by them."""
    for k, sizes in ((0, (1, 2)), (1, (1, 2)), (1, (2, 1))):
        owner = np.repeat([0, 1], sizes)
        size = np.where(owner == k, 10.0, 0.1)
        d = np.zeros((4, 4))
        d[:3, :3] = np.outer(size, size)
        channels = Channels(-np.eye(1), np.zeros((1, 4)), np.zeros((4, 1)), d, sizes, 1)
        assert Proof((channels.a, channels.b, channels.c, d), sizes, 1.0)._most(channels, 1.0) == k
        for one, other in ((100.0, 0.01), (0.01, 100.0)):  # only drives the others, or is only driven
            d[:3, :3] = np.outer(np.where(owner == k, 5.0, one), np.where(owner == k, 5.0, other))
            assert Proof((channels.a, channels.b, channels.c, d), sizes, 1.0)._most(replace(channels, d=d), 1.0) == k


@pytest.mark.parametrize(("at", "direct"), [([0], False), ([0, 1], False), ([0], True)])
def test_velocities_and_units_change_no_closed_response(at, direct):
    """Channels of masses have accelerations as z; the gain is one of displacements or of accelerations."""
    rng, w = np.random.default_rng(3), 0.8
    mass, k = np.diag([2.0, 1.0]), np.array([[5.0, -2.0], [-2.0, 3.0]])
    damp = 0.1 * k
    a = np.block([[np.zeros((2, 2)), np.eye(2)], [-np.linalg.solve(mass, k), -np.linalg.solve(mass, damp)]])
    into = np.concatenate((np.zeros((2, 4)), np.linalg.solve(mass, rng.normal(size=(2, 4)))))
    accelerations = a[2:], into[2:]
    c, d = np.zeros((4, 4)), np.zeros((4, 4))
    for row in range(4):
        pick = rng.normal(size=2)
        if row in at or (direct and row == 3):
            c[row], d[row] = pick @ accelerations[0], pick @ accelerations[1]
        else:
            c[row, :2] = pick
    space = a, into, c, d
    r = 3
    for changed in (by_velocities(space, np.array(at), r), even_gain(space, r)):
        for delta in rng.uniform(-0.5, 0.5, (3, r)):
            values = []
            for part in (space, changed):
                m = response(Channels(*part, (1, 1, 1), 1), w)
                values.append(m[r:, r:] + m[r:, :r] @ np.linalg.solve(np.eye(r) - delta[:, None] * m[:r, :r],
                                                                      delta[:, None] * m[:r, r:]))  # fmt: skip
            np.testing.assert_allclose(values[1], values[0], rtol=1e-9)
    d, columns = by_velocities(space, np.array(at), r)[3], [*at, *[3] * direct]
    np.testing.assert_allclose(np.delete(d, columns, axis=1), 0.0, atol=1e-12)  # impulses change velocities at once
    assert (np.abs(d[np.ix_(columns, columns)]) > 0.0).all()
    m = np.abs(response(Channels(*even_gain(space, r), (1, 1, 1), 1), OFF_POLES)).max(axis=0)
    np.testing.assert_allclose(np.linalg.norm(m[:r, r:]), np.linalg.norm(m[r:, :r]), rtol=1e-9)


def test_frequencies_to_begin_with_go_before_rest(monkeypatch):
    """At rest scalings need not know what masses do, and may hold nowhere else; those of the peak often cover it."""
    tried = []

    def everywhere(_, __, w0):
        tried.append(w0)
        return 0.0, np.inf

    monkeypatch.setattr("mbsvib.uncertain.scalings.interval", everywhere)
    assert cover(made(0), [], [0.8]) is None
    assert tried == [0.8]
