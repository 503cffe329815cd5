"""Axes as a person would write them, that come back to the last bit."""

from __future__ import annotations

from itertools import product
from math import inf, nextafter

from mbsvib import _checks as check
from mbsvib._checks import Vector

# each quotient below is within two steps of the one that was rounded when the axis was made
STEPS = (0, 1, -1, 2, -2, 3, -3)


def plain_axis(axis: Vector) -> Vector:
    """Return a vector whose largest entry is 1 and of which the unit vector is exactly ``axis``.

    A unit vector that is normalised again may change in its last bit, so it cannot be written as it is. The vector
    with the largest entry 1 from which it came lies within a few roundings of ``axis / max|axis|``.
    """
    scale = max(map(abs, axis))
    choices = []
    for entry in axis:
        quotient = entry / scale
        exact = abs(quotient) == 1.0 or entry == 0.0
        choices.append([quotient] if exact else [_step(quotient, count) for count in STEPS])
    for candidate in product(*choices):
        if check.axis(candidate, "axis", "axis") == axis:
            return candidate  # type: ignore[return-value]
    return axis


def _step(value: float, count: int) -> float:
    for _ in range(abs(count)):
        value = nextafter(value, inf if count > 0 else -inf)
    return value
