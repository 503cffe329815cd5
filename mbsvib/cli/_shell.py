"""Terminal output of the commands: text, exit status, and messages of the library in the words of the command line."""

from __future__ import annotations

import re
import sys
import warnings
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from math import isfinite
from typing import TYPE_CHECKING, Any

from mbsvib import errors
from mbsvib.common import tables

if TYPE_CHECKING:
    from pathlib import Path


def _options(match: re.Match[str]) -> str:
    """``outputs=['x', 'y']`` as options, one for each name."""
    option = {"leave": "--leave", "legs": "--legs"}.get(match[1], f"--{match[1].removesuffix('s')}")
    names = re.findall(r"'([^']*)'", match[2]) or ["NAME"]
    return " ".join(f"{option} {name}" for name in names)


def _field(match: re.Match[str]) -> str:
    """A field of Python as one of a model file: ``follower=True`` is ``follower: true``."""
    value = match[2].strip("'\"")
    return f"{match[1]}: {value.lower() if value in ('True', 'False') else 'null' if value == 'None' else value}"


def _entry(match: re.Match[str]) -> str:
    """A call that adds a part as an entry of a model file: ``add_maxwell()`` is one of springs, with its type."""
    from mbsvib.files.words import ALL_SECTIONS

    section, kinds = next(((name, kinds) for name, kinds in ALL_SECTIONS.items() if match[1] in kinds), (match[1], ()))
    return f"an entry of {section} in the model file" + (f" with 'type: {match[1]}'" if match[1] in kinds[1:] else "")


EQUILIBRIUM, MODES, CHECK = "'mbsvib equilibrium MODEL -o FILE.yaml'", "'mbsvib modes MODEL'", "'mbsvib check MODEL'"
# What messages of the library name, and the command line has in its place, in this order.
COMMANDS: list[tuple[re.Pattern[str], str | Callable[[re.Match[str]], str]]] = [
    (re.compile(call), command) for call, command in (
        (r"(?:model\.)?equilibrium\(preload=(\S*?)\)", r"'mbsvib equilibrium MODEL --preload \1 -o FILE.yaml'"),
        (r"model\.equilibrium\(\)(?:\.linearize\(\))?", EQUILIBRIUM),
        (r"(?:model\.)?linearize\(align=([^()]*)\)", r"--align \1"),
        (r"(?:print\(system\.modes\(\)\)|(?:model\.linearize\(\)|system)\.modes\(\))", MODES),
        (r"print\(system\.explain\(\)\)|(?:system\.)?explain\(\)", CHECK),
        (r"modes\(10\), or modes\(10, near=f\)", "--count 10, or --count 10 --near HZ"),
        (r" \(--leave\)", ""),
        (r"both are keywords as well: outputs=\.\.\., inputs=\.\.\.\.", "their options are --output and --input."),
        (r"; 'modes\.stable' tells where", ""),
        (r"\w+=\w+ \((--\w+)\)", r"\1"),
        (r"\w+\(\.\.\., \w+=[^()]*\), or (--)", r"\1"),
        (r"connections=\{[^{}]*\}, on the command line by ", ""),
        (r"check_export\(\.\.\., run=True\)", "--run"),
        (r"\w+\(\.\.\., pose=\.\.\.\)(?: does)?", "--pose JOINT=Q"),
        (r"model\.moved\(\)", "another --pose JOINT=Q"),
        (r"(?:\w+\(\.\.\., )?platforms=[('\"]*([\w.-]+)['\",)]*\)?", r"--platforms \1"),
        (r"realization=['\"](\w+)['\"]", r"--realization \1"),
        (r"(?:loop\.)?sampled\(rate\)", "--rate HZ"),
        (r"ask loop\.continuous", "leave out --rate"),
        (r"\bplots\.\w+: ", ""),
        (r"free=\(directions\)", "free: [directions]"),
        (r"workers=(\d+)", r"--workers \1"),
        (r"\b(outputs|inputs|actuators|sensors|legs|leave)=\[([^\]]+)\]", _options),
        (r"(?:model\.)?\badd_(\w+)\b(?:\(\))?", _entry),
        (r"\b(follower|grounded|shear|absolute|quantity|second_order|free|kind|axis)"
         r"=(True|False|None|'[^']*'|\"[^\"]*\"|\w+)", _field),
    )]  # fmt: skip
# What no command stands for is said to be of Python: calls, attributes of known objects, and arguments.
ARGUMENTS = r"\((?:[^()]|\([^()]*\))*\)"
PYTHON = re.compile(
    rf"(?<![\w'/])((?:\w+\.)*\.?(?!sqrt|diag)[a-z]\w{{3,}}{ARGUMENTS}(?:\.[a-z_]+(?:{ARGUMENTS})?)*"
    r"|(?:model|system|loop|isolation|mv|plant)\.(?:actuated|continuous|cycle|feedback|goals|linearize|load|open_loop"
    r"|shaped|simulate|truncation_error|tunable|with_values)\b"
    r"|[a-z_]+=(?:True|False|None|'[^']*'|\[[^\]]*\]))(?!:)")


def in_commands(words: str) -> str:
    """Return a message that names calls of Python with the commands, options and entries that do the same.

    What only Python does is marked so.
    """
    for call, command in COMMANDS:
        words = call.sub(command, words)
    return PYTHON.sub(r"\1 in Python", words)


DEBUG = "--debug"
FAILED, MISUSED, INTERRUPTED = 1, 2, 130

class UsageProblem(errors.MbsvibError):
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
        for name in errors.__all__:
            if name.endswith("Warning"):
                warnings.simplefilter("default", getattr(errors, name))  # each text once
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
        except (errors.MbsvibError, OSError) as error:
            if debug:
                raise
            complain(f"error: {in_commands(str(error))}")
            status.value = MISUSED if isinstance(error, (UsageProblem, errors.ResponseError)) else FAILED
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


def answer(as_json: bool, record: Any, *results: object) -> None:
    """Print a record as JSON, or results as text."""
    if as_json:
        say_json(record)
    else:
        for result in results:
            say(str(result))


def say_written(path: Path, as_json: bool, **more: Any) -> None:
    """Print which file was written, as JSON or in words."""
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
