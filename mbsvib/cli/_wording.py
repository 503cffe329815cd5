"""Messages of the library in the words of the command line: commands, options, and entries of model files."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Callable


def _options(match: re.Match[str]) -> str:
    """``outputs=['x', 'y']`` as options, one for each name."""
    option = {"leave": "--leave", "legs": "--legs"}.get(match[1], f"--{match[1].removesuffix('s')}")
    names = re.findall(r"'([^']*)'", match[2]) or ["NAME"]
    return " ".join(f"{option} {name}" for name in names)


def _field(match: re.Match[str]) -> str:
    """A field of Python as one of a model file: ``follower=True`` is ``follower: true``."""
    value = match[2].strip("'\"")
    return f"{match[1]}: {value.lower() if value in ('True', 'False') else 'null' if value == 'None' else value}"


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
        (r"(?:model\.)?\badd_(\w+)\b(?:\(\))?", r"an entry of \1s in the model file"),
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
