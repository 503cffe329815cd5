"""Extrema and crossings over bands: random rational responses against fine sampling about each pole."""

import numpy as np
import pytest

import mbsvib as mv
from mbsvib.errors import ResponseError
from mbsvib.responses.extrema import Band, excited, panels
from tests.support.digits import mp

LOW, HIGH = 0.3, 300.0


def square(g):
    return np.abs(g) ** 2


def oscillators(seed):
    """A sum of oscillators with damping ratios from 1e-7 to 0.3: its response, and its poles."""
    rng = np.random.default_rng(seed)
    n = rng.integers(1, 9)
    w, ratio, gain = 10 ** rng.uniform(0, 2, n), 10 ** rng.uniform(-7, -0.5, n), rng.normal(size=n)
    pole = w * (-ratio + 1j * np.sqrt(1 - ratio**2))

    def response(omega):
        s = 1j * omega[:, None]
        return (gain / ((s - pole) * (s - pole.conj()))).sum(axis=1)

    return response, np.concatenate((pole, pole.conj()))


def fine(poles):
    """Frequencies that lie ever closer about each pole."""
    away = np.sinh(np.linspace(-16, 16, 3001))
    around = [pole.imag + abs(pole.real) * away for pole in poles if pole.imag > 0]
    w = np.unique(np.concatenate([np.geomspace(LOW, HIGH, 5000), *around]))
    return w[(w >= LOW) & (w <= HIGH)]


@pytest.mark.few(20)
@pytest.mark.parametrize("seed", range(60))
def test_every_local_maximum_is_there(seed):
    response, poles = oscillators(seed)
    where, top = Band(response, panels(poles, LOW, HIGH)).maxima(square)
    w = fine(poles)
    value = square(response(w))
    assert value.max() * (1 - 1e-12) <= top.max() <= value.max() * 1.001
    assert np.allclose(square(response(where)), top, rtol=1e-12, atol=0)
    peaks = 1 + np.flatnonzero((value[1:-1] > value[:-2]) & (value[1:-1] >= value[2:]))
    assert len(where) >= len(peaks)
    for k in peaks:
        assert ((where >= w[k - 1]) & (where <= w[k + 1])).any()


@pytest.mark.few(20)
@pytest.mark.parametrize("seed", range(60))
def test_every_crossing_is_there(seed):
    response, poles = oscillators(seed)
    band, w = Band(response, panels(poles, LOW, HIGH)), fine(poles)
    value = square(response(w))
    level = np.exp(np.random.default_rng(seed).uniform(*np.log([value.min(), value.max()])))
    at = band.crossings(lambda g: square(g) - level)
    change = np.flatnonzero((value[1:] >= level) != (value[:-1] >= level))
    assert len(at) >= len(change)
    for k in change:
        assert ((at >= w[k]) & (at <= w[k + 1])).any()
    below, above = (square(response(at * (1 + step))) < level for step in (-1e-10, 1e-10))
    assert (below != above).all()


@pytest.mark.parametrize("ratio", [0.3, 1e-2, 1e-4, 1e-6, 1e-9])
def test_one_oscillator_in_fifty_digits(ratio):
    """Highest at w^2 = 1 - 2 ratio^2, where |G| = 1 / 2 ratio sqrt(1 - ratio^2)."""
    pole = complex(-ratio, np.sqrt(1 - ratio**2))

    def response(w):
        return 1 / ((1j * w - pole) * (1j * w - pole.conjugate()))

    band = Band(response, panels(np.array([pole, pole.conjugate()]), 0.0, 50.0))
    where, top = band.highest(square)
    exact = mp.mpf(ratio)
    assert where == pytest.approx(float(mp.sqrt(1 - 2 * exact**2)), rel=1e-12)
    assert top == pytest.approx(float(1 / (4 * exact**2 * (1 - exact**2))), rel=4e-16 / ratio + 1e-14)


def test_a_level_that_a_peak_just_exceeds_is_crossed_twice():
    ratio = 0.1
    pole = np.array([-ratio + 1j * np.sqrt(1 - ratio**2)])
    top = 1 / (4 * ratio**2 * (1 - ratio**2))

    def response(w):
        return 1 / (1 - w**2 + 2j * ratio * w)

    band = Band(response, panels(pole, 0.01, 50.0))
    for share in (1e-4, 1e-8, 1e-12):
        at = band.crossings(lambda g, share=share: square(g) - top * (1 - share))
        middle = np.sqrt(1 - 2 * ratio**2)
        assert len(at) == 2
        assert at[0] < middle < at[1]
        assert square(response(at)) == pytest.approx(top * (1 - share), rel=1e-14)
        assert len(band.crossings(lambda g, share=share: square(g) - top * (1 + share))) == 0


def test_largest_singular_values_with_kinks():
    """Two oscillators of their own, turned against each other: the larger of both counts."""
    w, ratio = np.array([1.0, 1.3]), np.array([1e-3, 2e-3])
    turn = np.linalg.qr(np.random.default_rng(0).normal(size=(2, 2)))[0]
    poles = w * (-ratio + 1j * np.sqrt(1 - ratio**2))

    def response(omega):
        diagonal = 1 / (w**2 - omega[:, None] ** 2 + 2j * ratio * w * omega[:, None])
        return turn @ (diagonal[:, :, None] * turn.T)

    def largest(g):
        return np.linalg.svd(g, compute_uv=False)[:, 0]

    band = Band(response, panels(poles, 0.1, 10.0))
    where, top = band.maxima(largest, 0.1)
    own = 1 / (2 * ratio * w**2 * np.sqrt(1 - ratio**2))
    assert np.allclose(top, own, rtol=1e-12)
    assert np.allclose(where, w * np.sqrt(1 - 2 * ratio**2), rtol=1e-12)
    assert band.highest(largest) == pytest.approx((where[0], own[0]), rel=1e-12)


def test_panels_are_short_against_the_distance_of_poles():
    poles = np.array([-1e-3 + 2j, -0.5 + 0j, -1e-8 + 30j])
    ends = panels(poles, 0.0, 1e3, marks=(7.0, 2e3))
    assert ends[0] == 0.0
    assert ends[-1] == 1e3
    assert 7.0 in ends
    middle = 0.5 * (ends[1:] + ends[:-1])
    assert (np.diff(ends) <= np.abs(1j * middle[:, None] - poles).min(axis=1)).all()
    assert len(ends) < 200


def test_poles_that_repeat_and_panels_that_are_bounded():
    poles, period = np.array([-1e-2 + 3j, -1e-2 - 3j]), 10.0
    ends = panels(poles, 0.0, 45.0, longest=2.0, period=period)
    images = (poles[:, None] + 1j * period * np.arange(-6, 7)).reshape(-1)
    middle = 0.5 * (ends[1:] + ends[:-1])
    limit = np.abs(1j * middle[:, None] - images).min(axis=1)
    assert (np.diff(ends) <= np.minimum(limit, 2.0) * (1 + 1e-12)).all()
    with pytest.raises(ResponseError, match="give a narrower one"):
        panels(poles, 0.0, 1e9, longest=2.0)


@pytest.mark.parametrize("residue", [1.0, 1e-4, 1e-7])
def test_undamped_poles_that_are_excited(residue):
    poles = 1j * np.array([1.0, 2.0, 5.0])

    def size(w):
        return np.abs(3.0 + residue / (4.0 - w**2) + 1e-14 / (1.0 - w**2))

    assert excited(size, poles, 0.1, 4.0).tolist() == [2.0]
    assert len(excited(size, poles, 2.5, 4.0)) == 0
    assert len(excited(size, poles - 1e-3, 0.1, 4.0)) == 0


@pytest.mark.slow
@pytest.mark.parametrize("quantity", range(3))
def test_no_response_is_above_its_norm(quantity):
    """On a grid about each pole, of modes with damping ratios down to 1e-7; SLICOT missed a peak at 13 rad/s once."""
    rng = np.random.default_rng(quantity)
    for _ in range(3):
        n, outputs, inputs = rng.integers(1, [7, 3, 3])
        k, c = (part @ part.T for part in rng.normal(size=(2, n, n)))
        k = 10 ** rng.uniform(0, 5) * k + np.diag(10 ** rng.uniform(0, 4, n))
        c = 10 ** rng.uniform(-8, -2) * k + 10 ** rng.uniform(-6, -1) * c
        rows = np.zeros((3, outputs, n))
        rows[quantity] = rng.normal(size=(outputs, n))
        mass, forces = np.diag(10 ** rng.uniform(-1, 1, n)), rng.normal(size=(n, inputs))
        system = mv.System.from_matrices(mass, c, k, forces, *rows)
        poles = system.poles()
        w = np.abs(poles)[:, None] + np.abs(poles.real)[:, None] * np.linspace(-4.0, 4.0, 81)
        w = np.concatenate((w[w > 0.0], np.geomspace(1e-3, 1e3, 300) * np.abs(poles).max()))
        highest = np.linalg.svd(system.frequency_response(w).transpose(2, 0, 1), compute_uv=False)[:, 0].max()
        for form in (system, system.state_space("physical")):
            norm = form.hinf_norm()
            assert norm.value >= highest * (1.0 - 1e-10)
            if np.isfinite(norm.omega):
                reached = np.linalg.norm(system.frequency_response([norm.omega])[:, :, 0], 2)
                assert reached == pytest.approx(norm.value, rel=1e-9)


def test_frequencies_of_flat_peaks_are_known_to_more_than_half_of_the_digits():
    """w0 sqrt(1 - 2 zeta^2): values beside a peak differ by rounding only over 1e-8 of the frequency."""
    rng = np.random.default_rng(0)
    square, ratio = rng.uniform(5.0, 50.0, 60), 10.0 ** rng.uniform(-2.0, -0.5, 60)
    for w2, zeta in zip(square.tolist(), ratio.tolist(), strict=True):
        damping = 2.0 * zeta * np.sqrt(w2)
        band = Band(lambda w, k=w2, c=damping: 1.0 / (k - w * w + 1j * c * w), np.linspace(0.0, 2.0 * np.sqrt(w2), 80))
        where, _ = band.highest(np.abs)
        assert where == pytest.approx(np.sqrt(w2 * (1.0 - 2.0 * zeta**2)), rel=3e-12)
