"""The parser of a command: messages of one line with the nearest word, options in any place."""

from __future__ import annotations

from argparse import Action, ArgumentParser, HelpFormatter
from collections.abc import Sequence
from typing import Any, NoReturn

from mbsvib.cli._arguments import ALIGN, Command, ModelFile
from mbsvib.cli._lookup import ROBOTS, given
from mbsvib.cli._shell import UsageProblem
from mbsvib.errors import nearest

EPILOG = "MODEL is a file (.yaml, .json, .xml of MuJoCo, .urdf) or a name that mbsvib models lists."


class Parser(ArgumentParser):
    """An ``ArgumentParser`` whose errors are ``UsageProblem``."""

    def __init__(self, name: str, command: Command) -> None:
        """Prepare a command's arguments."""
        self._models = command.models
        super().__init__(f"mbsvib {name}", description=command.summary, allow_abbrev=False, add_help=False,
                         formatter_class=Formatter, epilog=EPILOG if self._models else None)  # fmt: skip
        for argument in command.arguments:
            self.add_argument(*argument.names, **argument.settings)
        if self._models:
            self.add_argument(*ALIGN.names, **ALIGN.settings)
            group = self.add_argument_group("options of URDF and MJCF files")
            for argument in ROBOTS:
                group.add_argument(*argument.names, **argument.settings)
        self.add_argument("--help", "-h", action="help", help="Show this message and exit.")

    def read(self, words: Sequence[str]) -> dict[str, Any]:
        """Return the values in the ``words`` after the command by the names of the function's arguments."""
        values, rest = self.parse_known_intermixed_args(list(words))
        if rest:
            known = [name for action in self._actions for name in action.option_strings]
            kind = "option" if rest[0].startswith("-") else "argument"
            word = rest[0].lstrip("-").partition("=")[0]
            bare = [action.metavar for action in self._actions if not action.option_strings and action.dest == word]
            hint = f" {bare[0]} is given by its value alone." if bare else nearest(rest[0], known)
            self.error(f"there is no {kind} '{rest[0]}' here.{hint}")
        result = vars(values)
        options, align = (given(result), result.pop("align")) if self._models else ({}, None)
        return result | {name: ModelFile(result[name], options, align) for name in self._models
                         if result[name] is not None}  # fmt: skip

    def error(self, message: str) -> NoReturn:
        """Raise the problem that argparse has met."""
        message = message[0].lower() + message[1:]
        end = "" if message.endswith((".", "?")) else "."
        raise UsageProblem(f"{self.prog.removeprefix('mbsvib ')}: {message}{end} See: {self.prog} --help.")


class Formatter(HelpFormatter):
    """Help with the metavar of an option once, and defaults as the commands say them."""

    def __init__(self, prog: str, **settings: Any) -> None:
        """Prepare wide columns."""
        super().__init__(prog, max_help_position=32, **settings)

    def _format_action_invocation(self, action: Action) -> str:
        if not action.option_strings or action.nargs == 0:
            return super()._format_action_invocation(action)
        return f"{', '.join(action.option_strings)} {self._format_args(action, str(action.metavar))}"
