"""Selection of systems, inputs and outputs of a figure, and its layout of panels."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, TypeAlias

from mbsvib.common.expected import a_linear
from mbsvib.common.selection import Names, selected
from mbsvib.errors import ResponseError
from mbsvib.plots._system import Linear
from mbsvib.responses.from_control import is_control, is_transfer_function, of_control

Systems: TypeAlias = Linear | Sequence[Linear]

MOST_PANELS = 12


def linear(value: Any) -> Linear:
    """Return a system, closed loop, state space or controller; systems of python-control become state spaces.

    Raises ResponseError for anything else, or data without equations.
    """
    if is_control(value) or is_transfer_function(value):
        from mbsvib.responses.state_space import StateSpace

        return StateSpace.from_control(value)
    if of_control(value):
        raise ResponseError(f"plots: systems = {type(value).__name__} '{value.name}'; expected equations, a "
                            f"control.StateSpace or control.TransferFunction. Data are drawn by python-control.")
    return a_linear(value, "plots", "systems")


def listed(systems: Systems, labels: Sequence[str] | None) -> list[tuple[str, Linear]]:
    """Return systems with their labels in a legend."""
    several = systems if isinstance(systems, (list, tuple)) else [systems]
    group = [linear(item) for item in several]
    if not group:
        raise ResponseError("no system is given; pass one or a list of them.")
    names = list(labels) if labels is not None else [system.name for system in group]
    if len(names) != len(group):
        raise ResponseError(f"{len(names)} labels for {len(group)} systems; give one for each.")
    if labels is None and len(set(names)) < len(names):  # a model and what is reduced of it
        sized = [f"{name}, {len(system.poles())} states" for name, system in zip(names, group, strict=True)]
        names = sized if len(set(sized)) == len(sized) else [f"{name} ({i})" for i, name in enumerate(names, 1)]
    return list(zip(names, group, strict=True))


def pick(system: Linear, kind: str, names: Names) -> list[str]:
    """Return the selected names of inputs or outputs; None selects all, a pattern those that it fits."""
    known, others = (system.inputs, system.outputs) if kind == "input" else (system.outputs, system.inputs)
    if not known:
        raise ResponseError(f"system '{system.name}' has no {kind}s, so there is no response to draw; "
                            f"add some to the model by add_{kind}().")  # fmt: skip
    result = [known[i] for i in selected(names, known, kind, system.name, others)]
    if not result:
        raise ResponseError(f"the list of {kind}s is empty; name at least one of {', '.join(known)}.")
    return result


def pairs(system: Linear, outputs: Names, inputs: Names) -> list[list[tuple[str, str]]]:
    """Return the panels of a figure, row by row, as (output, input).

    Several outputs and inputs make a matrix, as the transfer matrix is written; a single input or output fills rows
    of at most three.
    """
    results, sources = pick(system, "output", outputs), pick(system, "input", inputs)
    count = len(sources) * len(results)
    if count > MOST_PANELS:
        raise ResponseError(
            f"{len(results)} outputs x {len(sources)} inputs are {count} panels; a figure holds at "
            f"most {MOST_PANELS}: choose, for example, output {results[0]!r} and input {sources[0]!r}. "
            f"Outputs: {', '.join(results)}. Inputs: {', '.join(sources)}."
        )
    if len(sources) > 1 and len(results) > 1:
        return [[(result, source) for source in sources] for result in results]
    flat = [(result, source) for source in sources for result in results]
    width = 2 if count in (2, 4) else min(count, 3)
    return [flat[start : start + width] for start in range(0, count, width)]
