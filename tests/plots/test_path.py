"""Figures of paths of equilibria."""

import numpy as np
import pytest

from mbsvib import library, plots


@pytest.mark.slow
def test_a_latch_over_its_stretched_pose():
    data = library.toggle(angle=0.284).path("base.rz", [0.0, -0.1, -0.2, -0.4, -0.5])
    above, below = plots.path(data).axes
    stable, unstable = (line.get_xydata() for line in above.lines[:2])
    limits = [point.value for point in data.points]
    assert np.nanmin(unstable[:, 0]) >= limits[1] - 1e-9
    assert np.nanmax(unstable[:, 0]) <= limits[0] + 1e-9
    assert np.nanmax(stable[:, 0]) == 0.0
    assert np.isin(data.forces, np.concatenate((stable, unstable))[:, 1]).all()
    markers = above.lines[2].get_xydata()
    assert np.array_equal(markers, [(point.value, point.force) for point in data.points])
    assert [text.get_text() for text in above.figure.legends[0].get_texts()] == [
        "stable", "unstable", "limit point"]  # fmt: skip
    assert (above.get_ylabel(), below.get_xlabel()) == ("holding moment [N m]", "base.rz [rad]")
    heights = below.lines[0].get_ydata()
    assert np.isnan(heights).sum() == 4  # two unstable values, and gaps beside them
    assert above.get_title(loc="right") == "toggle"


@pytest.mark.slow
def test_frequencies_end_at_0_where_the_force_has_its_extreme():
    """The moment, k l^2 (cos b - cos a) sin b times a number, has them at 2 cos^2 b - cos a cos b = 1."""
    cosine = (np.cos(0.284) + np.sqrt(np.cos(0.284) ** 2 + 8.0)) / 4.0
    extremes = -0.284 + np.arccos(cosine) * np.array([1.0, -1.0])
    for values in ([0.0, -0.1, -0.2, -0.4, -0.5], [0.0, -0.1, -0.5]):  # with and without unstable values
        data = library.toggle(angle=0.284).path("base.rz", values)
        x, y = plots.path(data).axes[1].lines[0].get_data()
        np.testing.assert_allclose(x[y == 0.0], extremes, rtol=1e-6)
        inside = (x < extremes[0] - 1e-6) & (x > extremes[1] + 1e-6)
        assert np.isnan(y[inside]).all()
