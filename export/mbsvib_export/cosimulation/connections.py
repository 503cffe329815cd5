"""Which output goes to which input; what cannot work is refused here, by name."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from graphlib import CycleError, TopologicalSorter
from typing import Any

import numpy as np
from scipy.linalg import block_diag

from mbsvib.common.arguments import shown, unknown
from mbsvib.common.arrays import Array
from mbsvib.errors import ExportError
from mbsvib_export.cosimulation.unit import Signal, UnitFile

SIDES = ("plant", "controller")
_TINY = 1e-12  # of the largest entry of D: rounding is not feedthrough


@dataclass(frozen=True, slots=True)
class Connections:
    """What each input takes, by numbers in the lists of both FMUs, those of the plant first.

    ``pairs`` (input, output); ``free``: inputs that take none; ``shape``: numbers of inputs and of outputs.
    """

    pairs: tuple[tuple[int, int], ...]
    free: tuple[int, ...]
    shape: tuple[int, int]
    notes: tuple[str, ...]

    @property
    def coupling(self) -> Array:
        """Matrix (inputs, outputs) from outputs to the inputs that take them."""
        result = np.zeros(self.shape)
        result[tuple(zip(*self.pairs, strict=True))] = 1.0
        return result

    @property
    def outside(self) -> Array:
        """Matrix (inputs, free inputs)."""
        return np.eye(self.shape[0])[:, list(self.free)]


def by_names(value: object, caller: str, field: str, expected: str) -> dict[str, Any]:
    """Return a mapping from names, which may be left out (None), as a dict."""
    if value is None:
        return {}
    if not isinstance(value, Mapping) or not all(isinstance(name, str) for name in value):
        raise ExportError(f"{caller}: {field} = {shown(value)}; expected {expected}.")
    return dict(value)


def connect(units: Sequence[UnitFile], wishes: Mapping[str, str | None] | None, caller: str) -> Connections:
    """Return the connections of a plant and a controller: signals of one name, and ``wishes``, output by input."""
    listed = by_names(wishes, caller, "connections", "a mapping {input: output}")
    outputs = dict(_input_of(units, name, wish, caller) for name, wish in listed.items())
    pairs, free, notes = [], [], []
    i = 0  # inputs of the FMUs before
    for side, goal, source, o in zip(SIDES, units, reversed(units), (len(units[0].outputs), 0), strict=True):
        names = [port.name for port in source.outputs]
        words = []
        for number, signal in enumerate(goal.inputs, i):
            wish = outputs.get((side, signal.name), signal.name)
            if wish not in names:
                if wish is not None and (side, signal.name) in outputs:
                    raise unknown(wish, names, f"{caller}: connections: '{wish}' for the {side}'s input '"
                                  f"{signal.name}' is not an output of '{source.name}'", error=ExportError)  # fmt: skip
                free.append(number)
                continue
            port = names.index(wish)
            _same_unit(source.outputs[port], signal, side, caller)
            pairs.append((number, o + port))
            words.append(wish if wish == signal.name else f"{wish} as {signal.name}")
        if not words:
            other = SIDES[side == SIDES[0]]
            raise ExportError(
                f"{caller}: no connection from outputs of the {other} to inputs of the {side}: there is "
                f"{', '.join(names) or 'no output'} on one side, "
                f"{', '.join(port.name for port in goal.inputs) or 'no input'} on the other. Signals of one name are "
                f"connected; say others by connections={{input: output}}, on the command line by --connect "
                f"INPUT=OUTPUT."
            )
        notes.append(f"{side} <- {', '.join(words)}")
        i += len(goal.inputs)
    shape = i, sum(len(unit.outputs) for unit in units)
    return Connections(tuple(pairs), tuple(free), shape, tuple(notes))


def _input_of(
    units: Sequence[UnitFile], name: str, wish: str | None, caller: str
) -> tuple[tuple[str, str], str | None]:  # fmt: skip
    """Side and name of an input, and the output that it is to take."""
    inputs = {side: [signal.name for signal in unit.inputs] for side, unit in zip(SIDES, units, strict=True)}
    side, _, rest = name.partition(":")
    if side in inputs and rest:
        inputs, name = {side: inputs[side]}, rest
    matches = [side for side, names in inputs.items() if name in names]
    if len(matches) == 1:
        return (matches[0], name), wish
    if matches:
        raise ExportError(f"{caller}: connections: both FMUs have an input '{name}'; say 'plant:{name}' or "
                          f"'controller:{name}'.")  # fmt: skip
    known = [item for names in inputs.values() for item in names]
    raise unknown(name, known, f"{caller}: connections: there is no input '{name}'", None, "Inputs are",
                  ExportError)  # fmt: skip


def _same_unit(out: Signal, into: Signal, side: str, caller: str) -> None:
    if out.base is not None and into.base is not None and out.base != into.base:
        raise ExportError(f"{caller}: output '{out.name}' [{out.unit}] does not go with the {side}'s input "
                          f"'{into.name}' [{into.unit}]: the units differ.")  # fmt: skip


def refuse_algebraic_loop(units: Sequence[UnitFile], links: Connections, through: Sequence[Array]) -> None:
    """Refuse a loop in which signals depend on each other at once; ``through``: D (outputs, inputs) of each FMU."""
    filled = block_diag(*(np.abs(d) > _TINY * np.abs(d).max(initial=0.0) for d in through))
    direct = filled @ links.coupling  # row depends on column
    names = [f"{signal.name} ({side})" for side, unit in zip(SIDES, units, strict=True) for signal in unit.outputs]
    try:
        TopologicalSorter({i: np.flatnonzero(row).tolist() for i, row in enumerate(direct)}).prepare()
    except CycleError as error:
        raise ExportError(
            f"check_cosimulation: algebraic loop: {' <- '.join(names[i] for i in reversed(error.args[1]))} "
            f"depend on each other at once, as plant and controller both have feedthrough there. Roll one off (a "
            f"low-pass filter in the controller), or measure what does not answer at once."
        ) from None
