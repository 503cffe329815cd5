"""Commands that print: models, modes, check, certify, schema."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

from mbsvib.cli import _shell as shell
from mbsvib.cli._arguments import JSON, MODEL, Command, ModelFile, file_argument, flag, number, option, whole_number
from mbsvib.cli._lookup import model_of, system_of

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


def modes(
    model: ModelFile, count: int | None = None, near: float = 0.0, as_csv: bool = False, as_json: bool = False
) -> None:
    """Print natural frequencies, damping ratios and the largest motion of each mode."""
    if as_csv and as_json:
        raise shell.UsageProblem("modes: --csv and --json together; choose one of them.")
    if near and count is None:
        raise shell.UsageProblem(f"--near {near:g}: say how many modes are wanted by --count.")
    if count is not None and count < 1:
        raise shell.UsageProblem(f"--count {count}: expected how many modes, 1 or more.")
    from mbsvib.common import tables

    system = system_of(model)
    result = system.modes(count, near=near) if system.kind == "sparse system" else system.modes()
    which = sorted(sorted(range(len(result)), key=lambda k: abs(result.frequencies[k] - near))[:count])
    columns = {name: [column[k] for k in which] for name, column in _columns(result).items()}
    if as_json:
        rows = [dict(zip(columns, row, strict=True)) for row in zip(*columns.values(), strict=True)]
        shell.say_json({"name": result.name, "dof": len(result.coordinates), "modes": rows})
    elif as_csv:
        from mbsvib.common.columnar import csv_text

        shell.say(csv_text(columns).rstrip("\n"))
    else:
        table = result.table()
        tables.show(**{**table, "rows": [table["rows"][k] for k in which]})


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
        "largest_motion": list(map(" ".join, modes.strongest())),
    }  # fmt: skip


def check(model: ModelFile, as_json: bool = False) -> None:
    """Load and linearize a model and explain what was found; exit status 1 if it is faulty."""
    system = system_of(model)
    if as_json and system.kind == "sparse system":
        shell.say_json({"name": system.name, "dof": system.dof, "inputs": system.inputs, "outputs": system.outputs})
        return
    if as_json:
        modes = system.modes()
        shell.say_json({
            "name": system.name, "dof": system.dof, "coordinates": system.coordinates, "inputs": system.inputs,
            "outputs": system.outputs, "cut_joints": system.cut_joints, "redundant": system.redundant,
            "natural_hz": modes.frequencies.tolist(), "remarks": list(modes.remarks()),
        })  # fmt: skip
        return
    shell.say(system.explain())
    if system.kind == "sparse system":
        return
    modes = system.modes()
    shell.say("modes")
    if len(modes):
        reach = " to ".join(dict.fromkeys(f"{modes.frequencies[i]:.6g}" for i in (0, -1)))
        shell.say(f"  {len(modes)}, {reach} Hz")
    for remark in modes.remarks():
        shell.say(f"  {remark}")


def certify(model: ModelFile, file: Path | None = None, as_json: bool = False) -> None:
    """Check balance, ranks, digits and units of a model, and ask another engine; exit status 1 if a check fails."""
    from mbsvib.certificate import certify as certified

    result = certified(model_of(model))
    if file is not None:
        result.to_json(file)
    shell.answer(as_json, result.content(), result, *([] if file is None else [f"Written: {shell.shown(file)}"]))
    if not result.passed:
        raise shell.CheckFailed


def schema(as_json: bool = True) -> None:
    """Print the JSON schema of model files, for editors that check and complete them."""
    import json

    from mbsvib.files import schema as of_files

    shell.say(json.dumps(of_files(), indent=2))


CSV = flag("--csv", "as_csv", "Print comma-separated values with every digit.")
COMMANDS = {
    "models": Command(models, (JSON,)),
    "modes": Command(modes, (
        MODEL,
        option("--count", to="count", metavar="N", type=whole_number,
               words="How many of the lowest modes. Default: all, of models of at most some hundred bodies."),
        option("--near", to="near", metavar="HZ", type=number, default=0.0,
               words="Those nearest to this frequency in their place [Hz]."),
        CSV, JSON,
    )),
    "check": Command(check, (MODEL, JSON)),
    "certify": Command(certify, (MODEL, file_argument("The certificate as JSON."), JSON)),
    "schema": Command(schema, (JSON,)),
}
