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
    assert axes.get_xlabel() == "time [ms]"
    t, y = curve(axes)
    t = t / 1e3
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
    assert "zero" in [text.get_text() for text in axes.texts]
    assert not any(text.get_text().startswith("rise time") for text in axes.texts)
    assert not axes.lines[-1].get_ydata().any()


@pytest.mark.slow
def test_several_systems_and_panels(slider, tmp_path):
    figure = step([slider(damping=1.0), slider(damping=50.0)], ["x", "v", "a"], "F", labels=["light", "heavy"])
    assert [text.get_text() for text in figure.legends[0].get_texts()] == ["light", "heavy"]
    assert len(figure.axes) == 3
    figure.savefig(tmp_path / "several.png")
    assert (tmp_path / "several.png").read_bytes().startswith(b"\x89PNG")


def marked(axes):
    """Points of rise and peak, times of settling, words."""
    points = [line.get_xydata()[0] for line in axes.lines if len(line.get_xdata()) == 1]
    upright = [line.get_xdata()[0] for line in axes.lines if list(line.get_ydata()) == [0, 1]]
    return points, upright, axes.texts[-1].get_text().split("\n")


@pytest.mark.few(1)
@pytest.mark.parametrize("ratio", [0.02, 0.3, 1.5])
def test_rise_peak_and_settling_are_marked(slider, ratio):
    system = slider(damping=2 * ratio * np.sqrt(STIFFNESS * MASS))
    info = system.step_info("x", "F")
    (axes,) = step(system, "x", "F").axes
    points, (settled,), words = marked(axes)
    unit = 1e3 if "[ms]" in axes.get_xlabel() else 1.0
    assert settled == pytest.approx(unit * info.settling_time[0, 0])
    assert axes.get_xlim()[1] == pytest.approx(1.2 * settled)
    final = 1e6 / STIFFNESS  # µm
    assert [point[1] for point in points[:2]] == pytest.approx([0.1 * final, 0.9 * final], rel=1e-9)
    assert points[1][0] - points[0][0] == pytest.approx(unit * info.rise_time[0, 0], rel=0.01)
    if ratio < 1.0:
        assert points[2] == pytest.approx([unit * info.peak_time[0, 0], 1e6 * info.peak[0, 0]], rel=0.01)
        over = 100.0 * np.exp(-np.pi * ratio / np.sqrt(1.0 - ratio**2))
        assert words[1] == f"overshoot {over:.3g} %"
    else:
        assert len(points) == 2
        assert words[1] == "no overshoot"
    assert [word.rsplit(" ", 2)[0] for word in (words[0], words[2])] == ["rise time", "settling time"]


@pytest.mark.slow
def test_what_is_zero_does_not_decide_how_long_to_look():
    system = mv.library.build("stewart").linearize()
    alone, beside = (step(system, outputs, "Fx").axes[0].get_xlim()[1] for outputs in ("x", ["x", "y"]))
    assert beside == pytest.approx(alone)


def test_many_periods_are_not_shown_to_the_end(slider):
    system = slider(damping=2e-4 * np.sqrt(STIFFNESS * MASS))
    (axes,) = step(system, "x", "F").axes
    assert axes.texts[-1].get_text().endswith("(not shown)")
    assert not marked(axes)[1]


def test_signals_without_units_have_none_on_their_axes():
    control = pytest.importorskip("control")
    (axes,) = step(control.tf([1], [1, 1])).axes
    assert axes.get_ylabel().endswith("[1]")
    assert "/" not in str(mv.StateSpace.from_control(control.tf([1], [1, 1])).step_info())


def test_duration(slider):
    (axes,) = step(slider(), "x", "F", duration=2.0).axes
    assert axes.get_xlim()[1] == pytest.approx(2.0)
    with pytest.raises(mv.ResponseError, match="duration"):
        step(slider(), "x", "F", duration=-1.0)
