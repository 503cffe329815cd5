"""Changes: parts with other values of some of their parameters, one by one or many variants at once."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import fields
from typing import TYPE_CHECKING, Any

import numpy as np

from mbsvib.common import arguments as check
from mbsvib.elements import Joint
from mbsvib.elements.making import remade
from mbsvib.elements.part import Numbered
from mbsvib.errors import ModelError
from mbsvib.mechanism.parameters import unit

if TYPE_CHECKING:
    from mbsvib.common.arrays import Array
    from mbsvib.elements.part import Part
    from mbsvib.mechanism.parameters import Parameters


def parts_with(parameters: Parameters, values: Mapping[str, Any]) -> dict[str, Part]:
    """Return the parts that some values change, through the checks that every part goes through.

    Parameters
    ----------
    parameters : Parameters
        Those of the model.
    values : mapping
        New value of each parameter, by name or pattern; a name goes before a pattern.

    Returns
    -------
    dict of str to Part
        The changed parts by name.

    Raises
    ------
    ModelError
        If a parameter is unknown or a value refused.
    """
    given = {}
    for name, value in resolved(parameters, values).items():
        given[name] = np.array([check.number(value, f"parameter '{name}'", "value", f"a finite number [{unit(name)}]")])
    return {name: variant(parameters.parts[name], whole, 0) for name, whole in whole_fields(parameters, given).items()}


def resolved(parameters: Parameters, values: Mapping[str, Any]) -> dict[str, Any]:
    """Return the value of every parameter that is named or picked by a pattern, by name.

    Parameters
    ----------
    parameters : Parameters
        Those of the model.
    values : mapping
        A value for each name or pattern; a name goes before the patterns that pick it too.

    Returns
    -------
    dict of str to object
        The values, unchecked.

    Raises
    ------
    ModelError
        If a parameter is unknown, or two patterns pick the same one.
    """
    if not isinstance(values, Mapping):
        raise check.refuse("values", "values", values, "a mapping of parameters to values, {'body.mass': 1.0}")
    result: dict[str, Any] = {}
    pattern_of: dict[str, str] = {}
    for pattern, value in values.items():
        for name in parameters.matching(pattern):
            if name == pattern:
                pattern_of[name] = name
            elif name in values:
                continue
            elif name in pattern_of:
                raise ModelError(f"values: both '{pattern_of[name]}' and '{pattern}' pick '{name}'; name it by itself "
                                 f"too, which goes before patterns.", element=name, field="values")  # fmt: skip
            else:
                pattern_of[name] = pattern
            result[name] = value
    return result


def whole_fields(parameters: Parameters, values: Mapping[str, Array]) -> dict[str, dict[str, Array]]:
    """Return the whole fields of parts of which some entries get new values.

    Parameters
    ----------
    parameters : Parameters
        Those of the model.
    values : mapping
        Arrays of shape (n,) by the names of the parameters.

    Returns
    -------
    dict of str to dict of str to array
        By part and field: arrays whose last axis is that of the values (position: (3, n)); orientations as rotation
        vectors from the given pose.
    """
    result: dict[str, dict[str, Array]] = {}
    for name, array in values.items():
        entry = parameters.entry(name)
        whole = result.setdefault(entry.part, {})
        if entry.field not in whole:
            given = (0.0, 0.0, 0.0) if entry.field == "orientation" else _value(
                parameters.parts[entry.part], entry.field)  # fmt: skip
            start = np.array(given, dtype=float)
            whole[entry.field] = np.repeat(start[..., None], len(array), axis=-1)
        whole[entry.field][entry.index] = array
        if len(entry.index) == 2:
            whole[entry.field][entry.index[::-1]] = array
    return result


def variant(part: Part, whole: Mapping[str, Array], i: int) -> Part:
    """Return a part with other values, through the checks that every part goes through.

    Parameters
    ----------
    part : Part
        The part as given.
    whole : mapping
        New fields as ``whole_fields`` has them.
    i : int
        Which of the values along their last axis.

    Returns
    -------
    Part
        The changed part.

    Raises
    ------
    ModelError
        If a value is refused.
    """
    if isinstance(part, Numbered):
        return part.with_numbers({field: array[..., i].tolist() for field, array in whole.items()})
    words = {item.name: getattr(part, item.name) for item in fields(part) if not item.metadata.get("derived")}
    for field, array in whole.items():
        if field != "orientation":
            words[field] = array[..., i].tolist()
            continue
        turn = np.array(check.exponential(tuple(array[:, i].tolist())))
        if not isinstance(part, Joint):
            words[field] = turn @ np.array(words[field])
        elif part.kind == "universal" and part.axis is not None:
            words["axis"], words["axis2"] = turn @ part.axis, turn @ part.axis2
        else:
            words["axis"], words[field] = None, turn @ np.array(part.axes)
    return remade(part, words)


def scale_of(parameters: Parameters, name: str) -> float:
    """Return what a parameter is measured by: its own value, or the largest entry beside it.

    Parameters
    ----------
    parameters : Parameters
        Those of the model.
    name : str
        Name of the parameter.

    Returns
    -------
    float
        A positive number [unit of the parameter]; 1 where all entries are 0, and for orientations, which have no size.
    """
    entry = parameters.entry(name)
    if entry.value or entry.field == "orientation":
        return abs(entry.value) or 1.0
    return float(np.abs(np.array(_value(parameters.parts[entry.part], entry.field))).max()) or 1.0


def _value(part: Part, field: str) -> Any:
    return part.number(field) if isinstance(part, Numbered) else getattr(part, field)


def rotations(w: Array) -> Array:
    """Return the rotation matrices exp([w]x) of rotation vectors (3, n) [rad], shape (n, 3, 3)."""
    x, y, z = w
    square = x * x + y * y + z * z
    angle = np.sqrt(square)
    small = square < 1e-10  # the next term of either series is below 1e-22
    safe = np.where(small, 1.0, angle)
    s = np.where(small, 1.0 - square / 6.0, np.sin(safe) / safe)
    c = np.where(small, 0.5 - square / 24.0, 2.0 * (np.sin(0.5 * safe) / safe) ** 2)
    return np.array([
        [1.0 - c * (y * y + z * z), c * x * y - s * z, c * x * z + s * y],
        [c * x * y + s * z, 1.0 - c * (x * x + z * z), c * y * z - s * x],
        [c * x * z - s * y, c * y * z + s * x, 1.0 - c * (x * x + y * y)],
    ]).transpose(2, 0, 1)  # fmt: skip
