"""Names and units in FMI."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping

# exponents of kg, m, s, rad
_UNITS = {"kg": {"kg": 1}, "m": {"m": 1}, "s": {"s": 1}, "rad": {"rad": 1}, "N": {"kg": 1, "m": 1, "s": -2}}
_FACTOR = re.compile(r"(1|[A-Za-z]+)(?:\^?(-?[0-9]+))?$")
# Characters that XML cannot hold.
CONTROL = re.compile(r"[\x00-\x1f\x7f\ud800-\udfff\ufffe\uffff]")


def identifier(name: str) -> str:
    """Return a name that files and functions may have: ASCII letters, digits and ``_``, no digit first."""
    plain = re.sub(r"[^A-Za-z0-9_]", "_", name)[:60]
    return plain if plain and not plain[0].isdigit() else f"model_{plain}"


def printable(text: str) -> str:
    """Return a text on one line, with a space for each character that is not printed."""
    return "".join([letter if letter.isprintable() else " " for letter in text])


def unique_names(groups: Mapping[str, Iterable[str]]) -> dict[str, list[str]]:
    """Return names that differ from each other over all groups, changed as little as possible.

    A name that an earlier group has gets its own group appended (``"x (output)"``); control characters become spaces.
    """
    used: set[str] = set()
    result: dict[str, list[str]] = {}
    for group, names in groups.items():
        result[group] = []
        for name in names:
            plain = CONTROL.sub(" ", name).strip() or group
            unique, count = plain, 1
            while unique in used:
                unique = f"{plain} ({group})" if count == 1 else f"{plain} ({group} {count})"
                count += 1
            used.add(unique)
            result[group].append(unique)
    return result


def original_outputs(outputs: Iterable[str], inputs: Iterable[str]) -> tuple[str, ...]:
    """Return the names of outputs without what ``unique_names`` appends where an input has the same name."""
    known = set(inputs)
    return tuple(short if (short := name.removesuffix(" (output)")) in known else name for name in outputs)


def base_unit(unit: str) -> dict[str, int] | None:
    """Return the exponents other than 0 of kg, m, s, rad in a unit, ``"N m/rad"``; None for ``"modal"`` and ``""``.
    """
    if not unit or unit == "-":
        return None
    total: dict[str, int] = {}
    for k, part in enumerate(unit.split("/")):
        for factor in part.split():
            match = _FACTOR.match(factor)
            if not match or (match[1] != "1" and match[1] not in _UNITS):
                return None
            power = int(match[2] or 1) * (1 if k == 0 else -1)
            for base, exponent in _UNITS.get(match[1], {}).items():
                total[base] = total.get(base, 0) + power * exponent
    return {base: exponent for base, exponent in total.items() if exponent}
