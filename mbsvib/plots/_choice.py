"""Selection of systems, inputs and outputs of a figure, and its layout of panels."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import TypeAlias

from mbsvib.common.expected import a_system
from mbsvib.common.expected import names as listed_names
from mbsvib.errors import ResponseError, nearest
from mbsvib.plots._system import System

Names: TypeAlias = str | Sequence[str] | None
Systems: TypeAlias = System | Sequence[System]

MOST_PANELS = 12


def listed(systems: Systems, labels: Sequence[str] | None) -> list[tuple[str, System]]:
    """Return systems with their labels in a legend."""
    several = systems if isinstance(systems, Iterable) and not isinstance(systems, str) else [systems]
    group = [a_system(item, "plots", "systems") for item in several]
    if not group:
        raise ResponseError("no system is given; pass one or a list of them.")
    names = list(labels) if labels is not None else [system.name for system in group]
    if len(names) != len(group):
        raise ResponseError(f"{len(names)} labels for {len(group)} systems; give one for each.")
    if labels is None and len(set(names)) < len(names):
        names = [f"{name} ({i})" for i, name in enumerate(names, 1)]
    return list(zip(names, group, strict=True))


def pick(system: System, what: str, names: Names) -> list[str]:
    """Return the selected names of inputs or outputs; None selects all.

    Raises
    ------
    ResponseError
        If the system has none, or has no such name; the nearest one is suggested.
    """
    known = system.inputs if what == "input" else system.outputs
    if not known:
        raise ResponseError(f"system '{system.name}' has no {what}s, so there is no response to draw; "
                            f"add some to the model by add_{what}().")  # fmt: skip
    selected = list(known) if names is None else listed_names(names, "plots", f"{what}s")
    for name in selected:
        if name not in known:
            raise ResponseError(
                f"{what} {name!r}: system '{system.name}' has no such {what}.{nearest(str(name), known)} "
                f"It has {', '.join(known)}."
            )
    if not selected:
        raise ResponseError(f"the list of {what}s is empty; name at least one of {', '.join(known)}.")
    return selected


def pairs(system: System, inputs: Names, outputs: Names) -> list[list[tuple[str, str]]]:
    """Return the panels of a figure, row by row, as (input, output).

    Several inputs and outputs make a matrix, as the transfer matrix is written; a single input or output fills rows
    of at most three.
    """
    sources, results = pick(system, "input", inputs), pick(system, "output", outputs)
    count = len(sources) * len(results)
    if count > MOST_PANELS:
        raise ResponseError(
            f"{len(sources)} inputs x {len(results)} outputs are {count} panels; a figure holds at "
            f"most {MOST_PANELS}: choose, for example, input {sources[0]!r} and output {results[0]!r}. "
            f"Inputs: {', '.join(sources)}. Outputs: {', '.join(results)}."
        )
    if len(sources) > 1 and len(results) > 1:
        return [[(source, result) for source in sources] for result in results]
    flat = [(source, result) for source in sources for result in results]
    width = 2 if count in (2, 4) else min(count, 3)
    return [flat[start : start + width] for start in range(0, count, width)]
