"""The command that co-simulates a plant and a controller, for CI: exit status 0 if all is well, 1 if not."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from mbsvib.cli import _shell as shell


def cosim(
    plant: Annotated[Path, typer.Argument(metavar="PLANT.fmu", help="FMU of the plant.")],
    controller: Annotated[Path, typer.Argument(metavar="CONTROLLER.fmu", help="FMU of the controller.")],
    step: Annotated[float, typer.Option("--step", metavar="SECONDS", help="Communication step.")],
    master: Annotated[
        list[str] | None,
        typer.Option("--master", metavar="NAME", help="jacobi, gauss-seidel, slopes (linear extrapolation) or "
                     "iteration; may be given several times. Default: all."),
    ] = None,
    connect: Annotated[
        list[str] | None,
        typer.Option("--connect", metavar="INPUT=OUTPUT", help="Where names differ; nothing behind = leaves it free."),
    ] = None,
    duration: Annotated[
        float | None, typer.Option("--duration", metavar="SECONDS", help="Time to simulate. Default: 256 steps.")
    ] = None,
    plot: Annotated[
        Path | None, typer.Option("--plot", metavar="FILE", help="Error against step, as .png, .svg or .pdf.")
    ] = None,
) -> None:  # fmt: skip
    """Co-simulate two FMUs: error against step, order, largest stable step; exit status 1 if it fails."""
    import mbsvib_export as mx

    pairs = {}
    for connection in connect or []:
        name, sign, source = connection.partition("=")
        if not sign or not name:
            raise shell.UsageProblem(f"--connect {connection}: expected INPUT=OUTPUT, such as --connect F=u.")
        pairs[name] = source or None
    result = mx.check_cosimulation(plant, controller, step, masters=master, connections=pairs, duration=duration)
    shell.say(str(result))
    if plot is not None:
        try:
            result.plot().savefig(plot)
        except ValueError as error:  # matplotlib's, for a suffix that it does not know
            raise shell.UsageProblem(f"--plot {plot}: {error}") from error
        shell.say(f"Written: {shell.shown(plot)}")
    if not result.passed:
        raise typer.Exit(shell.FAILED)
