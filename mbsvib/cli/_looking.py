"""Commands that print: models, modes, check, schema."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from mbsvib.cli import _shell as shell
from mbsvib.cli._arguments import JSON, MODEL, Command, ModelFile, flag
from mbsvib.cli._lookup import system_of

if TYPE_CHECKING:
    from mbsvib.modes import Modes


def models(as_json: bool = False) -> None:
    """List the built-in models."""
    from mbsvib import library
    from mbsvib.common import tables

    if as_json:
        shell.say_json([{"name": name, "what": words} for name, (_, words) in library.models().items()])
        return
    rows = [(name, words) for name, (_, words) in library.models().items()]
    note = "Members of the families by the chapter's names too: C50RF1, T5PF1, L20SF1 (size and joint)."
    tables.show("Built-in models", [("name", "left"), ("what it is", "left")], rows, [note])


def modes(model: ModelFile, as_csv: bool = False, as_json: bool = False) -> None:
    """Print natural frequencies, damping ratios and the largest motion of each mode."""
    if as_csv and as_json:
        raise shell.UsageProblem("modes: --csv and --json together; choose one of them.")
    from mbsvib.common import tables

    result = system_of(model).modes()
    if as_json:
        columns = _columns(result)
        rows = [dict(zip(columns, row, strict=True)) for row in zip(*columns.values(), strict=True)]
        shell.say_json({"name": result.name, "dof": len(result), "modes": rows})
    elif as_csv:
        shell.say(csv_text(result).rstrip("\n"))
    else:
        tables.show(**result.table())


def csv_text(modes: Modes) -> str:
    """Return modes as CSV with a header and every digit, lines ended by a line feed."""
    import csv
    from io import StringIO

    columns, stream = _columns(modes), StringIO()
    writer = csv.writer(stream, lineterminator="\n")
    writer.writerow(columns)
    writer.writerows(zip(*columns.values(), strict=True))
    return stream.getvalue()


def _columns(modes: Modes) -> dict[str, list[Any]]:
    """Numbers, frequencies [Hz], damping ratios, both eigenvalues [1/s], errors, and the largest motion, by mode.

    A mode of first order has one eigenvalue, and no second one.
    """
    first, second = modes.pairs.T
    single = [False] * len(modes) if modes.first_order is None else modes.first_order.tolist()
    return {
        "mode": list(range(1, len(modes) + 1)), "natural_hz": modes.frequencies.tolist(),
        "damped_hz": modes.damped_frequencies.tolist(), "damping_ratio": modes.damping_ratios.tolist(),
        "real_1": first.real.tolist(), "imag_1": first.imag.tolist(),
        **{key: [None if alone else value for alone, value in zip(single, values.tolist(), strict=True)]
           for key, values in (("real_2", second.real), ("imag_2", second.imag))},
        "relative_error": modes.pair_errors.max(axis=1, initial=0.0).tolist(),
        "moves_most": list(map(" ".join, modes.strongest())),
    }  # fmt: skip


def check(model: ModelFile, as_json: bool = False) -> None:
    """Load and linearize a model and explain what was found; exit status 1 if it is faulty."""
    system = system_of(model)
    if as_json:
        modes = system.modes()
        shell.say_json({
            "name": system.name, "dof": system.dof, "coordinates": system.coordinates, "inputs": system.inputs,
            "outputs": system.outputs, "cut_joints": system.cut_joints, "redundant": system.redundant,
            "natural_hz": modes.frequencies.tolist(), "remarks": list(modes.remarks()),
        })  # fmt: skip
        return
    shell.say(system.explain())
    modes = system.modes()
    shell.say("modes")
    if len(modes):
        reach = " to ".join(dict.fromkeys(f"{modes.frequencies[i]:.6g}" for i in (0, -1)))
        shell.say(f"  {len(modes)}, {reach} Hz")
    for remark in modes.remarks():
        shell.say(f"  {remark}")


def schema(as_json: bool = True) -> None:
    """Print the JSON schema of model files, for editors that check and complete them."""
    import json

    from mbsvib.files import schema as of_files

    shell.say(json.dumps(of_files(), indent=2))


CSV = flag("--csv", "as_csv", "Print comma-separated values with every digit.")
COMMANDS = {
    "models": Command(models, (JSON,)),
    "modes": Command(modes, (MODEL, CSV, JSON)),
    "check": Command(check, (MODEL, JSON)),
    "schema": Command(schema, (JSON,)),
}
