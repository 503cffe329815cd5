"""The command of uncertain plants: for which values of parameters a system or a loop is stable, and how bad it becomes.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from mbsvib.cli import _shell as shell
from mbsvib.cli._arguments import JSON, MODEL, OUTPUTS, Command, ModelFile, option
from mbsvib.cli._budgeting import CONTROLLERS, closed, densities_of, noise_argument, pairs
from mbsvib.cli._lookup import as_misuse, system_of
from mbsvib.common.number_text import real

if TYPE_CHECKING:
    from pathlib import Path

EXAMPLE = "PARAMETER=SHARE or PARAMETER=LOW:HIGH, such as 'leg*.k.stiffness=0.1' or payload.mass=9:12"


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
        plant, _ = closed(plant, controllers, None)
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


COMMANDS = {"robust": Command(robust, (
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
        "help": "Output whose largest root mean square is searched for; may be given several times. Default: all."}),
    JSON,
))}  # fmt: skip
