"""Commands that study a mechanism as a whole: equilibrium and isolation."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

from mbsvib.cli import _shell as shell
from mbsvib.cli._arguments import JSON, MODEL, Command, ModelFile, file_argument, number, option, positional
from mbsvib.cli._drawing import check_format, deliver, plotted
from mbsvib.cli._lookup import as_misuse, model_of, range_of

if TYPE_CHECKING:
    from mbsvib.isolation import Active, ClosedLoop, Isolation

LAWS = ("force", "velocity", "skyhook")


def equilibrium(
    model: ModelFile, preload: list[str] | None = None, file: Path | None = None, as_json: bool = False
) -> None:
    """Find the equilibrium of a mechanism under its loads."""
    result = model_of(model).equilibrium(preload or None, report=True)
    if file is not None:
        from mbsvib.files import save

        save(result.model, file)
    shell.answer(as_json, {
        "name": result.model.name, "stable": result.stable, "unstable_modes": list(result.unstable_modes),
        "iterations": result.iterations, "residual": result.residuals[-1], "units": ["m"] * 3 + ["rad"] * 3,
        "displacements": {name: motion.tolist() for name, motion in result.displacements.items()},
    }, result)  # fmt: skip
    if file is not None and not as_json:
        shell.say(f"Written: {shell.shown(file)}")


def path(model: ModelFile, values: str, switch: int = 0, file: Path | None = None, as_json: bool = False) -> None:
    """Follow the equilibria while a joint coordinate is led along values, with their stability."""
    check_format(file, table=True)
    coordinate, requested = range_of(values, "COORDINATE", "elbow.rz=0:1.2:25")
    source = model_of(model)
    with as_misuse(coordinate):
        result = source.path(coordinate, requested, switch)
    shell.answer(as_json, {
        "coordinate": coordinate, "unit": result.unit, "values": result.values.tolist(),
        "forces": result.forces.tolist(), "stable": result.stable.tolist(),
        "stable_held": result.stable_held.tolist(),
        "natural_hz": [[value for value in row if value == value] for row in result.frequencies.tolist()],
        "points": [{"kind": point.kind, "value": point.value, "force": point.force, "before": point.before}
                   for point in result.points],
    }, result)  # fmt: skip
    deliver(file, as_json, plotted("path", result), result.columns)


def isolation(
    model: ModelFile, body: str, base: str = "ground", feedback: str | None = None, gain: float | None = None,
    leak: float = 0.0, legs: list[str] | None = None, file: Path | None = None, as_json: bool = False,
) -> None:  # fmt: skip
    """Print how well a body is isolated from the motion of its base, also with feedback in its legs."""
    check_format(file, table=True)
    if (feedback is None) != (gain is None):
        raise shell.UsageProblem("--feedback and --gain belong together, as in --feedback force --gain 60.")
    if legs and feedback is None:
        raise shell.UsageProblem(f"--legs {legs[0]}: legs get actuators for --feedback; give it, or leave --legs out.")
    from mbsvib import isolation as isolating
    from mbsvib.common import tables

    source = model_of(model)
    with as_misuse(body, base):
        results = [isolating.study(source, body, base)]
    loop = None
    if feedback is not None and gain is not None:
        with as_misuse(*(legs or ())):
            plant = isolating.actuated(source, body, legs, base=base)
        loop = _closed(plant, feedback, gain, leak)
    if loop is not None:
        results.append(loop.isolation())
    if as_json:
        records = [_record(result) for result in results]
        shell.say_json({**records[0], "name": results[0].name, "body": body, "base": base,
                        **({} if loop is None else {"closed_loop": {
                            **records[1], "damping_ratios": loop.damping_ratios.tolist(),
                            "phase_margin_deg": loop.margins().all_phases}})})  # fmt: skip
    else:
        tables.show(**results[0].table())
        if loop is not None:
            for table in (loop, loop.margins(), results[1]):
                tables.show(**table.table())
    labels = ["open loop", f"{feedback} feedback"] if len(results) == 2 else [results[0].name]
    deliver(file, as_json, plotted("isolation", results, labels), results[-1].columns)


def _closed(plant: Active, feedback: str, gain: float, leak: float) -> ClosedLoop:
    from mbsvib import isolation as isolating

    if feedback == "force":
        return plant.with_gains(isolating.force_feedback(plant, gain, leak))
    if feedback == "skyhook":
        return plant.with_gains(isolating.skyhook(plant, gain, leak=leak))
    if leak:
        raise shell.UsageProblem(f"--leak {leak:g}: velocity feedback integrates nothing; leave --leak out.")
    return plant.with_gains(isolating.velocity_feedback(plant, gain))


def _record(result: Isolation) -> dict[str, Any]:
    return {"amplification": result.amplification, "frequencies": result.frequencies.tolist(),
            "index": result.index.tolist()}  # fmt: skip


COMMANDS = {
    "equilibrium": Command(equilibrium, (
        MODEL,
        option("--preload", to="preload", metavar="NAME", action="append", completes="spring",
               words="Springs or patterns whose preloads hold the pose as described."),
        file_argument("Model file (.yaml, .json) of the mechanism there."),
        JSON,
    )),
    "path": Command(path, (
        MODEL,
        positional("values", "COORDINATE=FROM:TO[:COUNT]",
                   "A joint coordinate, such as elbow.rz, and its displacements [m, rad].", completes="coordinate"),
        option("--switch", to="switch", metavar="WAY", type=int, choices=(-1, 0, 1), default=0,
               words="1 or -1: go on along the path that crosses at the first branch point. Default: 0."),
        file_argument("Force and frequencies over the coordinate, as .png, .pdf, .svg or .csv."),
        JSON,
    )),
    "isolation": Command(isolation, (
        MODEL,
        positional("body", "BODY", "The isolated body.", completes="body"),
        option("--base", to="base", metavar="BODY", default="ground", completes="body",
               words="What is shaken. Default: ground."),
        option("--feedback", to="feedback", metavar="KIND", choices=LAWS,
               words="Actuators and sensors in the legs: force (integral force feedback), velocity or skyhook."),
        option("--gain", to="gain", metavar="G", type=number, words="Of force feedback [1/s], of the others [N s/m]."),
        option("--leak", to="leak", metavar="W", type=number, default=0.0,
               words="Corner of the integrators [rad/s]. Default: 0."),
        option("--legs", to="legs", metavar="NAME", action="append", completes="spring",
               words="Springs, joints or patterns that get actuators, mount1.z of a bushing; may be given several "
                     "times. Default: all line springs, without any all prismatic joints."),
        file_argument("Transmissibility and compliance, as .png, .pdf, .svg or .csv (with feedback if that is given)."),
        JSON,
    )),
}  # fmt: skip
