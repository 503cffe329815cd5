"""Commands on parameters: params lists them, sweep varies them."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path
from typing import TYPE_CHECKING

from mbsvib.cli import _shell as shell
from mbsvib.cli._arguments import JSON, MODEL, Command, ModelFile, file_argument, flag, option, positional, whole_number
from mbsvib.cli._lookup import model_of, range_of
from mbsvib.common.patterns import matching
from mbsvib.common.tables import listed as row
from mbsvib.errors import nearest

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from mbsvib.studies.results import Sweep


def params(model: ModelFile, pattern: str = "*", as_json: bool = False) -> None:
    """List the parameters of a model with values and units."""
    known = model_of(model).parameters
    names = _fitting(pattern, known, model.word)
    if as_json:
        shell.say_json([{"name": name, "value": known[name], "unit": known.units[name]} for name in names])
        return
    from mbsvib.common import tables

    rows = [(name, f"{known[name]:.8g}", known.units[name]) for name in names]
    tables.show("Parameters", [("name", "left"), ("value", "right"), ("unit", "left")], rows, [])


def sweep(
    model: ModelFile, ranges: list[str], modes: int = 6, log: bool = False, file: Path | None = None,
    as_json: bool = False,
) -> None:  # fmt: skip
    """Compute natural frequencies over one or more parameters."""
    from mbsvib import studies
    from mbsvib.cli._drawing import check_format, deliver

    check_format(file, table=True)
    if modes < 1:
        raise shell.UsageProblem(f"--modes {modes}: expected how many of the lowest modes, 1 or more.")
    source = model_of(model)
    pairs = [range_of(text, "PARAMETER", "mount.stiffness.z=1e4:1e6:50", log) for text in ranges]
    values = dict(pairs)
    if len(values) < len(pairs):
        twice = next(name for k, (name, _) in enumerate(pairs) if name in [other for other, _ in pairs[:k]])
        raise shell.UsageProblem(f"'{twice}' is given twice; give one range for each parameter.")
    for name in values:
        _fitting(name, source.parameters, model.word)
    count = min(modes, source.linearize().dof)
    result = studies.sweep(source, values, of={f"mode {k + 1} [Hz]": studies.frequency(k + 1) for k in range(count)})
    if as_json:
        shell.say_json({"name": source.name, "parameters": {name: part.tolist() for name, part in values.items()},
                        "natural_hz": [result[f"mode {k + 1} [Hz]"].tolist() for k in range(count)]})  # fmt: skip
    elif file is None:
        from mbsvib.common import tables

        tables.show(**result.table())
    deliver(file, as_json, lambda: _over_ranges(result), result.columns)


def _over_ranges(result: Sweep) -> Figure:
    """The natural frequencies of all modes asked for over what varies."""
    import numpy as np

    from mbsvib.plots.studies import over_variables

    label = "natural frequency" if len(result.results) > 1 else "natural frequency of mode 1"
    return over_variables(
        np.stack(list(result.results.values()), axis=1), label, result.parameters, result.axes,
        grid=len(result.shape) > 1, units={**result.units, label: "Hz"}, name=result.name,
        entries=[f"{k + 1}" for k in range(len(result.results))],
    )  # fmt: skip


def _fitting(pattern: str, known: Iterable[str], model: str) -> list[str]:
    """The names of parameters that fit a pattern."""
    listed = list(known)
    names = matching(pattern, listed)
    if not names:
        own = [name for name in listed if name.startswith(f"{pattern}.")]
        hint = f" '{pattern}' has {row(own)}." if own else nearest(pattern, listed)
        raise shell.UsageProblem(f"no parameter of the model fits '{pattern}'.{hint} See: mbsvib params {model}.")
    return names


COMMANDS = {
    "params": Command(params, (
        MODEL,
        positional("pattern", "PATTERN", "Names to list, such as 'leg*.stiffness'. Default: all.", nargs="?",
                   default="*", completes="parameter"),
        JSON,
    )),
    "sweep": Command(sweep, (
        MODEL,
        positional("ranges", "PARAMETER=FROM:TO[:COUNT]", "What is varied; several parameters make a grid.", nargs="+",
                   completes="parameter"),
        option("--modes", to="modes", metavar="N", type=whole_number, default=6,
               words="Number of the lowest modes. Default: 6."),
        flag("--log", "log", "Values in equal ratios."),
        file_argument("A figure (.png, .pdf, .svg) or a table (.csv)."),
        JSON,
    )),
}  # fmt: skip
