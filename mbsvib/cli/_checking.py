"""Commands that read exports again, for CI: exit status 0 if all is well, 1 if not."""

from __future__ import annotations

from pathlib import Path

from mbsvib.cli import _shell as shell
from mbsvib.cli._arguments import JSON, Command, ModelFile, flag, number, option, positional
from mbsvib.cli._lookup import system_of


def check_export(
    file: Path, model: ModelFile | None = None, limit: float = 1e-6, run: bool = False, as_json: bool = False
) -> None:
    """Read an export again and compare frequency response and poles with the model; exit status 1 if they differ."""
    import mbsvib_export as mx

    result = mx.check_export(file, None if model is None else system_of(model), limit, run=run)
    if as_json:
        rows = [{key: getattr(row, key) for key in ("quantity", "against", "error", "limit", "passed")}
                for row in result.comparisons]  # fmt: skip
        shell.say_json({"file": str(file), "passed": result.passed, "comparisons": rows, "remarks": result.remarks})
    else:
        shell.say(str(result))
    if not result.passed:
        raise shell.CheckFailed


COMMANDS = {"check-export": Command(check_export, (
    positional("file", "FILE", "What mbsvib export wrote.", type=Path, completes="file"),
    positional("model", "MODEL", "The model that it came from: a file or a built-in name.", nargs="?",
               completes="model"),
    option("--limit", to="limit", metavar="ERROR", type=number, default=1e-6,
           words="Largest relative error to pass. Default: 1e-6."),
    flag("--run", "run", "Load the binary of an .fmu and compare its answers. It is a program: only if you trust the "
         "file."),
    JSON,
))}  # fmt: skip
