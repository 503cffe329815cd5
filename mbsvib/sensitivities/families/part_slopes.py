"""Slopes of the numbers that a part is made of, by differences of its own closed formulas.

They are extrapolated to rounding (12 digits); nothing of the mechanism is differenced.
"""

from __future__ import annotations

from itertools import product
from typing import TYPE_CHECKING, Any, TypeVar

import numpy as np

from mbsvib.errors import ModelError
from mbsvib.linalg.differences import slope
from mbsvib.linalg.rank import AGREEING_SLOPES

if TYPE_CHECKING:
    from collections.abc import Callable

    from mbsvib.common.arrays import Array
    from mbsvib.elements.part import Part

    P = TypeVar("P", bound=Part)

# The first step of differences, against the scale of the number; the next one is smaller.
STEP, SMALLER = 2.0**-7, 0.125
# A size that stands for zero in a division.
TINY = 1e-300


def part_slopes(
    part: P, field: str, index: tuple[int, ...], numbers: Callable[[P], dict[str, Array]], scale: float | None = None
) -> dict[str, Array]:
    """Return the derivatives of what a part is made of to one of its parameters.

    ``numbers``: returns what a part is made of, by name; ``scale``: what is a large change of the parameter, None: its
    value. Raises an error if these do not change smoothly.
    """
    value = next(item.value for item in part.parameter_fields() if item.name == field)
    present = numbers(part)
    size = scale or abs(_entry(value, index)) or 1.0

    def at(change: float) -> Array:
        varied = part.with_values({field: _changed(value, index, change)})
        return np.concatenate([array.reshape(-1) for array in numbers(varied).values()])

    best, refusal = np.inf, None
    sizes = np.concatenate([np.full(array.size, np.abs(array).max(initial=0.0)) for array in present.values()])
    for step, sides in product((STEP, STEP * SMALLER), (0, 1, -1)):
        try:
            flat, error = slope(at, step * size, sides)
        except ModelError as problem:  # a value that such a part refuses, as a negative one may be
            refusal = problem
            continue
        worst = float((size * error / (sizes + size * np.abs(flat) + TINY)).max(initial=0.0))
        if worst <= AGREEING_SLOPES:
            ends = np.cumsum([array.size for array in present.values()])[:-1]
            return {key: change.reshape(array.shape)
                    for (key, array), change in zip(present.items(), np.split(flat, ends), strict=True)}  # fmt: skip
        best = min(best, worst)
    if refusal is not None and not np.isfinite(best):
        raise refusal
    raise ModelError(
        f"sensitivities: {part.family} '{part.name}' does not change smoothly with its '{field}' (differences agree to "
        f"{best:.1e} only). Compare variants by model.with_values.", element=part.name, field=field,
    )  # fmt: skip


def _entry(value: Any, index: tuple[int, ...]) -> float:
    for i in index:
        value = value[i]
    return float(value)


def _changed(value: Any, index: tuple[int, ...], change: float) -> Any:
    """A number, vector or symmetric matrix of which one entry has changed."""
    if not index:
        return value + change
    array = np.array(value, dtype=float)
    array[index] += change
    array[index[::-1]] = array[index]
    return array.tolist() if array.ndim > 1 else tuple(array.tolist())
