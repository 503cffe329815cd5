"""State spaces of python-control, read without importing it."""

from __future__ import annotations

from typing import Any

from mbsvib.errors import ResponseError


def is_control(value: Any) -> bool:
    """Return whether a value is a state space of python-control."""
    return of_control(value) and all(hasattr(value, label) for label in "ABCD")


def of_control(value: Any) -> bool:
    """Return whether a value is of a class of python-control, or of one that is made from it."""
    return any(base.__module__.split(".")[0] == "control" for base in type(value).__mro__)


def arguments(value: Any) -> dict[str, Any]:
    """Return matrices and names as arguments of ``StateSpace.from_arrays``.

    Parameters
    ----------
    value : control.StateSpace
        In continuous time.

    Returns
    -------
    dict
        A, B, C, D, inputs, outputs, states, name.

    Raises
    ------
    ResponseError
        If it is discrete.
    """
    if getattr(value, "dt", None) not in (None, 0):
        raise ResponseError(f"'{value.name}': dt = {value.dt}; expected a state space in continuous time. Sampled "
                            f"loops are made by loop.sampled(rate).")  # fmt: skip
    return {label: getattr(value, label) for label in "ABCD"} | {
        "inputs": list(value.input_labels), "outputs": list(value.output_labels), "states": list(value.state_labels),
        "name": str(value.name)}  # fmt: skip
