"""From the words of a JSON document to the neutral object, with errors that say where."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from mbsvib.errors import ExportError
from mbsvib_export.neutral import ERROR_BOUND, FIRST_ORDER, SECOND_ORDER, THROUGH
from mbsvib_export.record import SPACE_FORMAT, check_version, data_from

if TYPE_CHECKING:
    from mbsvib.api.state_space import StateSpace
    from mbsvib.common.arrays import Array
    from mbsvib_export.neutral import SystemData


def data_in(document: Any) -> SystemData | StateSpace:
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
