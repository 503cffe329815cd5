"""The topology of a mechanism: its spanning tree with ground at the bottom, cut joints, springs."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable
from itertools import pairwise
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from mbsvib.common.arrays import Array
from mbsvib.common.expected import a_system
from mbsvib.elements.part import Part
from mbsvib.mechanism.topology import FLOATS, Topology
from mbsvib.plots import _labels as labels
from mbsvib.plots import _style as style
from mbsvib.plots._curves import System
from mbsvib.plots._sheet import Given, sheet


def positions(topology: Topology) -> list[tuple[float, int]]:
    """Return abscissa and level of each body, ground (level 0) last: leaves in a row, parents above their middle."""
    ground = len(topology.bodies)
    children: list[list[int]] = [[] for _ in range(ground + 1)]
    level = [0] * (ground + 1)
    for branch in topology.branches:
        children[branch.parent].append(branch.body)
        level[branch.body] = level[branch.parent] + 1
    abscissa = [0.0] * (ground + 1)
    next_column = 0
    stack = [ground]
    while stack:  # leaves in depth-first order
        body = stack.pop()
        stack += reversed(children[body])
        if not children[body]:
            abscissa[body] = next_column
            next_column += 1
    for body in [*(branch.body for branch in reversed(topology.branches)), ground]:
        below = [abscissa[child] for child in children[body]]
        if below:
            abscissa[body] = 0.5 * (min(below) + max(below))
    return list(zip(abscissa, level, strict=True))


def laid_out(topology: Topology, parts: Iterable[Part]) -> dict[str, Any]:
    """Return bodies and their connections: nodes [name, x, level, floats], edges [kind, name, words, first, second].

    ``parts``: what the mechanism is made of, for its springs and couplers. Returns ``nodes``, ground last, and
    ``edges`` of kind "tree", "cut", "floating", "spring" and "coupler".
    """
    points = positions(topology)
    names = (*topology.bodies, "ground")
    number = {name: i for i, name in enumerate(names)}
    cut, floating = set(topology.cut), set(topology.floating)
    nodes = [[name, x, level, i in floating] for i, (name, (x, level)) in enumerate(zip(names, points, strict=True))]
    edges = [["cut" if k in cut else "tree", joint.name, f"{joint.kind} joint", number[joint.first],
              number[joint.second]] for k, joint in enumerate(topology.joints)]  # fmt: skip
    edges += [["floating", names[branch.body], "free: no joint holds it", branch.parent, branch.body]
              for branch in topology.branches if branch.joint == FLOATS]  # fmt: skip
    elements: list[Any] = list(parts)
    generated = {name for part in elements if part.symbol == "composed" for name in part.generated_names}
    for part in elements:
        if part.symbol in ("spring", "bushing") and part.name not in generated:
            edges.append(["spring", part.name, part.family, number[part.first], number[part.second]])
        elif part.symbol == "coupler":
            coupled_bodies = list(dict.fromkeys(_moved(topology, coordinate) for coordinate, _ in part.terms))
            edges += [["coupler", part.name, part.family, number[a], number[b]] for a, b in pairwise(coupled_bodies)]
    return {"nodes": nodes, "edges": edges}


def _moved(topology: Topology, coordinate: str) -> str:
    """The outer body of a coordinate, to which a gear belongs."""
    joint = next(joint for joint in topology.joints if joint.name == coordinate.rpartition(".")[0])
    return joint.first if joint.second == "ground" else joint.second


KINDS = {
    "tree": ("joint of the tree", style.INK, 1.6, "-"), "cut": ("cut joint", style.COLOURS[1], 1.6, (0, (5, 2))),
    "spring": ("spring or damper", style.COLOURS[4], 1.0, "-"),
    "coupler": ("gear or coupler", style.COLOURS[2], 1.2, (0, (1, 1))),
    "floating": ("no joint: floats", style.MARK, 1.0, (0, (1.5, 1))),
}  # fmt: skip
MOST_NAMES = 60
HIGHEST = 9.0  # inch
CROWDED = 0.6  # inch, between levels with names above their bodies
BESIDE: dict[str, Any] = {"ha": "right", "va": "center", "fontsize": 7.5}
ABOVE: dict[str, Any] = {"ha": "center", "va": "baseline", "fontsize": 8.0}
BOX = {"fc": "white", "ec": "none", "alpha": 0.85, "pad": 0.4}


def topology(system: System, *, ax: Given | None = None) -> Figure | Given:
    """Draw bodies as a tree that grows from the ground, with joints at which loops are cut, springs and couplers.

    Parameters
    ----------
    system : System
        The equations of motion.
    ax : Axes or sequence of Axes, optional
        Where to draw, a panel each, row by row; default: a new figure.

    Returns
    -------
    matplotlib.figure.Figure, or ``ax``
        Joints of the tree black, cut joints red and dashed, springs orange, gears and other couplers green and dotted.
    """
    a_system(system, "topology").provenance.check_mechanism(system.name, "plots.topology")
    graph = laid_out(system.provenance.topology, system.provenance.parts)
    nodes, edges = graph["nodes"], graph["edges"]
    at = np.array([node[1:3] for node in nodes], dtype=float)
    width, height = np.ptp(at, axis=0)
    edges_between: Counter[tuple[int, int]] = Counter()
    size = np.clip((1.1 * width + 2.0, height + 1.6), (4.5, 3.0), (style.WIDEST, HIGHEST))
    with sheet("plots.topology", ax, size.tolist()) as paper:
        crowded = height * CROWDED > HIGHEST
        axes = paper.panels[0]
        axes.set_axis_off()
        texts, curves = [], []
        for kind, name, _, first, second in edges:
            pair = (first, second) if (*at[first][::-1], first) < (*at[second][::-1], second) else (second, first)
            nth, edges_between[pair] = edges_between[pair], edges_between[pair] + 1
            side = (1 if nth % 2 else -1) * ((nth + 1) // 2) * 0.2
            points = _bent(at[pair[0]], at[pair[1]], side)
            label, colour, thick, dash = KINDS[kind]
            axes.plot(*points.T, color=colour, linewidth=thick, linestyle=dash, label=label, zorder=2)
            if len(edges) <= MOST_NAMES and kind != "floating":
                texts.append(axes.annotate(name, points[len(points) // 2], ha="center", va="center", fontsize=7.0,
                                           bbox=BOX, zorder=3))  # fmt: skip
                curves.append(points)
        ground = len(nodes) - 1
        axes.plot(*at[:ground].T, "o", ms=8.0, color=style.COLOURS[0], mec="white", zorder=4)
        axes.plot(*at[ground], "s", ms=10.0, color=style.INK, mec="white", zorder=4)
        if len(nodes) <= MOST_NAMES:
            for i, node in enumerate(nodes):
                left_of_body = crowded and i != ground  # the next level is where a name would be
                look = BESIDE if left_of_body else ABOVE
                axes.annotate(node[0], at[i], (-7, 0) if left_of_body else (0, -13 if i == ground else 8),
                              textcoords="offset points", zorder=5, bbox=BOX, **look)  # fmt: skip
        axes.margins(0.08, 0.14)
        handles = dict(zip(*reversed(axes.get_legend_handles_labels()), strict=True))
        paper.legend([*handles.values()], columns=len(handles), below=True)
        axes.set_title(system.name)
        paper.figure.draw_without_rendering()
        marks = [text for text in axes.texts if text not in texts]
        blocked = np.array([text.get_window_extent().extents for text in marks]).reshape(-1, 4)
        labels.slide(axes, texts, curves, blocked)
    return paper.result


def _bent(start: Array, end: Array, curvature: float) -> Array:
    """A curved line from start to end."""
    s = np.linspace(0.0, 1.0, 41)[:, None]
    aside = 0.5 * (start + end) + curvature * np.array([end[1] - start[1] or 1.0, start[0] - end[0]])
    return np.asarray((1.0 - s) ** 2 * start + 2.0 * s * (1.0 - s) * aside + s**2 * end)
