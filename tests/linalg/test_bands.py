"""The ends of a band belong to it, however its frequencies were rounded."""

import numpy as np
import pytest

import mbsvib as mv
from mbsvib.linalg.bands import within
from mbsvib.responses.densities import density


def test_ends_are_within():
    f = np.array([3.0 * (1 - 2e-16), 3.0, 7.0, 7.0 * (1 + 1e-13)])
    assert within(f, 3.0, 7.0).all()
    assert within(f, 3.0, np.inf).all()
    assert not within(np.array([3.0 * (1 - 1e-8), 7.0 * (1 + 1e-8), np.nan]), 3.0, 7.0).any()


@pytest.mark.parametrize("seconds", [0.3, 0.7, 1.1, 4.9])
def test_lines_at_the_ends_of_a_band_count(seconds):
    """Line k of a record is at k / length, which is rounded, and so is k again, in whatever unit of time."""
    count, rng = 50, np.random.default_rng(0)
    t = seconds / count * np.arange(count)
    records = {"F": rng.normal(size=count)}, {"x": rng.normal(size=count)}  # inputs, outputs
    for low in range(1, 10):
        for high in (low + 1, 10 + low):
            band = mv.Records(t, *records, variance={"x": 1.0}, band=(low / seconds, high / seconds))
            assert band.lines().tolist() == list(range(low, high + 1))
    twice = [{name: np.stack((values, values[::-1])) for name, values in part.items()} for part in records]
    for low in (3, 6, 7):
        data = mv.Measurement.from_records(t, *twice, segments=1, band=(low / seconds, 20 / seconds))
        np.testing.assert_allclose(data.omega * seconds / (2 * np.pi), np.arange(low, 21))
        assert len(data.within(low / seconds, 20 / seconds).omega) == 21 - low


def test_a_table_goes_to_its_ends():
    ends = np.array([0.1, 0.3])
    noise = density(np.stack((ends, [2.0, 4.0]), axis=1), "x")
    np.testing.assert_allclose(noise.at(ends * np.array([1 - 1e-15, 1 + 1e-15])), [2.0, 4.0])
