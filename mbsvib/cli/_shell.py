"""Terminal output of the commands: text, warnings and errors as messages, exit status."""

from __future__ import annotations

import sys
import warnings
from math import isfinite
from typing import TYPE_CHECKING, Any

import typer
from typer.core import TyperGroup

from mbsvib.common import tables
from mbsvib.errors import (
    AccuracyWarning,
    LargeDisplacementWarning,
    LeftOutWarning,
    MbsvibError,
    NearSingularWarning,
    ResponseError,
    UndeterminedForceWarning,
)

if TYPE_CHECKING:
    from pathlib import Path

    from rich.console import Console

DEBUG = "--debug"
FAILED, MISUSED = 1, 2


class UsageProblem(MbsvibError):
    """A command line with invalid arguments: exit status 2; a faulty model has 1."""


class Group(TyperGroup):
    """The commands, with mbsvib's errors and warnings as readable messages on standard error."""

    def parse_args(self, ctx: Any, args: list[str]) -> list[str]:
        """Accept ``--debug`` at any position."""
        ctx.meta[DEBUG] = DEBUG in args
        return super().parse_args(ctx, [word for word in args if word != DEBUG])

    def invoke(self, ctx: Any) -> Any:
        """Run a command; an error that mbsvib raises on purpose ends it with a message and a status."""
        with warnings.catch_warnings():
            for category in (NearSingularWarning, AccuracyWarning, LargeDisplacementWarning, LeftOutWarning,
                             UndeterminedForceWarning):  # fmt: skip
                warnings.simplefilter("always", category)
            warnings.showwarning = _show_warning
            try:
                return super().invoke(ctx)
            except (MbsvibError, OSError) as error:
                if ctx.meta[DEBUG] or isinstance(error, BrokenPipeError):
                    raise
                complain(f"error: {error}")
                raise typer.Exit(MISUSED if isinstance(error, (UsageProblem, ResponseError)) else FAILED) from error


def console() -> Console:
    """Return a console on standard output as it is now."""
    from rich.console import Console

    return Console(highlight=False)


def say(words: str) -> None:
    """Print lines without colours or wrapping, in ASCII if standard output supports nothing else."""
    typer.echo(words if tables.encodable(words) else tables.to_ascii(words))


def say_json(content: Any) -> None:
    """Print a value as JSON with every digit; numbers that JSON does not have become null."""
    import json

    typer.echo(json.dumps(_finite(content), indent=1, allow_nan=False))


def _finite(content: Any) -> Any:
    if isinstance(content, dict):
        return {key: _finite(value) for key, value in content.items()}
    if isinstance(content, (list, tuple)):
        return [_finite(value) for value in content]
    return None if isinstance(content, float) and not isfinite(content) else content


def complain(words: str) -> None:
    """Print a message on standard error."""
    typer.echo(words if tables.encodable(words, sys.stderr.encoding) else tables.to_ascii(words), err=True)


def shown(path: Path) -> str:
    """Return a path as the user would type it: relative to the current folder if it is in there."""
    from pathlib import Path

    try:
        return str(path.resolve().relative_to(Path.cwd()))
    except (ValueError, OSError):
        return str(path)


def _show_warning(message: Warning | str, category: type[Warning], *_: Any, **__: Any) -> None:
    complain(f"warning: {message}")
