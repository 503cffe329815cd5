"""Commands that write systems and models for other tools, read what was written, and run two FMUs together.

The last two are for CI: exit status 0 if all is well, 1 if not.
"""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

from mbsvib.cli import _shell as shell
from mbsvib.cli._arguments import (
    INPUTS,
    JSON,
    OUTPUTS,
    Command,
    ModelFile,
    file_argument,
    flag,
    number,
    option,
    positional,
)
from mbsvib.cli._controllers import holds_controller, read_controller
from mbsvib.cli._drawing import check_format, deliver
from mbsvib.cli._lookup import model_of, system_of
from mbsvib.errors import nearest
from mbsvib_export.targets import BY_SUFFIX, TARGETS

if TYPE_CHECKING:
    from mbsvib_export import CosimulationCheck

KINDS = {target.suffixes[0]: target.contents for target in TARGETS} | {".yaml": "the model itself, to be edited"}
SHORT = 2  # letters of a suffix that is near to most others
STEP = 1e-4  # s between samples of .c
# options that some formats have, and the argument of the exporter
CHOICES = {
    "--realization": "realization", "--step": "step", "--method": "method", "--fmi": "version",
    "--platforms": "platforms", "--tunable": "tunable", "--input": "inputs", "--output": "outputs",
}  # fmt: skip


def export(
    model: ModelFile, file: Path, realization: str | None = None, step: float | None = None, method: str | None = None,
    version: str | None = None, platforms: str | None = None, tunable: list[str] | None = None,
    inputs: list[str] | None = None, outputs: list[str] | None = None, as_json: bool = False,
) -> None:  # fmt: skip
    """Write the linear system, frequency responses, the model (.yaml) or a controller, by the suffix of the file."""
    suffix = file.suffix.lower()
    if suffix not in KINDS:
        known = "; ".join(f"{kind}: {words}" for kind, words in KINDS.items())
        hint = nearest(suffix, [kind for kind in KINDS if len(kind) > SHORT])  # .csv is no misspelt .c
        raise shell.UsageProblem(f"'{file}': no format goes by the suffix '{suffix}'.{hint} Known: {known}.")
    values: dict[str, Any] = {
        "realization": realization, "step": step, "method": method, "version": version, "tunable": tunable,
        "platforms": platforms if platforms in (None, "all") else tuple(platforms.split(",")),
        "inputs": inputs, "outputs": outputs,
    }  # fmt: skip
    for name, argument in CHOICES.items():
        kinds = [kind for kind in KINDS if kind in BY_SUFFIX
                 and argument in ("inputs", "outputs", *BY_SUFFIX[kind].options)]  # fmt: skip
        if values[argument] is not None and suffix not in kinds:
            raise shell.UsageProblem(f"{name}: '{file}' has no such choice; give {name} with a file that ends in "
                                     f"{' or '.join(kinds)}.")  # fmt: skip
    law = _controller_of(model, suffix, file)
    source = model_of(model) if law is None else None
    if file.exists() and Path(model.word).exists() and file.samefile(model.word):
        raise shell.UsageProblem(f"'{file}' is the model itself, which would be overwritten; give another file by -o.")
    content = KINDS[suffix]
    if source is None:
        part = law.with_ports(values.pop("outputs"), values.pop("inputs"))
        if suffix == ".c":
            values["method"] = values["method"] or "tustin"
        content = _write(part, file, {name: value for name, value in values.items() if value is not None})
    elif suffix == ".yaml":
        from mbsvib.files import save

        save(source, file)
    else:
        system = source.linearize().with_ports(values.pop("outputs"), values.pop("inputs"))
        content = _write(system, file, {name: value for name, value in values.items() if value is not None})
    if as_json:
        shell.say_written(file, as_json, content=content)
    else:
        shell.say(f"Written: {shell.shown(file)} ({content})")


def _controller_of(model: ModelFile, suffix: str, file: Path) -> Any:
    """The controller of a file in continuous time, None if the file is a model."""
    path = Path(model.word)
    if not holds_controller(path):
        return None
    if suffix == ".yaml":
        raise shell.UsageProblem(f"'{file}': {path} holds a controller, and .yaml is for models; give another format.")
    law, rate = read_controller(path, None, None, None, "add lists of names to the file, 'inputs' of the columns of B "
                                "and 'outputs' of the rows of C")  # fmt: skip
    if rate is not None:
        raise shell.UsageProblem(f"{path} is in discrete time, at {rate:g} Hz; only controllers in continuous time are "
                                 f"exported. For a computer it is ready as it is.")  # fmt: skip
    return law


def _write(system: Any, file: Path, choices: dict[str, Any]) -> str:
    """Write a system by the suffix of a file; return what it contains."""
    suffix = file.suffix.lower()
    target = BY_SUFFIX[suffix]
    if suffix == ".c":
        step = choices.pop("step", STEP)
        target.write(system, file.parent, step, name=file.stem, **choices)
        return f"{target.contents}; a step every {step:g} s"
    written = target.write(system, file, **choices)
    if suffix == ".fmu":
        more = "; others by --platforms all" if written.other_platforms else ""
        return f"an FMU (FMI {written.version}) that runs on {', '.join(written.platforms)}{more}"
    return target.contents


def check_export(
    file: Path, model: ModelFile | None = None, limit: float = 1e-6, run: bool = False, as_json: bool = False
) -> None:
    """Read an export again and compare frequency response and poles with the model; exit status 1 if they differ."""
    import mbsvib_export as mx

    result = mx.check_export(file, None if model is None else system_of(model), limit, run=run)
    rows = [{key: getattr(row, key) for key in ("quantity", "against", "error", "limit", "passed")}
            for row in result.comparisons]  # fmt: skip
    record = {"file": str(file), "passed": result.passed, "comparisons": rows, "remarks": result.remarks}
    shell.answer(as_json, record, result)
    if not result.passed:
        raise shell.CheckFailed


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
    check_format(file)
    result = mx.check_cosimulation(plant, controller, step, masters=master, connections=pairs, duration=duration)
    shell.answer(as_json, _record(result), result)
    deliver(file, as_json, result.plot)
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


COMMANDS = {
    "export": Command(export, (
        positional("model", "MODEL", "Model file, name of a built-in model, or controller with A, B, C, D (.json, "
                   ".npz, .mat).", completes="model"),
        file_argument(f"Where to: {', '.join(KINDS)}.", required=True),
        INPUTS,
        OUTPUTS,
        option("--realization", to="realization", metavar="KIND", completes=("physical", "modal", "balanced"),
               words="States: physical (of .c: modal), modal or balanced."),
        option("--step", "--dt", to="step", metavar="SECONDS", type=number,
               words=f"Time between samples, for .c. Default: {STEP:g}."),
        option("--method", to="method", metavar="KIND", completes=("zoh", "foh", "tustin"),
               words="Discretization, for .c: zoh, foh or tustin."),
        option("--fmi", to="version", metavar="VERSION", choices=("2.0", "3.0"),
               words="Of an FMU: 2.0 or 3.0. Default: 3.0."),
        option("--platforms", to="platforms", metavar="NAMES", words="Of an FMU: all, or names with commas between."),
        option("--tunable", to="tunable", metavar="PARAMETER", action="append", completes="parameter",
               words="Parameter that the user of an FMU may change, such as 'leg*.k.stiffness'; may be given several "
                     "times."),
        JSON,
    )),
    "check-export": Command(check_export, (
        positional("file", "FILE", "What mbsvib export wrote.", type=Path, completes="file"),
        positional("model", "MODEL", "The model that it came from: a file or a built-in name.", nargs="?",
                   completes="model"),
        option("--limit", to="limit", metavar="ERROR", type=number, default=1e-6,
               words="Largest relative error to pass. Default: 1e-6."),
        flag("--run", "run", "Load the binary of an .fmu and compare its answers. It is a program: only if you trust "
             "the file."),
        JSON,
    )),
    "cosim": Command(cosim, (
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
    )),
}  # fmt: skip
