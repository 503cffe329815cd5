"""Modelica: a state space as the text of a model, every signal with its name and unit."""

from __future__ import annotations

import os
import re
from collections.abc import Iterable, Sequence
from pathlib import Path
from textwrap import fill

import numpy as np

from mbsvib.common.arrays import Array
from mbsvib.common.atomic_file import write_atomic
from mbsvib.common.expected import a_path, flag
from mbsvib.common.selection import Names
from mbsvib.errors import ExportError
from mbsvib.responses.state_space import StateSpace
from mbsvib.version import __version__
from mbsvib_export.fmu_.names import base_unit, identifier, printable
from mbsvib_export.neutral import Source, check_finite, state_space_of

WIDTH = 110
# Words of the language, its predefined types, and the library of the connectors.
_RESERVED = frozenset((
    "algorithm", "and", "annotation", "assert", "block", "break", "class", "connect", "connector", "constant",
    "constrainedby", "der", "discrete", "each", "else", "elseif", "elsewhen", "encapsulated", "end", "enumeration",
    "equation", "expandable", "extends", "external", "false", "final", "flow", "for", "function", "if", "import",
    "impure", "in", "initial", "inner", "input", "loop", "model", "not", "operator", "or", "outer", "output", "package",
    "parameter", "partial", "protected", "public", "pure", "record", "redeclare", "replaceable", "return", "stream",
    "then", "time", "true", "type", "when", "while", "within", "Real", "Integer", "Boolean", "String", "Modelica",
))  # fmt: skip


def to_modelica(
    system: Source, path: str | os.PathLike[str], *, realization: str = "physical", connectors: bool = False,
    name: str | None = None, outputs: Names = None, inputs: Names = None,
) -> Path:  # fmt: skip
    """Write a state space as a model in Modelica.

    der(x) = A x + B u,  y = C x + D u,  one equation for each state and each output, zeros left out

    States, inputs and outputs are variables with their units; what Modelica does not allow in a name becomes ``_``, and
    the name of mbsvib is the variable's description. States begin at zero. The model needs no library.

    Parameters
    ----------
    system : System, ClosedLoop, StateSpace, control.StateSpace, SystemData or Controller
        The equations of motion, a closed loop, a state space that is ready, or a controller.
    path : str or path
        The file, such as ``"isolator.mo"``; tools expect that it is named after the model.
    realization : str
        The states of a System: "physical" (q and q'), "modal" or "balanced".
    connectors : bool
        Whether inputs and outputs are ``RealInput`` and ``RealOutput`` of ``Modelica.Blocks.Interfaces``, which
        diagrams connect.
    name : str, optional
        Name of the model; default: that of the file, as far as Modelica allows it.
    outputs, inputs : str or sequence of str, optional
        Names or patterns of those to export; default: all.

    Returns
    -------
    Path
        The path.

    Raises
    ------
    ExportError
        If there is no system, nothing to write, or the file cannot be written.
    ResponseError
        If the realization, or the name of an output or input, is unknown.
    """
    caller = "to_modelica"
    space = state_space_of(system, realization, caller, outputs, inputs)
    model = identifier(a_path(path, caller, ExportError).stem) if name is None else name
    if not (isinstance(model, str) and re.fullmatch(r"[A-Za-z_][A-Za-z0-9_]*", model)) or model in _RESERVED:
        raise ExportError(f"{caller}: name = {model!r}; expected letters, digits and _ of ASCII, no digit first, and "
                          f"no word of Modelica.")  # fmt: skip
    if not space.states and not space.outputs:
        raise ExportError(f"{caller}: '{space.name}' has no states and no outputs; its model would be empty.")
    check_finite(space, caller)
    text = _model(space, model, flag(connectors, caller, "connectors", ExportError))
    return write_atomic(path, lambda file: file.write(text.encode("utf-8")))


def _model(space: StateSpace, model: str, connectors: bool) -> str:
    names = _variables([*space.states, *space.inputs, *space.outputs], {model})
    n, i = len(space.states), len(space.inputs)
    states, inputs, outputs = names[:n], names[n : n + i], names[n + i :]
    package = "Modelica.Blocks.Interfaces." if connectors else ""
    kinds = (f"{package}RealInput", f"{package}RealOutput") if connectors else ("input Real", "output Real")
    known = [*states, *inputs]
    lines = [
        f"// Written by mbsvib {__version__}. SI units and radians.",
        f"model {model} {_text(f'{space.name}: der(x) = A x + B u, y = C x + D u, {space.realization} states')}",
        *_declared(kinds[0], inputs, space.input_units, space.inputs),
        *_declared(kinds[1], outputs, space.output_units, space.outputs),
        *_declared("Real", states, space.state_units, space.states, "start = 0, fixed = true"),
        "equation",
        *_equations([f"der({state})" for state in states], np.hstack((space.A, space.B)), known),
        *_equations(outputs, np.hstack((space.C, space.D)), known),
        f"end {model};",
    ]  # fmt: skip
    return "\n".join(lines) + "\n"


def _declared(
    kind: str, variables: Sequence[str], units: Sequence[str], names: Sequence[str], more: str = ""
) -> Iterable[str]:
    for variable, unit, name in zip(variables, units, names, strict=True):
        attributes = [f'unit = "{modelica_unit(unit)}"'] if base_unit(unit) else []
        changes = ", ".join([*attributes, *([more] if more else [])])
        yield f"  {kind} {variable}{f'({changes})' if changes else ''} {_text(name)};"


def _equations(left: Sequence[str], matrix: Array, names: Sequence[str]) -> Iterable[str]:
    for name, row in zip(left, matrix.tolist(), strict=True):
        terms = " ".join([f"{'-' if value < 0.0 else '+'} {abs(value)!r}*{variable}"
                          for value, variable in zip(row, names, strict=True) if value])  # fmt: skip
        text = f"{name} = {terms.removeprefix('+ ') or '0'};"
        yield fill(text, WIDTH, initial_indent="  ", subsequent_indent="    ", break_long_words=False,
                   break_on_hyphens=False)  # fmt: skip


def _variables(names: Sequence[str], reserved: set[str]) -> list[str]:
    """Distinct names of variables, as close to the given ones as Modelica allows."""
    used, result = reserved | _RESERVED, []
    for name in names:
        word = re.sub(r"[^A-Za-z0-9_]+", "_", name).strip("_") or "v"
        word = f"v_{word}" if word[0].isdigit() else word
        unique, count = word, 1
        while unique in used:
            count += 1
            unique = f"{word}_{count}"
        used = used | {unique}
        result.append(unique)
    return result


def modelica_unit(unit: str) -> str:
    """Return a unit in Modelica's syntax, such as ``"N.m/rad"`` for ``"N m/rad"`` and ``"m/s2"`` for ``"m/s^2"``."""
    parts = [part.split() for part in unit.replace("^", "").split("/")]
    return "/".join([".".join(part) if i == 0 or len(part) == 1 else f"({'.'.join(part)})"
                     for i, part in enumerate(parts)])  # fmt: skip


def _text(name: str) -> str:
    """A string of Modelica."""
    plain = printable(name).replace("\\", "\\\\").replace('"', '\\"')
    return f'"{plain}"'
