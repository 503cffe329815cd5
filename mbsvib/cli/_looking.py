"""Commands that print: models, modes, check, schema."""

from __future__ import annotations

from mbsvib.cli import _shell as shell
from mbsvib.cli._arguments import JSON, MODEL, Command, ModelFile, flag
from mbsvib.cli._lookup import system_of


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
    """Print natural frequencies, damping ratios and what moves most in each mode."""
    if as_csv and as_json:
        raise shell.UsageProblem("modes: --csv and --json together; choose one of them.")
    from mbsvib.common import tables

    result = system_of(model).modes()
    if as_csv or as_json:
        from mbsvib.cli import _records as records

        shell.say(records.json_text(result) if as_json else records.csv_text(result).rstrip("\n"))
        return
    tables.show(**result.table())


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
