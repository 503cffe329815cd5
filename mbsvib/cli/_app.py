"""The application: its commands, the options that all of them share, and how they end."""

from __future__ import annotations

from collections.abc import Sequence

from mbsvib.cli import _shell as shell
from mbsvib.cli._commands import HOMES, OPTIONS, command_of
from mbsvib.cli._parser import EPILOG, Parser
from mbsvib.version import __version__

DESCRIPTION = "Vibration of multibody mechanisms: modes, Bode plots, step responses and state-space models."


def run(words: Sequence[str]) -> int:
    """Run the command line and return the exit status.

    0; 1 for a faulty model or a check that failed; 2 for a wrong command line; 130 if interrupted.
    """
    if words[:1] in (["--complete"], ["--complete-line"]):
        from mbsvib.cli import _completion as completion

        asked = list(words[1:])
        fitting = completion.candidates(asked) if words[0] == "--complete" else completion.line_candidates(*asked)
        shell.say("\n".join(fitting))
        return 0
    debug = shell.DEBUG in words
    with shell.as_messages(debug) as status:
        _run([word for word in words if word != shell.DEBUG])
    return status.value


def _run(words: list[str]) -> None:
    if not words or words[0] in ("--help", "-h"):
        shell.say(_help())
    elif words[0] == "--version":
        shell.say(f"mbsvib {__version__}")
    elif words[0] in ("--install-completion", "--show-completion"):
        from mbsvib.cli import _completion as completion

        completion.install(*words[1:2]) if words[0] == "--install-completion" else completion.show(*words[1:2])
    else:
        command = command_of(words[0])
        command.run(**Parser(words[0], command).read(words[1:]))


def _help() -> str:
    rows = {"Commands": {name: command_of(name).summary for name in HOMES}, "Options": OPTIONS}
    lines = ["Usage: mbsvib COMMAND ...", "", DESCRIPTION]
    for title, entries in rows.items():
        width = max(map(len, entries))
        lines += ["", f"{title}:", *(f"  {name:<{width}}  {words}" for name, words in entries.items())]
    return "\n".join([*lines, "", EPILOG, "mbsvib COMMAND --help shows the options of a command."])
