"""The mechanism itself: bodies, joints, springs and inputs, as they are at the pose."""

from __future__ import annotations

from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from mbsvib.common.arrays import Array
from mbsvib.common.expected import a_system
from mbsvib.mechanism.mechanism import Mechanism
from mbsvib.plots import _labels as labels
from mbsvib.plots import _scene
from mbsvib.plots import _style as style
from mbsvib.plots._curves import System
from mbsvib.plots._projection import CORNER, LINES, Picture, View, legend, triad
from mbsvib.plots._scene import DrawnScene
from mbsvib.plots._sheet import Given, sheet

MOST_NAMES = 40


def mechanism(
    source: Mechanism | System, view: View = "3-D", names: bool = True, *, ax: Given | None = None
) -> Figure | Given:
    """Draw bodies, joints, springs, dampers and inputs.

    Bodies are blue and reach as far as what holds them; joints are circles, those at which a loop is cut red
    diamonds; springs are orange, bushings orange rings, dampers pink, inputs green arrows with their names. A legend
    explains what occurs.

    Parameters
    ----------
    source : Mechanism or System
        What to draw; a model need not be complete.
    view : str or sequence of 2 float
        From where: "3-D", "x", "y", "z", or azimuth and elevation [deg].
    names : bool
        Whether bodies and inputs are named, if they are not too many.
    ax : Axes or sequence of Axes, optional
        Where to draw, a panel each, row by row; default: a new figure.

    Returns
    -------
    matplotlib.figure.Figure, or ``ax``
        The drawing.

    Raises
    ------
    ResponseError
        If the view is none of these.
    """
    if isinstance(source, Mechanism):
        scene = _scene.of_model(source)
    else:
        system = a_system(source, "mechanism", "source")
        system.provenance.check_mechanism(system.name, "plots.mechanism")
        scene = _scene.of_system(system.name, system.provenance)
    with sheet("plots.mechanism", ax, (style.ALONE, 5.0)) as paper:
        axes = paper.panels[0]
        picture = Picture(axes, scene, view)
        triad(axes, view)
        axes.set_title(scene.name)
        legend(paper, scene)
        if names:
            _write_names(axes, scene, picture.flat(scene.points)[:, :2])
    return paper.result


def _write_names(axes: Axes, scene: DrawnScene, flat: Array) -> None:
    """Name bodies at their centres of mass, and inputs where their arrows begin, if they are not too many.

    ``flat`` (n, 2): the points of the scene in data of ``axes``.
    """
    bodies = [(mark.name, mark.point) for mark in scene.marks if mark.kind in ("body", "node")]
    starts: dict[tuple[float, ...], list[tuple[str, int]]] = {}
    for line in scene.lines:
        if line.kind == "input":
            starts.setdefault(tuple(np.round(flat[line.first] / scene.size, 3)), []).append((line.name, line.first))
    inputs = [(", ".join(name for name, _ in group), group[0][1]) for group in starts.values()]
    named = bodies + inputs if len(bodies) + len(inputs) <= MOST_NAMES else bodies
    if len(bodies) > MOST_NAMES:
        return
    curves = [flat[line.first : line.last] for line in scene.lines if line.kind != "axis"]
    figure: Any = axes.figure
    figure.draw_without_rendering()
    outer, inner = axes.get_position(original=True), axes.get_position()
    corners = figure.transFigure.transform(((outer.x0, outer.y0), (outer.x1, inner.y1)))
    corner = figure.transFigure.transform((inner.x0, inner.y0))
    blocked = np.concatenate((corner, corner + CORNER * figure.dpi / 72.0))[None]
    anchors, marks = flat[[point for _, point in named]], flat[[mark.point for mark in scene.marks]]
    colours = [style.INK] * len(bodies) + [LINES["input"][0]] * len(inputs)
    labels.write_names(axes, [name for name, _ in named], anchors, marks, curves, corners.ravel(), blocked, colours)
