"""The legend of a drawing of a mechanism: only symbols that occur."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from mbsvib.plots._projection import LINES, MARKS

if TYPE_CHECKING:
    from matplotlib.lines import Line2D

    from mbsvib.plots._scene import DrawnScene
    from mbsvib.plots._sheet import Sheet

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
    from matplotlib.lines import Line2D

    colour, width = LINES.get(kind, ("none", 0.0))
    sign, size, fill, edge, edge_width = MARKS.get(kind, ("None", 0.0, "none", "none", 0.0))
    if kind == "input":
        sign, size, fill, edge = ">", 5.0, colour, colour
    if kind == "ground":
        sign, size, fill, edge, edge_width = "^", 6.0, "none", colour, 0.8
    drawn, marked = drawn and kind != "ground", marked or kind in ("ground", "input")
    return Line2D([], [], color=colour if drawn else "none", linewidth=width, marker=sign if marked else "None",
                  markersize=size, mfc=fill, mec=edge, mew=edge_width, label=words)  # fmt: skip
