"""Style of all figures, of the library, the gallery and the documentation, and figures whose texts shrink with them, so
that they fit a column of a paper as they fit a page.

Colours are told apart by the colour-blind (Okabe and Ito); lines differ in dashes too. Texts have 8.5 to 10.5 pt in a
figure as it is made, and 7 pt at least where it is made or shown smaller.
"""

from __future__ import annotations

import re
import warnings
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from textwrap import TextWrapper, wrap
from threading import RLock
from typing import Any
from weakref import WeakKeyDictionary

import numpy as np
from matplotlib import rc_context
from matplotlib.axes import Axes
from matplotlib.axis import Axis
from matplotlib.figure import Figure, SubFigure
from matplotlib.text import Text
from matplotlib.ticker import Formatter, LogLocator, MaxNLocator, NullFormatter

COLOURS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9", "#000000")  # Okabe and Ito
DASHES: tuple[Any, ...] = ("-", (0, (5, 1.5)), (0, (1.5, 1)), (0, (6, 1.5, 1, 1.5)))
INK, FAINT, MARK, NOTE = "#333333", "#E4E4E4", "#9A9A9A", "#6A6A6A"
# Sizes [inch]. The widest figure is shown at 7.2 in, the width of a page, where its smallest text, 8.5 pt, has 7 pt.
PANEL_WIDTH, ALONE, WIDEST = 3.6, 6.0, 8.6
DPI = 150
LETTERS_PER_INCH = 12.0
LINE_ENDS = re.compile(r"([\t ]+|(?<=[._]))")  # of titles
ROOM = 0.78  # of the width of a figure for its legend, which shrinks less where the figure is made smaller

STYLE: Any = {
    "figure.dpi": DPI,
    "figure.facecolor": "white",
    "savefig.dpi": DPI,
    "font.size": 9.5,
    "axes.titlesize": 10.5,
    "axes.titlelocation": "left",
    "axes.labelsize": 9.5,
    "axes.labelcolor": INK,
    "axes.edgecolor": "#777777",
    "axes.linewidth": 0.7,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.axisbelow": True,
    "axes.grid": True,
    "axes.grid.which": "major",
    "axes.unicode_minus": True,
    "axes.prop_cycle": f"cycler('color', {COLOURS})",
    "grid.color": FAINT,
    "grid.linewidth": 0.6,
    "lines.linewidth": 1.4,
    "lines.solid_joinstyle": "round",
    "xtick.color": "#777777",
    "ytick.color": "#777777",
    "xtick.labelcolor": INK,
    "ytick.labelcolor": INK,
    "xtick.labelsize": 8.5,
    "ytick.labelsize": 8.5,
    "xtick.major.width": 0.7,
    "ytick.major.width": 0.7,
    "xtick.minor.width": 0.4,
    "ytick.minor.width": 0.4,
    "legend.edgecolor": "none",
    "legend.framealpha": 0.8,
    "legend.fontsize": 8.5,
    "legend.title_fontsize": 8.5,
    "text.color": INK,
}
"""Settings of matplotlib, for own figures beside those of mbsvib: ``plt.style.use(mbsvib.plots.STYLE)``."""

_LOCK = RLock()  # matplotlib's settings are one dictionary for the whole process


@contextmanager
def context() -> Iterator[None]:
    """Apply the style while a figure is built; figures may be built in several threads."""
    with _LOCK, rc_context(STYLE):
        yield


def new_figure(width: float, height: float) -> Figure:
    """Return an empty figure [inch] that fits its labels by itself, in smaller sizes too."""
    return ScaledFigure(figsize=(width, height), layout="constrained")


def line(number: int, faint: bool = False) -> dict[str, Any]:
    """Return colour and dashes of the line with this number; lines differ in grey print too."""
    look = {"color": COLOURS[number % len(COLOURS)], "linestyle": DASHES[number % len(DASHES)]}
    return {**look, "color": MARK, "linewidth": 0.8} if faint else look


def legend(figure: Figure, handles: Sequence[Any], loc: Any, columns: int, **look: Any) -> None:
    """Explain the curves of a figure outside its panels, in as many columns as there is room for.

    ``loc``: where, such as "outside upper right". ``**look``: further arguments of ``figure.legend``.
    """
    def made(count: int) -> Any:
        words = figure.legend(handles=handles, loc=loc, ncols=count, **look)
        return words, words.get_window_extent().width

    words, least = made(1)  # of the title, if this is wider than the names
    for count in range(min(len(handles), columns), 1, -1):
        wider, width = made(count)
        if width <= max(ROOM * figure.bbox.width, least):
            words.remove()
            return
        wider.remove()


def name_aside(axes: Axes, name: str) -> None:
    """Write a name at the right end above a panel, if there is room beside its title."""
    if len(axes.get_title(loc="left")) + len(name) + 3 <= _letters(axes):
        axes.set_title(name, loc="right", color=NOTE, fontsize=8.5)


def title(axes: Axes, *names: str) -> None:
    """Write names with arrows between them above a panel; where they are too long for it, in lines that end at
    arrows, blanks, . and _.
    """
    words = " → ".join(names)
    lines = TextWrapper(max(1, int(_letters(axes))), break_on_hyphens=False)
    lines.wordsep_simple_re = LINE_ENDS
    parts = [name if k == 0 else f"→ {name}" for k, name in enumerate(names)]
    axes.set_title(words if len(words) <= lines.width else "\n".join([lines.fill(part) for part in parts]))


def _letters(axes: Axes) -> float:
    """About how many letters of a title are as wide as a panel."""
    return float(axes.get_position().width * axes.figure.bbox.width / axes.figure.dpi * LETTERS_PER_INCH)


def frequency_axis(axes: Axes, low: float, high: float, label: str = "frequency [Hz]") -> None:
    """Make the horizontal axis logarithmic, from ``low`` to ``high``."""
    axes.set_xlabel(label)
    logarithmic(axes.xaxis)
    if high > low:
        axes.set_xlim(low, high)


def phase_axis(axes: Axes) -> None:
    """Give the vertical axis the range of phases within -180 to 180 degrees."""
    axes.set_yticks([-180.0, -90.0, 0.0, 90.0, 180.0])
    axes.set(ylim=(-190.0, 190.0), ylabel="phase [deg]")


def logarithmic(*several: Axis) -> None:
    """Make axes logarithmic, with plain numbers at ticks where they are short: 0.2, 0.3, not powers of ten."""
    for axis in several:
        axis.axes.set(**{"xscale" if axis is axis.axes.xaxis else "yscale": "log"})
        axis.set_major_locator(LogTicks())
        axis.set_major_formatter(LogTexts())
        axis.set_minor_locator(LogLocator(subs="auto"))
        axis.set_minor_formatter(NullFormatter())


def wrapped(figure: Figure | SubFigure, words: str, share: float = 1.0) -> str:
    """Return words in lines that are no longer than a ``share`` of the width of a figure."""
    width = int(share * figure.bbox.width / figure.dpi * LETTERS_PER_INCH)
    return "\n".join(part for line in words.split("\n") for part in wrap(line, width) or [""])


def nothing(*panels: Axes) -> None:
    """Say that what would be drawn is zero, and leave out the numbers at axes that have no curve."""
    for axes in panels:
        axes.set_ylim(-1.0, 1.0)
        axes.set_yticks([])
    panels[0].text(0.5, 0.5, "zero", transform=panels[0].transAxes, ha="center", va="center", color=NOTE,
                   style="italic", bbox={"fc": "white", "ec": "none"})  # fmt: skip


def remark(axes: Axes, words: str, top: bool = False) -> None:
    """Write a short remark into the lower or upper left corner of a panel."""
    height, side = (0.96, "top") if top else (0.04, "bottom")
    axes.text(0.02, height, words, transform=axes.transAxes, va=side, fontsize=8.5, color=NOTE, style="italic")


LEAST, LEGIBLE = 0.6, 7.0  # of the size of texts, and points: less is not legible in print
MOST_TICKS = 8  # of a log axis with 2 and 5
LONG = 4.0  # letters of a tick's text for which matplotlib counts on room
TOUCH = 3.0  # pixels by which boxes of texts may overlap or leave the figure: their margins


class ScaledFigure(Figure):
    """A figure of matplotlib whose texts shrink where it is made smaller, to 60 % of their size and 7 pt at least.

    Warns if a smaller figure has no room for its texts.
    """

    def __init__(self, *args: Any, **settings: Any) -> None:
        super().__init__(*args, **settings)
        self._designed = self.get_size_inches().copy()
        self._scale = 1.0
        self._sizes: WeakKeyDictionary[Text, float] = WeakKeyDictionary()

    def draw(self, renderer: Any) -> None:
        """Draw the figure with texts in proportion to its size; warn if it is too small for them."""
        scale = float(np.clip((self.get_size_inches() / self._designed).min(), LEAST, 1.0))
        if scale != self._scale:
            self._resize_texts(scale)
        super().draw(renderer)
        if scale < 1.0 and self._crowded(renderer):
            size, designed = (" x ".join(f"{side:.3g}" for side in inches)
                              for inches in (self.get_size_inches(), self._designed))  # fmt: skip
            warnings.warn(f"figure of {size} in: texts meet or are cut. It is designed for {designed} in; make it "
                          f"larger, or draw fewer panels.", stacklevel=2)  # fmt: skip

    def _resize_texts(self, scale: float) -> None:
        for text in self.findobj(Text):
            size = self._sizes.setdefault(text, float(text.get_fontsize()) / self._scale)
            text.set_fontsize(max(scale * size, min(size, LEGIBLE)))
        for axes in self.axes:
            for axis in (axes.xaxis, axes.yaxis):  # ticks that are made later
                axis.set_tick_params("both", labelsize=axis.get_major_ticks(1)[0].label1.get_fontsize())
        self._scale = scale

    def _crowded(self, renderer: Any) -> bool:
        """Whether titles, labels, legends and remarks meet each other or are cut."""
        shown = [axes for axes in self.axes if axes.get_visible()]
        parts: list[Any] = [*self.texts, *self.legends]
        for axes in shown:
            parts += [axes.xaxis.label, axes.yaxis.label, axes.get_legend(), *axes.texts,
                      *(child for child in axes.get_children() if isinstance(child, Text))]  # fmt: skip
        drawn = {id(part): part for part in parts if part is not None and part.get_visible()
                 and not (isinstance(part, Text) and not part.get_text())}  # fmt: skip
        boxes = np.array([part.get_window_extent(renderer).extents for part in drawn.values()]).reshape(-1, 4)
        low, high = boxes[:, :2], boxes[:, 2:]
        if (low < -TOUCH).any() or (high > np.array(self.bbox.size) + TOUCH).any():
            return True
        shared = np.minimum(high[:, None], high) - np.maximum(low[:, None], low)
        return bool(np.triu((shared > TOUCH).all(axis=2), 1).any())


class LogTicks(LogLocator):
    """Ticks of a log axis: powers of ten, with 2 and 5 where there is room, even steps within a factor 3."""

    def tick_values(self, vmin: float, vmax: float) -> Any:
        """Return where ticks are between two values."""
        low, high = sorted((vmin, vmax))
        if 0.0 < high < 3.0 * low:
            return MaxNLocator(5, steps=[1, 2, 5, 10]).tick_values(low, high)
        decades = np.log10(high) - np.log10(low)
        room = 1 if self.axis is None else min(int(self.axis.get_tick_space() * self._share(low)), MOST_TICKS)
        within = (1.0, 2.0, 5.0) if decades < 1.0 or 3.0 * decades <= room else (1.0,)
        self.set_params(subs=(1.0, 2.0, 3.0, 5.0) if decades < 0.9 and room > 4 else within)
        return super().tick_values(low, high)

    def _share(self, low: float) -> float:
        """The share of the ticks for which there is room if their plain numbers are long, as 0.005 is."""
        axis: Any = self.axis
        return min(1.0, LONG / len(f"{low:.0g}")) if axis is axis.axes.xaxis and low > 0.99e-4 else 1.0


class LogTexts(Formatter):
    """Plain numbers at the ticks of a log axis; powers of ten where numbers are long."""

    def __call__(self, value: float, pos: int | None = None) -> str:
        """Return the text at a value."""
        axis: Any = self.axis
        low, high = sorted(axis.get_view_interval())
        if low > 0.99e-4 and high < 1.001e5:
            return f"{value:g}"
        power = np.floor(np.log10(value) + 1e-9)
        factor = value / 10.0**power
        text = rf"10^{{{power:.0f}}}"
        return f"${text}$" if np.isclose(factor, 1.0) else rf"${factor:.3g}\times{text}$"
