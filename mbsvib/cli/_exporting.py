"""The command that writes systems and models for other tools."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from mbsvib.cli import _shell as shell
from mbsvib.cli._lookup import ModelArgument, model_of
from mbsvib.errors import nearest

KINDS = {
    ".json": "the linear system with names and units as JSON",
    ".npz": "the linear system with names and units as numpy arrays",
    ".yaml": "the model itself, to be edited",
}


def export(
    model: ModelArgument,
    file: Annotated[Path, typer.Option("--output", "-o", metavar="FILE", help=f"Where to: {', '.join(KINDS)}.")],
    realization: Annotated[
        str, typer.Option("--states", metavar="KIND", help="States of the state space: physical, modal or balanced.")
    ] = "physical",
) -> None:
    """Write the linear system (.json, .npz) or the model (.yaml), by the suffix of the file."""
    suffix = file.suffix.lower()
    if suffix not in KINDS:
        known = "; ".join(f"{each}: {words}" for each, words in KINDS.items())
        hint = nearest(suffix, KINDS)
        raise shell.UsageProblem(f"'{file}': no format goes by the suffix '{suffix}'.{hint} Known: {known}.")
    source = model_of(model)
    if suffix == ".yaml":
        from mbsvib.files import save

        save(source, file)
    else:
        import mbsvib_export as mx

        write = mx.to_json if suffix == ".json" else mx.to_npz
        write(source.linearize(), file, realization=realization)
    shell.say(f"Written: {shell.shown(file)} ({KINDS[suffix]})")
