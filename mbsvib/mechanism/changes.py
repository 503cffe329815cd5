"""Changes: parts with other values of some of their parameters, one by one or many variants at once."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from mbsvib.common import arguments as check
from mbsvib.errors import ModelError

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
        expected = f"a finite number [{parameters.entry(name).unit}]"
        given[name] = np.array([check.number(value, f"parameter '{name}'", "value", expected)])
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
            start = np.array(_value(parameters.parts[entry.part], entry.field), dtype=float)
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
    return part.with_values({field: _plain(array[..., i]) for field, array in whole.items()})


def _plain(array: Array) -> Any:
    """Numbers as tuples, as parts hold them."""
    items = array.tolist()
    if array.ndim < 2:
        return tuple(items) if array.ndim else items
    return tuple([tuple(row) for row in items])


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
    return next(item.value for item in part.parameter_fields() if item.name == field)
