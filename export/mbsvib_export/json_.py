"""JSON: the whole neutral object as text that any language reads, every number to the last bit."""

from __future__ import annotations

import json
import os
from importlib.resources import files
from typing import TYPE_CHECKING, Any

from mbsvib.common.atomic_file import write_atomic
from mbsvib.common.file_content import ContentError, content_of
from mbsvib.common.json_content import read_json_content
from mbsvib.errors import ExportError
from mbsvib_export.json_reading import data_in
from mbsvib_export.neutral import ERROR_BOUND, SECOND_ORDER, SystemData, data_of, first_order, with_ports
from mbsvib_export.record import FORMAT, SPACE_FORMAT, VERSION

if TYPE_CHECKING:
    from collections.abc import Mapping

    from mbsvib.common.selection import Names
    from mbsvib.responses.state_space import StateSpace
    from mbsvib_export.neutral import Source


def to_json(
    system: Source, path: str | os.PathLike[str] | None = None,
    realization: str = "physical",
    *, outputs: Names = None, inputs: Names = None,
) -> str:  # fmt: skip
    """Return a system as JSON text, and write it to a file if a path is given.

    The text holds M, C, K, B, Cq, Cv, Ca, D, the state space A, B, C, D, names, units and the bodies' displacements
    per coordinate, in the form that ``json_schema()`` lays down; of first-order equations alone A, B, C, D, names and
    units. Numbers come back bit for bit.

    Parameters
    ----------
    system : System, ClosedLoop, Controller, StateSpace, control.StateSpace or SystemData
        The equations of motion, or first-order equations alone, as of loops whose controllers have states.
    path : str or path, optional
        File to write: whole or not at all.
    realization : str
        States of the state space: "physical", "modal" or "balanced".
    outputs, inputs : str or sequence of str, optional
        Names or patterns of those to export; default: all.

    Returns
    -------
    str
        The JSON text.

    Raises
    ------
    ExportError
        If the file cannot be written, or no system is given.
    ResponseError
        If the realization, or the name of an output or input, is unknown.
    """
    system = with_ports(system, outputs, inputs)
    text = _text(_words(data_of(system, realization, "to_json"))) + "\n"
    if path is not None:
        write_atomic(path, lambda stream: stream.write(text.encode()))
    return text


def from_json(source: str | os.PathLike[str] | Mapping[str, Any]) -> SystemData | StateSpace:
    """Return the system, or the state space, that ``to_json`` wrote.

    Parameters
    ----------
    source : str, path or dict
        Path of a file, the JSON text itself (it begins with a brace), or what a JSON reader made of it.

    Returns
    -------
    SystemData, or StateSpace
        Matrices, names and units; ``to_control``, ``to_json`` and the other exporters take it. A StateSpace of
        first-order equations alone.

    Raises
    ------
    ExportError
        If the file cannot be read, is damaged, or is of a later version of the format.
    """
    if not isinstance(source, (str, os.PathLike)):
        return data_in(source)
    is_text = isinstance(source, str) and source.lstrip()[:1] == "{"
    where = "from_json" if is_text else os.fspath(source)
    try:
        return data_in(read_json_content(str(source) if is_text else content_of(source, ExportError,
                                                                                "a file of to_json")))  # fmt: skip
    except ContentError as error:
        raise ExportError(f"{where}: {error}; expected JSON as to_json writes it. The file is damaged or of another "
                          f"kind: write it again.") from error  # fmt: skip
    except ExportError as error:
        raise ExportError(str(error) if str(error).startswith(where) else f"{where}: {error}") from error


def json_schema() -> dict[str, Any]:
    """Return the JSON schema (draft 2020-12) of the files of ``to_json``.

    Returns
    -------
    dict
        The schema; the file ``system.schema.json`` of this package.
    """
    text = (files("mbsvib_export") / "system.schema.json").read_text(encoding="utf-8")
    result: dict[str, Any] = json.loads(text)
    return result


def _words(data: SystemData | StateSpace) -> dict[str, Any]:
    from mbsvib import __version__

    space = data.state_space if isinstance(data, SystemData) else data
    of_file = {"version": VERSION, "generator": f"mbsvib {__version__}", "name": data.name}
    ports = {"inputs": _signals(data.inputs, data.input_units), "outputs": _signals(data.outputs, data.output_units)}
    first = {"realization": space.realization, "states": _signals(space.states, space.state_units)}
    if not isinstance(data, SystemData):
        matrices = {label: getattr(space, label).tolist() for label in "ABCD"}
        bound = {} if space.error_bound is None else {ERROR_BOUND: space.error_bound}
        return {"format": SPACE_FORMAT, **of_file, **ports, "state_space": {**first, **matrices, **bound}}
    return {
        "format": FORMAT,
        **of_file,
        "coordinates": _signals(data.coordinates, data.coordinate_units),
        **ports,
        "second_order": {label: getattr(data, label).tolist() for label in SECOND_ORDER},
        "state_space": {**first, **{label: array.tolist() for label, array in first_order(space).items()}},
        "bodies": [
            {"name": name, "displacement": motion.tolist()}
            for name, motion in zip(data.bodies, data.body_motion, strict=True)
        ],
    }


def _signals(names: tuple[str, ...], units: tuple[str, ...]) -> list[dict[str, str]]:
    return [{"name": name, "unit": unit} for name, unit in zip(names, units, strict=True)]


def _text(value: Any, indent: str = "") -> str:
    """JSON with one line for each row of a matrix and each signal: people read these files, and compare them."""
    inner = indent + "  "
    parts = value.values() if isinstance(value, dict) else value
    if not any(isinstance(part, (dict, list)) for part in parts):
        return json.dumps(value, ensure_ascii=False, allow_nan=False)
    if isinstance(value, dict):
        lines = [f"{inner}{json.dumps(key, ensure_ascii=False)}: {_line(part, inner)}" for key, part in value.items()]
        return "{\n" + ",\n".join(lines) + f"\n{indent}}}"
    return "[\n" + ",\n".join(inner + _line(part, inner) for part in value) + f"\n{indent}]"


def _line(value: Any, indent: str) -> str:
    plain = not isinstance(value, (dict, list))
    return json.dumps(value, ensure_ascii=False) if plain else _text(value, indent)
