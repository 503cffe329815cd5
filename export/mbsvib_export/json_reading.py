"""From the words of a JSON document to the neutral object, with errors that say where."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from mbsvib.api.state_space import StateSpace
from mbsvib.errors import ExportError
from mbsvib_export.consistency import consistent
from mbsvib_export.format_version import SPACE_FORMAT, check_version
from mbsvib_export.neutral import ERROR_BOUND, FIRST_ORDER, SECOND_ORDER, THROUGH, SystemData, checked

if TYPE_CHECKING:
    from mbsvib.common.arrays import Array

    Signals = tuple[tuple[str, ...], tuple[str, ...]]


def data_in(document: Any) -> SystemData | StateSpace:
    """Return the neutral object that a parsed JSON document describes, or the state space if that is all."""
    top = _mapping(document, "the document")
    check_version(top.get("format"), top.get("version"))
    if top["format"] == SPACE_FORMAT:
        return _state_space(top)
    name = _word(top, "name", "the document")
    coordinates, inputs, outputs = (_signals(top, key, "the document") for key in ("coordinates", "inputs", "outputs"))
    second = _mapping(_item(top, "second_order", "the document"), "second_order")
    first = _mapping(_item(top, "state_space", "the document"), "state_space")
    states = _signals(first, "states", "state_space")
    m, i, n = len(coordinates[0]), len(inputs[0]), len(states[0])
    widths = dict(zip(SECOND_ORDER, (m, m, m, i, m, m, m, i), strict=True))
    first_widths = dict(zip(FIRST_ORDER, (n, i, n, i, n), strict=True))
    matrices: dict[str, Any] = {key: _matrix(second, key, width, "second_order") for key, width in widths.items()}
    space: dict[str, Any] = {key: _matrix(first, key, width, "state_space") for key, width in first_widths.items()}
    if THROUGH in first:
        space[THROUGH] = _matrix(first, THROUGH, i, "state_space")
    ports = {**_pair("input", inputs), **_pair("output", outputs)}
    bodies = [_mapping(body, "bodies") for body in _list(top, "bodies", "the document")]
    realization = _word(first, "realization", "state_space")
    return consistent(SystemData(
        name=name, bodies=tuple(_word(body, "name", "bodies") for body in bodies), body_motion=_motion(bodies, m),
        state_space=StateSpace(name=name, realization=realization, **space, **_pair("state", states), **ports),
        **_pair("coordinate", coordinates), **ports, **matrices,
    ))  # fmt: skip


def _state_space(top: Mapping[str, Any]) -> StateSpace:
    name = _word(top, "name", "the document")
    inputs, outputs = (_signals(top, key, "the document") for key in ("inputs", "outputs"))
    first = _mapping(_item(top, "state_space", "the document"), "state_space")
    states = _signals(first, "states", "state_space")
    n, i = len(states[0]), len(inputs[0])
    matrices: dict[str, Any] = {key: _matrix(first, key, width, "state_space")
                                for key, width in zip("ABCD", (n, i, n, i), strict=True)}  # fmt: skip
    bound = first.get(ERROR_BOUND)
    if bound is not None and type(bound) not in (float, int):
        raise ExportError(f"state_space: {ERROR_BOUND} = {str(bound)[:60]}; expected a number.")
    return checked(StateSpace(
        name=name, realization=_word(first, "realization", "state_space"), transform=np.zeros((0, n)), **matrices,
        **_pair("state", states), **_pair("input", inputs), **_pair("output", outputs),
        error_bound=None if bound is None else float(bound),
    ))  # fmt: skip


def _pair(kind: str, signals: Signals) -> dict[str, Any]:
    return {f"{kind}s": signals[0], f"{kind}_units": signals[1]}


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


def _signals(group: Mapping[str, Any], key: str, where: str) -> Signals:
    entries = [_mapping(entry, key) for entry in _list(group, key, where)]
    return tuple(_word(entry, "name", key) for entry in entries), tuple(_word(entry, "unit", key) for entry in entries)


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
