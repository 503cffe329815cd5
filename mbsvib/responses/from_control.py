"""State spaces and transfer functions of python-control, read without importing it."""

from __future__ import annotations

from typing import Any

from mbsvib.errors import ResponseError


def is_control(value: Any) -> bool:
    """Return whether a value is a state space of python-control."""
    return of_control(value) and all(hasattr(value, label) for label in "ABCD")


def of_control(value: Any) -> bool:
    """Return whether a value is of a class of python-control, or of one that is made from it."""
    return any(base.__module__.split(".")[0] == "control" for base in type(value).__mro__)


def is_transfer_function(value: Any) -> bool:
    """Return whether a value is a transfer function of python-control."""
    return of_control(value) and all(hasattr(value, label) for label in ("num", "den"))


def arguments(value: Any) -> dict[str, Any]:
    """Return matrices and names as arguments of ``StateSpace.from_arrays``.

    ``value``: in continuous time; a transfer function from one input to one output, which gets the states of its
    controllable canonical form. Returns A, B, C, D, inputs, outputs, states, name.
    """
    if is_transfer_function(value):
        return _realized(value)
    _check_continuous(value)
    return {label: getattr(value, label) for label in "ABCD"} | {
        "inputs": list(value.input_labels), "outputs": list(value.output_labels), "states": list(value.state_labels),
        "name": str(value.name)}  # fmt: skip


def _realized(value: Any) -> dict[str, Any]:
    """Return the arguments of a transfer function."""
    from scipy.signal import tf2ss

    _check_continuous(value)
    if (value.ninputs, value.noutputs) != (1, 1):
        raise ResponseError(f"'{value.name}': a transfer function from {value.ninputs} inputs to {value.noutputs} "
                            f"outputs; expected one of each. Give a state space, by control.ss(A, B, C, D), or by "
                            f"control.ss('{value.name}'), which needs slycot.")  # fmt: skip
    numerator, denominator = value.num[0][0], value.den[0][0]
    if len(numerator) > len(denominator):
        raise ResponseError(f"'{value.name}': the numerator has degree {len(numerator) - 1}, the denominator has "
                            f"{len(denominator) - 1}; expected no higher degree above. Add fast poles.")  # fmt: skip
    a, b, c, d = tf2ss(numerator, denominator)
    n = len(denominator) - 1
    return {"A": a[:n, :n], "B": b[:n], "C": c[:, :n], "D": d, "inputs": list(value.input_labels),
            "outputs": list(value.output_labels), "states": [f"x{i}" for i in range(n)], "name": str(value.name)}


def _check_continuous(value: Any) -> None:
    if getattr(value, "dt", None) not in (None, 0):
        raise ResponseError(f"'{value.name}': dt = {value.dt}; expected a system in continuous time. Sampled "
                            f"loops are made by loop.sampled(rate).")  # fmt: skip
