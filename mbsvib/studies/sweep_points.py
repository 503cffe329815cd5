"""Points of a sweep: every combination of values, or values point by point."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from math import prod
from typing import TYPE_CHECKING, Any

import numpy as np

from mbsvib.common import arguments as check
from mbsvib.common.expected import reals
from mbsvib.errors import ModelError, counted

if TYPE_CHECKING:
    from mbsvib.common.arrays import Array


HOW = ("grid", "paired")


@dataclass(frozen=True, slots=True)
class Points:
    """Values of variables: ``axes`` as given, ``columns`` (n,) point by point, ``shape`` of the grid or (n,)."""

    axes: Mapping[str, Array]
    columns: Mapping[str, Array]
    shape: tuple[int, ...]

    def __len__(self) -> int:
        return prod(self.shape)


def points(values: Mapping[str, Any], how: str) -> Points:
    """Return the points of a sweep.

    ``values`` (k,) or (): values of each variable. ``how``: "grid": every combination, the last variable runs fastest;
    "paired": the arrays have one length, and a number is the same at all points.
    """
    if how not in HOW:
        raise check.refuse("sweep", "how", how, "'grid' or 'paired'")
    if not isinstance(values, Mapping) or not values:
        raise check.refuse("sweep", "values", values, "a mapping from parameters to values, such as "
                           "{'leg*.k.stiffness': [1e6, 2e6]}")  # fmt: skip
    arrays = {str(name): _values(str(name), value) for name, value in values.items()}
    if how == "grid":
        axes = {name: np.atleast_1d(array) for name, array in arrays.items()}
        mesh = np.meshgrid(*axes.values(), indexing="ij")
        columns = {name: grid.reshape(-1) for name, grid in zip(axes, mesh, strict=True)}
        return Points(axes, columns, tuple([len(axis) for axis in axes.values()]))
    count = max([array.size for array in arrays.values()])
    for name, array in arrays.items():
        if array.ndim and array.size != count:
            longest = next(variable for variable, value in arrays.items() if value.size == count)
            raise ModelError(f"sweep: values['{name}'] has {counted(array.size, 'entry')}, values['{longest}'] "
                             f"{count}; a paired sweep has one for each point. For all combinations: how='grid'.",
                             element=name, field="values")  # fmt: skip
    columns = {name: np.broadcast_to(array, (count,)) for name, array in arrays.items()}
    return Points(columns, columns, (count,))


def _values(name: str, value: Any) -> Array:
    expected = "a number or a list of finite numbers"
    array = reals(value, "sweep", f"values['{name}']", expected, ModelError).copy()
    if array.ndim > 1 or not array.size or not np.isfinite(array).all():
        raise check.refuse("sweep", f"values['{name}']", value, expected)
    array.setflags(write=False)
    return array
