"""Sets of sensors and actuators: their scores, and which candidates each has."""

from __future__ import annotations

from typing import TYPE_CHECKING

from mbsvib.plots import _style as style

if TYPE_CHECKING:
    from collections.abc import Sequence

    from matplotlib.figure import Figure

MOST = 24  # candidates with a row


def placement_figure(
    name: str, criterion: str, sets: Sequence[Sequence[str]], scores: Sequence[float], bound: float, label: str,
    candidates: Sequence[str],
) -> Figure:  # fmt: skip
    """Draw the scores of sets, the best first, and below these a row for each candidate that one of them has."""
    used = [one for one in dict.fromkeys(candidates) if any(one in some for some in sets)]
    shown = used[:MOST]
    ranks = range(1, len(sets) + 1)
    with style.context():
        figure = style.new_figure(max(4.6, 1.6 + 0.34 * len(sets)), 2.6 + 0.22 * len(shown))
        top, below = figure.subplots(2, 1, sharex=True, height_ratios=[2.2, 0.22 * len(shown) + 0.3])
        top.bar(ranks, scores, color=style.COLOURS[0], width=0.6)
        top.axhline(bound, color=style.INK, linewidth=0.9, linestyle="--", label=f"no set is better: {bound:.4g}")
        top.set_ylabel(label)
        top.set_ylim(0.0, 1.25 * max(bound, max((score for score in scores if score < float("inf")), default=1.0)))
        top.legend(loc="upper right", frameon=False)
        top.set_title(criterion[0].upper() + criterion[1:])
        style.name_aside(top, name)
        for row, candidate in enumerate(shown):
            at = [rank for rank, some in zip(ranks, sets, strict=True) if candidate in some]
            below.plot(at, [row] * len(at), "s", color=style.COLOURS[1], markersize=6)
        below.set_yticks(range(len(shown)), shown)
        below.set_ylim(len(shown) - 0.5, -0.5)
        below.set_xticks(list(ranks))
        below.set_xlabel("number of the set, the best first")
        below.grid(visible=True, axis="y", linewidth=0.4)
        if len(used) > len(shown):
            style.tell_left_out(figure, len(shown), len(used), "candidates")
    return figure
