"""The command that closes a loop: a model with a controller of a file."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

from mbsvib.cli import _shell as shell
from mbsvib.cli._arguments import INPUTS, JSON, MODEL, OUTPUTS, Command, ModelFile, file_argument, option, positional
from mbsvib.cli._controllers import DELAY, FORMATS, RATE, check_delay, read_controller
from mbsvib.cli._drawing import check_format, deliver, is_table, plotted
from mbsvib.cli._lookup import ports, system_of

if TYPE_CHECKING:
    from mbsvib.feedback.closed_loop import ClosedLoop
    from mbsvib.feedback.sampled import SampledLoop


def loop(
    model: ModelFile, controller: Path, sensors: list[str] | None = None, actuators: list[str] | None = None,
    rate: float | None = None, delay: float = 0.0, inputs: list[str] | None = None, outputs: list[str] | None = None,
    file: Path | None = None, as_json: bool = False,
) -> None:  # fmt: skip
    """Close a loop, u = w + K y: poles, damping and stability margins; exit status 1 if it is unstable."""
    check_format(file, table=True)
    law, rate = read_controller(controller, sensors, actuators, rate)
    check_delay(delay, rate)
    plant = system_of(model)
    loop = plant.feedback(law, sensors, actuators, controller.stem)
    closed: ClosedLoop | SampledLoop = loop if rate is None else loop.sampled(rate, delay)
    margins = closed.margins() if closed.stable else None
    poles = closed.poles()
    shell.answer(as_json, {
        "name": closed.name, "stable": closed.stable, "discrete": rate is not None,
        "poles": {"real": poles.real.tolist(), "imag": poles.imag.tolist()},
        "damping_ratios": closed.damping_ratios.tolist(), "margins": None if margins is None else {
            "gain": margins.all_gains, "phase_deg": margins.all_phases, "table": margins.table()["rows"],
        },
    }, closed, margins if margins is not None else f"Unstable: {', '.join(closed.growing)}.")  # fmt: skip
    if is_table(file):
        deliver(file, as_json, plotted("bode"), lambda: _columns(plant, closed, inputs, outputs))
    elif file is not None:
        sources, results, remark = ports(plant, inputs, outputs)
        figure = plotted("bode", [plant, closed], results, sources, labels=["open", "closed"])
        deliver(file, as_json, figure, remark=remark)
    if not closed.stable:
        raise shell.CheckFailed


def _columns(plant: Any, closed: Any, inputs: list[str] | None, outputs: list[str] | None) -> dict[str, Any]:
    """Frequency responses of open and closed loop."""
    from math import pi

    from mbsvib.common.columnar import by_pair

    parts = {label: one.with_ports(outputs, inputs) for label, one in (("open", plant), ("closed", closed))}
    omega = parts["closed"].frequency_grid()
    return {"frequency_hz": omega / (2.0 * pi)} | {
        f"{label}:{name}": values for label, part in parts.items()
        for name, values in by_pair(part.outputs, part.inputs, part.frequency_response(omega)).items()}  # fmt: skip


COMMANDS = {"loop": Command(loop, (
    MODEL,
    positional("controller", "CONTROLLER", f"Matrices A, B, C, D with names, and dt if discrete: "
               f"{', '.join(FORMATS)}.", type=Path, completes="file"),
    option("--sensor", to="sensors", metavar="NAME", action="append", completes="output",
           words="Output of the model that the controller takes; may be given several times. Default: the names of its "
                 "inputs."),
    option("--actuator", to="actuators", metavar="NAME", action="append", completes="input",
           words="Input of the model that it drives; may be given several times. Default: the names of its outputs."),
    RATE, DELAY, INPUTS, OUTPUTS,
    file_argument("Frequency responses of open and closed loop: a Bode plot (.png, .pdf, .svg) or a table (.csv)."),
    JSON,
))}  # fmt: skip
