"""The command that closes a loop: a model with a controller of a file."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

from mbsvib.cli import _shell as shell
from mbsvib.cli._arguments import INPUTS, JSON, MODEL, OUTPUTS, Command, file_argument, number, option, positional
from mbsvib.cli._figures import check_format, deliver
from mbsvib.cli._lookup import ports, system_of
from mbsvib.errors import ModelError

if TYPE_CHECKING:
    from mbsvib import StateSpace
    from mbsvib.feedback.closed_loop import ClosedLoop
    from mbsvib.feedback.sampled import SampledLoop

FORMATS = (".json", ".npz", ".mat")
MATRICES = ("A", "B", "C", "D")


def loop(
    model: str, controller: Path, sensors: list[str] | None = None, actuators: list[str] | None = None,
    rate: float | None = None, delay: float = 0.0, inputs: list[str] | None = None, outputs: list[str] | None = None,
    file: Path | None = None, as_json: bool = False,
) -> None:  # fmt: skip
    """Close a loop, u = w + K y: poles, damping and stability margins; exit status 1 if it is unstable."""
    check_format(file)
    if rate is not None and file is not None:
        raise shell.UsageProblem(f"'{file}': Bode plots are of loops in continuous time; leave --rate or -o out.")
    plant = system_of(model)
    law = _read(controller, sensors, actuators)
    continuous = plant.feedback(law, sensors, actuators, controller.stem)
    closed: ClosedLoop | SampledLoop = continuous if rate is None else continuous.sampled(rate, delay)
    if delay and rate is None:
        raise shell.UsageProblem(f"--delay {delay:g}: give --rate too; in continuous time nothing is delayed.")
    margins = closed.margins() if closed.stable else None
    if as_json:
        poles = closed.poles()
        shell.say_json({
            "name": closed.name, "stable": closed.stable, "discrete": rate is not None,
            "poles": {"real": poles.real.tolist(), "imag": poles.imag.tolist()},
            "damping_ratios": closed.damping_ratios.tolist(), "margins": None if margins is None else {
                "gain": margins.all_gains, "phase_deg": margins.all_phases, "table": margins.table()["rows"],
            },
        })  # fmt: skip
    else:
        shell.say(str(closed))
        shell.say(str(margins) if margins is not None else f"Unstable: {', '.join(closed.growing)}.")
    if file is not None and not closed.stable:
        shell.complain(f"Not written: {shell.shown(file)}, as an unstable loop has no frequency response.")
    elif file is not None:
        from mbsvib import plots

        sources, results, remark = ports(plant, inputs, outputs)
        deliver(plots.bode([plant, continuous], results, sources, labels=["open", "closed"]), file, as_json, remark)
    if not closed.stable:
        raise shell.CheckFailed


def _read(path: Path, sensors: list[str] | None, actuators: list[str] | None) -> StateSpace:
    """Return the state space of a file: A, B, C, D, and names of inputs and outputs if it has them."""
    if path.suffix.lower() not in FORMATS:
        raise shell.UsageProblem(f"'{path}': controllers end in {', '.join(FORMATS)}.")
    if not path.is_file():
        raise shell.UsageProblem(f"there is no file '{path}'.")
    content = _content(path)
    missing = [name for name in MATRICES if name not in content]
    if missing:
        raise ModelError(f"{path}: {', '.join(missing)} missing; expected the matrices A, B, C and D of "
                         f"x' = A x + B y, u = C x + D y, and names as inputs and outputs, or by --sensor and "
                         f"--actuator.")  # fmt: skip
    from mbsvib import StateSpace

    names: dict[str, Any] = {key: [str(name).strip() for name in content[key]]
                             for key in ("inputs", "outputs") if key in content}  # fmt: skip
    if not names and not (sensors and actuators):
        raise shell.UsageProblem(f"{path} names no signals: give --sensor and --actuator, in the order of the columns "
                                 f"of B and the rows of C.")  # fmt: skip
    return StateSpace.from_arrays(*(content[name] for name in MATRICES), **names)


def _content(path: Path) -> dict[str, Any]:
    suffix = path.suffix.lower()
    try:
        if suffix == ".json":
            import json

            loaded = json.loads(path.read_text(encoding="utf-8"))
            if "state_space" in loaded:  # written by mbsvib
                names = {key: [signal["name"] for signal in loaded[key]] for key in ("inputs", "outputs")}
                return {**loaded["state_space"], **names}
            return dict(loaded)
        if suffix == ".npz":
            import numpy as np

            with np.load(path, allow_pickle=False) as arrays:
                return dict(arrays)
        from scipy.io import loadmat

        return dict(loadmat(path, squeeze_me=False, chars_as_strings=True))
    except (ValueError, TypeError, KeyError, NotImplementedError) as error:
        raise ModelError(f"{path}: cannot be read as {suffix}: {error}") from error


COMMANDS = {"loop": Command(loop, (
    MODEL,
    positional("controller", "CONTROLLER", f"Matrices A, B, C, D with names: {', '.join(FORMATS)}.", type=Path,
               completes="file"),
    option("--sensor", to="sensors", metavar="NAME", action="append", completes="output",
           words="Output of the model that the controller takes; may be given several times. Default: the names of its "
                 "inputs."),
    option("--actuator", to="actuators", metavar="NAME", action="append", completes="input",
           words="Input of the model that it drives; may be given several times. Default: the names of its outputs."),
    option("--rate", to="rate", metavar="HZ", type=number, words="Sample rate of a controller in discrete time."),
    option("--delay", to="delay", metavar="SECONDS", type=number, default=0.0, words="Its delay."),
    INPUTS, OUTPUTS, file_argument("Bode plot of open and closed loop, as .png, .pdf or .svg."), JSON,
))}  # fmt: skip
