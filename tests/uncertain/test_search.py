"""Ascent within limits: starts, gradients, the smallest change that makes equations unstable."""

import itertools
from types import SimpleNamespace

import numpy as np
import pytest

import mbsvib as mv
from mbsvib.equations.matrices import MATRICES
from mbsvib.uncertain import blocks
from mbsvib.uncertain.search import Perturbed, gain, growth, samples
from tests.random.scenes import two_masses


def diagonal(rates, changes, limits):
    """x_k' = (rate_k + sum of changes_kj delta_j) x_k: each of the parameters acts on several states."""
    rates, changes = np.array(rates), np.array(changes, dtype=float)
    n, count = changes.shape
    owner = np.repeat(np.arange(count), n)
    into = np.concatenate([np.diag(changes[:, j]) for j in range(count)], axis=1)
    out = np.concatenate([np.eye(n)] * count)
    b, c = np.concatenate((into, np.ones((n, 1))), axis=1), np.concatenate((out, np.ones((1, n))))
    r = len(owner)
    return Perturbed((np.diag(rates), b, c, np.zeros((r + 1, r + 1))), owner, np.array(limits, dtype=float), [r], [r])


@pytest.mark.parametrize("measure", [growth, gain])
def test_gradients_of_parameters_add_up_over_their_channels(measure):
    problem = diagonal([-1.0, -0.7], [[0.3, -0.1], [-0.2, 0.25]], [[-1.0, 1.0]] * 2)
    delta, step = np.array([0.3, -0.4]), 1e-6
    value, gradient = problem.measured(measure, delta)
    pole = np.array([-1.0, -0.7]) + np.array([[0.3, -0.1], [-0.2, 0.25]]) @ delta
    assert value == pytest.approx(pole.max() if measure is growth else -(1.0 / pole).sum(), rel=1e-9)
    for along in np.random.default_rng(0).normal(size=(3, 2)):
        high, low = (problem.measured(measure, delta + side * step * along)[0] for side in (1.0, -1.0))
        assert gradient @ along == pytest.approx((high - low) / (2.0 * step), rel=1e-6)


def test_gain_of_a_static_map():
    """0.5 + 0.1 d / (1 - 0.5 d), with its derivative 0.1 / (1 - 0.5 d)^2; no state, no growth."""
    d = np.array([[0.5, 0.1], [1.0, 0.5]])
    problem = Perturbed((np.zeros((0, 0)), np.zeros((0, 2)), np.zeros((2, 0)), d), np.array([0]),
                        np.array([[-1.0, 1.0]]), [1], [1])  # fmt: skip
    value, gradient = problem.measured(gain, np.array([0.4]))
    assert (value, gradient[0]) == (pytest.approx(0.5 + 0.04 / 0.8), pytest.approx(0.1 / 0.8**2))
    assert problem.measured(growth, np.array([0.4]))[0] == -np.inf
    assert problem.measured(gain, np.array([2.0]))[0] == np.inf  # singular


@pytest.mark.parametrize("count", [1, 3, 9])
def test_starts_are_the_nominal_values_vertices_and_points_within(count):
    limits = np.array([[-1.0 - k, 0.5 * (k + 1.0)] for k in range(count)])
    points = samples(limits, 3)
    assert (points[0] == 0.0).all()
    assert ((points >= limits[:, 0]) & (points <= limits[:, 1])).all()
    known = set(map(tuple, points))
    assert {tuple(limits[:, 0]), tuple(limits[:, 1])} <= known
    vertices = ((points == limits[:, 0]) | (points == limits[:, 1])).all(axis=1)
    if count <= 7:
        assert set(itertools.product(*limits)) <= known
        assert vertices.sum() == 2**count
    else:
        assert len({tuple(point) for point in points[vertices]}) > 50
    inside = points[~vertices][1:]
    assert len(inside) >= 20
    share = (inside - limits[:, 0]) / np.diff(limits, axis=1)[:, 0]
    assert share.min() < 0.2
    assert share.max() > 0.8
    assert np.abs(share.mean(axis=0) - 0.5).max() < 0.25


def test_an_ascent_ends_at_the_highest_point_within_limits():
    """-(x - 0.4)^2 - 3 (y + 0.2)^2 + 7, through the entries of a static map of channels."""
    problem = Perturbed((np.zeros((0, 0)), np.zeros((0, 3)), np.zeros((3, 0)), np.zeros((3, 3))), np.arange(2),
                        np.array([[-1.0, 1.0], [-2.0, 0.5]]))  # fmt: skip

    def measured(_, delta):
        x, y = delta
        return 7.0 - (x - 0.4) ** 2 - 3.0 * (y + 0.2) ** 2, np.array([-2.0 * (x - 0.4), -6.0 * (y + 0.2)])

    object.__setattr__(problem, "measured", measured)
    value, where = problem.highest(growth)
    assert value == pytest.approx(7.0, rel=1e-10)
    np.testing.assert_allclose(where, [0.4, -0.2], atol=1e-5)


@pytest.mark.slow
@pytest.mark.parametrize(("rates", "changes", "limits", "expected"), [
    ([-1.0, -3.0], [[0.5, 0.1], [0.2, 0.3]], [[-1.0, 1.0], [-1.0, 1.0]], 1.0 / 0.6),
    ([-1.0, -3.0], [[-0.5, 0.1], [0.2, 0.3]], [[-2.0, 0.3], [-1.0, 0.5]], 1.0 / 1.05),
    ([-1.0, -0.6], [[0.5, 0.1], [-0.2, -0.3]], [[-0.5, 1.0], [-3.0, 1.0]], 0.6 / 1.0),
    ([-2.0, -2.0, -5.0], [[0.01, 0.0], [0.0, 0.02], [0.03, 0.03]], [[-1.0, 1.0], [-1.0, 1.0]], 100.0 / 1.2),
])  # fmt: skip
def test_the_smallest_change_that_destabilizes(rates, changes, limits, expected):
    """Each pole is a straight line of the parameters: the first one to cross 0 does so at a vertex."""
    problem = diagonal(rates, changes, limits)
    factor, where = problem.destabilizing(0.05, 100.0)
    assert factor == pytest.approx(expected, rel=1e-6)
    assert problem.factor(where) == pytest.approx(factor, rel=1e-12)
    pole = np.array(rates) + np.array(changes) @ where
    assert abs(pole.max()) < 1e-9 * np.abs(rates).max()
    assert (where >= factor * np.array(limits)[:, 0] * (1.0 + 1e-9)).all()
    assert (where <= factor * np.array(limits)[:, 1] * (1.0 + 1e-9)).all()
    assert problem.destabilizing(0.05, 0.9 * expected) is None


def test_a_smaller_box_may_hold_another_one():
    """The first vertex that is found is not the nearest: a pole grows with the square of a parameter."""
    problem = diagonal([-1.0], [[1.0]], [[-1.0, 1.0]])
    calls = []

    def measured(_, delta):
        calls.append(delta)
        return delta[0] ** 2 - 0.09 * (1.0 + 0.5 * delta[0]), np.array([2.0 * delta[0] - 0.045])

    object.__setattr__(problem, "measured", measured)
    object.__setattr__(problem, "within", lambda t: problem_of(t))

    def problem_of(t):
        other = diagonal([-1.0], [[1.0]], [[-t, t]])
        object.__setattr__(other, "measured", measured)
        object.__setattr__(other, "within", problem_of)
        return other

    factor, where = problem.destabilizing(1.0, 100.0)
    assert where[0] < 0.0
    assert factor == pytest.approx((0.045 - np.sqrt(0.045**2 + 0.36)) / -2.0, rel=1e-6)


@pytest.mark.parametrize(("nominal", "given", "expected"), [
    (3.0, 0.1, (3.0, 2.7, 3.3)), (-2.0, 0.1, (-2.0, -2.2, -1.8)), (0.0, (-1.0, 2.0), (0.0, -1.0, 2.0)),
    (3.0, 1, (3.0, 0.0, 6.0)), (3.0, (2.0, 7.0), (3.0, 2.0, 7.0)),
])  # fmt: skip
def test_limits(nominal, given, expected):
    assert blocks._limits("p", nominal, given) == pytest.approx(expected)


@pytest.mark.parametrize("given", [True, 0.0, -0.1, np.inf, (3.0, 4.0), (1.0, 3.0), (2.0,), "wide"])
def test_limits_that_are_none(given):
    with pytest.raises(mv.MbsvibError):
        blocks._limits("p", 3.0, given)


def test_a_name_goes_before_patterns_in_any_order():
    system = two_masses().linearize()
    for limits in ({"k1.stiffness": 0.2, "k*.stiffness": 0.1}, {"k*.stiffness": 0.1, "k1.stiffness": 0.2}):
        found = blocks.ranges(system, limits)
        assert found == {"k1.stiffness": pytest.approx((900.0, 720.0, 1080.0)),
                         "k2.stiffness": pytest.approx((300.0, 270.0, 330.0))}  # fmt: skip
    with pytest.raises(mv.ModelError, match=r"two patterns match 'k1\.stiffness'"):
        blocks.ranges(system, {"k*.stiffness": 0.1, "*1.stiffness": 0.2})


@pytest.mark.parametrize("key", MATRICES)
@pytest.mark.parametrize("together", [False, True])
def test_what_is_no_straight_line_is_refused_in_any_matrix(key, together):
    """One parameter alone, or two whose product enters only where both are at their limits."""
    zero = {name: np.zeros((2, 2)) for name in MATRICES}
    slopes = SimpleNamespace(**{name: np.array([np.eye(2), 2.0 * np.eye(2)]) for name in MATRICES})
    system = SimpleNamespace(name="plant", output_units=("m", "m"), poles=lambda: np.array([-1.0 + 1.0j]),
                             **{name: 3.0 * np.eye(2) for name in zero})  # fmt: skip

    def vary(case, bent):
        p, q = case.get("p", 1.0) - 1.0, case.get("q", 5.0) - 5.0
        extra = bent * (p * q if together else p * p)
        return SimpleNamespace(**{name: (3.0 + p + 2.0 * q + (extra if name == key else 0.0)) * np.eye(2)
                                  for name in zero})  # fmt: skip

    found = {"p": (1.0, 0.5, 2.0), "q": (5.0, 4.0, 7.0)}
    blocks._check_affine(system, slopes, found, lambda case: vary(case, 0.0))
    with pytest.raises(mv.ModelError, match=f"the matrix {key} of 'plant' is no straight line"):
        blocks._check_affine(system, slopes, found, lambda case: vary(case, 0.3))


def test_signals_of_parameters_do_as_much_to_others_as_others_to_them():
    plant = two_masses().linearize().uncertain({"k1.stiffness": 0.1, "m2.mass": 0.2, "k2.damping": 0.5})
    m = np.abs(plant.linear.frequency_response(blocks.OFF_POLES * np.median(np.abs(plant.nominal.poles()))))
    m = m.max(axis=2)[:3, :3] ** 2
    np.testing.assert_allclose(m.sum(axis=0), m.sum(axis=1), rtol=1e-3)
    half = [block.half for block in plant.parameters]
    np.testing.assert_allclose(half, [90.0, 0.2, 0.2], rtol=1e-12)
    assert [block.inertial for block in plant.parameters] == [False, True, False]
