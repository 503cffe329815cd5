"""The command that compares two models, or a model with measured data."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from mbsvib.cli import _shell as shell
from mbsvib.cli._arguments import JSON, Command, file_argument, positional
from mbsvib.cli._figures import check_format, deliver
from mbsvib.cli._lookup import model_of

if TYPE_CHECKING:
    from mbsvib.api.model import Model
    from mbsvib.cli._arguments import ModelFile
    from mbsvib.measurement.data import Measurement

MEASURED = (".uff", ".unv", ".npz")


def compare(first: ModelFile, second: ModelFile, file: Path | None = None, as_json: bool = False) -> None:
    """Compare modes, responses and parts of two models or measurements."""
    check_format(file)
    import mbsvib as mv

    result = mv.compare(_read(first), _read(second))
    if as_json:
        shell.say_json(result.record())
    else:
        from mbsvib.common import tables

        tables.show(**result.table())
    if file is not None:
        deliver(result.plot(), file, as_json)


def _read(source: ModelFile) -> Model | Measurement:
    """A model, or what was measured, by the suffix of its file."""
    word = source.word
    suffix = Path(word).suffix.lower()
    if suffix not in MEASURED:
        return model_of(source)
    if not Path(word).is_file():
        raise shell.UsageProblem(f"there is no file '{word}'.")
    if suffix == ".npz":
        from mbsvib.measurement.data import Measurement

        return Measurement.from_npz(word)
    from mbsvib_export import from_uff

    return from_uff(word)


WORDS = "Model file, name of a built-in model, or measured data: .uff, .unv or .npz."
COMMANDS = {"compare": Command(compare, (
    positional("first", "A", WORDS, completes="model"),
    positional("second", "B", WORDS, completes="model"),
    file_argument("MAC and differences of the frequencies, as .png, .pdf or .svg."), JSON,
))}  # fmt: skip
