"""The command that compares two models, or a model with measured data."""

from __future__ import annotations

from typing import TYPE_CHECKING

from mbsvib.cli import _shell as shell
from mbsvib.cli._arguments import JSON, Command, file_argument, positional
from mbsvib.cli._figures import check_format, deliver
from mbsvib.cli._lookup import model_or_measurement

if TYPE_CHECKING:
    from pathlib import Path

    from mbsvib.cli._arguments import ModelFile


def compare(first: ModelFile, second: ModelFile, file: Path | None = None, as_json: bool = False) -> None:
    """Compare modes, responses and parts of two models or measurements."""
    check_format(file)
    import mbsvib as mv

    result = mv.compare(model_or_measurement(first), model_or_measurement(second))
    if as_json:
        shell.say_json(result.record())
    else:
        from mbsvib.common import tables

        tables.show(**result.table())
    if file is not None:
        deliver(result.plot(), file, as_json)


WORDS = "Model file, name of a built-in model, or measured data: .uff, .unv or .npz."
COMMANDS = {"compare": Command(compare, (
    positional("first", "A", WORDS, completes="model"),
    positional("second", "B", WORDS, completes="model"),
    file_argument("MAC and differences of the frequencies, as .png, .pdf or .svg."), JSON,
))}  # fmt: skip
