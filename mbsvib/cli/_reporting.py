"""The command that writes a report for a browser."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from mbsvib.cli import _shell as shell
from mbsvib.cli._lookup import ModelArgument, model_of

NamesOption = list[str] | None


def report(
    model: ModelArgument,
    file: Annotated[
        Path | None, typer.Option("--file", "-o", metavar="FILE", help="Where to (default: NAME-report.html).")
    ] = None,
    inputs: Annotated[
        NamesOption, typer.Option("--input", "-i", metavar="NAME", help="Input to show; may be given several times.")
    ] = None,
    outputs: Annotated[
        NamesOption, typer.Option("--output", metavar="NAME", help="Output to show; may be given several times.")
    ] = None,
) -> None:
    """Write one page for a browser: the model in 3-D, its modes in motion, any Bode plot, topology, accuracy."""
    if file is not None and file.suffix.lower() not in (".html", ".htm"):
        raise shell.UsageProblem(f"'{file}': reports end in .html.")
    source = model_of(model)
    from mbsvib.report import write

    path = file if file is not None else Path(f"{source.name}-report.html".replace("/", "_"))
    write(source, path, outputs or None, inputs or None)
    shell.say(f"Written: {shell.shown(path)} ({path.stat().st_size / 1e6:.1f} MB, needs no network)")
