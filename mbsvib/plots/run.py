"""Runs as figures and in motion."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np

from mbsvib.common import units
from mbsvib.errors import ResponseError, nearest
from mbsvib.mechanism.mechanism import GROUND
from mbsvib.plots import _style as style
from mbsvib.plots._projection import axes_of
from mbsvib.plots._scene import of_model
from mbsvib.plots._sheet import Given, sheet
from mbsvib.plots.animation import Animation

if TYPE_CHECKING:
    from collections.abc import Sequence

    from matplotlib.figure import Figure

    from mbsvib.common.arrays import Array
    from mbsvib.plots._projection import View

MOST_CURVES = 12  # in one panel that was not asked for by name
AT_REST = 1e-12  # displacement, as a share of the size, and rotation [rad] of a run that does not move: rounding
QUANTITIES = {"m": "displacement", "rad": "rotation", "m/s": "velocity", "rad/s": "angular velocity", "N": "force",
              "m/s^2": "acceleration", "rad/s^2": "angular acceleration", "N m": "moment", "1": "strain"}  # fmt: skip


@dataclass(frozen=True, eq=False)
class RunAnimation(Animation):
    """A run in motion: ``positions`` (frames, points, 3) [m] of all points."""

    positions: Array = field(repr=False, default_factory=lambda: np.zeros((1, 0, 3)))

    def points(self, phase: float) -> Array:
        """Return the positions (points, 3) [m] of all points at a share of the run, times 2 pi."""
        return np.asarray(self.positions[round(phase / (2.0 * np.pi) * self.frames) % self.frames])


def run_figure(run: Any, names: Sequence[str] | str | None, ax: Given | None = None) -> Figure | Given:
    """Return outputs or coordinates, and energies, over time.

    ``names``: what to draw; default: the outputs, or the coordinates where there are none.
    """
    known: dict[str, Any] = dict(run.coordinates) | dict(run.outputs)
    unit = {name: "rad" if name.rpartition(".")[2].startswith("r") else "m" for name in run.coordinates}
    unit |= dict(run.output_units)
    if names is None:
        kind = "outputs" if run.outputs else "coordinates"
        everything = list(run.outputs or run.coordinates)
        names_drawn = everything[:MOST_CURVES]
    else:
        names_drawn = [names] if isinstance(names, str) else list(names)
    for name in names_drawn:
        if name not in known:
            raise ResponseError(f"plot: '{name}' is neither an output nor a coordinate of the run."
                                f"{nearest(str(name), known)}")  # fmt: skip
    groups: dict[str, list[str]] = {}
    for name in names_drawn:
        groups.setdefault(unit[name], []).append(name)
    size = of_model(run.model).size
    moved = [np.ptp(values) / (1.0 if unit[name] == "rad" else size) for name, values in run.coordinates.items()]
    rest = max(moved, default=0.0) < AT_REST
    with sheet("plot", ax, (style.ALONE, 1.9 * (len(groups) + 1) + 0.5), len(groups) + 1) as paper:
        panels = paper.panels
        paper.join(panels)
        for axes, (own_unit, members) in zip(panels, groups.items(), strict=False):
            for i, name in enumerate(members):
                values = known[name]
                axes.plot(run.time, np.full_like(values, values[0]) if rest else values, label=name, **style.line(i))
            axes.set_ylabel(f"{QUANTITIES.get(own_unit, 'output')} [{units.pretty(own_unit)}]")
            axes.legend(loc="center left", bbox_to_anchor=(1.0, 0.5))
        for i, kind in enumerate(("total", "kinetic", "potential", "dissipated")):
            values = getattr(run.energy, kind)
            panels[-1].plot(run.time, np.full_like(values, values[0]) if rest else values, label=kind, **style.line(i))
        panels[-1].set(ylabel="energy [J]", xlabel="time [s]")
        panels[-1].legend(loc="center left", bbox_to_anchor=(1.0, 0.5))
        panels[-1].set_xlim(run.time[0], run.time[-1])
        panels[-1].locator_params(axis="x", nbins=6)
        paper.name([run.name])
        if names is None:
            paper.left_out(len(names_drawn), len(everything), kind, "name others by run.plot([...])")
    return paper.result


def run_animation(run: Any, view: View, frames: int, rate: float) -> RunAnimation:
    """Return a run in motion, true to scale, with ``rate`` frames a second [Hz]."""
    for name, value, least in (("frames", frames, 2), ("rate", rate, 0.1)):
        if not least <= value < np.inf:
            raise ResponseError(f"{name} = {value!r}: expected a number of at least {least:g}.")
    axes_of(view)
    scene = of_model(run.model)
    times = np.linspace(run.time[0], run.time[-1], int(frames))
    samples = np.array([int(np.argmin(np.abs(run.time - time))) for time in times])
    pose_of = run.frames()
    ground = (np.tile(np.eye(3), (len(run.time), 1, 1)), np.zeros((len(run.time), 3)))
    moves = [pose_of.get(body, ground) for body in (*scene.bodies, GROUND)]
    # the coils of springs keep their offset from the line between their ends
    positions = np.tile(scene.points, (len(samples), 1, 1))
    for share, body, at in ((1.0 - scene.share, scene.first, scene.start), (scene.share, scene.second, scene.end)):
        for number in np.unique(body):
            which = body == number
            rotation, shift = (array[samples] for array in moves[number])
            turned = np.einsum("fij,pj->fpi", rotation, at[which]) + shift[:, None]
            positions[:, which] += share[which][:, None] * (turned - at[which])
    went = positions - scene.points
    farthest = went[np.argmax(np.linalg.norm(went, axis=2), axis=0), np.arange(len(scene.points))]
    title = f"{run.time[0]:g} to {run.time[-1]:g} s"
    return RunAnimation(scene, farthest, title, view, len(samples), float(rate), positions)
