"""The page: its frame, the JavaScript library and the data in one text."""

from __future__ import annotations

import json
from html import escape
from importlib.resources import files
from typing import TYPE_CHECKING, Any

from mbsvib.api.system import System
from mbsvib.common.expected import a_model
from mbsvib.errors import ExportError, ModelError
from mbsvib.report.data import collect

if TYPE_CHECKING:
    import os
    from pathlib import Path

    from mbsvib.api.model import Model
    from mbsvib.plots._choice import Names

# Characters that could end a script element, open a comment in it, or end a line of JavaScript.
_UNSAFE = {"<": "\\u003c", ">": "\\u003e", "&": "\\u0026", "\u2028": "\\u2028", "\u2029": "\\u2029"}


def html(source: Model | System, outputs: Names = None, inputs: Names = None) -> str:
    """Return the report of a mechanism as one page of HTML that needs no network.

    Parameters
    ----------
    source : Model or System
        What to report on.
    outputs, inputs : str or sequence of str, optional
        Names of those whose responses are shown; default: all, or as many as fit into a page.

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
        If a name is unknown.
    """
    script = _plotly()
    system = source if isinstance(source, System) else _linearized(a_model(source, "report", "source"))
    data = collect(system, outputs, inputs)
    pieces = {
        "TITLE": escape(system.name),
        "STYLE": _read("page.css"),
        "PLOTLY": script,
        "DATA": embedded(data),
        "SCRIPT": "\n".join(_read(name) for name in ("page.js", "motion.js", "panels.js")),
    }
    return "".join([pieces.get(piece, piece) for piece in _read("page.html").split("@@")])


def write(
    source: Model | System, path: str | os.PathLike[str], outputs: Names = None, inputs: Names = None
) -> Path:  # fmt: skip
    """Write the report of a mechanism to a file, whole or not at all.

    Parameters
    ----------
    source : Model or System
        What to report on.
    path : str or path-like
        Where the page goes.
    outputs, inputs : str or sequence of str, optional
        Names of those whose responses are shown; default: all, or as many as fit into a page.

    Returns
    -------
    Path
        The path.

    Raises
    ------
    ExportError
        If plotly is not installed, or the file cannot be written.
    """
    from mbsvib.common.atomic_file import write_atomic

    text = html(source, outputs, inputs).encode("utf-8")
    try:
        return write_atomic(path, lambda stream: stream.write(text))
    except OSError as error:
        raise ExportError(f"{path}: cannot be written: {error.strerror or error}. Give the path of a file in a folder "
                          f"that exists and that you may write to.") from error  # fmt: skip


def embedded(data: Any) -> str:
    """Return data as JSON that is safe inside a script element for any names.

    Parameters
    ----------
    data : dict or list
        Texts, finite numbers and lists.

    Returns
    -------
    str
        JSON in ASCII without < > &.
    """
    text = json.dumps(data, allow_nan=False, separators=(",", ":"))
    for sign, code in _UNSAFE.items():
        text = text.replace(sign, code)
    return text


def _linearized(model: Model) -> System:
    system = model.linearize()
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
