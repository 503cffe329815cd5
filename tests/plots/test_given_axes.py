"""Figures on axes that are given: all kinds draw there and return them; papers put several side by side."""

import inspect

import numpy as np
import pytest
from matplotlib.figure import Figure

import mbsvib as mv
from mbsvib import library, plots
from mbsvib.plots import _sheet
from mbsvib.plots._style import LogTexts
from tests.plots.test_axes import FIGURES
from tests.support.public import returned_classes

NO_FIGURE = ("STYLE", "time_grid")
KINDS = FIGURES | {"mechanism": lambda: [plots.mechanism(library.four_bar())],
                   "topology": lambda: [plots.topology(library.four_bar().linearize())],
                   "measured": lambda: [mv.Measurement(np.array([6.0, 12.0]), np.ones((1, 1, 2), complex), ("y",),
                                                       ("u",)).plot()],
                   "motion": lambda: [library.four_bar().linearize().modes().animate(1).figure()]}  # fmt: skip


def axes(count):
    return list(Figure(figsize=(6.0, 3.0 * count)).subplots(count, 1, squeeze=False)[:, 0])


@pytest.mark.few(1)
@pytest.mark.parametrize("kind", [kind for kind in KINDS if kind not in NO_FIGURE])
def test_every_kind_draws_on_given_axes(kind, monkeypatch):
    """It returns what was given, with something on each, and adds nothing to the figure around."""
    made, original = [], _sheet.Sheet.__init__

    def given(self, who, ax, size, cells, **grid):
        assert ax is None
        made.append(axes(len(cells)))
        original(self, who, made[-1], size, cells, **grid)

    monkeypatch.setattr(_sheet.Sheet, "__init__", given)
    for result, panels in zip(KINDS[kind](), made, strict=True):
        assert result is panels
        for one in panels:
            assert one.lines or one.collections or one.images or one.patches
        figure = panels[0].figure
        assert not figure.legends
        assert figure.get_suptitle() == ""
        figure.draw_without_rendering()


@pytest.mark.parametrize("name", [name for name in plots.__all__ if name not in NO_FIGURE])
def test_functions_take_axes(name):
    assert "ax" in inspect.signature(getattr(plots, name)).parameters


def test_methods_take_axes():
    """All that return a figure."""
    missing = [f"{name}.{method}" for name, kind in returned_classes().items() for method, part in vars(kind).items()
               if inspect.isfunction(part) and "Figure" in str(part.__annotations__.get("return"))
               and "ax" not in inspect.signature(part).parameters]  # fmt: skip
    assert missing == []


def test_axes_are_returned_as_given_and_curves_take_the_next_look():
    system = library.quarter_car().linearize()
    pair = np.array(axes(2))
    pair[0].plot([1.0, 10.0], [1e-5, 1e-5], label="measured")
    output, source = system.outputs[0], system.inputs[0]
    assert plots.bode(system, output, source, marks=False, ax=pair) is pair
    assert pair[0].lines[1].get_color() == plots._style.COLOURS[1]
    assert pair[0].get_shared_x_axes().joined(*pair)
    (single,) = axes(1)
    assert plots.step(system, output, source, ax=single) is single


@pytest.mark.parametrize(("ax", "words"), [
    (axes(1)[0], r"plots\.modes: ax has 1 panel, and this figure 2 panels; give axes for each"),
    (axes(3), r"ax has 3 panels, and this figure 2 panels"),
    (Figure(), r"ax has an object of class Figure; expected matplotlib's Axes, one for each of 2 panels"),
    ([None, None], r"ax has an object of class NoneType"),
])  # fmt: skip
def test_other_axes_are_refused(ax, words):
    with pytest.raises(mv.ResponseError, match=words):
        plots.modes(library.quarter_car().linearize(), ax=ax)


def test_axes_that_share_with_others_are_refused():
    grid = Figure().subplots(2, 2, sharex="row")
    with pytest.raises(mv.ResponseError, match="share their x-axis share it with others"):
        plots.modes(library.quarter_car().linearize(), ax=grid[:, 1])


@pytest.mark.parametrize(("low", "high", "words"), [
    (0.15, 0.9, {"0.2", "0.3", "0.5"}), (0.21, 0.29, {"0.22", "0.24", "0.26", "0.28"}),
    (0.5, 40.0, {"0.5", "1", "2", "5", "10", "20"}), (1e-3, 1e4, {"0.001", "0.1", "10", "1000"}),
    (2e-9, 9e-9, {r"$2\times10^{-9}$", r"$5\times10^{-9}$"}), (1e-9, 1e-2, {"$10^{-8}$", "$10^{-4}$"}),
])  # fmt: skip
def test_log_axes_have_plain_numbers(low, high, words):
    (one,) = axes(1)
    plots._style.logarithmic(one.yaxis)
    one.set_ylim(low, high)
    ticks = [tick for tick in one.yaxis.get_major_locator()() if low <= tick <= high]
    texts = LogTexts()
    texts.set_axis(one.yaxis)
    assert words <= {texts(tick) for tick in ticks}
    assert len(ticks) <= 9


def test_the_style_is_for_own_figures_too():
    from matplotlib import rc_context, rcParams

    with rc_context(plots.STYLE):
        assert rcParams["axes.prop_cycle"].by_key()["color"] == list(plots._style.COLOURS)
    sizes = [value for key, value in plots.STYLE.items() if key.endswith(("size", "font.size"))]
    assert min(sizes) * 7.2 / plots._style.WIDEST >= 7.0
