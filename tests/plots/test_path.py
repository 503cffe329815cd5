"""Figures of paths of equilibria."""

import numpy as np

from mbsvib import library, plots


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
        "stable", "unstable", "extreme of the force"]  # fmt: skip
    assert (above.get_ylabel(), below.get_xlabel()) == ("holding moment [N m]", "base.rz [rad]")
    heights = below.lines[0].get_ydata()
    assert np.isnan(heights).sum() == 4  # two unstable values, and gaps beside them
