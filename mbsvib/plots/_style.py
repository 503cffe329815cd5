"""Style of all figures: colours for the colour-blind, a light grid, sizes for a paper."""

from __future__ import annotations

from contextlib import contextmanager
from textwrap import wrap
from threading import RLock
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator, Sequence

    from matplotlib.axes import Axes
    from matplotlib.axis import Axis
    from matplotlib.figure import Figure, SubFigure
    from numpy.typing import NDArray

COLOURS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9", "#000000")  # Okabe and Ito
DASHES: tuple[Any, ...] = ("-", (0, (5, 1.5)), (0, (1.5, 1)), (0, (6, 1.5, 1, 1.5)))
INK, FAINT, MARK = "#333333", "#E4E4E4", "#9A9A9A"
PANEL_WIDTH, WIDEST = 3.6, 10.8
DPI = 150
LETTERS_PER_INCH = 12.0
ROOM = 0.94  # of the width of a figure for its legend

RC: Any = {
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
    "legend.frameon": False,
    "legend.fontsize": 8.5,
    "text.color": INK,
}

_LOCK = RLock()  # matplotlib's settings are one dictionary for the whole process


@contextmanager
def context() -> Iterator[None]:
    """Apply the style while a figure is built; figures may be built in several threads."""
    import matplotlib

    with _LOCK, matplotlib.rc_context(RC):
        yield


def new_figure(width: float, height: float) -> Figure:
    """Return an empty figure [inch] that fits its labels by itself, in smaller sizes too."""
    from mbsvib.plots._figure import ScaledFigure

    return ScaledFigure(figsize=(width, height), layout="constrained")


def line(number: int, faint: bool = False) -> dict[str, Any]:
    """Return colour and dashes of the line with this number; lines differ in grey print too."""
    look = {"color": COLOURS[number % len(COLOURS)], "linestyle": DASHES[number % len(DASHES)]}
    return {**look, "color": MARK, "linewidth": 0.8} if faint else look


def panel_size(rows: int, columns: int, height: float, tall: float) -> tuple[float, float]:
    """Return the size [inch] of a figure that is ``tall`` with one row of panels and else ``height`` for each."""
    width = WIDEST * 0.6 if columns == 1 else min(columns * PANEL_WIDTH, WIDEST)
    return width, tall if rows == 1 else height * rows


def legend(figure: Figure, handles: Sequence[Any], loc: Any, columns: int, **look: Any) -> None:
    """Explain the curves of a figure outside its panels, in as many columns as there is room for.

    ``loc``: where, such as "outside upper right". ``**look``: further arguments of ``figure.legend``.
    """
    for count in range(min(len(handles), columns), 0, -1):
        words = figure.legend(handles=handles, loc=loc, ncols=count, **look)
        if count == 1 or words.get_window_extent().width <= ROOM * figure.bbox.width:
            return
        words.remove()


def name_systems(figure: Figure, names: Sequence[str], axes: Axes) -> None:
    """Name a single system at the right end above ``axes`` if there is room, several in a legend above all."""
    if len(names) > 1:
        legend(figure, figure.axes[0].get_legend_handles_labels()[0], "outside upper right", 4)
        return
    name_aside(axes, names[0])


def name_aside(axes: Axes, name: str) -> None:
    """Write a name at the right end above a panel, if there is room beside its title."""
    room = axes.get_position().width * axes.figure.bbox.width / axes.figure.dpi * LETTERS_PER_INCH
    if len(axes.get_title(loc="left")) + len(name) + 3 <= room:
        axes.set_title(name, loc="right", color=MARK, fontsize=8.5)


def frequency_axis(axes: Axes, low: float, high: float, label: str = "frequency [Hz]") -> None:
    """Make the horizontal axis logarithmic, from ``low`` to ``high``, with plain numbers where they are short."""
    axes.set_xlabel(label)
    logarithmic(axes.xaxis, low, high)
    if high > low:
        axes.set_xlim(low, high)


def logarithmic(axis: Axis, low: float, high: float) -> None:
    """Make an axis of values from ``low`` to ``high`` logarithmic, with plain numbers where they are short."""
    from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter

    axis.axes.set(**{"xscale" if axis is axis.axes.xaxis else "yscale": "log"})
    narrow = high < 50.0 * low
    if narrow:
        axis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
    axis.set_minor_formatter(NullFormatter())
    if low >= 1e-3 and high < (1e6 if narrow else 1.001e5):
        axis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))


def head(figure: Figure, words: str) -> None:
    """Write the title of a whole figure, in as many lines as it takes."""
    figure.suptitle(wrapped(figure, words), x=0.02, ha="left", fontsize=10.5)


def wrapped(figure: Figure | SubFigure, words: str, share: float = 1.0) -> str:
    """Return words in lines that are no longer than a ``share`` of the width of a figure."""
    width = int(share * figure.bbox.width / figure.dpi * LETTERS_PER_INCH)
    return "\n".join(part for line in words.split("\n") for part in wrap(line, width) or [""])


def tell_left_out(figure: Figure, shown: int, count: int, items: str, how: str = "") -> None:
    """Tell above a figure that it shows only the first of so many, and how the others are obtained."""
    if shown < count:
        words = f"{shown} of {count} {items}" + (f"; {how}" if how else "")
        figure.suptitle(words, x=0.02, ha="left", fontsize=8.5, color=MARK)


def zero(curves: Iterable[NDArray[Any]]) -> str:
    """Return the remark on responses that are zero by symmetry, exactly or up to rounding."""
    return "zero: what is drawn is rounding" if any(values.any() for values in curves) else "zero"


def remark(axes: Axes, words: str, top: bool = False) -> None:
    """Write a short remark into the lower or upper left corner of a panel."""
    height, side = (0.96, "top") if top else (0.04, "bottom")
    axes.text(0.02, height, words, transform=axes.transAxes, va=side, fontsize=8.5, color=MARK, style="italic")
