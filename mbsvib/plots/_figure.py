"""Figures whose texts shrink with them, so that they fit a column of a paper as they fit a page."""

from __future__ import annotations

from typing import Any
from weakref import WeakKeyDictionary

import numpy as np
from matplotlib.figure import Figure
from matplotlib.text import Text

LEAST = 0.6  # of the size of texts: less is not legible in print


class ScaledFigure(Figure):
    """A figure of matplotlib; where it is made smaller, texts shrink in proportion, to 60 % of their size at most."""

    def __init__(self, *args: Any, **settings: Any) -> None:
        super().__init__(*args, **settings)
        self._designed = self.get_size_inches().copy()
        self._scale = 1.0
        self._sizes: WeakKeyDictionary[Text, float] = WeakKeyDictionary()

    def draw(self, renderer: Any) -> None:
        """Draw the figure with texts of the size that belongs to it.

        Parameters
        ----------
        renderer : matplotlib.backend_bases.RendererBase
            What draws.
        """
        scale = float(np.clip((self.get_size_inches() / self._designed).min(), LEAST, 1.0))
        if scale != self._scale:
            self._resize_texts(scale)
        super().draw(renderer)

    def _resize_texts(self, scale: float) -> None:
        for text in self.findobj(Text):
            size = self._sizes.setdefault(text, float(text.get_fontsize()) / self._scale)
            text.set_fontsize(scale * size)
        for axes in self.axes:
            for axis in (axes.xaxis, axes.yaxis):  # ticks that are made later
                axis.set_tick_params("both", labelsize=axis.get_major_ticks(1)[0].label1.get_fontsize())
        self._scale = scale
