"""Commands that draw: bode and step."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from mbsvib.cli import _shell as shell
from mbsvib.cli._lookup import InputOption, ModelArgument, OutputOption, ports, system_of

if TYPE_CHECKING:
    from matplotlib.figure import Figure

FORMATS = (".png", ".pdf", ".svg")
FileOption = Annotated[
    Path | None, typer.Option("--file", "-f", metavar="FILE", help=f"Where to: {', '.join(FORMATS)}.")
]


def bode(
    model: ModelArgument,
    inputs: InputOption = None,
    outputs: OutputOption = None,
    first: Annotated[float | None, typer.Option("--from", metavar="HZ", help="First frequency [Hz].")] = None,
    last: Annotated[float | None, typer.Option("--to", metavar="HZ", help="Last frequency [Hz].")] = None,
    file: FileOption = None,
) -> None:
    """Draw a Bode plot into a file (default: NAME-bode.png)."""
    _check_format(file)
    system = system_of(model)
    sources, results, remark = ports(system, inputs, outputs)
    from mbsvib import plots

    figure = plots.bode(system, sources, results, span=(first, last))
    _deliver(figure, file, f"{system.name}-bode.png", remark)


def step(
    model: ModelArgument,
    inputs: InputOption = None,
    outputs: OutputOption = None,
    until: Annotated[float | None, typer.Option("--until", metavar="S", help="Last time [s].")] = None,
    file: FileOption = None,
) -> None:
    """Draw responses to unit steps into a file (default: NAME-step.png)."""
    _check_format(file)
    system = system_of(model)
    sources, results, remark = ports(system, inputs, outputs)
    from mbsvib import plots

    _deliver(plots.step(system, sources, results, until), file, f"{system.name}-step.png", remark)


def write_figure(figure: Figure, path: Path) -> Path:
    """Write a figure in the format of the path's suffix, whole or not at all.

    Parameters
    ----------
    figure : matplotlib.figure.Figure
        What to write.
    path : Path
        Where to.

    Returns
    -------
    Path
        The path.

    Raises
    ------
    UsageProblem
        If the suffix is unknown.
    ExportError
        If the file cannot be written.
    """
    from mbsvib_export.whole_file import write_whole

    _check_format(path)
    return write_whole(path, lambda stream: figure.savefig(stream, format=path.suffix[1:].lower()))


def _check_format(path: Path | None) -> None:
    if path is not None and path.suffix.lower() not in FORMATS:
        raise shell.UsageProblem(f"'{path}': figures end in {', '.join(FORMATS)}.")


def _deliver(figure: Figure, file: Path | None, default: str, remark: str) -> None:
    path = write_figure(figure, file if file is not None else Path(default.replace("/", "_")))
    if remark:
        shell.say(remark)
    shell.say(f"Written: {shell.shown(path)}")
