"""Figures whose texts shrink with them, so that they fit a column of a paper as they fit a page."""

from __future__ import annotations

import warnings
from typing import Any
from weakref import WeakKeyDictionary

import numpy as np
from matplotlib.figure import Figure
from matplotlib.text import Text
from matplotlib.ticker import Formatter, LogLocator, MaxNLocator

LEAST, LEGIBLE = 0.6, 7.0  # of the size of texts, and points: less is not legible in print
MOST_TICKS = 8  # of a log axis with 2 and 5
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
        decades = np.log10(high / low)
        room = 1 if self.axis is None else min(self.axis.get_tick_space(), MOST_TICKS)
        within = (1.0, 2.0, 5.0) if decades < 1.0 or 3.0 * decades <= room else (1.0,)
        self.set_params(subs=(1.0, 2.0, 3.0, 5.0) if decades < 0.9 and room > 4 else within)
        return super().tick_values(low, high)


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
