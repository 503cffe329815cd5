"""The panels of a picture: those of a new figure, or axes that the caller gave."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from typing import Any, Generic, TypeVar

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from mbsvib.errors import ResponseError, counted
from mbsvib.plots import _style as style

# What is given as ``ax``: axes, or a sequence or array of them. Returned where it is given, instead of a figure.
Given = TypeVar("Given")
Cell = tuple[Any, Any]  # row and column, numbers or slices, of a panel in the grid of a figure

ONE = (6.0, 4.0)  # inch: a figure of one panel


class Sheet(Generic[Given]):
    """Panels in reading order, row by row, and what stands outside of them.

    ``panels``: matplotlib's axes; ``figure``: theirs; ``result``: what a function returns that draws on them, the
    ``ax`` that was given or a new figure. On given axes, legends stand within the first panel, and titles above all
    panels are left to the caller; ``first`` is the number of curves that it has, whose looks are taken.
    """

    def __init__(self, who: str, ax: Given | None, size: tuple[float, float], cells: Sequence[Cell],
                 **grid: Any) -> None:  # fmt: skip
        self.own = ax is None
        self.figure: Any
        if self.own:
            self.figure = style.new_figure(*size)
            spec = self.figure.add_gridspec(1 + max(_last(row) for row, _ in cells),
                                            1 + max(_last(column) for _, column in cells), **grid)  # fmt: skip
            self.panels: list[Any] = [self.figure.add_subplot(spec[cell]) for cell in cells]
        else:
            self.panels = _given(who, ax, len(cells))
            self.figure = self.panels[0].get_figure(root=True)
        self.result: Figure | Given = self.figure if ax is None else ax
        self.first = len(self.panels[0].get_legend_handles_labels()[0])

    def join(self, panels: Sequence[Axes], axis: str = "x") -> None:
        """Let panels share an axis; those of a new figure have its labels at the last (x) or first (y) one only."""
        lead, *others = panels if axis == "y" else reversed(panels)
        for axes in others:
            if not getattr(axes, f"get_shared_{axis}_axes")().joined(axes, lead):
                try:
                    getattr(axes, f"share{axis}")(lead)
                except ValueError as error:
                    raise ResponseError(f"ax: panels that must share their {axis}-axis share it with others; give axes "
                                        f"with share{axis}=True, or that share nothing.") from error  # fmt: skip
            if self.own:
                hidden: Any = {"labelbottom" if axis == "x" else "labelleft": False}
                axes.tick_params(which="both", **hidden)

    def legend(self, handles: Sequence[Any] | None = None, loc: Any = "outside lower center", columns: int = 3,
               below: bool = False, **look: Any) -> None:  # fmt: skip
        """Explain curves outside of the panels, in as many columns as there is room for; default: the first panel's.

        ``below``: of given axes, where the panel is a drawing that leaves no room.
        """
        shown = self.panels[0].get_legend_handles_labels()[0] if handles is None else handles
        if self.own:
            style.legend(self.figure, shown, loc, columns, **look)
        elif shown:
            place: Any = {"loc": "upper center", "bbox_to_anchor": (0.5, 0.0), "ncols": 2} if below else {}
            self.panels[0].legend(handles=shown, **place, **look)

    def name(self, names: Sequence[str], panel: int = 0) -> None:
        """Name a single system at the right end above a panel if there is room, several in a legend above all."""
        if len(names) > 1:
            self.legend(loc="outside upper right", columns=4)
        elif self.own:
            style.name_aside(self.panels[panel], names[0])

    def head(self, words: str) -> None:
        """Write the title of a whole figure."""
        if self.own:
            self.figure.suptitle(style.wrapped(self.figure, words), x=0.02, ha="left", fontsize=10.5)

    def left_out(self, shown: int, count: int, items: str, how: str = "") -> None:
        """Say that only the first of so many are shown, and how the others are obtained."""
        if shown < count:
            words = f"{shown} of {count} {items}" + (f"; {how}" if how else "")
            if self.own:
                self.figure.suptitle(words, x=0.02, ha="left", fontsize=8.5, color=style.NOTE)
            else:
                style.remark(self.panels[0], words, top=True)


@contextmanager
def sheet(
    who: str, ax: Given | None, size: tuple[float, float] = ONE, rows: int = 1, columns: int = 1,
    count: int | None = None, *, cells: Sequence[Cell] | None = None, **grid: Any,
) -> Iterator[Sheet[Given]]:  # fmt: skip
    """Give the panels for a picture, in the style of all figures.

    ``who``: the function that draws, for messages. ``ax``: axes that were given; None: a new figure of ``size`` [inch]
    with the first ``count`` cells of a grid, or with ``cells``. ``**grid``: further arguments of its gridspec.
    """
    each = [divmod(k, columns) for k in range(rows * columns if count is None else count)]
    with style.context():
        yield Sheet(who, ax, size, each if cells is None else cells, **grid)


@contextmanager
def in_rows(
    who: str, ax: Given | None, count: int, columns: int, heights: tuple[float, float]
) -> Iterator[Sheet[Given]]:
    """Give ``count`` panels, ``columns`` of them in a row; ``heights`` [inch]: of one row, of each of several rows."""
    rows = -(-count // columns)
    with sheet(who, ax, _size(rows, columns, heights), rows, columns, count) as made:
        yield made


@contextmanager
def pairs(
    who: str, ax: Given | None, count: int, columns: int
) -> Iterator[tuple[Sheet[Given], list[tuple[Axes, Axes]]]]:
    """Give ``count`` pairs of panels, magnitude above phase, ``columns`` of them in a row."""
    rows = -(-count // columns)
    cells = [(2 * (k // columns) + below, k % columns) for k in range(count) for below in (0, 1)]
    order = sorted(range(2 * count), key=cells.__getitem__)
    with sheet(who, ax, _size(rows, columns, (4.8, 3.4)), cells=cells,
               height_ratios=[2.0, 1.15] * rows) as made:  # fmt: skip
        if made.own:
            made.panels = [made.panels[k] for k in order]
        drawn = dict(zip(order, made.panels, strict=True))
        couples = [(drawn[2 * k], drawn[2 * k + 1]) for k in range(count)]
        for couple in couples:
            made.join(couple)
        yield made, couples


def _size(rows: int, columns: int, heights: tuple[float, float]) -> tuple[float, float]:
    """The size [inch] of a figure of panels in rows; ``heights``: of a single row, and of each of several."""
    width = style.ALONE if columns == 1 else min(columns * style.PANEL_WIDTH, style.WIDEST)
    return width, heights[0] if rows == 1 else heights[1] * rows


def _last(cell: Any) -> int:
    return cell.stop - 1 if isinstance(cell, slice) else int(cell)


def _given(who: str, ax: Any, count: int) -> list[Any]:
    """Return given axes in a row, if they are axes, and as many as there are panels."""
    flat = [ax] if isinstance(ax, Axes) else np.array(ax, dtype=object).ravel().tolist()
    wrong = next((type(one).__name__ for one in flat if not isinstance(one, Axes)), None)
    needed = counted(count, "panel")
    if wrong is not None:
        raise ResponseError(f"{who}: ax has an object of class {wrong}; expected matplotlib's Axes, one for each of "
                            f"{needed}, such as matplotlib.pyplot.subplots({count}, 1)[1].")  # fmt: skip
    if len(flat) != count:
        raise ResponseError(f"{who}: ax has {counted(len(flat), 'panel')}, and this figure {needed}; give axes for "
                            f"each, row by row, or draw fewer panels.")  # fmt: skip
    return flat
