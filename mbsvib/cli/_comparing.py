"""Commands that compare two models or a model with measured data, and that write a report for a browser."""

from __future__ import annotations

from pathlib import Path

from mbsvib.cli import _shell as shell
from mbsvib.cli._arguments import INPUTS, JSON, MODEL, OUTPUTS, Command, ModelFile, file_argument, option, positional
from mbsvib.cli._budgeting import densities_of, noise_argument
from mbsvib.cli._drawing import check_format, deliver
from mbsvib.cli._lookup import model_of, model_or_measurement, system_of


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
    deliver(file, as_json, result.plot)


def report(
    model: ModelFile, file: Path | None = None, inputs: list[str] | None = None, outputs: list[str] | None = None,
    as_json: bool = False, compare: ModelFile | None = None, noise: list[str] | None = None,
) -> None:  # fmt: skip
    """Write one page for a browser: the model in 3-D, its modes in motion, any Bode plot, topology, accuracy.

    With ``--compare`` the page has the modes of both side by side, their responses in one figure, and differences.
    With ``--noise`` it has the error budget of the outputs.
    """
    if file is not None and file.suffix.lower() not in (".html", ".htm"):
        raise shell.UsageProblem(f"'{file}': reports end in .html.")
    source = model_of(model)
    from mbsvib.report import write

    path = file if file is not None else Path(f"{source.name}-report.html".replace("/", "_"))
    plant = system_of(model) if noise else None
    budget = plant.budget(densities_of(noise or [], plant), outputs or None) if plant is not None else None
    if compare is None:
        write(source, path, outputs or None, inputs or None, budget=budget)
    else:
        other, names = model_or_measurement(compare), (Path(model.word).stem, Path(compare.word).stem)
        write(source, path, outputs or None, inputs or None, compare=other,
              names=names if names[0] != names[1] else (model.word, compare.word), budget=budget)  # fmt: skip
    size = path.stat().st_size
    if as_json:
        shell.say_written(path, as_json, bytes=size)
    else:
        shell.say(f"Written: {shell.shown(path)} ({size / 1e6:.1f} MB, needs no network)")


WORDS = "Model file, name of a built-in model, or measured data: .uff, .unv or .npz."
COMMANDS = {
    "compare": Command(compare, (
        positional("first", "A", WORDS, completes="model"),
        positional("second", "B", WORDS, completes="model"),
        file_argument("MAC and differences of the frequencies, as .png, .pdf or .svg."),
        JSON,
    )),
    "report": Command(report, (
        MODEL, INPUTS, OUTPUTS, file_argument("Where to. Default: NAME-report.html."),
        option("--compare", to="compare", metavar="MODEL", completes="model",
               words="Model or measured data to compare with: .uff, .unv or .npz."),
        noise_argument(),
        JSON,
    )),
}  # fmt: skip
