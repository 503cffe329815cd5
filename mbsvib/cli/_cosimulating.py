"""The command that co-simulates a plant and a controller, for CI: exit status 0 if all is well, 1 if not."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

from mbsvib.cli import _shell as shell
from mbsvib.cli._arguments import JSON, Command, file_argument, number, option, positional
from mbsvib.cli._figures import check_format, deliver

if TYPE_CHECKING:
    from mbsvib_export import CosimulationCheck


def cosim(
    plant: Path, controller: Path, step: float, master: list[str] | None = None, connect: list[str] | None = None,
    duration: float | None = None, file: Path | None = None, as_json: bool = False,
) -> None:  # fmt: skip
    """Co-simulate two FMUs: error against step, order, largest stable step; exit status 1 if it fails."""
    import mbsvib_export as mx

    pairs = {}
    for connection in connect or []:
        name, sign, source = connection.partition("=")
        if not sign or not name:
            raise shell.UsageProblem(f"--connect {connection}: expected INPUT=OUTPUT, such as --connect F=u.")
        pairs[name] = source or None
    if file is not None:
        check_format(file)
    result = mx.check_cosimulation(plant, controller, step, masters=master, connections=pairs, duration=duration)
    if as_json:
        shell.say_json(_record(result))
    else:
        shell.say(str(result))
    if file is not None:
        deliver(result.plot(), file, as_json)
    if not result.passed:
        raise shell.CheckFailed


def _record(result: CosimulationCheck) -> dict[str, Any]:
    masters = [{"master": master.method, "steps": master.steps, "errors": master.errors, "worst_output": master.worst,
                "order": master.order, "fmu_against_reference": master.difference, "stable": master.stable,
                "largest_stable_step": master.largest_stable_step, "passed": master.passed}
               for master in result.masters]  # fmt: skip
    return {"plant": result.plant, "controller": result.controller, "step": result.step, "duration": result.duration,
            "connections": result.connections, "growth": result.growth, "passed": result.passed, "masters": masters,
            "remarks": result.remarks}  # fmt: skip


COMMANDS = {"cosim": Command(cosim, (
    positional("plant", "PLANT.fmu", "FMU of the plant.", type=Path, completes="file"),
    positional("controller", "CONTROLLER.fmu", "FMU of the controller.", type=Path, completes="file"),
    option("--step", "--dt", to="step", metavar="SECONDS", type=number, required=True, words="Communication step."),
    option("--master", to="master", metavar="NAME", action="append",
           choices=("jacobi", "gauss-seidel", "slopes", "iteration"),
           words="jacobi, gauss-seidel, slopes (linear extrapolation) or iteration; may be given several times. "
                 "Default: all."),
    option("--connect", to="connect", metavar="INPUT=OUTPUT", action="append",
           words="Where names differ; nothing behind = leaves it free."),
    option("--duration", to="duration", metavar="SECONDS", type=number,
           words="Time to simulate. Default: 256 steps."),
    file_argument("Error against step, as .png, .svg or .pdf."),
    JSON,
))}  # fmt: skip
