"""Names beside points, placed so that they overlap neither each other nor marks, and hide as few lines as possible."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise

import numpy as np
from matplotlib.axes import Axes
from matplotlib.text import Annotation, Text
from numpy.typing import NDArray

from mbsvib.common.arrays import Array
from mbsvib.plots import _style as style

Boxes = NDArray[np.float64]  # (..., 4): left, bottom, right, top [pixel]

# Distances [pt] from a point to the nearest edge of its name, and directions, that are tried.
DISTANCES = (3.5, 9.0, 16.0, 25.0, 36.0, 50.0, 66.0, 84.0)
DIRECTIONS = 24
LEADER = 8.0  # distance [pt] from which a thin line leads from the point to its name
GAP = 1.0  # least space [pt] around a name
MARK = 4.5  # half the size [pt] of a mark
SPACING = 3.0  # between points [pt] by which lines are represented
SWEEPS = 6  # over all names, each of which takes the best place there is
# Costs of overlapping a name or the edge of the picture, of hiding a mark, a point of a line, of a leader that crosses
# a name, and of a distance of 1 pt.
OVERLAP, HIDDEN, LINE, CROSSED, FAR = 1e4, 60.0, 3.0, 200.0, 0.6
# Cost of a name at the end of its line rather than in the middle, and the share of half of it that is no place for one.
ASIDE, END = 6.0, 0.8


def write_names(
    axes: Axes, names: Sequence[str], anchors: Array, marks: Array, curves: Sequence[Array], bounds: Boxes,
    blocked: Boxes, colours: Sequence[str],
) -> None:  # fmt: skip
    """Write names at points of axes.

    ``anchors`` (n, 2): the points, in data of the axes. ``marks`` (m, 2): where marks are, which should remain visible.
    ``curves`` (m, 2): polylines that should remain visible. ``bounds`` (4,): where names may be: left, bottom, right,
    top [pixel]. ``blocked`` (b, 4): boxes [pixel] where they may not be. ``colours``: of the names.
    """
    if not names:
        return
    pixel = axes.figure.dpi / 72.0
    texts = [axes.annotate(name, at, (0.0, 0.0), textcoords="offset points", fontsize=8.0, zorder=6, ha="center",
                           va="center", color=colour,
                           arrowprops={"arrowstyle": "-", "color": style.MARK, "linewidth": 0.6, "shrinkA": 0.0,
                                       "shrinkB": 2.0},
                           bbox={"fc": "white", "ec": "none", "alpha": 0.7, "pad": 0.5})
             for name, at, colour in zip(names, anchors.tolist(), colours, strict=True)]  # fmt: skip
    half = 0.5 * _sizes(texts) + GAP * pixel
    points = axes.transData.transform(anchors)
    lines = np.concatenate([np.zeros((0, 2)), *(_sampled(axes.transData.transform(curve), SPACING * pixel)
                                                for curve in curves)])  # fmt: skip
    offsets, distances = _candidates(half, pixel)
    centres = points[:, None] + offsets
    boxes = np.concatenate((centres - half[:, None], centres + half[:, None]), axis=2)
    cost = FAR * distances[None] + OVERLAP * _outside(boxes, bounds) + HIDDEN * _inside(
        boxes, axes.transData.transform(marks), MARK * pixel)
    cost = cost + LINE * _inside(boxes, lines, 0.0)
    cost += OVERLAP * np.array([_overlaps(group, blocked).sum(axis=1) for group in boxes])
    leaders = np.stack((np.broadcast_to(points[:, None], centres.shape), centres), axis=2)
    candidate = _best_candidates(boxes, cost, leaders)
    for k, text in enumerate(texts):
        text.set_position(tuple((offsets[k, candidate[k]] / pixel).tolist()))
        if text.arrow_patch is not None:
            text.arrow_patch.set_visible(bool(distances[candidate[k]] > LEADER))
        text.set_in_layout(False)


def slide(axes: Axes, texts: Sequence[Annotation], curves: Sequence[Array], blocked: Boxes) -> None:
    """Move names along their lines until they overlap as little as possible.

    ``texts``: names, centred at points of ``axes``. ``curves`` (n, 2): the line of each name, in data, all with as many
    points; places are its inner points, those in the middle first. ``blocked`` (b, 4): boxes [pixel] where names may
    not be.
    """
    if not texts:
        return
    half = 0.5 * _sizes(texts) + GAP * axes.figure.dpi / 72.0
    centres = np.array([axes.transData.transform(curve) for curve in curves])
    boxes = np.concatenate((centres - half[:, None], centres + half[:, None]), axis=2)
    aside = np.abs(np.linspace(-1.0, 1.0, centres.shape[1]))
    cost = np.broadcast_to(ASIDE * aside + np.where(aside > END, OVERLAP, 0.0), centres.shape[:2])
    cost = cost + OVERLAP * np.array([_overlaps(group, blocked).sum(axis=1) for group in boxes])
    for k, other in enumerate(centres):  # lines of others that a name hides
        cost = cost + LINE * np.where(np.arange(len(centres)) == k, 0.0, 1.0)[:, None] * _inside(boxes, other, 0.0)
    for text, curve, k in zip(texts, curves, _best_candidates(boxes, cost), strict=True):
        text.xy = (float(curve[k, 0]), float(curve[k, 1]))
        text.set_position(text.xy)


def _sizes(texts: Sequence[Annotation]) -> Array:
    """Return widths and heights of texts [pixel], (n, 2), without the lines that lead to them."""
    return np.array([(box.width, box.height) for box in (Text.get_window_extent(text) for text in texts)])


def _candidates(half: Array, pixel: float) -> tuple[Array, Array]:
    """Return offsets (n, candidates, 2) [pixel] of the centres of names, and their distances [pt] (candidates,)."""
    angle = np.linspace(0.0, 2.0 * np.pi, DIRECTIONS, endpoint=False) + np.pi / DIRECTIONS
    direction = np.stack((np.cos(angle), np.sin(angle)), axis=1)
    distances = np.repeat(DISTANCES, DIRECTIONS)
    out = np.tile(direction, (len(DISTANCES), 1))
    # the box touches a circle: its centre is as far out as its half size in that direction
    return out * (distances * pixel)[:, None] + half[:, None] * np.clip(1.5 * out, -1.0, 1.0), distances


def _sampled(curve: Array, spacing: float) -> Array:
    """Return points along a polyline."""
    pieces = [start + np.linspace(0.0, 1.0, 2 + int(np.hypot(*(end - start)) / spacing))[:, None] * (end - start)
              for start, end in pairwise(curve)]  # fmt: skip
    return np.concatenate(pieces) if pieces else curve


def _outside(boxes: Boxes, bounds: Boxes) -> Array:
    """Return whether boxes (..., 4) leave the bounds, as 0 or 1."""
    return np.asarray(((boxes[..., :2] < bounds[:2]) | (boxes[..., 2:] > bounds[2:])).any(axis=-1), dtype=float)


def _inside(boxes: Boxes, points: Array, room: float) -> Array:
    """Return how many points (p, 2) are in boxes (n, c, 4), or nearer than ``room``, (n, c)."""
    count = np.zeros(boxes.shape[:-1])
    for k, group in enumerate(boxes):
        inside = (points > group[:, None, :2] - room) & (points < group[:, None, 2:] + room)
        count[k] = inside.all(axis=-1).sum(axis=-1)
    return count


def _best_candidates(boxes: Boxes, cost: Array, leaders: Array | None = None) -> NDArray[np.intp]:
    """Return the candidate of each name, by sweeps in which each takes the cheapest place beside the others.

    ``boxes`` (n, candidates, 4) and ``cost`` (n, candidates) are theirs, ``leaders`` (n, candidates, 2 ends, 2) the
    lines that lead to them.
    """
    count = len(boxes)
    candidate = cost.argmin(axis=1)
    middle = 0.5 * (boxes[np.arange(count), candidate, :2] + boxes[np.arange(count), candidate, 2:])
    near = np.hypot(*(middle[:, None] - middle).T)
    order = np.argsort(np.sort(near, axis=1)[:, : min(4, count)].sum(axis=1), kind="stable")  # the most crowded first
    best, least = candidate.copy(), np.inf
    for _ in range(SWEEPS):
        total, before = 0.0, candidate.copy()
        for k in order:
            others = np.delete(np.arange(count), k)
            occupied = boxes[others, candidate[others]]
            sum_of = cost[k] + OVERLAP * _overlaps(boxes[k], occupied).sum(axis=1)
            if leaders is not None:
                sum_of += CROSSED * _crossed(leaders[k], occupied).sum(axis=1)
                sum_of += CROSSED * _crossed(leaders[others, candidate[others]], boxes[k]).sum(axis=0)
            candidate[k] = int(sum_of.argmin())
            total += float(sum_of[candidate[k]])
        if total < least:
            best, least = candidate.copy(), total
        if (candidate == before).all():
            break
    return np.asarray(best)


def _crossed(lines: Array, boxes: Boxes) -> NDArray[np.bool_]:
    """Return which lines (n, 2 ends, 2) cross boxes (m, 4), (n, m)."""
    along = lines[:, :1] + np.linspace(0.0, 0.9, 10)[:, None] * (lines[:, 1:] - lines[:, :1])
    inside = (along[:, :, None] > boxes[:, :2]) & (along[:, :, None] < boxes[:, 2:])
    return np.asarray(np.any(np.all(inside, axis=-1), axis=1))


def _overlaps(boxes: Boxes, occupied: Boxes) -> NDArray[np.bool_]:
    """Return which boxes (c, 4) overlap others (m, 4), (c, m)."""
    low, high = boxes[:, None, :2], boxes[:, None, 2:]
    return np.asarray(((low < occupied[:, 2:]) & (high > occupied[:, :2])).all(axis=-1))
