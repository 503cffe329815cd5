"""Step responses: labels, units, and data against closed forms."""

import numpy as np
import pytest

import mbsvib as mv
from mbsvib.plots import step
from tests.plots.conftest import MASS, STIFFNESS


def curve(axes):
    line = next(line for line in axes.lines if len(line.get_xdata()) > 2)
    return np.asarray(line.get_xdata()), np.asarray(line.get_ydata(), dtype=float)


def test_labels_units_and_values(slider):
    ratio = 0.1
    (axes,) = step(slider(damping=2 * ratio * np.sqrt(STIFFNESS * MASS)), "x", "F").axes
    assert axes.get_title(loc="left") == "F → x"
    assert axes.get_ylabel() == "x [µm] for 1 N"
    assert axes.get_xlabel() == "time [s]"
    t, y = curve(axes)
    w = np.sqrt(STIFFNESS / MASS)
    damped = w * np.sqrt(1 - ratio**2)
    after = t >= 0
    wave = np.cos(damped * t) + ratio / np.sqrt(1 - ratio**2) * np.sin(damped * t)
    exact = (1 - np.exp(-ratio * w * t) * wave) / STIFFNESS * 1e6
    np.testing.assert_allclose(y[after][1:], exact[after][1:], atol=1e-9)
    assert (y[~after] == 0).all()
    assert (~after).any()


def test_time_in_milliseconds_and_the_static_line(slider):
    (axes,) = step(slider(stiffness=5e9, damping=1000.0), "x", "F").axes
    assert axes.get_xlabel() == "time [ms]"
    static = next(line for line in axes.lines if len(line.get_xdata()) == 2)
    assert static.get_ydata()[0] == pytest.approx(200.0)  # 1 N / 5e9 N/m
    assert axes.get_ylabel() == "x [pm] for 1 N"


def test_base_motion_jumps_at_once(slider):
    (axes,) = step(slider(damping=20.0), "a", "F").axes
    t, y = curve(axes)
    first = y[np.searchsorted(t, 0.0, side="right")]
    assert first == pytest.approx(1000 / MASS, rel=0.1)  # mm/s^2
    assert axes.get_ylabel() == "a [mm/s²] for 1 N"


def test_a_rigid_body_runs_away_and_is_said_to(slider):
    (axes,) = step(slider(stiffness=0.0), "x", "F").axes
    t, y = curve(axes)
    assert (axes.get_xlabel(), axes.get_ylabel()) == ("time [s]", "x [mm] for 1 N")
    np.testing.assert_allclose(y[t > 0], 1e3 * t[t > 0] ** 2 / (2 * MASS), rtol=1e-9)
    assert any("rigid-body" in text.get_text() for text in axes.texts)
    assert not [line for line in axes.lines if len(line.get_xdata()) == 2]


def test_what_is_zero_by_symmetry_is_named():
    (axes,) = step(mv.library.build("stewart").linearize(), "y", "Fx").axes
    assert any("rounding" in text.get_text() for text in axes.texts)


def test_several_systems_and_panels(slider, tmp_path):
    figure = step([slider(damping=1.0), slider(damping=50.0)], ["x", "v", "a"], "F", labels=["light", "heavy"])
    assert [text.get_text() for text in figure.legends[0].get_texts()] == ["light", "heavy"]
    assert len(figure.axes) == 3
    figure.savefig(tmp_path / "several.png")
    assert (tmp_path / "several.png").read_bytes().startswith(b"\x89PNG")


def test_duration(slider):
    (axes,) = step(slider(), "x", "F", duration=2.0).axes
    assert axes.get_xlim()[1] == pytest.approx(2.0)
    with pytest.raises(mv.ResponseError, match="duration"):
        step(slider(), "x", "F", duration=-1.0)
