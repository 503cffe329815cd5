"""The command that certifies a model, for CI: exit status 0 if it passes, 1 if not."""

from __future__ import annotations

from typing import TYPE_CHECKING

from mbsvib.cli import _shell as shell
from mbsvib.cli._arguments import JSON, MODEL, Command, ModelFile, file_argument
from mbsvib.cli._lookup import model_of

if TYPE_CHECKING:
    from pathlib import Path


def certify(model: ModelFile, file: Path | None = None, as_json: bool = False) -> None:
    """Check balance, ranks, digits and units of a model, and ask another engine; exit status 1 if a check fails."""
    from mbsvib.certificate import certify as certified

    result = certified(model_of(model))
    if file is not None:
        result.to_json(file)
    if as_json:
        shell.say_json(result.content())
    else:
        shell.say(str(result))
        if file is not None:
            shell.say(f"Written: {shell.shown(file)}")
    if not result.passed:
        raise shell.CheckFailed


COMMANDS = {"certify": Command(certify, (MODEL, file_argument("The certificate as JSON."), JSON))}
