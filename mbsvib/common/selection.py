"""Selection of signals by names, lists of names and patterns, in the order in which they are named."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, TypeAlias

import numpy as np

from mbsvib.common.arguments import names_in, shown
from mbsvib.common.patterns import matching
from mbsvib.errors import ResponseError, counted, nearest

# Names or patterns of signals; None: all.
Names: TypeAlias = str | Sequence[str] | None

PATTERN = frozenset("*?[")  # a name with one of these that is no name of a signal is a pattern


def selected(
    requested: Any, known: Sequence[str], kind: str, owner: str, others: Sequence[str] = ()
) -> list[int]:
    """Return the numbers of the signals that are named, each once, in the order of the names.

    ``requested``: ``"tilt"``, ``"leg*.F"`` (``*`` any letters, ``?`` one letter), ``["x", "leg*.F"]``; what a pattern
    picks is in the order of the system. None and ``:`` pick all. ``kind``: "output", "input" or "state". ``others``:
    names of the signals of the other kind, to recognize exchanged arguments.
    """
    if requested is None or (isinstance(requested, slice) and requested == slice(None)):
        return list(range(len(known)))
    several = [requested] if isinstance(requested, str) or hasattr(requested, "name") else requested
    result: dict[int, None] = {}
    for name in _listed(several, kind, owner):
        found = set(matching(name, known))
        hits = [i for i, signal in enumerate(known) if signal in found]
        if not hits:
            raise ResponseError(_unknown(name, known, kind, owner, others))
        result |= dict.fromkeys(hits)
    return list(result)


def port_numbers(
    outputs: Any, inputs: Any, known: tuple[Sequence[str], Sequence[str]], name: str
) -> tuple[list[int], list[int]]:
    """Return the numbers of the selected ``outputs`` and ``inputs`` among the ``known`` ones by name; None: all."""
    rows, columns = known
    return selected(outputs, rows, "output", name, columns), selected(inputs, columns, "input", name, rows)


def needed_ports(
    outputs: Any, inputs: Any, known: tuple[Sequence[str], Sequence[str]], name: str
) -> tuple[list[int], list[int]]:
    """Return the numbers of outputs and inputs as ``port_numbers`` does, at least one of each."""
    numbers = port_numbers(outputs, inputs, known, name)
    for kind, indices, names in zip(("outputs", "inputs"), numbers, known, strict=True):
        if not indices:
            raise ResponseError(f"no {kind} are asked for, which leaves nothing of '{name}'; expected one or more of "
                                f"{', '.join(names) or 'its ' + kind + ', yet it has none'}.")  # fmt: skip
    return numbers


def key_ports(key: Any, name: str) -> tuple[Any, Any]:
    """Return outputs and inputs of ``system[outputs, inputs]``."""
    if not isinstance(key, tuple) or len(key) != 2:
        raise ResponseError(f"system '{name}': [{key!r}] selects signals; expected outputs and inputs, "
                            f'system["tilt", "motor"], or system["tilt", :] for all inputs.')  # fmt: skip
    return key


def _listed(several: Any, kind: str, owner: str) -> list[str]:
    names = names_in(several)
    if names is None:
        hint = " Numbers are refused: signals are selected by name." if _numbers(several) else ""
        raise ResponseError(f"system '{owner}': {kind}s = {shown(several)}; expected a name, a pattern such as "
                            f"'leg*', or a list of these; None or : for all.{hint}")  # fmt: skip
    return names


def _numbers(value: Any) -> bool:
    return isinstance(value, slice) or np.asarray(value).dtype.kind in "iub"


def _unknown(name: str, known: Sequence[str], kind: str, owner: str, others: Sequence[str]) -> str:
    listed = ", ".join(known) or "none"
    if name in others:
        other = "input" if kind == "output" else "output"
        return (f"system '{owner}': {name!r} is an {other}, and no {kind}. Outputs come first, then inputs; both are "
                f"keywords as well: outputs=..., inputs=.... The {kind}s are {listed}.")  # fmt: skip
    if PATTERN.intersection(name):
        return f"system '{owner}': the pattern {name!r} picks no {kind}. It has {listed}."
    hint = " Loops have noise of sensors and actuators as inputs by feedback(controller, noise=True)." \
        if kind == "input" and name.endswith(".noise") else nearest(name, known)  # fmt: skip
    return f"{kind} {name!r}: system '{owner}' has no such {kind}.{hint} It has {listed}."


def signal_names(requested: Any, count: int, label: str, owner: str) -> tuple[str, ...]:
    """Return ``count`` names for the rows or columns of matrices, u1, u2, ... if none are given.

    ``label``: "inputs", "outputs", "states" or "coordinates".
    """
    if requested is None:
        letter = {"inputs": "u", "outputs": "y", "states": "x", "coordinates": "q"}[label]
        return tuple([f"{letter}{i + 1}" for i in range(count)])
    names = (requested,) if isinstance(requested, str) else tuple(requested)
    if len(names) != count or not all(issubclass(kind, str) for kind in set(map(type, names))) or "" in names:
        raise ResponseError(f"{owner}: {label} = {shown(list(names))}; expected {counted(count, 'name')}, one for each "
                            f"row or column of the matrices.")  # fmt: skip
    if not all(map(str.isprintable, names)):
        wrong = next(name for name in names if not name.isprintable())
        raise ResponseError(f"{owner}: {label}: the name {wrong!r} has a line break or another character that is not "
                            f"printed, which files cannot hold; give it another name.")  # fmt: skip
    if len(set(names)) < count:
        twice = next(name for name in names if names.count(name) > 1)
        raise ResponseError(f"{owner}: {label}: the name {twice!r} is there more than once; expected names that "
                            f"differ.")  # fmt: skip
    return names


def united(*groups: tuple[str, ...]) -> tuple[str, ...]:
    """Return the names of all groups, each once."""
    return tuple(dict.fromkeys(name for group in groups for name in group))
