"""The mechanism itself: bodies, joints, springs and inputs, as they are at the pose."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from mbsvib.common.expected import a_system
from mbsvib.plots import _labels as labels
from mbsvib.plots import _scene
from mbsvib.plots import _style as style
from mbsvib.plots import _symbols as symbols
from mbsvib.plots._projection import CORNER, Picture, triad

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from mbsvib.mechanism.mechanism import Mechanism
    from mbsvib.plots._projection import View
    from mbsvib.plots._system import System

MOST_NAMES = 40


def mechanism(source: Mechanism | System, view: View = "3-D", names: bool = True) -> Figure:
    """Draw bodies, joints, springs, dampers and inputs.

    Bodies are blue and reach as far as what holds them; joints are circles, those at which a loop is cut red
    diamonds; springs are orange, bushings orange rings, dampers violet, inputs green. A legend explains what occurs.

    Parameters
    ----------
    source : Mechanism or System
        What to draw; a model need not be complete.
    view : str or sequence of 2 float
        From where: "3-D", "x", "y", "z", or azimuth and elevation [deg].
    names : bool
        Whether bodies are named, if they are not too many.

    Returns
    -------
    matplotlib.figure.Figure
        The drawing.

    Raises
    ------
    ResponseError
        If the view is none of these.
    """
    from mbsvib.mechanism.mechanism import Mechanism

    if isinstance(source, Mechanism):
        scene = _scene.of_model(source)
    else:
        system = a_system(source, "mechanism", "source")
        system.provenance.check_mechanism(system.name, "plots.mechanism")
        scene = _scene.of_system(system.name, system.provenance)
    with style.context():
        figure = style.new_figure(6.4, 5.0)
        axes = figure.subplots()
        picture = Picture(axes, scene, view)
        triad(axes, view)
        axes.set_title(scene.name)
        symbols.legend(figure, scene)
        bodies = [mark for mark in scene.marks if mark.kind in ("body", "node")]
        if names and len(bodies) <= MOST_NAMES:
            flat = picture.flat(scene.points)[:, :2]
            curves = [flat[line.first : line.last] for line in scene.lines if line.kind != "axis"]
            figure.draw_without_rendering()
            outer, inner = axes.get_position(original=True), axes.get_position()
            corners = figure.transFigure.transform(((outer.x0, outer.y0), (outer.x1, inner.y1)))
            corner = figure.transFigure.transform((inner.x0, inner.y0))
            blocked = np.concatenate((corner, corner + CORNER * figure.dpi / 72.0))[None]
            anchors, marks = (flat[[mark.point for mark in group]] for group in (bodies, scene.marks))
            labels.write_names(axes, [mark.name for mark in bodies], anchors, marks, curves, corners.ravel(), blocked)
    return figure
