"""Style of all figures, of the library, the gallery and the documentation: what it is is said here alone.

Colours are told apart by the colour-blind (Okabe and Ito); lines differ in dashes too. Texts have 8.5 to 10.5 pt in a
figure as it is made, and 7 pt at least where it is made or shown smaller.
"""

from __future__ import annotations

from contextlib import contextmanager
from textwrap import wrap
from threading import RLock
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from matplotlib.axes import Axes
    from matplotlib.axis import Axis
    from matplotlib.figure import Figure, SubFigure

COLOURS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9", "#000000")  # Okabe and Ito
DASHES: tuple[Any, ...] = ("-", (0, (5, 1.5)), (0, (1.5, 1)), (0, (6, 1.5, 1, 1.5)))
INK, FAINT, MARK, NOTE = "#333333", "#E4E4E4", "#9A9A9A", "#6A6A6A"
# Sizes [inch]. The widest figure is shown at 7.2 in, the width of a page, where its smallest text, 8.5 pt, has 7 pt.
PANEL_WIDTH, ALONE, WIDEST = 3.6, 6.0, 8.6
DPI = 150
LETTERS_PER_INCH = 12.0
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
    import matplotlib

    with _LOCK, matplotlib.rc_context(STYLE):
        yield


def new_figure(width: float, height: float) -> Figure:
    """Return an empty figure [inch] that fits its labels by itself, in smaller sizes too."""
    from mbsvib.plots._figure import ScaledFigure

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
    room = axes.get_position().width * axes.figure.bbox.width / axes.figure.dpi * LETTERS_PER_INCH
    if len(axes.get_title(loc="left")) + len(name) + 3 <= room:
        axes.set_title(name, loc="right", color=NOTE, fontsize=8.5)


def frequency_axis(axes: Axes, low: float, high: float, label: str = "frequency [Hz]") -> None:
    """Make the horizontal axis logarithmic, from ``low`` to ``high``."""
    axes.set_xlabel(label)
    logarithmic(axes.xaxis)
    if high > low:
        axes.set_xlim(low, high)


def logarithmic(*several: Axis) -> None:
    """Make axes logarithmic, with plain numbers at ticks where they are short: 0.2, 0.3, not powers of ten."""
    from matplotlib.ticker import LogLocator, NullFormatter

    from mbsvib.plots._figure import LogTexts, LogTicks

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
