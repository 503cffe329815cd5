"""Figures in other sizes: texts shrink with them, and nothing leaves the figure or hides another text."""

import numpy as np
import pytest

import mbsvib as mv
from mbsvib import isolation, library, plots
from mbsvib.campbell import campbell
from mbsvib.plots import _style as style
from tests.support.sizes import few

SMALL = (4.0, 3.0)


def boxes(texts):
    return [text.get_window_extent().extents for text in texts if text.get_text() and text.get_visible()]


def overlaps(group):
    return [(one, other) for k, one in enumerate(group) for other in group[:k]
            if one[0] < other[2] and other[0] < one[2] and one[1] < other[3] and other[1] < one[3]]  # fmt: skip


def within(figure, box):
    width, height = figure.get_size_inches() * figure.dpi
    return box[0] >= -1 and box[1] >= -1 and box[2] <= width + 1 and box[3] <= height + 1


def drawn(figure, size=None):
    if size is not None:
        figure.set_size_inches(*size)
    figure.draw_without_rendering()
    return figure


def locus():
    plant = isolation.actuated(library.stewart_isolator(), "platform")
    return isolation.root_locus(plant, lambda gain: isolation.force_feedback(plant, gain, 1.0), [0.0, 40.0, 90.0])


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore:figure of 1.2 x")
def test_texts_shrink_with_the_figure_and_grow_back():
    figure = drawn(plots.modes(library.engine_on_mounts().linearize()))
    (width, height), axes = figure.get_size_inches(), figure.axes[0]
    others = axes.yaxis.label, axes._left_title, axes._right_title
    before = np.array([text.get_fontsize() for text in others])
    for size, scale in (((0.8, 0.9), 0.8), ((0.2, 1.0), 0.6), ((2.0, 2.0), 1.0)):
        drawn(figure, (size[0] * width, size[1] * height))
        np.testing.assert_allclose([text.get_fontsize() for text in others], np.maximum(scale * before, 7.0))
        labels = [text for each in figure.axes for text in (*each.get_xticklabels(), *each.get_yticklabels())]
        np.testing.assert_allclose([text.get_fontsize() for text in labels], max(8.5 * scale, 7.0))


@pytest.mark.slow
@pytest.mark.parametrize("size", few([SMALL, None, (12.0, 8.0)], 1))
def test_labels_of_axes_do_not_meet(size):
    system = library.stewart_isolator().linearize()
    for figure in (plots.modes(system), plots.energy(system), plots.mode_comparison(system, [9.0, 10.0, 11.0])):
        drawn(figure, size)
        labels = [label for axes in figure.axes for label in (axes.yaxis.label, axes.xaxis.label)]
        titles = [title for axes in figure.axes for title in (axes.title, axes._left_title, axes._right_title)]
        assert overlaps(boxes([*labels, *titles])) == []
        assert all(within(figure, box) for box in boxes([*labels, *titles]))


@pytest.mark.slow
@pytest.mark.parametrize("size", few([None, (12.0, 8.0)], 1))
@pytest.mark.parametrize("model", [library.stewart_isolator, library.quadruped, library.cantilever])
def test_the_legend_of_a_mechanism_is_within_the_figure(model, size):
    figure = drawn(plots.mechanism(model()), size)
    (legend,) = figure.legends
    assert within(figure, legend.get_window_extent().extents)


@pytest.mark.slow
def test_results_in_a_legend_are_within_the_figure():
    figure = drawn(plots.root_locus(locus()))
    title = figure.legends[0].get_title()
    assert "least damping" in title.get_text()
    assert within(figure, title.get_window_extent().extents)


@pytest.mark.slow
def test_strips_do_not_hide_their_legend():
    figure = drawn(plots.mode_strips(library.rotor_stator().linearize()))
    legend = figure.legends[0].get_window_extent().extents
    assert overlaps([legend, *boxes(figure.texts)]) == []
    assert within(figure, legend)


@pytest.mark.slow
def test_names_of_a_long_chain_do_not_hide_another():
    """Thirty levels in nine inches: names stand beside their bodies, and all springs are on the same side."""
    figure = drawn(plots.topology(library.chain(30).linearize()))
    (axes,) = figure.axes
    names = {text.get_text(): text for text in axes.texts}
    assert {f"{what}{i}" for what in ("body", "joint", "spring") for i in range(1, 31)} <= set(names)
    assert overlaps(boxes(axes.texts)) == []
    sides = {np.sign(names[f"spring{i}"].get_window_extent().x0 - names[f"body{i}"].get_window_extent().x1)
             for i in range(1, 31)}  # fmt: skip
    assert sides == {1.0}


def test_the_marks_of_one_mode_are_within_the_axes():
    axes = plots.mode_comparison([7.958], [8.1]).axes[0]
    assert axes.get_ylim()[0] == 0.0
    assert axes.get_ylim()[1] > 8.5


@pytest.mark.slow
def test_one_figure_has_one_style_of_labels():
    system = library.stewart_isolator(ports=("platform", "base")).linearize()
    for decibels in (False, True):
        figure = plots.bode(system, ["z", "platform.az"], ["Fz", "az"], decibels=decibels)
        words = {axes.get_ylabel().partition(" [")[0] for axes in figure.axes[::2]}
        assert words == {"|G|" if decibels else "magnitude"}
    assert plots.bode(system, "z", "Fz").axes[0].get_ylabel() == "|z / Fz| [m/N]"


@pytest.mark.slow
@pytest.mark.parametrize("draw", [
    pytest.param(lambda: plots.bode(library.stewart_isolator().linearize(), ["x", "y", "z"], ["Fx", "Fy", "Fz"]),
                 marks=pytest.mark.slow),
    lambda: plots.mechanism(library.stewart()),
])  # fmt: skip
def test_a_figure_too_small_for_its_panels_says_so(draw):
    with pytest.warns(UserWarning, match=r"figure of 4 x 3 in: texts meet or are cut. It is designed for .* in"):
        drawn(draw(), SMALL)


@pytest.mark.slow
def test_campbell_diagrams_and_long_titles_fit_small_figures():
    """Legends and titles ran out of the figure."""
    data = campbell(library.rotor_stator(), np.linspace(0.0, 500.0, 6))
    drawn(plots.campbell(data, (1.0, 2.0)), SMALL)
    damping = np.geomspace(50.0, 5e3, 5)
    swept = mv.sweep(library.quarter_car(), {"suspension.damping": damping, "suspension.stiffness": 10.0 * damping,
                                             "body.mass": damping}, "modes.frequencies", how="paired")  # fmt: skip
    figure = drawn(swept.plot())
    assert within(figure, boxes([figure.axes[0].title, figure.axes[0]._left_title])[0])


@pytest.mark.slow
def test_loops_and_studies_of_one_model_have_different_names():
    plant = isolation.actuated(library.stewart_isolator(), "platform")
    loop = plant.with_gains(isolation.force_feedback(plant, 80.0, 1.0))
    names = [line.get_label().split(":")[0] for line in plots.sensitivity([loop, loop.sampled(1e4)]).axes[0].lines[:2]]
    assert names == ["IFF", "IFF at 10000 Hz"]
    studied = plots.isolation([plant.isolation([10.0, 20.0]), loop.isolation([10.0, 20.0])])
    words = [text.get_text() for text in studied.legends[0].get_texts()]
    assert words == ["stewart_isolator", "stewart_isolator with IFF", "isolation begins"]


def test_a_name_without_room_is_left_out():
    with style.context():
        axes = style.new_figure(3.0, 3.0).subplots()
        axes.set_title("a title that takes all")
        style.name_aside(axes, "a long name of a model")
        assert axes.get_title(loc="right") == ""
        axes.set_title("short")
        style.name_aside(axes, "a model")
        assert axes.get_title(loc="right") == "a model"


@pytest.mark.slow
def test_long_names_of_signals_are_within_the_figure():
    """Titles ended at the edge of the figure, or ran into those of the next panel."""
    plant = library.stewart_isolator().linearize().with_ports(["x", "y", "z"], ["Fx", "Fy", "Fz"])
    names = [f"left_front_{name}_of_the_hub" for name in plant.inputs]
    system = mv.StateSpace.from_arrays(*[getattr(plant.state_space(), key) for key in "ABCD"], names, plant.outputs)
    for figure in (plots.bode(system), plots.step(system), plots.nyquist(system)):
        drawn(figure)
        titles = boxes([axes._left_title for axes in figure.axes])
        assert overlaps(titles) == []
        assert all(within(figure, box) for box in titles)
        assert figure.axes[0].get_title(loc="left").replace("\n", " ").startswith("left_front_Fx_of_the_ hub → x")


@pytest.mark.slow
def test_margins_of_three_loops_are_within_their_panels():
    plant = isolation.actuated(library.stewart_isolator(), "platform")
    loop = plant.with_gains(isolation.force_feedback(plant, 80.0, 1.0))
    figure = drawn(plots.loop_gain(loop, loop.actuators[:3]))
    for axes in figure.axes[::2]:
        panel, legend = axes.get_window_extent().extents, axes.get_legend().get_window_extent().extents
        assert panel[0] <= legend[0] < legend[2] <= panel[2]
