"""The list of commands, and the options that all of them share."""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING

from mbsvib.cli._shell import UsageProblem
from mbsvib.errors import nearest

if TYPE_CHECKING:
    from mbsvib.cli._arguments import Command

# each command, and the file that it is in: only that is imported when it runs
HOMES = {
    "demo": "_demo", "models": "_looking", "modes": "_looking", "bode": "_drawing", "nyquist": "_drawing",
    "sigma": "_drawing", "step": "_drawing", "draw": "_drawing", "animate": "_drawing", "check": "_looking",
    "certify": "_looking",
    "compare": "_comparing", "params": "_parameters", "sweep": "_parameters", "equilibrium": "_studying",
    "path": "_studying", "isolation": "_studying",
    "loop": "_loops", "budget": "_budgeting", "robust": "_loops", "tune": "_tuning",
    "export": "_exporting", "check-export": "_exporting",
    "cosim": "_exporting", "report": "_comparing", "schema": "_looking",
}  # fmt: skip
OPTIONS = {
    "--help, -h": "Show this message and exit.",
    "--version": "Show the version and exit.",
    "--debug": "Show the traceback of an error, with any command.",
    "--install-completion [SHELL]": "Complete words in bash, zsh or fish.",
    "--show-completion [SHELL]": "Print the script that does so.",
}


def command_of(name: str) -> Command:
    """Return a command by its name."""
    if name not in HOMES:
        kind = "option" if name.startswith("-") else "command"
        known = [word.split()[0].rstrip(",") for word in OPTIONS] if kind == "option" else list(HOMES)
        raise UsageProblem(f"there is no {kind} '{name}'.{nearest(name, known)} See: mbsvib --help.")
    commands: dict[str, Command] = import_module(f"mbsvib.cli.{HOMES[name]}").COMMANDS
    return commands[name]
