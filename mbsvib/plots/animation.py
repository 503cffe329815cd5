"""Modes and runs in motion, as figures, GIF, MP4 (by ffmpeg on the path or of imageio-ffmpeg) or pages; runs drawn."""

from __future__ import annotations

import os
from base64 import b64encode
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from io import BytesIO
from pathlib import Path
from shutil import which
from subprocess import CalledProcessError
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
from matplotlib import rc_context, rcParams
from matplotlib.figure import Figure
from numpy.typing import NDArray

from mbsvib.common import arguments as check
from mbsvib.common import expected, units
from mbsvib.common.arrays import Array
from mbsvib.common.atomic_file import write_atomic
from mbsvib.common.display import Displayed
from mbsvib.equations.equations import Provenance
from mbsvib.errors import ExportError, ResponseError
from mbsvib.mechanism.mechanism import GROUND
from mbsvib.modes import Modes
from mbsvib.modes.pairs import damping_ratios
from mbsvib.plots import _style as style
from mbsvib.plots._projection import Picture, View, axes_of, triad
from mbsvib.plots._scene import DrawnScene, of_model, of_system
from mbsvib.plots._sheet import Given, sheet

SUFFIXES = (".gif", ".mp4", ".html")
COLOURS = 96  # of a GIF
DPI = 100


@dataclass(frozen=True, eq=False, repr=False)
class Animation(Displayed):
    """One period of a mode: ``frames`` pictures of a mechanism, ``rate`` of them in a second.

    Points move by Re(shape e^(i phase)); ``shape`` (points, 3) is scaled such that the farthest one goes by its share
    of the mechanism's size. In Jupyter it shows itself.
    """

    _engine = "scene"

    scene: DrawnScene = field(repr=False)
    shape: NDArray[Any] = field(repr=False)
    title: str
    """Title above the picture."""
    view: View = "3-D"
    frames: int = 30
    rate: float = 20.0

    def points(self, phase: float) -> NDArray[np.float64]:
        """Return the positions (points, 3) [m] of all points at a phase [rad] of the motion."""
        return np.asarray(self.scene.points + (self.shape * np.exp(1j * phase)).real)

    def figure(self, phase: float = 0.0, *, ax: Given | None = None) -> Figure | Given:
        """Return the picture at a phase.

        Parameters
        ----------
        phase : float
            Phase of the motion [rad]: 0 is farthest out for real shapes.
        ax : Axes or sequence of Axes, optional
            Where to draw, a panel each, row by row; default: a new figure.

        Returns
        -------
        matplotlib.figure.Figure, or ``ax``
            The mechanism, its pose at rest in grey.
        """
        canvas: tuple[Figure | Given, Picture] = self._canvas(ax)
        canvas[1].set_points(self.points(phase))
        return canvas[0]

    def _canvas(self, ax: Any = None) -> tuple[Any, Picture]:
        with sheet("figure", ax, (5.6, 4.4)) as paper:
            axes = paper.panels[0]
            if paper.own:
                paper.figure.set_dpi(DPI)
            reach = float(np.linalg.norm(self.shape, axis=1).max(initial=0.0))
            picture = Picture(axes, self.scene, self.view, rest=True, reach=reach)
            triad(axes, self.view)
            axes.set_title(self.title)
        return paper.result, picture

    def _pictures(self) -> Iterator[Any]:
        """The frames, as images of pillow."""
        from matplotlib.backends.backend_agg import FigureCanvasAgg
        from PIL import Image

        figure, picture = self._canvas()
        canvas: Any = FigureCanvasAgg(figure)
        for phase in self._phases():
            picture.set_points(self.points(phase))
            canvas.draw()
            figure.set_layout_engine("none")  # all frames have the layout of the first
            yield Image.fromarray(np.asarray(canvas.buffer_rgba()).copy()).convert("RGB")

    def _phases(self) -> list[float]:
        return [2.0 * np.pi * i / self.frames for i in range(self.frames)]

    def save(self, path: str | os.PathLike[str]) -> Path:
        """Write the motion to a file, whole or not at all.

        Parameters
        ----------
        path : str or path-like
            A name that ends in .gif, .mp4 (which needs ffmpeg, on the path or by ``pip install "mbsvib[video]"``) or
            .html (a page with a player, without network).

        Returns
        -------
        Path
            The path.

        Raises
        ------
        ExportError
            If the suffix is none of these, ffmpeg is not installed, or the file cannot be written.
        """
        kind = Path(path).suffix.lower()
        if kind not in SUFFIXES:
            raise ExportError(f"{path}: motions are written to files that end in {', '.join(SUFFIXES)}.")
        content = {".gif": self._gif, ".mp4": self._mp4, ".html": self._html}[kind]()
        return write_atomic(path, lambda stream: stream.write(content))

    def _gif(self) -> bytes:
        first, *others = [picture.quantize(COLOURS) for picture in self._pictures()]
        stream = BytesIO()
        first.save(stream, format="GIF", save_all=True, append_images=others, loop=0, duration=1000.0 / self.rate)
        return stream.getvalue()

    def _mp4(self) -> bytes:
        path = program()
        with style.context(), rc_context({"animation.ffmpeg_path": path}):
            try:
                return self._by_matplotlib("ffmpeg", "motion.mp4", fps=self.rate)
            except (OSError, CalledProcessError) as error:
                raise ExportError(f"{path}: this program wrote no MP4: {error}. See whether it works, or write a .gif "
                                  f"or .html.") from error  # fmt: skip

    def _html(self) -> bytes:
        return self._by_matplotlib("html", "motion.html", fps=self.rate, embed_frames=True)

    def _by_matplotlib(self, writer: str, name: str, **options: Any) -> bytes:
        from matplotlib.animation import writers
        from matplotlib.backends.backend_agg import FigureCanvasAgg

        figure, picture = self._canvas()
        FigureCanvasAgg(figure)
        movie_writer = writers[writer](**options)
        with TemporaryDirectory() as folder:
            target = Path(folder) / name
            with movie_writer.saving(figure, str(target), DPI):
                for phase in self._phases():
                    picture.set_points(self.points(phase))
                    movie_writer.grab_frame()
            return target.read_bytes()

    def _repr_html_(self) -> str:
        code = b64encode(self._gif()).decode("ascii")
        return f'<img alt="Mode in motion" src="data:image/gif;base64,{code}">'


def animation(
    modes: Modes, provenance: Provenance | None, mode: int, amplitude: float, view: View, frames: int, rate: float
) -> Animation:
    """Return a mode in motion.

    ``amplitude``: displacement of the farthest point, as a share of the mechanism's size. ``rate``: frames a second
    [Hz].
    """
    if provenance is None:
        raise ResponseError(f"modes of '{modes.name}': nothing is known of what it looks like, as it is sparse or a "
                            f"variant of a batch; linearize that one model by itself, method='dense'.")  # fmt: skip
    modes.check_any("animate")
    index = expected.mode_index(mode, "animate", len(modes))
    hertz, ratio = modes.frequencies[index], damping_ratios(modes.pairs, modes.pair_errors)[index]
    words = f"{hertz:.5g} Hz, damping {100.0 * ratio:.3g} %" if hertz > 0.0 else "rigid-body mode"
    return in_motion(modes.name, provenance, modes.body_motion @ modes.shapes[:, index], f"Mode {mode}: {words}",
                     amplitude, view, frames, rate)  # fmt: skip


def in_motion(
    name: str, provenance: Provenance, bodies: NDArray[Any], title: str, amplitude: float, view: View, frames: int,
    rate: float,
) -> Animation:  # fmt: skip
    """Return a motion of the ``bodies`` (bodies, 6), scaled so that the farthest point goes by ``amplitude``."""
    for label, value, least in (("frames", frames, 2), ("rate", rate, 0.1), ("amplitude", amplitude, 0.0)):
        if not least <= value < np.inf:
            raise ResponseError(f"{label} = {value!r}: expected a number of at least {least:g}.")
    axes_of(view)
    scene = of_system(name, provenance)
    moves = scene.displacements(bodies)
    farthest = np.linalg.norm(moves, axis=1).max(initial=0.0)
    shape = amplitude * scene.size / farthest * moves if farthest > 0.0 else moves
    return Animation(scene, shape, title, view, int(frames), float(rate))


def program() -> str:
    """Return the path of ffmpeg: of matplotlib's setting and the path first, then that of imageio-ffmpeg."""
    path = which(rcParams["animation.ffmpeg_path"])
    if path is None:
        try:
            from imageio_ffmpeg import get_ffmpeg_exe

            path = get_ffmpeg_exe()
        except (ImportError, RuntimeError) as error:  # RuntimeError: the package brings no program for this machine
            raise ExportError('MP4 needs the program ffmpeg, which is not found; install it with:  pip install '
                              '"mbsvib[video]"  or write a .gif or .html.') from error  # fmt: skip
    return str(path)


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
        names_drawn = expected.names(names, "plot", "names")
    for name in names_drawn:
        check.known(name, known, f"plot: '{name}' is neither an output nor a coordinate of the run", told="",
                    error=ResponseError)  # fmt: skip
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
