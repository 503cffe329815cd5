"""Commands that draw: bode, step, draw and animate."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from mbsvib.cli import _shell as shell
from mbsvib.cli._lookup import InputOption, ModelArgument, OutputOption, model_of, ports, system_of

if TYPE_CHECKING:
    from matplotlib.figure import Figure

FORMATS = (".png", ".pdf", ".svg")
MOTIONS = (".gif", ".mp4", ".html")
ViewOption = Annotated[str, typer.Option("--view", metavar="VIEW", help="From where: 3-D, x, y or z.")]
FileOption = Annotated[
    Path | None, typer.Option("--file", "-o", metavar="FILE", help=f"Where to: {', '.join(FORMATS)}.")
]
FirstOption = Annotated[float | None, typer.Option("--from", metavar="HZ", help="First frequency [Hz].")]
LastOption = Annotated[float | None, typer.Option("--to", metavar="HZ", help="Last frequency [Hz].")]


def bode(
    model: ModelArgument, inputs: InputOption = None, outputs: OutputOption = None, first: FirstOption = None,
    last: LastOption = None, file: FileOption = None,
) -> None:  # fmt: skip
    """Draw a Bode plot into a file (default: NAME-bode.png)."""
    _check_format(file)
    system = system_of(model)
    sources, results, remark = ports(system, inputs, outputs)
    from mbsvib import plots

    figure = plots.bode(system, results, sources, span=(first, last))
    _deliver(figure, file, f"{system.name}-bode.png", remark)


def nyquist(
    model: ModelArgument, inputs: InputOption = None, outputs: OutputOption = None, first: FirstOption = None,
    last: LastOption = None, file: FileOption = None,
) -> None:  # fmt: skip
    """Draw frequency responses in the complex plane into a file (default: NAME-nyquist.png)."""
    _check_format(file)
    system = system_of(model)
    sources, results, remark = ports(system, inputs, outputs)
    from mbsvib import plots

    figure = plots.nyquist(system, results, sources, span=(first, last))
    _deliver(figure, file, f"{system.name}-nyquist.png", remark)


def sigma(
    model: ModelArgument, inputs: InputOption = None, outputs: OutputOption = None, first: FirstOption = None,
    last: LastOption = None, file: FileOption = None,
) -> None:  # fmt: skip
    """Draw the singular values of the frequency response into a file (default: NAME-sigma.png)."""
    _check_format(file)
    system = system_of(model)
    from mbsvib import plots

    figure = plots.singular_values(system, outputs or None, inputs or None, span=(first, last))
    _deliver(figure, file, f"{system.name}-sigma.png", "")


def step(
    model: ModelArgument,
    inputs: InputOption = None,
    outputs: OutputOption = None,
    duration: Annotated[float | None, typer.Option("--duration", metavar="SECONDS", help="Time shown.")] = None,
    file: FileOption = None,
) -> None:
    """Draw responses to unit steps into a file (default: NAME-step.png)."""
    _check_format(file)
    system = system_of(model)
    sources, results, remark = ports(system, inputs, outputs)
    from mbsvib import plots

    _deliver(plots.step(system, results, sources, duration), file, f"{system.name}-step.png", remark)


def draw(model: ModelArgument, view: ViewOption = "3-D", file: FileOption = None) -> None:
    """Draw the mechanism into a file (default: NAME-mechanism.png)."""
    _check_format(file)
    source = model_of(model)
    from mbsvib import plots

    _deliver(plots.mechanism(source, view), file, f"{source.name}-mechanism.png", "")


def animate(
    model: ModelArgument,
    mode: Annotated[int, typer.Option("--mode", "-m", metavar="N", help="The mode's number in the table, from 1.")] = 1,
    view: ViewOption = "3-D",
    file: Annotated[
        Path | None, typer.Option("--file", "-o", metavar="FILE", help="Where to: .gif, .mp4 or .html.")
    ] = None,
) -> None:
    """Write a mode in motion into a file (default: NAME-modeN.gif)."""
    if file is not None and file.suffix.lower() not in MOTIONS:
        raise shell.UsageProblem(f"'{file}': motions end in {', '.join(MOTIONS)}.")
    system = system_of(model)
    path = file if file is not None else Path(f"{system.name}-mode{mode}.gif".replace("/", "_"))
    motion = system.modes().animate(mode, path, view=view)
    shell.say(motion.title)
    shell.say(f"Written: {shell.shown(path)}")


def write_figure(figure: Figure, path: Path) -> Path:
    """Write a figure in the format of the path's suffix, completely or not at all.

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
    from mbsvib_export.atomic_file import write_atomic

    _check_format(path)
    return write_atomic(path, lambda stream: figure.savefig(stream, format=path.suffix[1:].lower()))


def _check_format(path: Path | None) -> None:
    if path is not None and path.suffix.lower() not in FORMATS:
        raise shell.UsageProblem(f"'{path}': figures end in {', '.join(FORMATS)}.")


def _deliver(figure: Figure, file: Path | None, default: str, remark: str) -> None:
    path = write_figure(figure, file if file is not None else Path(default.replace("/", "_")))
    if remark:
        shell.say(remark)
    shell.say(f"Written: {shell.shown(path)}")
