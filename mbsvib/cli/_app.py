"""The application: its commands and the options that all of them share."""

from __future__ import annotations

from typing import Annotated

import typer

from mbsvib.cli import _checking as checking
from mbsvib.cli import _cosimulating as cosimulating
from mbsvib.cli import _demo as demo
from mbsvib.cli import _drawing as drawing
from mbsvib.cli import _exporting as exporting
from mbsvib.cli import _looking as looking
from mbsvib.cli import _parameters as parameters
from mbsvib.cli import _reporting as reporting
from mbsvib.cli import _shell as shell
from mbsvib.cli import _studying as studying
from mbsvib.version import __version__

app = typer.Typer(
    cls=shell.Group, no_args_is_help=True, add_completion=True, pretty_exceptions_enable=False,
    context_settings={"help_option_names": ["-h", "--help"]},
    epilog="MODEL is a model file (.yaml, .json, .xml of MuJoCo, .urdf) or a built-in model's name, see: mbsvib models",
)  # fmt: skip


def _version(wanted: bool) -> None:
    if wanted:
        typer.echo(f"mbsvib {__version__}")
        raise typer.Exit


@app.callback()
def options(
    version: Annotated[
        bool, typer.Option("--version", callback=_version, is_eager=True, help="Show the version and exit.")
    ] = False,
    debug: Annotated[bool, typer.Option(shell.DEBUG, help="Show an error's traceback, with any command.")] = False,
) -> None:
    """Vibration of multibody mechanisms: modes, Bode plots, step responses and state-space models."""


app.command()(demo.demo)
app.command()(looking.models)
app.command()(looking.modes)
app.command()(drawing.bode)
app.command()(drawing.nyquist)
app.command()(drawing.sigma)
app.command()(drawing.step)
app.command()(drawing.draw)
app.command()(drawing.animate)
app.command()(looking.check)
app.command()(parameters.params)
app.command()(parameters.sweep)
app.command()(studying.equilibrium)
app.command()(studying.isolation)
app.command()(exporting.export)
app.command()(checking.check_export)
app.command()(cosimulating.cosim)
app.command()(reporting.report)
app.command()(looking.schema)
