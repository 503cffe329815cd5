"""Arrays with named axes, coordinates and units: data sets of xarray."""

from __future__ import annotations

from collections.abc import Hashable, Mapping, Sequence
from importlib import import_module
from typing import Any, TypeAlias

from mbsvib.errors import ExportError

# Names of the axes of an array, the array, and its unit; None: it has none.
Labelled: TypeAlias = tuple[Sequence[Hashable], Any, str | None]


def dataset(
    caller: str, variables: Mapping[str, Labelled], coordinates: Mapping[str, Labelled], name: str = ""
) -> Any:
    """Return an ``xarray.Dataset`` with the units of variables and coordinates as their attribute "units".

    ``caller``: what needs it, for messages. ``name``: the attribute "name" of the whole.
    """
    try:
        xarray = import_module("xarray")
    except ImportError as error:
        raise ExportError(f'{caller}: needs xarray, which is not installed; pip install "mbsvib[xarray]".') from error

    def labelled(content: Labelled) -> tuple[Any, ...]:
        axes, values, unit = content
        return axes, values, {} if unit is None else {"units": unit}

    return xarray.Dataset({key: labelled(content) for key, content in variables.items()},
                          {key: labelled(content) for key, content in coordinates.items()},
                          {"name": name} if name else {})  # fmt: skip


def of_responses(
    caller: str, frequencies: Any, ends: tuple[Sequence[str], Sequence[str]],
    units: tuple[Sequence[str], Sequence[str]], variables: Mapping[str, Labelled], name: str = "",
) -> Any:  # fmt: skip
    """Return variables over outputs, inputs and frequencies [Hz].

    ``ends``: names of outputs and inputs; ``units``: theirs, which become the coordinates "output_unit" and
    "input_unit", or none where they are not known.
    """
    coordinates: dict[str, Labelled] = {"frequency": (["frequency"], frequencies, "Hz")}
    for axis, names, known in zip(("output", "input"), ends, units, strict=True):
        coordinates[axis] = [axis], list(names), None
        if any(known):
            coordinates[f"{axis}_unit"] = [axis], list(known), None
    return dataset(caller, variables, coordinates, name)
