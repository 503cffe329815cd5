"""Controllers of files: state spaces in JSON, .npz and .mat, of mbsvib or of other programs, continuous or discrete."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

from mbsvib.cli import _shell as shell
from mbsvib.cli._arguments import number, option
from mbsvib.common.file_content import ContentError, content_of, read_json_content
from mbsvib.errors import ModelError

FORMATS = (".json", ".npz", ".mat")
MATRICES = ("A", "B", "C", "D")
# Names of signals and the sample time: as in JSON and .npz, and as MATLAB has them.
SIGNALS = {"inputs": "InputName", "outputs": "OutputName"}
PERIODS = ("dt", "Ts", "ts", "sample_time")
DESCRIPTOR = "E"
KNOWN = (*MATRICES, DESCRIPTOR, *PERIODS, *SIGNALS, *SIGNALS.values(), "format", "mbsvib")
# --rate beside a sample time in the file may differ from it by rounding of printed digits.
SAME_RATE = 1e-6

RATE = option("--rate", to="rate", metavar="HZ", type=number,
              words="Rate at which controllers run in discrete time. Default: that of a file with dt or Ts, else "
                    "continuous time.")  # fmt: skip
DELAY = option("--delay", to="delay", metavar="SECONDS", type=number, default=0.0,
               words="Delay of controllers in discrete time. Default: 0.")  # fmt: skip


def check_delay(delay: float, rate: float | None) -> None:
    """Refuse a delay in continuous time."""
    if delay and rate is None:
        raise shell.UsageProblem(f"--delay {delay:g}: give --rate too; in continuous time nothing is delayed.")


def holds_controller(path: Path) -> bool:
    """Whether a file is a controller, or another state space, and no model: its content has matrices."""
    suffix = path.suffix.lower()
    if suffix not in FORMATS or not path.is_file():
        return False
    if suffix != ".json":
        return True
    try:
        fields = read_json_content(content_of(path, ModelError, "a model or a controller"))
    except ContentError:  # what is wrong with it is said where it is read as a model
        return False
    return isinstance(fields, dict) and ({"A", "B"} <= set(fields) or "state_space" in fields)


def read_controller(
    path: Path, sensors: list[str] | None, actuators: list[str] | None, rate: float | None,
    remedy: str = "give --sensor and --actuator, in the order of the columns of B and the rows of C",
) -> tuple[Any, float | None]:  # fmt: skip
    """Return a controller, and the rate [Hz] at which it runs, None in continuous time.

    A discrete one is a state space of python-control with its sample time. ``rate``: that of the command line;
    ``remedy``: what to do if no signals are named.
    """
    if path.suffix.lower() not in FORMATS:
        raise shell.UsageProblem(f"'{path}': controllers end in {', '.join(FORMATS)}.")
    if not path.is_file():
        raise shell.UsageProblem(f"there is no file '{path}'.")
    try:
        content = _content(path)
    except ContentError as error:
        raise ModelError(f"{path}: cannot be read as {path.suffix.lower()}: {error}.") from error
    if not isinstance(content, dict):
        return content, rate
    if missing := [name for name in MATRICES if name not in content]:
        raise ModelError(f"{path}: {', '.join(missing)} missing; expected the matrices A, B, C and D of "
                         f"x' = A x + B y, u = C x + D y, and names as inputs and outputs, or by --sensor and "
                         f"--actuator.")  # fmt: skip
    names: dict[str, Any] = {key: _names(content[word], path, word) for key, other in SIGNALS.items()
             for word in (key, other) if word in content}  # fmt: skip
    if len(names) < 2 and not (sensors and actuators):
        raise shell.UsageProblem(f"{path} names no signals: {remedy}.")
    _check_descriptor(content.get(DESCRIPTOR), path)
    period = _period(content, path, rate)
    from mbsvib import StateSpace

    law = StateSpace.from_arrays(*(content[name] for name in MATRICES), **(names | {"name": path.stem}))
    if period is None:
        return law, rate
    import control

    discrete = control.ss(law.A, law.B, law.C, law.D, period, inputs=list(law.inputs), outputs=list(law.outputs),
                          name=path.stem)  # fmt: skip
    return discrete, 1.0 / period


def _content(path: Path) -> Any:
    """The fields of a file by name, or the state space of one that mbsvib has written."""
    import mbsvib_export as mx
    from mbsvib_export.record import FORMAT, SPACE_FORMAT

    read: Callable[[Path], Any]
    raw, suffix = content_of(path, ModelError, "a controller"), path.suffix.lower()
    if suffix == ".json":
        fields, read = read_json_content(raw), mx.from_json
        if not isinstance(fields, dict):
            raise ContentError("expected an object with the keys A, B, C and D")
        own = fields.get("format") in (FORMAT, SPACE_FORMAT)
    elif suffix == ".npz":
        from mbsvib_export.reading import arrays_in

        fields, read = arrays_in(raw, KNOWN), mx.from_npz
        own = str(fields.get("format")) in (FORMAT, SPACE_FORMAT)
    else:
        from mbsvib.common.mat_file import read_mat_file

        fields, read = read_mat_file(raw, KNOWN), mx.from_mat
        own = "mbsvib" in fields
    if not own:
        return fields
    data = read(path)
    return data.state_space if isinstance(data, mx.SystemData) else data


def _names(value: Any, path: Path, word: str) -> list[str]:
    """Names as lists of texts, arrays of texts, or cells of MATLAB."""
    import numpy as np

    listed = [value] if isinstance(value, str) else np.ravel(np.asarray(value, dtype=object)).tolist()
    if not all(isinstance(name, str) for name in listed):
        raise ModelError(f"{path}: {word} = {str(value)[:60]}; expected texts.")
    return [name.strip() for name in listed]


def _period(content: dict[str, Any], path: Path, rate: float | None) -> float | None:
    """The sample time [s] of a controller in discrete time, None in continuous time."""
    import numpy as np

    given = {key: content[key] for key in PERIODS if key in content}
    values = {key: np.ravel(np.asarray(0.0 if value is None else value)) for key, value in given.items()}
    if any(value.size != 1 or value.dtype.kind not in "biuf" for value in values.values()) or \
            len({float(value[0]) for value in values.values()}) > 1:  # fmt: skip
        raise ModelError(f"{path}: {', '.join(f'{key} = {str(value)[:60]}' for key, value in given.items())}; expected "
                         f"one sample time [s] as dt or Ts, 0 or none in continuous time.")  # fmt: skip
    if not values:
        return None
    key, value = next(iter(values.items()))
    period = float(value[0])
    if value.dtype.kind == "b" or period == -1.0:  # python-control and MATLAB: discrete, without saying which time
        if value[0] and rate is None:
            raise shell.UsageProblem(f"{path}: {key} = {value[0]}: the controller is in discrete time without a sample "
                                     f"time; give --rate HZ.")  # fmt: skip
        return 1.0 / rate if value[0] and rate is not None else None
    if period == 0.0:
        return None
    if not 0.0 < period < np.inf:
        raise ModelError(f"{path}: {key} = {period:g}; expected a sample time [s] above 0, or 0 in continuous time.")
    if rate is not None and abs(rate * period - 1.0) > SAME_RATE:
        raise shell.UsageProblem(f"--rate {rate:g}: {path} has {key} = {period:g} s, which is {1.0 / period:g} Hz; "
                                 f"leave --rate out.")  # fmt: skip
    return period


def _check_descriptor(value: Any, path: Path) -> None:
    """Refuse E x' = A x + B y; an empty E stands for the identity."""
    import numpy as np

    if value is not None and np.size(value) and not np.array_equal(value, np.eye(len(value))):
        raise ModelError(f"{path}: it has a matrix E; expected x' = A x + B y without one. Multiply A and B by E^-1.")
