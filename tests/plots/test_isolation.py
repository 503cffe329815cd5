"""Figures of isolation show what the results hold."""

from functools import cache

import numpy as np
import pytest

import mbsvib as mv
from mbsvib import isolation, plots
from tests.isolation.scenes import active_strut, one_axis


def test_transmissibility_and_compliance():
    first, second = (isolation.study(one_axis(ratio), "payload", directions="z") for ratio in (0.05, 0.5))
    figure = plots.isolation([first, second], ["light", "heavy"])
    top, below = figure.axes
    assert np.array_equal(top.lines[0].get_ydata(), first.index)
    assert np.array_equal(below.lines[1].get_ydata(), second.compliance_values[0])
    assert top.get_ylabel().endswith("[1]")
    assert [text.get_text() for text in figure.legends[0].get_texts()] == ["light", "heavy", "isolation begins"]
    alone = plots.isolation(first)
    assert len(alone.axes) == 2
    assert [text.get_text() for text in alone.legends[0].get_texts()] == [
        "Frobenius index", "from smallest to largest singular value", "isolation begins"]  # fmt: skip
    with pytest.raises(mv.ModelError, match="a label for each"):
        plots.isolation([first, second], ["light"])


@pytest.mark.slow
def test_what_comes_from_other_axes_is_explained():
    hexapod = mv.library.stewart_isolator()
    study = isolation.study(hexapod, "platform", frequencies=[1.0, 10.0, 100.0])
    words = [text.get_text() for text in plots.transmissibility(study).legends[0].get_texts()]
    assert words == ["base along this axis", "base along all other axes"]
    words = [text.get_text() for text in plots.transmissibility([study, study], ["a", "b"]).legends[0].get_texts()]
    assert words == ["a", "b", "base along all other axes"]
    single = isolation.study(one_axis(0.05), "payload", directions="z")
    assert [text.get_text() for text in plots.transmissibility(single).legends[0].get_texts()] == [
        "base along this axis"]  # fmt: skip


@pytest.mark.slow
def test_root_locus_and_front():
    plant, locus = isolation.actuated(active_strut(), "payload", "leg", directions="z"), _locus()
    figure = plots.root_locus(locus)
    assert figure.axes[0].get_title(loc="left") == "IFF"
    assert figure.legends[0].get_title().get_text() == "least damping 0 % → 50 %\nat gain 141.4"
    dots = [line.get_xydata()[0] for line in figure.axes[0].lines
            if line.get_marker() == "o" and line.get_mfc() != "none"]  # fmt: skip
    at_best = plant.with_gains(isolation.force_feedback(plant, 1e2 * np.sqrt(2))).vibrating[0] / (2 * np.pi)
    assert np.allclose(dots, [[at_best.real, at_best.imag]], rtol=1e-3)
    assert plots.root_locus(locus, scale=2.0).legends[0].get_title().get_text().endswith("at gain 282.8")
    goal = isolation.passive(one_axis(0.1), "payload", directions="z")
    front = goal.front({"mount.stiffness": (1e3, 1e5)}, goal.index([100.0]), goal.sag(load=1.0), [1e-4, 2e-4])
    figure = plots.front(front)
    assert np.array_equal(figure.axes[0].lines[0].get_xdata(), front.price)


@cache
def _locus():
    plant = isolation.actuated(active_strut(), "payload", "leg", directions="z")
    return isolation.root_locus(plant, lambda g: isolation.force_feedback(plant, g), np.linspace(0.0, 300.0, 40))


@pytest.mark.slow
def test_root_locus_keeps_the_limits_that_are_given():
    locus = _locus()
    (default,) = plots.root_locus(locus).axes
    assert default.get_aspect() == 1.0
    (axes,) = plots.root_locus(locus, real=(-0.5, 0.1), imaginary=(1.0, 9.0)).axes
    assert (axes.get_xlim(), axes.get_ylim(), axes.get_aspect()) == ((-0.5, 0.1), (1.0, 9.0), "auto")
    (axes,) = plots.root_locus(locus, imaginary=(1.0, 9.0)).axes
    assert (axes.get_xlim(), axes.get_ylim()) == (default.get_xlim(), (1.0, 9.0))
    (axes,) = plots.root_locus(locus, equal=False).axes
    assert (axes.get_xlim(), axes.get_ylim(), axes.get_aspect()) == (default.get_xlim(), default.get_ylim(), "auto")
    assert plots.root_locus(locus, real=(-5.0, 1.0), equal=True).axes[0].get_aspect() == 1.0


@pytest.mark.slow
def test_modes_that_the_gain_does_not_move_leave_room_for_the_others():
    plant = isolation.actuated(mv.library.stewart_isolator(), "platform")
    locus = isolation.root_locus(plant, lambda g: isolation.force_feedback(plant, g), [0.0, 100.0])
    figure = plots.root_locus(locus)
    (axes,) = figure.axes
    assert 17.0 < axes.get_ylim()[1] < 25.0  # the highest mode that moves is at 17 Hz, those that do not are at 292 Hz
    assert axes.get_xlabel().endswith("(6 of 12 modes are outside)")
    assert [text.get_text() for text in figure.legends[0].get_texts()] == ["open loops", "best gain", "zeros"]


@pytest.mark.slow
def test_labels_of_damping_are_on_their_rays_and_within_the_limits():
    (axes,) = plots.root_locus(_locus(), real=(-3.0, 0.2), imaginary=(2.0, 10.0)).axes
    labels = {text.get_text(): text.get_position() for text in axes.texts}
    assert set(labels) == {"10 %", "20 %"}
    for words, (x, y) in labels.items():
        assert -x / np.hypot(x, y) == pytest.approx(float(words[:-2]) / 100.0)
        assert -3.0 < x < 0.2
        assert 2.0 < y < 10.0


@pytest.mark.few(2)
@pytest.mark.parametrize("limits", [(1.0, 1.0), (2.0, 1.0), (0.0, np.inf), (1.0, 2.0, 3.0), "wide"])
def test_limits_of_root_loci_that_are_none_are_refused(limits):
    with pytest.raises(mv.ResponseError, match=r"imaginary.*first and last value of the axis \[Hz\]"):
        plots.root_locus(_locus(), imaginary=limits)


def test_transmissibility_of_all_axes_in_one_figure():
    study = isolation.study(mv.library.stewart_isolator(), "platform", frequencies=[1.0, 20.0, 300.0])
    figure = plots.transmissibility(study)
    assert [axes.get_title(loc="left") for axes in figure.axes] == [
        f"base.{d} → {d}" for d in ("x", "y", "z", "rx", "ry", "rz")]  # fmt: skip
    for k, axes in enumerate(figure.axes):
        assert np.allclose(axes.lines[0].get_ydata(), np.abs(study.transmissibility[k, k]))
    others = figure.axes[0].lines[1].get_ydata()
    assert np.allclose(others, np.linalg.norm(study.scaled[0, 1:], axis=0))
    assert len(figure.axes[2].lines) == 1  # nothing along z comes from other axes
    only_z = isolation.study(mv.library.stewart_isolator(), "platform", frequencies=[1.0, 2.0], directions="z")
    with pytest.raises(mv.ModelError, match="shaken in different directions"):
        plots.transmissibility([study, only_z])


def test_contributions_of_modes_are_drawn_where_they_count():
    system = mv.library.stewart_isolator().linearize()
    f = np.array([1.0, 11.0, 30.0])
    (axes,) = plots.mode_contributions(system, "z", "Fz", f).axes
    total, third = axes.lines
    assert np.allclose(total.get_ydata(), np.abs(system.frequency_response(2 * np.pi * f, "z", "Fz")[0, 0]))
    assert third.get_label() == "mode 3"
    assert np.allclose(third.get_ydata(), np.abs(system.mode_contributions(2 * np.pi * f, "z", "Fz")[2, 0, 0]))
