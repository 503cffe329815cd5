"""The command that tunes controllers of a given structure, with parameters of the model beside them."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

from mbsvib.cli import _shell as shell
from mbsvib.cli._arguments import JSON, MODEL, Command, ModelFile, file_argument, flag, number, option, whole_number
from mbsvib.cli._budgeting import densities_of, noise_argument, pairs, rows_of
from mbsvib.cli._lookup import as_misuse, model_of
from mbsvib.cli._loops import limits_of
from mbsvib.common.number_text import integer, real

if TYPE_CHECKING:
    from mbsvib.api.model import Model
    from mbsvib.tuning.measures import Goal
    from mbsvib.tuning.structures import Tunable
    from mbsvib.tuning.tuning import Design

BOUNDS = "PARAMETER=LOW:HIGH, such as 'leg*.k.damping=1:500'"
VALUES = "PARAMETER=VALUE[,PARAMETER=VALUE...], such as payload.mass=14"


def tune(
    model: ModelFile, gains: list[list[str]] | None = None, pids: list[list[str]] | None = None,
    leads: list[list[str]] | None = None, spaces: list[list[str]] | None = None, each: bool = False,
    shared: bool = False, hinf: list[list[str]] | None = None, rms: list[str] | None = None,
    noise: list[str] | None = None, most_hinf: list[list[str]] | None = None, most_rms: list[str] | None = None,
    least_damping: float | None = None, margin: float | None = None, rolloff: str | None = None,
    parameters: list[str] | None = None, variants: list[str] | None = None, starts: int = 10, seed: int = 0,
    workers: int | None = None, file: Path | None = None, as_json: bool = False,
) -> None:  # fmt: skip
    """Tune the values of a controller, u = w + K y, to goals; exit status 1 if a limit is not reached."""
    import mbsvib as mv
    import mbsvib_export as mx
    from mbsvib_export.targets import BY_SUFFIX

    target = None if file is None else BY_SUFFIX.get(file.suffix.lower())
    if file is not None and (target is None or target.writes not in ("to_json", "to_npz", "to_mat")):
        raise shell.UsageProblem(f"'{file}': controllers end in .json, .npz or .mat.")
    source = model_of(model)
    plants = [source, *[_variant(source, text) for text in variants or []]]
    bounds = {}
    for name, word in pairs(parameters or [], "--parameter", BOUNDS):
        bounds[name] = limits_of(word, wrong := f"--parameter '{name}={word}': expected {BOUNDS}.")
        if not isinstance(bounds[name], tuple):
            raise shell.UsageProblem(wrong)
    system = source.linearize()
    entries = [("gain", *ports, 0) for ports in gains or []] + [("pid", *ports, 0) for ports in pids or []]
    entries += [("lead_lag", *ports, 0) for ports in leads or []]
    entries += [("state_space", *ports, _order(word)) for word, *ports in spaces or []]
    laws = [law for entry in entries for law in _laws(entry, system, each, shared)]  # type: ignore[arg-type]
    if not laws:
        raise shell.UsageProblem("no controller: give --gain, --pid, --lead-lag or --states.")
    goals = [mv.goals.hinf(output, *_weighted(word, "--hinf", file=True)) for output, word in hinf or []]
    goals += [mv.goals.hinf(output, port, most=most) for output, word in most_hinf or []
              for port, most in [_weighted(word, "--hinf-limit", limit=True)]]  # fmt: skip
    goals += _rms_goals(system, laws, rms or [], most_rms or [], noise or [])
    goals += [] if rolloff is None else [mv.goals.rolloff(*_slope(rolloff))]
    goals += [make(value) for make, value in ((mv.goals.damping, least_damping), (mv.goals.margin, margin))
              if value is not None]  # fmt: skip
    if not goals:
        raise shell.UsageProblem("no goal: give --hinf, --rms with --noise, one of their limits, --damping-ratio, "
                                 "--margin or --roll-off.")
    with as_misuse(*bounds):
        design = mv.tune(plants if variants else source, sum(laws[1:], laws[0]), goals, bounds, starts, seed,
                         workers=workers)  # fmt: skip
    _say(design, source.name, as_json)
    if file is not None and target is not None:
        getattr(mx, target.writes)(design.controller, file)
        if not as_json:
            shell.say_written(file, as_json)
    if not design.success:
        raise shell.CheckFailed


def _say(design: Design, name: str, as_json: bool) -> None:
    """Print a tuned controller as JSON or as tables."""
    if as_json:
        law = design.controller
        shell.say_json({
            "name": name, "values": dict(design.values), "objective": design.objective,
            "achieved": dict(design.achieved), "reached": dict(design.reached), "success": design.success,
            "by_plant": dict(design.by_plant), "controller": {
                **{key: getattr(law, key).tolist() for key in "ABCD"}, "inputs": law.inputs, "outputs": law.outputs},
        })  # fmt: skip
    else:
        from mbsvib.common import tables

        shell.say(str(design))
        rows = [(key, f"{value:.8g}") for key, value in design.values.items()]
        tables.show("Values", [("name", "left"), ("value", "right")], rows, [])


def _variant(model: Model, text: str) -> Model:
    """The model with the values of parameters of a text NAME=VALUE,NAME=VALUE."""
    values = {}
    for name, word in pairs(text.split(","), "--variant", VALUES):
        try:
            values[name] = real(word)
        except ValueError:
            raise shell.UsageProblem(f"--variant '{text}': expected {VALUES}.") from None
    with as_misuse(*values):
        return model.with_values(values)


def _order(word: str) -> int:
    try:
        return integer(word)
    except ValueError:
        raise shell.UsageProblem(f"--states {word}: expected the number of states, the actuator and the sensor, such "
                                 f"as --states 2 F x.") from None  # fmt: skip


def _laws(entry: tuple[str, str, str, int], system: Any, each: bool, shared: bool) -> list[Tunable]:
    """The controllers of an option: from all its sensors to all its actuators, or one for each pair."""
    import mbsvib as mv
    from mbsvib.common.selection import selected

    kind, actuators, sensors, order = entry
    make = getattr(mv.tunable, kind)
    to = [system.inputs[k] for k in selected(actuators, system.inputs, "input", system.name)]
    of = [system.outputs[k] for k in selected(sensors, system.outputs, "output", system.name)]
    ports: list[Any] = [(to, of)]
    if each or shared:
        if len(to) != len(of):
            raise shell.UsageProblem(f"'{actuators}' picks {len(to)} actuators and '{sensors}' {len(of)} sensors; "
                                     f"expected as many, for one controller each.")  # fmt: skip
        ports = list(zip(to, of, strict=True))
    name = f"{actuators}/{sensors}" if shared else None
    return [make(*((order,) if order else ()), *pair, name=name) for pair in ports]


def _rms_goals(system: Any, laws: list[Tunable], rms: list[str], most: list[str], noise: list[str]) -> list[Goal]:
    """Goals of root mean squares, then their limits."""
    import mbsvib as mv

    if bool(rms or most) != bool(noise):
        raise shell.UsageProblem("--rms OUTPUT and --noise INPUT=DENSITY belong together; give both or neither.")
    if not noise:
        return []
    spectra = densities_of(noise, system.feedback(*_silent(laws), noise=True))
    goals = [mv.goals.rms(name, spectra, weight) for name, weight in (_weighted(word, "--rms") for word in rms)]
    limits = [_weighted(word, "--rms-limit", limit=True) for word in most]
    return goals + [mv.goals.rms(name, spectra, most=limit) for name, limit in limits]


def _silent(laws: list[Tunable]) -> tuple[Any, list[str], list[str]]:
    """A controller that does nothing, with the signals of all: its loop has the names and units of their noise."""
    import numpy as np

    from mbsvib.common.selection import united

    sensors, actuators = united(*[law.inputs for law in laws]), united(*[law.outputs for law in laws])
    return np.zeros((len(actuators), len(sensors))), list(sensors), list(actuators)


def _weighted(text: str, name: str, limit: bool = False, file: bool = False) -> tuple[str, Any]:
    """The name and the number of a text NAME=NUMBER, of which a weight may be left out or, of some, in a file."""
    port, mark, word = text.partition("=")
    if file and Path(word).is_file():
        return port, rows_of(Path(word))
    try:
        return port, real(word) if mark or limit else 1.0
    except ValueError:
        forms = "NAME=LIMIT" if limit else "a name, NAME=WEIGHT or NAME=FILE" if file else "a name, or NAME=WEIGHT"
        raise shell.UsageProblem(f"{name} '{text}': expected {forms}.") from None


def _slope(text: str) -> list[float]:
    try:
        return [real(word) for word in text.split(":", 1)]
    except ValueError:
        raise shell.UsageProblem(f"--roll-off '{text}': expected HERTZ or HERTZ:DECIBELS, such as 30:40.") from None


def _structure(name: str, to: str, words: str, *before: str) -> Any:
    return option(name, to=to, metavar=(*before, "ACTUATOR", "SENSOR"), action="append", nargs=2 + len(before),
                  words=f"{words}; may be given several times.")  # fmt: skip


COMMANDS = {"tune": Command(tune, (
    MODEL,
    _structure("--gain", "gains", "Constant gains from all sensors to all actuators that patterns pick"),
    _structure("--pid", "pids", "PID with a filter of its derivative"),
    _structure("--lead-lag", "leads", "Lead or lag"),
    _structure("--states", "spaces", "State space of so many states", "COUNT"),
    flag("--each", "each", "Patterns of actuators and sensors pick pairs, which have one controller each."),
    flag("--shared", "shared", "As --each, and these controllers have the same values."),
    option("--hinf", to="hinf", metavar=("OUTPUT", "INPUT[=WEIGHT]"), action="append", nargs=2,
           words="Minimise the highest peak from an input, which may be noise, to an output; a weight is a number, "
                 "or a file of two columns (frequency [Hz], gain); may be given several times: the largest weighted "
                 "one is minimised."),
    option("--rms", to="rms", metavar="OUTPUT[=WEIGHT]", action="append", completes="output",
           words="Minimise the root mean square of an output under the noise; may be given several times."),
    noise_argument(),
    option("--hinf-limit", to="most_hinf", metavar=("OUTPUT", "INPUT=MOST"), action="append", nargs=2,
           words="Largest peak from an input to an output that is allowed; may be given several times."),
    option("--rms-limit", to="most_rms", metavar="OUTPUT=MOST", action="append", completes="output",
           words="Largest root mean square of an output that is allowed; may be given several times."),
    option("--damping-ratio", to="least_damping", metavar="RATIO", type=number, words="Least damping ratio."),
    option("--margin", to="margin", metavar="DISTANCE", type=number, words="Least modulus margin."),
    option("--roll-off", to="rolloff", metavar="HERTZ[:DECIBELS]",
           words="Commands fall from this frequency on, by so many dB a decade. Default: 20."),
    option("--parameter", to="parameters", metavar="PARAMETER=LOW:HIGH", action="append", completes="parameter",
           words="Bounds of a parameter of the model, or of one value for all that a pattern picks, which is tuned "
                 "beside the controller; may be given several times."),
    option("--variant", to="variants", metavar="PARAMETER=VALUE", action="append", completes="parameter",
           words="The model with other values too, several separated by commas: one controller for all; may be given "
                 "several times."),
    option("--starts", to="starts", metavar="COUNT", type=whole_number, default=10, words="Starts of the search."),
    option("--seed", to="seed", metavar="NUMBER", type=whole_number, default=0, words="Seed of the random starts."),
    option("--workers", to="workers", metavar="COUNT", type=whole_number,
           words="Processes, which change nothing of the result. Default: as many as processors for long searches."),
    file_argument("Controller, as .json, .npz or .mat, which mbsvib loop reads."), JSON,
))}  # fmt: skip
