"""Terminal output of the commands: text, warnings and errors as messages, exit status."""

from __future__ import annotations

import sys
import warnings
from contextlib import contextmanager
from dataclasses import dataclass
from math import isfinite
from typing import TYPE_CHECKING, Any

from mbsvib.cli._wording import in_commands
from mbsvib.common import tables
from mbsvib.errors import (
    AccuracyWarning,
    LargeDisplacementWarning,
    LeftOutWarning,
    MbsvibError,
    NearSingularWarning,
    ResponseError,
    UndeterminedForceWarning,
    UnstableWarning,
)

if TYPE_CHECKING:
    from collections.abc import Iterator
    from pathlib import Path

DEBUG = "--debug"
FAILED, MISUSED, INTERRUPTED = 1, 2, 130

class UsageProblem(MbsvibError):
    """A command line with invalid arguments: exit status 2; a faulty model has 1."""


class CheckFailed(Exception):
    """What a command checked is not as it should be, which it has printed: exit status 1."""


@dataclass
class Status:
    """Exit status of a command, 0 until something goes wrong."""

    value: int = 0


@contextmanager
def as_messages(debug: bool) -> Iterator[Status]:
    """Print errors that mbsvib raises on purpose, and its warnings, as lines on standard error."""
    status = Status()
    with warnings.catch_warnings():
        for category in (NearSingularWarning, AccuracyWarning, LargeDisplacementWarning, LeftOutWarning,
                         UndeterminedForceWarning, UnstableWarning):  # fmt: skip
            warnings.simplefilter("always", category)
        warnings.showwarning = _show_warning
        try:
            yield status
            sys.stdout.flush()
        except CheckFailed:
            status.value = FAILED
        except BrokenPipeError:  # whoever read the output has seen enough
            status.value = FAILED
            _close_output()
        except KeyboardInterrupt:
            if debug:
                raise
            complain("interrupted")
            status.value = INTERRUPTED
        except (MbsvibError, OSError) as error:
            if debug:
                raise
            complain(f"error: {in_commands(str(error))}")
            status.value = MISUSED if isinstance(error, (UsageProblem, ResponseError)) else FAILED
        except SystemExit as end:  # --help of a command
            status.value = int(end.code or 0)


def _close_output() -> None:
    """Send what is left of standard output nowhere, so that the interpreter does not complain at its end."""
    import os

    try:
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
    except OSError:  # it has no file
        return


def say(words: str) -> None:
    """Print lines without colours or wrapping, in ASCII if standard output supports nothing else."""
    print(words if tables.encodable(words) else tables.to_ascii(words))


def say_json(content: Any) -> None:
    """Print a value as JSON with every digit; numbers that JSON does not have become null."""
    import json

    print(json.dumps(_finite(content), indent=1, allow_nan=False))


def say_written(path: Path, as_json: bool, **more: Any) -> None:
    """Print which file was written."""
    if as_json:
        say_json({"file": str(path), **more})
    else:
        say(f"Written: {shown(path)}")


def _finite(content: Any) -> Any:
    if isinstance(content, dict):
        return {key: _finite(value) for key, value in content.items()}
    if isinstance(content, (list, tuple)):
        return [_finite(value) for value in content]
    return None if isinstance(content, float) and not isfinite(content) else content


def complain(words: str) -> None:
    """Print a message on standard error."""
    print(words if tables.encodable(words, sys.stderr.encoding) else tables.to_ascii(words), file=sys.stderr)


def shown(path: Path) -> str:
    """Return a path as the user would type it: relative to the current folder if it is in there."""
    from pathlib import Path

    try:
        return str(path.resolve().relative_to(Path.cwd()))
    except (ValueError, OSError):
        return str(path)


def _show_warning(message: Warning | str, category: type[Warning], *_: Any, **__: Any) -> None:
    complain(f"warning: {in_commands(str(message))}")
