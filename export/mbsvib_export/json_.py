"""JSON: the whole neutral object as text that any language reads, every number to the last bit."""

from __future__ import annotations

import json
import os
from collections.abc import Mapping, Sequence
from importlib.resources import files
from typing import Any

import numpy as np

from mbsvib.api.state_space import StateSpace
from mbsvib.common.arrays import Array
from mbsvib.common.atomic_file import write_atomic
from mbsvib.common.file_content import ContentError, content_of, read_json_content
from mbsvib.common.selection import Names
from mbsvib.errors import ExportError
from mbsvib.responses.state_space import StateSpace as FirstOrder
from mbsvib_export.neutral import ERROR_BOUND, FIRST_ORDER, OF_SPACE, SECOND_ORDER, THROUGH, Source, SystemData, data_of
from mbsvib_export.record import SPACE_FORMAT, VERSION, check_version, data_from, record_of


def to_json(
    system: Source, path: str | os.PathLike[str] | None = None, realization: str = "physical", *, outputs: Names = None,
    inputs: Names = None,
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
    text = _text(_words(data_of(system, realization, "to_json", outputs, inputs))) + "\n"
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
        return _data_in(source)
    is_text = isinstance(source, str) and source.lstrip()[:1] == "{"
    where = "from_json" if is_text else os.fspath(source)
    try:
        content = str(source) if is_text else content_of(source, ExportError, "a file of to_json")
        return _data_in(read_json_content(content))
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


def _words(data: SystemData | FirstOrder) -> dict[str, Any]:
    from mbsvib.version import __version__

    space = data.state_space if isinstance(data, SystemData) else data
    record = {key: value.tolist() if isinstance(value, np.ndarray) else value for key, value in record_of(data).items()}
    first = {key.removeprefix(OF_SPACE): value for key, value in record.items() if key.startswith(OF_SPACE)}
    words = {"format": record["format"], "version": VERSION, "generator": f"mbsvib {__version__}", "name": data.name}
    ports = {"inputs": _written(data, "inputs"), "outputs": _written(data, "outputs")}
    states = {"realization": space.realization, "states": _written(space, "states"), **first}
    if not isinstance(data, SystemData):
        return words | ports | {"state_space": states}
    return {
        **words, "coordinates": _written(data, "coordinates"), **ports,
        "second_order": {label: record[label] for label in SECOND_ORDER}, "state_space": states,
        "bodies": [{"name": name, "displacement": motion}
                   for name, motion in zip(data.bodies, record["body_motion"], strict=True)],
    }  # fmt: skip


def _written(group: SystemData | FirstOrder, key: str) -> list[dict[str, str]]:
    """The names and units of signals."""
    return [{"name": name, "unit": unit}
            for name, unit in zip(getattr(group, key), getattr(group, f"{key[:-1]}_units"), strict=True)]  # fmt: skip


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


def _data_in(document: Any) -> SystemData | StateSpace:
    """Return the neutral object that a parsed JSON document describes, or the state space if that is all."""
    top = _mapping(document, "the document")
    check_version(top.get("format"), top.get("version"))
    first = _mapping(_item(top, "state_space", "the document"), "state_space")
    record: dict[str, Any] = {
        "format": top["format"], "name": _word(top, "name", "the document"),
        "realization": _word(first, "realization", "state_space"), **_signals(top, "inputs", "the document"),
        **_signals(top, "outputs", "the document"), **_signals(first, "states", "state_space"),
    }  # fmt: skip
    n, i = len(record["states"]), len(record["inputs"])
    of_system = top["format"] != SPACE_FORMAT
    labels = [*FIRST_ORDER, *[THROUGH] * (THROUGH in first)] if of_system else "ABCD"
    record |= {f"state_space.{key}": _matrix(first, key, n if key in ("A", "C", "transform") else i, "state_space")
               for key in labels}  # fmt: skip
    if of_system:
        return data_from(record | _second_order(top, i))
    bound = first.get(ERROR_BOUND)
    if bound is not None and type(bound) not in (float, int):
        raise ExportError(f"state_space: {ERROR_BOUND} = {str(bound)[:60]}; expected a number.")
    return data_from(record if bound is None else record | {f"state_space.{ERROR_BOUND}": float(bound)})


def _second_order(top: Mapping[str, Any], inputs: int) -> dict[str, Any]:
    coordinates = _signals(top, "coordinates", "the document")
    second = _mapping(_item(top, "second_order", "the document"), "second_order")
    m = len(coordinates["coordinates"])
    bodies = [_mapping(body, "bodies") for body in _list(top, "bodies", "the document")]
    return {
        **coordinates, "bodies": tuple([_word(body, "name", "bodies") for body in bodies]),
        "body_motion": _motion(bodies, m),
        **{key: _matrix(second, key, inputs if key in "BD" else m, "second_order") for key in SECOND_ORDER},
    }  # fmt: skip


def _motion(bodies: list[Mapping[str, Any]], width: int) -> Array:
    maps = [_matrix(body, "displacement", width, f"bodies: {body['name']}") for body in bodies]
    for body, rows in zip(bodies, maps, strict=True):
        if len(rows) != 6:
            raise ExportError(f"bodies: {body['name']}: displacement has {len(rows)} rows; expected 6, "
                              f"x y z rx ry rz.")  # fmt: skip
    return np.array(maps).reshape(len(maps), 6, width)


def _matrix(group: Mapping[str, Any], key: str, width: int, where: str) -> Array:
    rows = _list(group, key, where)
    for number, row in enumerate(rows):
        if not isinstance(row, Sequence) or isinstance(row, str) or len(row) != width:
            actual = f"{len(row)} entries" if isinstance(row, Sequence) else repr(row)
            raise ExportError(f"{where}: {key}: row {number + 1} has {actual}; expected {width} numbers.")
        # bool is an int to Python, and numpy would read the text "1" as a number
        if wrong := [item for item in row if type(item) not in (float, int)]:
            raise ExportError(f"{where}: {key}: row {number + 1} holds {wrong[0]!r}; expected numbers.")
    try:
        return np.array(rows, dtype=float).reshape(len(rows), width)
    except OverflowError as error:
        raise ExportError(f"{where}: {key} holds an integer past 1e308; expected floating-point numbers.") from error


def _signals(group: Mapping[str, Any], key: str, where: str) -> dict[str, tuple[str, ...]]:
    """Names and units, by the key and by that of units."""
    entries = [_mapping(entry, key) for entry in _list(group, key, where)]
    return {kind: tuple([_word(entry, word, key) for entry in entries])
            for kind, word in ((key, "name"), (f"{key[:-1]}_units", "unit"))}  # fmt: skip


def _item(group: Mapping[str, Any], key: str, where: str) -> Any:
    if key not in group:
        raise ExportError(f"{where} has no key '{key}'; expected one. The file is incomplete: write it again.")
    return group[key]


def _word(group: Mapping[str, Any], key: str, where: str) -> str:
    value = _item(group, key, where)
    if not isinstance(value, str):
        raise ExportError(f"{where}: {key} = {str(value)[:60]}; expected a text.")
    if not value.isascii() and any("\ud800" <= letter <= "\udfff" for letter in value):
        raise ExportError(f"{where}: {key} = {value[:60]!r}; expected a text, and halves of characters are none.")
    return value


def _list(group: Mapping[str, Any], key: str, where: str) -> Sequence[Any]:
    value = _item(group, key, where)
    if not isinstance(value, Sequence) or isinstance(value, str):
        raise ExportError(f"{where}: {key} = {str(value)[:60]}; expected a list.")
    return value


def _mapping(value: Any, where: str) -> Mapping[str, Any]:
    if not isinstance(value, Mapping):
        raise ExportError(f"{where} is {str(value)[:60]!r}; expected an object with named keys.")
    return value
