"""Commands on closed loops: a model with a controller of a file, and a plant or loop whose parameters are uncertain."""

from __future__ import annotations

from math import pi
from pathlib import Path
from typing import TYPE_CHECKING, Any

from mbsvib.cli import _shell as shell
from mbsvib.cli._arguments import INPUTS, JSON, MODEL, OUTPUTS, Command, ModelFile, file_argument, option, positional
from mbsvib.cli._budgeting import CONTROLLERS, closed_by, densities_of, noise_argument, pairs
from mbsvib.cli._controllers import DELAY, FORMATS, RATE, check_delay, read_controller
from mbsvib.cli._drawing import check_format, deliver, is_table, plotted
from mbsvib.cli._lookup import as_misuse, ports, system_of
from mbsvib.common.number_text import real

if TYPE_CHECKING:
    from mbsvib.feedback.closed_loop import ClosedLoop
    from mbsvib.feedback.sampled import SampledLoop

EXAMPLE = "PARAMETER=SHARE or PARAMETER=LOW:HIGH, such as 'leg*.k.stiffness=0.1' or payload.mass=9:12"


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
    from mbsvib.common.columnar import by_pair

    parts = {label: one.with_ports(outputs, inputs) for label, one in (("open", plant), ("closed", closed))}
    omega = parts["closed"].frequency_grid()
    return {"frequency_hz": omega / (2.0 * pi)} | {
        f"{label}:{name}": values for label, part in parts.items()
        for name, values in by_pair(part.outputs, part.inputs, part.frequency_response(omega)).items()}  # fmt: skip


def robust(
    model: ModelFile, limits: list[str], controllers: list[Path] | None = None, gains: list[list[str]] | None = None,
    noise: list[str] | None = None, outputs: list[str] | None = None, as_json: bool = False,
) -> None:  # fmt: skip
    """Prove stability for all parameters within limits, with the worst gains; exit status 1 if it is not proven."""
    found = {name: limits_of(word, f"--limits '{name}={word}': expected {EXAMPLE}.")
             for name, word in pairs(limits, "--limits", EXAMPLE)}  # fmt: skip
    if outputs and not noise:
        raise shell.UsageProblem("--output is that of noise; give --noise INPUT=DENSITY, or --gain OUTPUT INPUT.")
    system = system_of(model)
    with as_misuse(*found):
        plant = system.uncertain(found)
    if controllers:
        plant, _ = closed_by(plant, controllers, None)
    stable = plant.robust_stability()
    results = [plant, stable, *[plant.worst_gain(output, source) for output, source in gains or []]]
    worst = plant.worst_rms(outputs or None, densities_of(noise, plant.nominal)) if noise else None
    shell.answer(as_json, {
        "name": plant.name, "parameters": {one.name: {
            "unit": one.unit, "low": one.low, "nominal": one.nominal, "high": one.high,
            "repetitions": one.repetitions} for one in plant.parameters},
        "stable": stable.lower >= 1.0, "stability": _bounds(stable),
        "gains": [{"output": output, "input": source, **_bounds(result)}
                  for (output, source), result in zip(gains or [], results[2:], strict=True)],
        "rms": None if worst is None else {"lower": dict(worst.lower), "upper": dict(worst.upper), "values": {
            name: dict(values) for name, values in worst.values.items()}},
    }, *results, *([] if worst is None else [worst]))  # fmt: skip
    if stable.lower < 1.0:
        raise shell.CheckFailed


def limits_of(word: str, wrong: str) -> float | tuple[float, float]:
    """Return half the width relative to the nominal value, or the limits LOW:HIGH, of a text."""
    try:
        ends = [real(part) for part in word.split(":")]
    except ValueError:
        ends = []
    if len(ends) not in (1, 2):
        raise shell.UsageProblem(wrong)
    return ends[0] if len(ends) == 1 else (ends[0], ends[1])


def _bounds(result: Any) -> dict[str, Any]:
    return {"lower": result.lower, "upper": result.upper, "omega": result.omega, "values": dict(result.values)}


COMMANDS = {
    "loop": Command(loop, (
        MODEL,
        positional("controller", "CONTROLLER", f"Matrices A, B, C, D with names, and dt if discrete: "
                   f"{', '.join(FORMATS)}.", type=Path, completes="file"),
        option("--sensor", to="sensors", metavar="NAME", action="append", completes="output",
               words="Output of the model that the controller takes; may be given several times. Default: the names of "
                     "its inputs."),
        option("--actuator", to="actuators", metavar="NAME", action="append", completes="input",
               words="Input of the model that it drives; may be given several times. Default: the names of its "
                     "outputs."),
        RATE, DELAY, INPUTS, OUTPUTS,
        file_argument("Frequency responses of open and closed loop: a Bode plot (.png, .pdf, .svg) or a table (.csv)."),
        JSON,
    )),
    "robust": Command(robust, (
        MODEL,
        option("--limits", "-l", to="limits", metavar="PARAMETER=SHARE", action="append", required=True,
               completes="parameter",
               words="Half the width relative to the value in the model, or limits LOW:HIGH, of a parameter or of each "
                     "that a pattern picks; may be given several times."),
        CONTROLLERS,
        option("--gain", to="gains", metavar=("OUTPUT", "INPUT"), action="append", nargs=2,
               words="Largest gain from an input to an output; may be given several times."),
        noise_argument(),
        OUTPUTS._replace(settings=OUTPUTS.settings | {
            "help": "Output whose largest root mean square is searched for; may be given several times. Default: "
                    "all."}),
        JSON,
    )),
}  # fmt: skip
