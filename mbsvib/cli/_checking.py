"""Commands that read exports again, for CI: exit status 0 if all is well, 1 if not."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from mbsvib.cli import _shell as shell
from mbsvib.cli._lookup import system_of


def check_export(
    file: Annotated[Path, typer.Argument(metavar="FILE", help="What mbsvib export wrote.")],
    model: Annotated[
        str | None, typer.Argument(metavar="[MODEL]", help="The model that it came from: a file or a built-in name.")
    ] = None,
    limit: Annotated[float, typer.Option("--limit", metavar="ERROR", help="Largest relative error to pass.")] = 1e-6,
    run: Annotated[
        bool, typer.Option("--run", help="Load the binary of an .fmu and compare its answers. It is a program: only if "
                           "you trust the file.")
    ] = False,
) -> None:
    """Read an export again and compare frequency response and poles with the model; exit status 1 if they differ."""
    import mbsvib_export as mx

    result = mx.check_export(file, None if model is None else system_of(model), limit, run=run)
    shell.say(str(result))
    if not result.passed:
        raise typer.Exit(shell.FAILED)
