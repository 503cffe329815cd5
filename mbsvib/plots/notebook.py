"""What models, systems and tables look like in a notebook: HTML of their own, escaped, without scripts."""

from __future__ import annotations

from base64 import b64encode
from html import escape
from io import BytesIO
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

    from matplotlib.figure import Figure

    from mbsvib.mechanism.mechanism import Mechanism
    from mbsvib.plots._system import System

MOST_BODIES = 200  # in a picture
MOST_NAMES = 12
LEFT, RIGHT = "text-align:left", "text-align:right;font-variant-numeric:tabular-nums"


def table(
    title: str, columns: Sequence[tuple[str, str]], rows: Iterable[Sequence[object]], notes: Sequence[str] = ()
) -> str:
    """Return a table as HTML; arguments as those of ``mbsvib.common.tables.text``.

    Parameters
    ----------
    title : str
        A line above the table; empty for none.
    columns : sequence of (str, str)
        Header of each column, and ``left`` or ``right``.
    rows : iterable of sequences
        One entry a column.
    notes : sequence of str
        Lines below the table.

    Returns
    -------
    str
        HTML.
    """
    looks = [RIGHT if side == "right" else LEFT for _, side in columns]
    head = "".join(f'<th style="{look}">{escape(name)}</th>' for (name, _), look in zip(columns, looks, strict=True))
    body = "".join(
        "<tr>" + "".join(f'<td style="{look}">{escape(str(cell))}</td>' for cell, look in zip(row, looks, strict=True))
        + "</tr>" for row in rows
    )  # fmt: skip
    words = "".join(f"<div>{escape(note)}</div>" for note in notes)
    above = f"<b>{escape(title)}</b>" if title else ""
    return f"<div>{above}<table><thead><tr>{head}</tr></thead><tbody>{body}</tbody></table>{words}</div>"


def of_model(model: Mechanism) -> str:
    """Return a picture of a model and what it consists of.

    Parameters
    ----------
    model : Mechanism
        The model.

    Returns
    -------
    str
        HTML.
    """
    groups = [("bodies", model.bodies), ("joints", model.joints), ("springs", model.springs),
              ("inputs", model.inputs), ("outputs", model.outputs)]  # fmt: skip
    rows = [(what, len(found), _few([*found])) for what, found in groups if found]
    text = table(model.name, (("", "left"), ("count", "right"), ("names", "left")), rows)
    return _with_picture(model, len(model.bodies), text)


def of_system(system: System) -> str:
    """Return a picture of a system, its coordinates, inputs and outputs.

    Parameters
    ----------
    system : System
        The equations of motion.

    Returns
    -------
    str
        HTML.
    """
    groups = [("coordinates", _named(system.coordinates, system.coordinate_units)),
              ("inputs", _named(system.inputs, system.input_units)),
              ("outputs", _named(system.outputs, system.output_units)), ("cut joints", list(system.cut_joints)),
              ("redundant constraints", list(system.redundant))]  # fmt: skip
    rows = [(what, len(names), _few(names)) for what, names in groups if names]
    text = table(f"{system.name}: {system.dof} DOF", (("", "left"), ("count", "right"), ("names", "left")), rows)
    return _with_picture(system, len(system.bodies), text)


def _named(names: Sequence[str], units: Sequence[str]) -> list[str]:
    return [f"{name} [{unit}]" for name, unit in zip(names, units, strict=True)]


def _few(names: Sequence[str]) -> str:
    return ", ".join(names[:MOST_NAMES]) + (", …" if len(names) > MOST_NAMES else "")


def _with_picture(source: Mechanism | System, bodies: int, text: str) -> str:
    if not 0 < bodies <= MOST_BODIES:
        return text
    from mbsvib.plots.mechanism import mechanism

    picture = image(mechanism(source))
    return f'<div style="display:flex;flex-wrap:wrap;gap:16px;align-items:center">{picture}{text}</div>'


def image(figure: Figure) -> str:
    """Return a figure as an image inside of HTML.

    Parameters
    ----------
    figure : matplotlib.figure.Figure
        The figure.

    Returns
    -------
    str
        HTML.
    """
    stream = BytesIO()
    figure.savefig(stream, format="png", dpi=80)
    return f'<img alt="The mechanism" src="data:image/png;base64,{b64encode(stream.getvalue()).decode("ascii")}">'
