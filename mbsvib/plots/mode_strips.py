"""Shapes of modes as strips: one for each mode, with the displacements of the bodies over their names."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple, cast

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import PolyCollection
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from mbsvib.common.arguments import DIRECTIONS
from mbsvib.common.arrays import Complex, Index
from mbsvib.common.expected import a_system, kind_of, mode_index, positive
from mbsvib.common.selection import Names, selected
from mbsvib.errors import ResponseError
from mbsvib.modes.pairs import damping_ratios
from mbsvib.modes.result import Modes
from mbsvib.plots import _style as style
from mbsvib.plots._curves import System
from mbsvib.plots._sheet import Given, Sheet, sheet

MOST_STRIPS = 12  # of a page
MOST_BARS = 20  # bodies; more of them are drawn as lines
MOST_NAMES = 40
STILL = 1e-9  # share of the largest displacement of a strip below which a body is at rest
QUADRATURE = 0.02  # share of a shape in quadrature from which it is drawn
STRIP, HEAD, FOOT = 0.72, 0.6, 1.0  # heights [inch] of a strip, and of what is above and below all
LONG = 34  # letters of all names in a row from which they are turned


class Shapes(NamedTuple):
    """Displacements (places, directions, modes) of bodies in some directions, or of coordinates in one."""

    places: tuple[str, ...]
    directions: tuple[str, ...]
    values: Complex
    radius: float | None


def mode_strips(
    source: System | Modes, modes: int | Sequence[int] | None = None, *, bodies: Names = None,
    radius: float | None = None, page: int = 1, ax: Given | None = None,
) -> Figure | Given:  # fmt: skip
    """Draw each mode as a strip: the displacements of the bodies, with natural frequency and damping ratio above.

    Parameters
    ----------
    source : System or Modes
        The equations of motion, or some of their modes.
    modes : int or sequence of int, optional
        Numbers of modes, from 1 as ``print(system.modes())`` lists them; default: all, twelve on a page.
    bodies : str or sequence of str, optional
        Names or patterns; default: all. A system without bodies has its coordinates in their place.
    radius : float, optional
        Length [m] that multiplies rotations; default: the radius of gyration of what moves, as the legend states.
    page : int
        Number of the page, from 1.
    ax : Axes or sequence of Axes, optional
        Where to draw, a panel each, row by row; default: a new figure.

    Returns
    -------
    matplotlib.figure.Figure, or ``ax``
        Translations of centres of mass along world axes and rotations times ``radius``, the largest of each mode being
        1; bars, or lines for more than twenty bodies. Complex shapes are turned so that they are most nearly real;
        short dashes are what is in quadrature.

    Raises
    ------
    ResponseError
        If there is no such mode, body or page, or the radius is not positive.
    """
    result = _modes(source)
    result.check_any("draw")
    numbers = range(1, len(result) + 1) if modes is None else np.atleast_1d(np.asarray(modes)).tolist()
    index = [mode_index(number, "plots.mode_strips", len(result)) for number in numbers]
    pages = -(-len(index) // MOST_STRIPS)
    if isinstance(page, bool) or not isinstance(page, (int, np.integer)) or not 1 <= page <= pages:
        raise ResponseError(f"plots.mode_strips: page = {page!r}; {len(index)} modes take pages 1 to {pages}.")
    shown = np.array(index[MOST_STRIPS * (page - 1) : MOST_STRIPS * page], dtype=np.intp)
    shapes = shapes_of(result, shown, bodies, radius)
    wide = len(shapes.places) * len(shapes.directions) > 24
    size = style.WIDEST if wide else style.ALONE, HEAD + FOOT + STRIP * len(shown)
    with sheet("plots.mode_strips", ax, size, len(shown)) as paper:
        strips = paper.panels
        paper.join(strips)
        for k, axes in enumerate(strips):
            _strip(axes, shapes, k)
            axes.set_title(_words(result, int(shown[k])), fontsize=8.5, pad=2.0)
        _name_places(strips[-1], shapes.places)
        _legend(paper, shapes)
        part = f", page {page} of {pages}" if pages > 1 else ""
        paper.head(f"Mode shapes of {result.name}{part}")
        if paper.own:
            paper.figure.supylabel("displacement / largest [1]", fontsize=9.5)
    return paper.result


def shapes_of(modes: Modes, which: Index, bodies: Names, radius: float | None) -> Shapes:
    """Return what is drawn of some modes, the largest displacement of each being 1.

    ``which`` (n,): numbers from 0. ``bodies``: names or patterns. ``radius``: length [m] that multiplies rotations.
    Complex shapes are turned in phase with the motion as a whole; directions in which nothing moves are left out.
    """
    if radius is not None:
        positive("plots.mode_strips", "radius", radius, "a length [m]")
    if not modes.bodies:
        values = np.asarray(modes.shapes[:, which], dtype=complex)[:, None, :]
        return Shapes(modes.coordinates, ("coordinate",), _turned(values), None)
    body = selected(bodies, modes.bodies, "body", modes.name)
    values = np.array([modes.body_shapes[modes.bodies[i]][:, which] for i in body], dtype=complex)
    turns = bool(np.abs(values[:, 3:]).max(initial=0.0) > 0.0)
    length = (gyration(modes) if radius is None else float(radius)) if turns else 1.0
    values[:, 3:] *= length
    values = _turned(values)
    moving = np.abs(values).max(axis=(0, 2)) > STILL
    names = tuple(name for name, moves in zip(DIRECTIONS, moving, strict=True) if moves)
    return Shapes(tuple(modes.bodies[i] for i in body), names, values[:, moving], length if turns else None)


def gyration(modes: Modes) -> float:
    """Return sqrt(sum of inertias / sum of masses) [m] of the bodies, from their motions and kinetic energies; 1 where
    no body moves with mass, or none turns with inertia.
    """
    rows, count = np.abs(modes.inertia_factor @ modes.shapes) ** 2, len(modes.bodies)
    energy = rows[: 6 * count].reshape(count, 6, -1)
    motion = np.abs(np.array([*modes.body_shapes.values()])) ** 2
    inertia, mass = (np.divide(speed, moved, out=np.zeros(count), where=moved > 0.0).sum() for speed, moved in (
        (energy[:, part].sum(axis=(1, 2)), motion[:, part].sum(axis=(1, 2))) for part in (slice(3, 6), slice(3))))
    return float(np.sqrt(inertia / mass)) if inertia > 0.0 and mass > 0.0 else 1.0


def _modes(source: Any) -> Modes:
    """Return modes as they are, or those of a system."""
    if kind_of(source) is None and all(hasattr(source, field) for field in ("shapes", "inertia_factor", "natural")):
        return cast("Modes", source)
    result: Modes = a_system(source, "plots.mode_strips").modes()
    return result


def _turned(values: Complex) -> Complex:
    """Return shapes (places, directions, modes) in the phase in which they are most nearly real, the largest 1."""
    flat = values.reshape(-1, values.shape[2])
    turn = np.exp(-0.5j * np.angle((flat**2).sum(axis=0)))
    flat = flat * turn
    largest = flat[np.abs(flat).argmax(axis=0), np.arange(flat.shape[1])]
    size = np.abs(largest) * np.where(largest.real < 0.0, -1.0, 1.0)
    flat = np.divide(flat, size, out=np.zeros_like(flat), where=size != 0.0)
    return np.asarray(flat.reshape(values.shape))


def _strip(axes: Axes, shapes: Shapes, k: int) -> None:
    """Draw one mode."""
    values = shapes.values[:, :, k]
    position, count = np.arange(len(shapes.places)), len(shapes.directions)
    complex_shape = bool(np.abs(values.imag).max(initial=0.0) > QUADRATURE)
    axes.axhline(0.0, color=style.MARK, linewidth=0.7)
    dashes = []
    for j, name in enumerate(shapes.directions):
        colour = _colour(name)
        if len(position) > MOST_BARS:
            axes.plot(position, values[:, j].real, color=colour, linewidth=1.1)
            if complex_shape:
                axes.plot(position, values[:, j].imag, color=colour, linewidth=0.8, linestyle=(0, (2, 2)))
            continue
        width = 0.84 / count
        at = position + (j - 0.5 * (count - 1)) * width
        sides = at[:, None] + 0.45 * width * np.array([-1.0, -1.0, 1.0, 1.0])
        heights = values[:, j].real[:, None] * np.array([0.0, 1.0, 1.0, 0.0])
        axes.add_collection(PolyCollection(list(np.stack((sides, heights), axis=2)), facecolors=colour))
        if complex_shape:
            dashes.append((at, values[:, j].imag, 0.5 * width))
    if dashes:
        at, heights, half = (np.concatenate([np.broadcast_to(row[i], len(position)) for row in dashes])
                             for i in range(3))  # fmt: skip
        visible = np.abs(heights) > QUADRATURE
        axes.hlines(heights[visible], (at - half)[visible], (at + half)[visible], color=style.INK, linewidth=1.0)
    if len(position) <= MOST_BARS:
        axes.vlines(position[:-1] + 0.5, -2.0, 2.0, color=style.FAINT, linewidth=0.8, zorder=0)
    axes.set(xlim=(-0.55, len(position) - 0.45), ylim=(-1.12, 1.12))
    axes.set_yticks([-1.0, 0.0, 1.0])
    axes.grid(False, axis="x")
    axes.tick_params(axis="x", length=0.0)
    axes.spines["bottom"].set_visible(False)


def _words(modes: Modes, i: int) -> str:
    """Return number, natural frequency and damping ratio of a mode."""
    if i < modes.rigid:
        return f"mode {i + 1}: rigid-body mode"
    ratio = damping_ratios(modes.pairs, modes.pair_errors)[i]
    return f"mode {i + 1}: {modes.frequencies[i]:.4g} Hz, damping ratio {100.0 * ratio:.3g} %"


def _name_places(axes: Axes, names: Sequence[str]) -> None:
    """Write the names below the last strip, upright where they are long, and not more than there is room for."""
    every = -(-len(names) // MOST_NAMES)
    shown = names[::every]
    turned = sum(map(len, shown)) > LONG
    axes.set_xticks(range(0, len(names), every), shown, rotation=90 if turned else 0, fontsize=8.0)


def _legend(paper: Sheet[Any], shapes: Shapes) -> None:
    """Explain the colours of directions."""
    if shapes.radius is None and len(shapes.directions) == 1:
        return
    handles: list[Patch | Line2D] = [Patch(color=_colour(name), label=name) for name in shapes.directions]
    if shapes.radius is not None:
        handles.append(Patch(alpha=0.0, label=f"rotations × {shapes.radius:.3g} m"))
    if np.abs(shapes.values.imag).max(initial=0.0) > QUADRATURE:
        handles.append(Line2D([], [], color=style.INK, linewidth=1.0, label="in quadrature"))
    paper.legend(handles, columns=len(handles), handlelength=1.0, columnspacing=1.0, handletextpad=0.4)


def _colour(direction: str) -> str:
    return style.COLOURS[DIRECTIONS.index(direction) if direction in DIRECTIONS else 0]
