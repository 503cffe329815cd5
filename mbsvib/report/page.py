"""The page: its frame, the JavaScript library and the data in one text."""

from __future__ import annotations

import json
import os
from base64 import b64encode
from gzip import compress
from html import escape
from importlib.resources import files
from io import BytesIO
from pathlib import Path
from typing import Any, TypeAlias

from mbsvib.api.driven import DrivenSystem
from mbsvib.api.model import Model
from mbsvib.api.system import System
from mbsvib.common.atomic_file import write_atomic
from mbsvib.common.expected import a_model, kind_of
from mbsvib.common.selection import Names
from mbsvib.errors import ExportError, ModelError
from mbsvib.feedback.closed_loop import ClosedLoop
from mbsvib.feedback.controller import Controller
from mbsvib.measurement.data import Measurement
from mbsvib.measurement.modes import MeasuredModes
from mbsvib.random.budget import Budget
from mbsvib.report.data import LABELS, MEASURED_LABELS, collect
from mbsvib.responses.from_control import is_control, is_transfer_function
from mbsvib.responses.state_space import StateSpace

Source: TypeAlias = Model | System | StateSpace | ClosedLoop | Controller

SCRIPTS = ("page", "motion", "compass", "curves", "responses", "panels", "keys")
FIGURES = 6  # of the first outputs of an error budget
# Characters that could end a script element, open a comment in it, or end a line of JavaScript.
_UNSAFE = {"<": "\\u003c", ">": "\\u003e", "&": "\\u0026", "\u2028": "\\u2028", "\u2029": "\\u2029"}


def html(
    source: Source, outputs: Names = None, inputs: Names = None, *,
    compare: Source | Measurement | MeasuredModes | None = None, names: tuple[str, str] | None = None,
    budget: Budget | None = None,
) -> str:  # fmt: skip
    """Return the report of a mechanism as one page of HTML that needs no network.

    Parameters
    ----------
    source, outputs, inputs, compare, names, budget : as of ``write``
        What is reported on, and what the page shows.

    Returns
    -------
    str
        The page.

    Raises
    ------
    ExportError
        If plotly is not installed.
    ModelError
        If the equations are sparse: there are too many bodies to look at.
    ResponseError
        If a name is unknown, or nothing was measured at an output.
    """
    script = _plotly()
    if budget is not None and not callable(getattr(budget, "cumulative", None)):
        raise ModelError(f"report: budget = {budget!r}; expected an error budget, such as system.budget(noise).")
    is_measured = isinstance(compare, (Measurement, MeasuredModes))
    labels = (MEASURED_LABELS if is_measured else LABELS) if names is None else tuple(names)
    if isinstance(names, str) or len(labels) != 2 or not all(isinstance(label, str) for label in labels):
        raise ModelError(f"report: names = {names!r}; expected two names, such as ('before', 'after').")
    system = _linear(source, "source")
    other = compare if compare is None or is_measured else _linear(compare, "compare")
    data = collect(system, outputs, inputs, other, (labels[0], labels[1]))
    pieces = {
        "TITLE": escape(system.name),
        "STYLE": _read("page.css"),
        "BUDGET_LINK": "" if budget is None else '<a href="#budget">Error budget</a>',
        "BUDGET": "" if budget is None else _budget_section(budget),
        "PLOTLY": b64encode(compress(script.encode("utf-8"), 9, mtime=0)).decode("ascii"),
        "DATA": embedded(data),
        "SCRIPT": "\n".join(_read(f"{name}.js") for name in SCRIPTS),
    }
    return "".join([pieces.get(piece, piece) for piece in _read("page.html").split("@@")])


def write(
    source: Source, path: str | os.PathLike[str], outputs: Names = None, inputs: Names = None, *,
    compare: Source | Measurement | MeasuredModes | None = None, names: tuple[str, str] | None = None,
    budget: Budget | None = None,
) -> Path:  # fmt: skip
    """Write the report of a mechanism to a file, whole or not at all.

    Parameters
    ----------
    source : Model, System, StateSpace, ClosedLoop, Controller, control.StateSpace or control.TransferFunction
        What to report on; what has no bodies has no picture of them.
    path : str or path-like
        Where the page goes.
    outputs, inputs : str or sequence of str, optional
        Names of those whose responses are shown; default: all.
    compare : Model, System, StateSpace, ClosedLoop, Controller, Measurement or MeasuredModes, optional
        Another design, or what was measured: its modes in pairs with those of ``source``, its curves over these, and
        the differences of ``mv.compare``.
    names : (str, str), optional
        What the page calls ``source`` and ``compare``; default: before and after, or model and measurement.
    budget : Budget, optional
        An error budget that the page shows, as of ``source.budget(noise)``: its table, and densities of six outputs.

    Returns
    -------
    Path
        The path.

    Raises
    ------
    ExportError
        If plotly is not installed, or the file cannot be written.
    ModelError, ResponseError
        As of ``html``.
    """
    text = html(source, outputs, inputs, compare=compare, names=names, budget=budget).encode("utf-8")
    return write_atomic(path, lambda stream: stream.write(text))


def embedded(data: Any) -> str:
    """Return data as JSON that is safe inside a script element for any names."""
    text = json.dumps(data, allow_nan=False, separators=(",", ":"))
    for sign, code in _UNSAFE.items():
        text = text.replace(sign, code)
    return text


def _budget_section(budget: Budget) -> str:
    """The section of an error budget as HTML."""
    table: dict[str, Any] = budget.table()
    words = ["words" if side == "left" else "" for _, side in table["columns"]]
    head = "".join(f'<th class="{kind}">{escape(name)}</th>' for (name, _), kind in
                   zip(table["columns"], words, strict=True))  # fmt: skip
    rows = "".join("<tr>" + "".join(f'<td class="{kind}">{escape(str(cell))}</td>' for cell, kind in
                                    zip(row, words, strict=True)) + "</tr>" for row in table["rows"])  # fmt: skip
    figures = "".join(_figure(budget, name) for name in budget.outputs[:FIGURES])
    notes = escape(" ".join(table["notes"]))
    return (f'<section id="budget"><div class="head"><h2>Error budget</h2><p class="remarks">{notes}</p></div>'
            '<div class="card wide"><div class="table" role="region" tabindex="0" aria-label="Contributions">'
            f"<table><thead><tr>{head}</tr></thead><tbody>{rows}</tbody></table></div></div>{figures}</section>")


def _figure(budget: Budget, output: str) -> str:
    stream = BytesIO()
    budget.plot(output).savefig(stream, format="png", bbox_inches="tight")
    words = escape(f"Density and cumulative root mean square of {output}", quote=True)
    code = b64encode(stream.getvalue()).decode("ascii")
    image = f'<img style="max-width:100%" src="data:image/png;base64,{code}" alt="{words}">'
    return f'<div class="card" style="margin-top:16px">{image}</div>'


def _linear(source: Any, field: str) -> Any:
    """A model's system, a loop of second order as its system, an unstable loop as its states, all else as it is."""
    if is_control(source) or is_transfer_function(source):
        return StateSpace.from_control(source)
    if kind_of(source) == "controller":
        return source.state_space()
    if kind_of(source) not in ("system", "closed loop", "state space"):
        return _linearized(a_model(source, "report", field))
    if isinstance(source, DrivenSystem):
        return source.ends
    closed = getattr(source, "second_order", None)
    if closed is None and kind_of(source) == "closed loop" and source.growing:
        return source.state_space()  # its responses are those of the equations, and the table says that it is unstable
    return source if closed is None else closed


def _linearized(model: Model) -> System:
    system = model.linearize()
    if isinstance(system, DrivenSystem):  # the page shows what each motion of an end does
        system = system.ends
    if not isinstance(system, System):
        raise ModelError(
            f"report: model '{model.name}' has so many bodies that its equations are sparse, and no page could show "
            f"them. Report on a part of it, or on model.linearize(method='dense') if you can wait.", element=model.name,
        )  # fmt: skip
    return system


def _plotly() -> str:
    try:
        from plotly.offline import get_plotlyjs
    except ImportError as error:
        raise ExportError("a report needs plotly; install it by: pip install 'mbsvib[report]'") from error
    return str(get_plotlyjs())


def _read(name: str) -> str:
    return files("mbsvib.report").joinpath("assets", name).read_text(encoding="utf-8")
