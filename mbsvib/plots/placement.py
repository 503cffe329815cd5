"""Sets of sensors and actuators: their scores, and which candidates each has."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from mbsvib.plots import _style as style
from mbsvib.plots._sheet import Given, sheet

if TYPE_CHECKING:
    from collections.abc import Sequence

    from matplotlib.figure import Figure

MOST = 24  # candidates with a row


def placement_figure(
    name: str, criterion: str, sets: Sequence[Sequence[str]], scores: Sequence[float], bound: float, label: str,
    candidates: Sequence[str], ax: Given | None = None,
) -> Figure | Given:  # fmt: skip
    """Draw the scores of sets, the best first, and below these a row for each candidate that one of them has."""
    used = [one for one in dict.fromkeys(candidates) if any(one in some for some in sets)]
    shown = used[:MOST]
    ranks = range(1, len(sets) + 1)
    size = float(np.clip(1.6 + 0.34 * len(sets), 4.6, style.WIDEST)), 2.6 + 0.22 * len(shown)
    with sheet("plot", ax, size, 2, height_ratios=[2.2, 0.22 * len(shown) + 0.3]) as paper:
        top, below = paper.panels
        paper.join(paper.panels)
        top.bar(ranks, scores, color=style.COLOURS[0], width=0.6)
        top.axhline(bound, color=style.INK, linewidth=0.9, linestyle="--", label=f"no set is better: {bound:.4g}")
        top.set_ylabel(label)
        top.set_ylim(0.0, 1.25 * max(bound, max((score for score in scores if score < float("inf")), default=1.0)))
        top.legend(loc="upper right")
        top.set_title(criterion[0].upper() + criterion[1:])
        paper.name([name])
        for row, candidate in enumerate(shown):
            at = [rank for rank, some in zip(ranks, sets, strict=True) if candidate in some]
            below.plot(at, [row] * len(at), "s", color=style.COLOURS[1], markersize=6)
        below.set_yticks(range(len(shown)), shown)
        below.set_ylim(len(shown) - 0.5, -0.5)
        below.set_xticks(list(ranks))
        below.set_xlabel("number of the set, the best first")
        below.grid(visible=True, axis="y", linewidth=0.4)
        paper.left_out(len(shown), len(used), "candidates")
    return paper.result
