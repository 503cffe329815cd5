"""Arguments of commands as data: what the parser, the help and the completion of the shell are made of."""

from __future__ import annotations

from argparse import ArgumentTypeError
from collections.abc import Callable
from pathlib import Path
from typing import Any, Literal, NamedTuple, TypeAlias

from mbsvib.common.number_text import integer, real

# names in the model on the line
Named: TypeAlias = Literal["input", "output", "body", "parameter", "coordinate", "spring", "joint"]
Candidates: TypeAlias = Named | Literal["", "model", "file"] | tuple[str, ...]  # or these words


class ModelFile(NamedTuple):
    """A model on the command line: a path or a built-in name, the options with which its file is read, and the
    tolerance within which axes of loops are aligned.
    """

    word: str
    options: dict[str, Any] = {}  # noqa: RUF012 (a default that nothing changes)
    align: float | None = None


class Argument(NamedTuple):
    """An argument of a command: names and settings as ``ArgumentParser.add_argument`` takes them."""

    names: tuple[str, ...]
    settings: dict[str, Any]
    completes: Candidates = ""  # what the shell proposes

    @property
    def optional(self) -> bool:
        """Whether it is known by its name."""
        return self.names[0].startswith("-")

    @property
    def takes_value(self) -> bool:
        """Whether it is an option with a value behind it."""
        return self.optional and self.settings.get("action") != "store_true"


class Command(NamedTuple):
    """A command: a function with one keyword argument for each of ``arguments``; its docstring is the help."""

    run: Callable[..., None]
    arguments: tuple[Argument, ...]

    @property
    def models(self) -> list[str]:
        """The names of those arguments that are models."""
        return [one.settings.get("dest", one.names[0]) for one in self.arguments if one.completes == "model"]

    @property
    def summary(self) -> str:
        """The first sentence of the help."""
        return (self.run.__doc__ or "").split("\n\n")[0].replace("\n    ", " ")


def positional(name: str, metavar: str, words: str, *, completes: Candidates = "", **settings: Any) -> Argument:
    """Return an argument that is known by its place."""
    return Argument((name,), {"metavar": metavar, "help": words, **settings}, completes)


def option(
    *names: str, to: str, metavar: str | tuple[str, ...], words: str, completes: Candidates = "", **settings: Any
) -> Argument:
    """Return an option with a value, or with one for each of ``metavar``; ``to`` is the function's argument."""
    return Argument(names, {"dest": to, "metavar": metavar, "help": words, **settings}, completes)


def flag(name: str, to: str, words: str) -> Argument:
    """Return an option without a value; ``to`` is the function's argument."""
    return Argument((name,), {"dest": to, "action": "store_true", "help": words})


def number(text: str) -> float:
    """Return a number."""
    try:
        return real(text)
    except ValueError:
        raise ArgumentTypeError(f"expected a number, such as 0.5 or 1e-3, and not '{text[:40]}'") from None


def whole_number(text: str) -> int:
    """Return an integer."""
    try:
        return integer(text)
    except ValueError:
        raise ArgumentTypeError(f"expected a whole number, such as 3, and not '{text[:40]}'") from None


MODEL = positional("model", "MODEL", "Model file, or name of a built-in model.", completes="model")
INPUTS = option("--input", "-i", to="inputs", metavar="NAME", action="append", completes="input",
                words="Input; may be given several times.")  # fmt: skip
OUTPUTS = option("--output", to="outputs", metavar="NAME", action="append", completes="output",
                 words="Output; may be given several times.")  # fmt: skip
FIRST = option("--from", to="first", metavar="HZ", type=number, words="First frequency [Hz].")
LAST = option("--to", to="last", metavar="HZ", type=number, words="Last frequency [Hz].")
ALIGN = option(
    "--align", to="align", metavar="TOLERANCE", type=number,
    words="Axes of joints that are by up to this off parallel [rad], or off a common line or point [share of the "
          "loops' size], are taken as meant so, in loops that gain freedom by it, such as 1e-3.",
)  # fmt: skip
JSON = flag("--json", "as_json", "Print JSON with every digit.")


def file_argument(words: str, *, required: bool = False) -> Argument:
    """Return the option ``-o FILE``."""
    return option("--file", "-o", to="file", metavar="FILE", type=Path, required=required, words=words,
                  completes="file")  # fmt: skip
