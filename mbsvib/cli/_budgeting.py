"""The command of error budgets: a model, noise at its inputs and, if there is one, a controller of a file."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

from mbsvib.cli import _shell as shell
from mbsvib.cli._arguments import JSON, MODEL, OUTPUTS, Argument, Command, ModelFile, file_argument, number, option
from mbsvib.cli._controllers import DELAY, RATE, check_delay, read_controller
from mbsvib.cli._drawing import check_format, deliver
from mbsvib.cli._lookup import system_of
from mbsvib.common.number_text import real
from mbsvib.errors import ModelError

if TYPE_CHECKING:
    from mbsvib.responses.densities import Shaped, Table

# Quantities of curves, by the unit of the input
QUANTITIES = {"m": "displacement", "m/s": "velocity", "m/s^2": "acceleration"}
EXAMPLE = "INPUT=VALUE, INPUT=FILE or INPUT=CURVE, such as floor=VC-C"


def budget(
    model: ModelFile, noise: list[str], outputs: list[str] | None = None, band: list[float] | None = None,
    weighting: str | None = None, controllers: list[Path] | None = None, rate: float | None = None, delay: float = 0.0,
    file: Path | None = None, as_json: bool = False,
) -> None:  # fmt: skip
    """Print which source of noise contributes how much to the root mean square of each output."""
    check_format(file, table=True)
    plant = system_of(model)
    if controllers:
        loop, rate = closed_by(plant, controllers, rate)
        check_delay(delay, rate)
        plant = loop if rate is None else loop.sampled(rate, delay)
    elif rate is not None or delay:
        raise shell.UsageProblem("--rate and --delay are those of a controller; give it by --controller FILE.")
    filters: Any = weighting if weighting is None or weighting in ("Wk", "Wd") else _gains_of(weighting)
    result = plant.budget(densities_of(noise, plant), outputs or None, band, weighting=filters)
    shell.answer(as_json, {
        "name": result.name, "rms": dict(result.rms), "units": dict(result.units), "band": result.band,
        "error": result.error, "contributions": {key: dict(parts) for key, parts in result.contributions.items()},
    }, result)  # fmt: skip
    remark = f"Drawn: {result.outputs[0]}. Others by --output." if len(result.outputs) > 1 else ""
    deliver(file, as_json, result.plot, result.columns, remark)


def closed_by(plant: Any, controllers: list[Path], rate: float | None) -> tuple[Any, float | None]:
    """Return the loop that controllers of files close around a system or an uncertain plant, with their noise, and the
    rate [Hz] at which they run, None in continuous time.
    """
    read = [read_controller(path, None, None, rate) for path in controllers]
    law, rate = read[0]
    if len(read) > 1:
        from mbsvib.common.selection import united
        from mbsvib.feedback.controller import as_controller, combined

        if (discrete := [path for path, (one, _) in zip(controllers, read, strict=True) if getattr(one, "dt", 0)]):
            raise shell.UsageProblem(f"{discrete[0]} is in discrete time: give no other controller beside it.")
        laws = [as_controller(one, plant) for one, _ in read]
        law = combined(laws, united(*[one.inputs for one in laws]), united(*[one.outputs for one in laws]))
    return plant.feedback(law, name=", ".join(path.stem for path in controllers), noise=True), rate


def densities_of(noise: list[str], linear: Any) -> dict[str, Any]:
    """Return the densities at inputs of texts INPUT=DENSITY."""
    spectra: dict[str, Any] = {}
    for pattern, word in pairs(noise, "--noise", EXAMPLE):
        spectra[pattern] = density_of(word, units_of(linear, pattern))
    return spectra


def pairs(texts: list[str], name: str, expected: str) -> list[tuple[str, str]]:
    """Return the two sides of texts NAME=VALUE of an option, whose names must differ."""
    result: dict[str, str] = {}
    for text in texts:
        key, _, word = text.partition("=")
        if not key or not word:
            raise shell.UsageProblem(f"{name} '{text}': expected {expected}.")
        if key in result:
            raise shell.UsageProblem(f"{name} '{text}': '{key}' is there already, as {key}={result[key]}; give one of "
                                     f"them.")  # fmt: skip
        result[key] = word
    return list(result.items())


def units_of(linear: Any, pattern: str) -> set[str]:
    """Return the units of the inputs that a pattern picks."""
    from mbsvib.common.selection import selected

    return {linear.input_units[k] for k in selected(pattern, linear.inputs, "input", linear.name)}


def density_of(word: str, units: set[str]) -> float | Table | Shaped:
    """Return a density of a number, of the name of a curve, or of a file with columns of frequency and density."""
    from mbsvib import isolation
    from mbsvib.random.curves import VC

    try:
        return real(word)
    except ValueError:
        pass
    name, _, speed = word.partition("@")
    quantity = QUANTITIES.get(units.copy().pop() if len(units) == 1 else "", "acceleration")
    if name in VC:
        return isolation.vc_spectrum(name, quantity)
    if name in ("NLNM", "NHNM"):
        return isolation.seismic_spectrum(name, quantity)
    if name.startswith("ISO-") and speed:
        try:
            return isolation.road_spectrum(name.removeprefix("ISO-"), real(speed), quantity)
        except ValueError:
            raise shell.UsageProblem(f"'{word}': expected a class of roads and a speed [m/s], such as ISO-C@20."
                                     ) from None  # fmt: skip
    path = Path(word)
    if not path.is_file():
        raise shell.UsageProblem(f"'{word}' is not a number, a file or a curve; curves: {', '.join(VC)}, NLNM, NHNM, "
                                 f"and roads such as ISO-C@20, at 20 m/s.")  # fmt: skip
    return isolation.table(rows_of(path), str(path))


def _gains_of(word: str) -> list[tuple[float, float]]:
    if not Path(word).is_file():
        raise shell.UsageProblem(f"--weighting '{word}': expected Wk, Wd, or a file of two columns (frequency [Hz], "
                                 f"gain).")  # fmt: skip
    return rows_of(Path(word))


def rows_of(path: Path) -> list[tuple[float, float]]:
    """Return the rows of a text file with frequency [Hz] and density, below lines of words."""
    rows: list[tuple[float, float]] = []
    for count, line in enumerate(path.read_text(encoding="utf-8-sig", errors="replace").splitlines(), 1):
        words = line.split("#")[0].replace(",", " ").replace(";", " ").split()
        try:
            values = [real(word) for word in words]
        except ValueError:
            values = []
        if len(values) == 2:
            rows.append((values[0], values[1]))
        elif words and (rows or values):
            raise ModelError(f"{path}, line {count}: '{line[:60]}'; expected two numbers, frequency [Hz] and one-sided "
                             f"density, or gain of a weight.")  # fmt: skip
    return rows


def noise_argument(*, required: bool = False) -> Argument:
    """Return the option ``--noise INPUT=DENSITY``."""
    return option(
        "--noise", to="noise", metavar="INPUT=DENSITY", action="append", required=required,
        words="One-sided density [unit^2/Hz] at an input or a pattern: a number (white noise), a file of two columns "
              "(frequency [Hz], density), or a curve: VC-A to VC-G, NLNM, NHNM, ISO-C@20 (a road of class C at 20 m/s)"
              "; may be given several times. With a controller also at SENSOR.noise and ACTUATOR.noise.",
    )  # fmt: skip


CONTROLLERS = option("--controller", to="controllers", metavar="FILE", type=Path, action="append", completes="file",
                     words="Controller with names of its signals, as of mbsvib loop; may be given several times.",
                     )  # fmt: skip
COMMANDS = {"budget": Command(budget, (
    MODEL, noise_argument(required=True), OUTPUTS,
    option("--band", to="band", metavar=("LOW", "HIGH"), type=number, nargs=2,
           words="First and last frequency [Hz]. Default: all."),
    option("--weighting", to="weighting", metavar="NAME", completes="file",
           words="Filter of all outputs: Wk or Wd of ISO 2631-1, of accelerations, or a file of two columns (frequency "
                 "[Hz], gain)."),
    CONTROLLERS,
    RATE,
    DELAY,
    file_argument("Density and cumulative root mean square of the first output (.png, .pdf, .svg), or of all (.csv)."),
    JSON,
))}  # fmt: skip
