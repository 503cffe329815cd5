"""The mechanism itself: bodies, joints, springs and inputs, as they are at the pose."""

from __future__ import annotations

from typing import TYPE_CHECKING

from mbsvib.common.expected import a_system
from mbsvib.plots import _scene
from mbsvib.plots import _style as style
from mbsvib.plots._projection import Picture, triad

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from mbsvib.mechanism.mechanism import Mechanism
    from mbsvib.plots._projection import View
    from mbsvib.plots._system import System

MOST_NAMES = 40


def mechanism(source: Mechanism | System, view: View = "3-D", names: bool = True) -> Figure:
    """Draw bodies, joints, springs, dampers and inputs.

    Bodies are blue and reach as far as what holds them; joints are circles, those at which a loop is cut red
    diamonds; springs are orange, dampers violet, inputs green.

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
        bodies = [mark for mark in scene.marks if mark.kind in ("body", "node")]
        if names and len(bodies) <= MOST_NAMES:
            flat = picture.flat(scene.points)
            for mark in bodies:
                x, y, _ = flat[mark.point]
                axes.annotate(mark.name, (x, y), (5, 4), textcoords="offset points", fontsize=8, zorder=5,
                              bbox={"fc": "white", "ec": "none", "alpha": 0.7, "pad": 0.5})  # fmt: skip
        axes.set_title(scene.name)
    return figure
