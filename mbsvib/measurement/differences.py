"""Differences of two mechanisms, part by part: numbers, words, orientations, and parts that one has alone."""

from __future__ import annotations

from dataclasses import dataclass, fields
from typing import Any

import numpy as np

from mbsvib.common.expected import kind_of

# Numbers of a model that differ by less than this share of the larger one are the same, but for rounding of their text.
SAME_VALUE = 1e-12
# Axes that differ by less [rad] are the same, but for rounding.
SAME_ANGLE = 1e-12


@dataclass(frozen=True, slots=True)
class Difference:
    """A number or word of a part that differs, with both values; None where it is in one model alone.

    Of an ``orientation``, the second value is the angle [rad] from the first to the second.
    """

    part: str
    quantity: str
    values: tuple[float | str | None, float | str | None]
    unit: str = ""

    @property
    def percent(self) -> float | None:
        """Change from the first to the second value, None where the first is 0 or there is only one."""
        first, second = self.values
        return 100.0 * (second / first - 1.0) if isinstance(first, float) and first and isinstance(second, float) \
            else None  # fmt: skip

    def __str__(self) -> str:
        if None in self.values:
            alone = "the first" if self.values[1] is None else "the second"
            return f"{self.part}{f' {self.quantity}' if self.quantity else ''}: only in {alone}"
        change = "" if self.percent is None else f" ({self.percent:+.3g} %)"
        first, second = (f"{value:g}" if isinstance(value, float) else value for value in self.values)
        return f"{self.part}: {self.quantity} {first} → {second} {self.unit}{change}".rstrip()


def differences(a: Any, b: Any) -> tuple[Difference, ...]:
    """Return numbers and parts in which two mechanisms differ, part by part."""
    mechanisms: list[Any] = [
        value if kind_of(value) == "model" else getattr(getattr(value, "provenance", None), "origin", None)
        for value in (a, b)]  # fmt: skip
    if None in mechanisms:
        return ()
    first, second = ({part.name: part for part in mechanism.declared_parts} for mechanism in mechanisms)
    alone = first.keys() ^ second.keys()
    result = [Difference(name, "", (1.0, None) if name in first else (None, 1.0)) for name in sorted(alone)]
    for name in sorted(first.keys() & second.keys()):
        result += _words(first[name], second[name])
    entries = [{entry.name: entry for entry in mechanism.parameters.entries} for mechanism in mechanisms]
    for name in dict.fromkeys([*entries[0], *entries[1]]):
        one, other = (listed.get(name) for listed in entries)
        known = one or other
        if known is None or known.part in alone:
            continue
        values: Any = (None if one is None else one.value, None if other is None else other.value)
        if values[0] is not None and values[1] is not None and \
                abs(values[0] - values[1]) <= SAME_VALUE * max(map(abs, values)):  # fmt: skip
            continue
        result.append(Difference(known.part, name.removeprefix(f"{known.part}."), values, known.unit))
    return tuple(result)


def _words(one: Any, other: Any) -> list[Difference]:
    """Kinds, names of bodies and orientations in which two parts differ, which are no parameters."""
    if type(one) is not type(other):
        return [Difference(one.name, "", (type(one).__name__, type(other).__name__))]
    result = []
    for entry in fields(one):
        values = getattr(one, entry.name), getattr(other, entry.name)
        if all(isinstance(value, str) for value in values) and values[0] != values[1]:
            result.append(Difference(one.name, entry.name, values))
        elif entry.name == "orientation" and np.shape(values[0]) == np.shape(values[1]) == (3, 3):
            turn = np.array(values[1]) @ np.array(values[0]).T
            axis = np.array([turn[2, 1] - turn[1, 2], turn[0, 2] - turn[2, 0], turn[1, 0] - turn[0, 1]])
            angle = float(np.arctan2(np.linalg.norm(axis), np.trace(turn) - 1.0))
            if angle > SAME_ANGLE:
                result.append(Difference(one.name, "orientation", (0.0, angle), "rad"))
    return result
