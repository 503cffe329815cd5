"""Commands that study a mechanism as a whole: equilibrium and isolation."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from mbsvib.cli import _shell as shell
from mbsvib.cli._drawing import FileOption, write_figure
from mbsvib.cli._looking import JsonOption
from mbsvib.cli._lookup import ModelArgument, model_of


def equilibrium(
    model: ModelArgument,
    file: Annotated[Path | None, typer.Option("--output", "-o", metavar="FILE", help="Model file (.yaml, .json) of the "
                                              "mechanism there.")] = None,
    preload: Annotated[list[str] | None, typer.Option("--preload", metavar="NAME", help="Springs or patterns whose "
                                                      "preloads hold the pose as described.")] = None,
    as_json: JsonOption = False,
) -> None:
    """Find the equilibrium of a mechanism under its loads."""
    found = model_of(model).equilibrium(preload or None, report=True)
    if file is not None:
        from mbsvib.files import save

        save(found.model, file)
    if as_json:
        shell.say_json({
            "name": found.model.name, "stable": found.stable, "iterations": found.iterations,
            "displacements": {name: motion.tolist() for name, motion in found.displacements.items()},
        })  # fmt: skip
    else:
        shell.say(str(found))
    if file is not None and not as_json:
        shell.say(f"Written: {shell.shown(file)}")


def isolation(
    model: ModelArgument,
    body: Annotated[str, typer.Argument(metavar="BODY", help="The isolated body.")],
    base: Annotated[str, typer.Option("--base", metavar="BODY", help="What is shaken.")] = "ground",
    file: FileOption = None,
    as_json: JsonOption = False,
) -> None:
    """Print how well a body is isolated from the motion of its base, and draw its transmissibility."""
    from mbsvib import isolation as isolating
    from mbsvib.common import tables

    result = isolating.study(model_of(model), body, base)
    if as_json:
        shell.say_json({
            "name": result.name, "body": body, "base": base, "amplification": result.amplification,
            "frequencies": result.frequencies.tolist(), "index": result.index.tolist(),
        })  # fmt: skip
    else:
        tables.show(shell.console(), **result.table())
    if file is not None:
        from mbsvib import plots

        write_figure(plots.isolation(result), file)
        if not as_json:
            shell.say(f"Written: {shell.shown(file)}")
