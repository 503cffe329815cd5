"""State spaces and transfer functions of python-control, read without importing it."""

from __future__ import annotations

from typing import Any

from mbsvib.errors import ResponseError
from mbsvib.responses.realized import realized


def is_control(value: Any) -> bool:
    """Return whether a value is a state space of python-control."""
    return of_control(value) and all(hasattr(value, label) for label in "ABCD")


def of_control(value: Any) -> bool:
    """Return whether a value is of a class of python-control, or of one that is made from it."""
    return any(base.__module__.split(".")[0] == "control" for base in type(value).__mro__)


def is_transfer_function(value: Any) -> bool:
    """Return whether a value is a transfer function of python-control."""
    return of_control(value) and all(hasattr(value, label) for label in ("num", "den"))


def sample_time(value: Any) -> float | None:
    """Return the sample time [s] of equations of python-control, None in continuous time."""
    dt = getattr(value, "dt", None)
    if dt is None or dt == 0:
        return None
    if dt is True:
        raise ResponseError(f"'{value.name}': it is discrete without a sample time; expected dt in seconds.")
    return float(dt)


def arguments(value: Any) -> dict[str, Any]:
    """Return matrices and names as arguments of ``StateSpace.from_arrays``; of a transfer function as ``realized`` has
    them.

    Refused if it is an improper transfer function; equations may be in discrete time.
    """
    if is_transfer_function(value):
        matrices = dict(zip("ABCD", realized(value.num, value.den, str(value.name)), strict=True))
        states = [f"x{i}" for i in range(len(matrices["A"]))]
    else:
        matrices, states = {label: getattr(value, label) for label in "ABCD"}, list(value.state_labels)
    return {**matrices, "inputs": list(value.input_labels), "outputs": list(value.output_labels), "states": states,
            "name": str(value.name)}  # fmt: skip


def check_continuous(value: Any) -> None:
    """Refuse equations of python-control in discrete time."""
    if getattr(value, "dt", None) not in (None, 0):
        raise ResponseError(f"'{value.name}': dt = {value.dt}; expected a system in continuous time. Loops with "
                            f"discrete controllers are made by system.feedback and loop.sampled(rate).")  # fmt: skip
