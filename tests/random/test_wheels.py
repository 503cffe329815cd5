"""One road under several wheels: delays along it, and what isotropy says across it."""

import numpy as np
import pytest
from scipy.integrate import quad

import mbsvib as mv
from mbsvib import isolation
from mbsvib.errors import ResponseError

SPEED, BASE, TRACK = 20.0, 2.6, 1.5


def test_a_wheel_on_the_same_track_is_late():
    f = np.array([0.0, 1.3, 7.0])
    r = isolation.road_correlation([0.0, BASE], SPEED)(f)
    np.testing.assert_allclose(r[:, 0, 1], np.exp(2j * np.pi * f * BASE / SPEED))
    np.testing.assert_allclose(r[:, 1, 0], r[:, 0, 1].conj())
    np.testing.assert_array_equal(r[:, [0, 1], [0, 1]], 1.0)
    np.testing.assert_allclose(isolation.road_correlation([0.0, BASE], SPEED)(1.3), r[1])


@pytest.mark.parametrize("n", [0.02, 0.1, 0.4])
def test_tracks_are_related_by_isotropy(n):
    """The density (n^2 + q^2)^-3/2 over both wave numbers of a plane has n^-2 along each line."""
    both = quad(lambda q: (n * n + q * q) ** -1.5, 0.0, np.inf, weight="cos", wvar=2.0 * np.pi * TRACK)[0]
    one = quad(lambda q: (n * n + q * q) ** -1.5, 0.0, np.inf)[0]
    r = isolation.road_correlation([0.0, 0.0], SPEED, [0.5 * TRACK, -0.5 * TRACK])(n * SPEED)
    assert r[0, 1] == pytest.approx(both / one, rel=1e-6)


def test_four_wheels_are_correlated_as_noise_may_be():
    """Hermitian with ones and no negative eigenvalue at any frequency, and independent where waves are short."""
    r = isolation.road_correlation([0, 0, BASE, BASE], SPEED, [TRACK, 0, TRACK, 0])(np.geomspace(1e-3, 1e4, 200))
    assert np.linalg.eigvalsh(r).min() > -1e-12
    np.testing.assert_allclose(r, r.conj().transpose(0, 2, 1))
    assert abs(r[-1, 0, 1]) < 1e-12
    np.testing.assert_allclose(r[0, 0, 1], 1.0, atol=1e-5)


def test_budgets_take_it():
    """A bar on two wheels of no mass: the middle of both heights, whose variance follows from the correlation."""
    bar = mv.StateSpace.from_arrays(np.diag([-3.0, -3.0]), 3.0 * np.eye(2), [[0.5, 0.5]], 0)
    noise, across = [(1.0, 1e-3), (40.0, 1e-3)], [0.0, TRACK]
    road = isolation.road_correlation([0.0, 0.0], SPEED, across)
    f = np.linspace(1.0, 40.0, 200001)
    density = 0.25 * 1e-3 / np.abs(1.0 + 2j * np.pi * f / 3.0) ** 2 * (2.0 + 2.0 * road(f)[:, 0, 1].real)
    found = bar.budget({"u1": noise, "u2": noise}, correlation=road)
    assert found.rms["y1"] == pytest.approx(np.sqrt(np.trapezoid(density, f)), rel=1e-6)


def test_what_is_refused():
    with pytest.raises(ResponseError, match="one for each wheel"):
        isolation.road_correlation([0.0, BASE], SPEED, [0.0])
    with pytest.raises(ResponseError, match=r"road_correlation: .*speed"):
        isolation.road_correlation([0.0, BASE], 0.0)
