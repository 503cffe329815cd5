"""Projection of a mechanism: lines, faces and marks on the plane of a figure, sorted by distance, and their legend."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, TypeAlias

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection, PolyCollection
from matplotlib.lines import Line2D
from matplotlib.transforms import offset_copy

from mbsvib.common.arrays import Array
from mbsvib.errors import ResponseError
from mbsvib.plots import _style as style
from mbsvib.plots._scene import DrawnScene
from mbsvib.plots._sheet import Sheet

View: TypeAlias = str | Sequence[float]

# Azimuth and elevation [deg] of the eye.
VIEWS = {"3-D": (-52.0, 24.0), "x": (0.0, 0.0), "y": (-90.0, 0.0), "z": (-90.0, 90.0)}
BLUE, RED, GREEN, PINK, ORANGE = style.COLOURS[:5]
# Colour and width [pt] of a line by its kind.
LINES: dict[str, tuple[str, float]] = {
    "body": (BLUE, 2.6), "beam": (BLUE, 2.6), "rod": (BLUE, 1.8), "spoke": ("#7FB8D8", 0.8),
    "spring": (ORANGE, 1.2), "gap": (ORANGE, 1.2), "damper": (PINK, 1.4), "axis": (style.INK, 0.9),
    "ground": (style.MARK, 0.8), "input": (GREEN, 1.8),
}  # fmt: skip
REST = ("#ccd3da", 0.9)
# Sign, size [pt], colour, edge and its width [pt] of a mark by its kind, from below to above: a bushing is a ring,
# within which a joint at the same place is seen.
MARKS: dict[str, tuple[str, float, str, str, float]] = {
    "bushing": ("o", 10.0, "#FBEBCC", ORANGE, 2.2),
    "body": ("o", 4.5, "#003A5C", "white", 0.9), "node": ("o", 3.5, "#003A5C", "white", 0.9),
    "joint": ("o", 4.5, "white", style.INK, 0.9), "cut": ("D", 4.5, RED, "white", 0.9),
}  # fmt: skip
FACE = (0.56, 0.69, 0.85, 0.35)
MARGIN = 0.06
SLIMMEST = 0.5  # width over height of a drawing, or the reverse: at its corner the axes are beside the mechanism
HEAD, HALF_ANGLE = 0.022, np.radians(24.0)  # of arrows: length as a share of the size, and half of the opening angle
CORNER = 44.0  # size [pt] of the corner with the directions of the axes


def axes_of(view: View) -> Array:
    """Return the rows right, up and towards the eye of a view."""
    angles = VIEWS.get(view) if isinstance(view, str) else view
    if angles is None or len(angles) != 2:
        raise ResponseError(f"view = {view!r}: expected {', '.join(map(repr, VIEWS))} or two angles, azimuth and "
                            f"elevation in degrees.")  # fmt: skip
    azimuth, elevation = np.radians(np.asarray(angles, dtype=float))
    back = np.array([np.cos(elevation) * np.cos(azimuth), np.cos(elevation) * np.sin(azimuth), np.sin(elevation)])
    right = np.array([-np.sin(azimuth), np.cos(azimuth), 0.0])
    return np.array([right, np.cross(back, right), back])


class Picture:
    """A scene in axes of matplotlib, whose points can be moved.

    ``view``: "3-D", "x", "y", "z", or azimuth and elevation [deg]. ``rest``: whether the pose at rest is drawn in grey
    behind the moving one. ``reach``: largest displacement of points [m], for the frame.
    """

    def __init__(self, axes: Axes, scene: DrawnScene, view: View, rest: bool = False, reach: float = 0.0) -> None:
        self._scene, self._axes_of = scene, axes_of(view)
        flat = scene.points @ self._axes_of.T
        polylines = [(line.kind, np.arange(line.first, line.last)) for line in scene.lines]
        resting = [("rest", numbers) for kind, numbers in polylines if kind in ("body", "beam", "rod")] if rest else []
        self._ends = np.concatenate([np.zeros((0, 2), int), *(np.stack((n[:-1], n[1:]), axis=1) for _, n in polylines)])
        looks = [LINES[kind] for kind, numbers in polylines for _ in numbers[1:]]
        self._colours = np.array([look[0] for look in looks], dtype=object)
        self._widths = np.array([look[1] for look in looks])
        axes.add_collection(LineCollection([flat[numbers, :2] for _, numbers in resting], colors=REST[0],
                                           linewidths=REST[1], zorder=1))  # fmt: skip
        self._faces = PolyCollection([], facecolors=[FACE], edgecolors="none", zorder=2)
        self._lines = LineCollection([], capstyle="round", joinstyle="round", zorder=3)
        axes.add_collection(self._faces)
        axes.add_collection(self._lines)
        self._marks = []
        for kind, (sign, size, colour, edge, width) in MARKS.items():
            numbers = [mark.point for mark in scene.marks if mark.kind == kind]
            drawn = axes.plot([], [], sign, ms=size, mfc=colour, mec=edge, mew=width, zorder=4)[0]
            self._marks.append((drawn, numbers))
        arrows = [(line.first, tip) for line in scene.lines if line.kind == "input"
                  for tip in range(line.first + 1, line.last)]  # fmt: skip
        self._arrows = np.array(arrows, dtype=np.intp).reshape(-1, 2)
        self._heads = LineCollection([], colors=LINES["input"][0], linewidths=LINES["input"][1], capstyle="round",
                                     zorder=3.5)  # fmt: skip
        axes.add_collection(self._heads)
        low, high = (flat.min(axis=0), flat.max(axis=0)) if len(flat) else (-np.ones(3), np.ones(3))
        middle, half = 0.5 * (low + high)[:2], 0.5 * (high - low)[:2] + MARGIN * scene.size + reach
        half = np.maximum(half, SLIMMEST * half.max())
        axes.set(xlim=(middle[0] - half[0], middle[0] + half[0]), ylim=(middle[1] - half[1], middle[1] + half[1]),
                 aspect="equal")  # fmt: skip
        axes.set_axis_off()
        self.set_points(scene.points)

    def flat(self, points: Any) -> Array:
        """Return points (n, 3): coordinates on the plane of the figure, and the distance towards the eye, (n, 3)."""
        return np.asarray(points, dtype=float) @ self._axes_of.T

    def set_points(self, points: Array) -> None:
        """Move all points, (n, 3)."""
        flat = self.flat(points)
        if len(self._ends):
            order = np.argsort(flat[self._ends, 2].mean(axis=1), kind="stable")
            self._lines.set_segments(list(flat[self._ends[order], :2]))
            self._lines.set_color(self._colours[order].tolist())
            self._lines.set_linewidth(self._widths[order].tolist())
        if len(self._scene.faces):
            self._faces.set_verts(list(flat[self._scene.faces, :2]))
        tails, tips = flat[self._arrows, :2].transpose(1, 0, 2)
        self._heads.set_segments(list(_heads(tails, tips, HEAD * self._scene.size)))
        for drawn, numbers in self._marks:
            drawn.set_data(flat[numbers, 0], flat[numbers, 1])


def _heads(tails: Array, tips: Array, length: float) -> Array:
    """Return the heads of arrows from tails to tips (n, 2) as polylines (n, 3, 2); shorter for arrows seen end-on."""
    along = tips - tails
    reach = np.linalg.norm(along, axis=1, keepdims=True)
    back = -np.divide(along, reach, out=np.zeros_like(along), where=reach > 0.0) * np.minimum(length, 0.5 * reach)
    c, s = np.cos(HALF_ANGLE), np.sin(HALF_ANGLE)
    sides = [tips + back @ np.array([[c, sign * s], [-sign * s, c]]) for sign in (-1.0, 1.0)]
    return np.stack((sides[0], tips, sides[1]), axis=1)


def triad(axes: Axes, view: View) -> None:
    """Draw the directions x, y and z into the lower left corner, as large in every drawing."""
    arms, corner = axes_of(view)[:2].T, 0.5 * CORNER
    origin = offset_copy(axes.transAxes, axes.get_figure(root=True), corner, corner, units="points")
    for name, arm in zip("xyz", arms, strict=True):
        if np.linalg.norm(arm) > 0.1:
            axes.annotate(name, (0.0, 0.0), tuple((0.75 * corner * arm).tolist()), xycoords=origin,
                          textcoords="offset points", ha="center", va="center", fontsize=7.5, color=style.INK,
                          arrowprops={"arrowstyle": "-", "color": style.MARK, "linewidth": 0.9, "shrinkA": 1.0,
                                      "shrinkB": 0.0})  # fmt: skip


# What a symbol means, by the kind of marks and lines, in the order of the legend.
MEANINGS = {"body": "body, centre of mass", "beam": "beam", "rod": "rod", "joint": "joint",
            "cut": "cut joint", "axis": "axis of a joint", "bushing": "bushing",
            "spring": "spring", "damper": "damper", "input": "input", "ground": "ground"}  # fmt: skip
COLUMNS = 4


def legend(paper: Sheet[Any], scene: DrawnScene) -> None:
    """Explain below the drawing what its symbols mean."""
    marks, lines = {mark.kind for mark in scene.marks}, {line.kind for line in scene.lines}
    families = {"bushing": _families(scene, "bushing", " between "), "beam": _families(scene, "node", " '")}
    meanings = MEANINGS | {kind: words for kind, words in families.items() if words}
    if any(line.kind == "input" and line.last - line.first > 2 for line in scene.lines):
        meanings |= {"input": "input (torque: two heads)"}
    handles = [_handle(kind, words, kind in marks, kind in lines) for kind, words in meanings.items()
               if kind in marks | lines]  # fmt: skip
    paper.legend(handles, columns=COLUMNS, below=True, handlelength=1.8, columnspacing=1.4)


def _families(scene: DrawnScene, kind: str, until: str) -> str:
    """The families of what marks of a kind stand for, each once, as the first words of the marks name them."""
    return ", ".join(dict.fromkeys(mark.words.partition(until)[0] for mark in scene.marks if mark.kind == kind))


def _handle(kind: str, words: str, marked: bool, drawn: bool) -> Line2D:
    """Return an entry: a line, a mark, or both."""
    colour, width = LINES.get(kind, ("none", 0.0))
    sign, size, fill, edge, edge_width = MARKS.get(kind, ("None", 0.0, "none", "none", 0.0))
    if kind == "input":
        sign, size, fill, edge = ">", 5.0, colour, colour
    if kind == "ground":
        sign, size, fill, edge, edge_width = "^", 6.0, "none", colour, 0.8
    drawn, marked = drawn and kind != "ground", marked or kind in ("ground", "input")
    return Line2D([], [], color=colour if drawn else "none", linewidth=width, marker=sign if marked else "None",
                  markersize=size, mfc=fill, mec=edge, mew=edge_width, label=words)  # fmt: skip
