"""State spaces and transfer functions of python-control, read without importing it, and their states."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from mbsvib.common.arrays import Array
from mbsvib.errors import ResponseError


def realized(
    numerators: Sequence[Sequence[Any]], denominators: Sequence[Sequence[Any]], name: str
) -> tuple[Array, Array, Array, Array]:
    """Return A, B, C, D of a matrix of transfer functions, coefficients in descending powers of s for each output and
    input.

    Entries of one input with one denominator share the states of a controllable canonical form; entries without
    dynamics have none. A pole that several inputs have in common may then be there more often than it must.
    """
    shape = len(numerators), len(numerators[0])
    d, blocks = np.zeros(shape), []
    for j in range(shape[1]):
        groups: dict[tuple[float, ...], list[tuple[int, Array]]] = {}
        for i in range(shape[0]):
            top, below = (np.trim_zeros(np.atleast_1d(np.asarray(table[i][j], dtype=float)), "f")
                          for table in (numerators, denominators))  # fmt: skip
            if len(top) > len(below):
                raise ResponseError(f"'{name}': the numerator has degree {len(top) - 1}, the denominator has "
                                    f"{len(below) - 1}; expected no higher degree above. Add fast poles.")  # fmt: skip
            monic = below / below[0]
            padded = np.concatenate((np.zeros(len(below) - len(top)), top)) / below[0]
            d[i, j] = padded[0]
            if (row := padded[1:] - padded[0] * monic[1:]).any():
                groups.setdefault(tuple(monic[1:].tolist()), []).append((i, row))
        blocks += [(j, np.array(denominator), rows) for denominator, rows in groups.items()]
    n = sum(len(denominator) for _, denominator, _ in blocks)
    a, b, c, start = np.zeros((n, n)), np.zeros((n, shape[1])), np.zeros((shape[0], n)), 0
    for j, denominator, rows in blocks:
        part = slice(start, start + len(denominator))
        a[part, part] = np.eye(len(denominator), k=-1)
        a[start, part] = -denominator
        b[start, j] = 1.0
        for i, row in rows:
            c[i, part] = row
        start = part.stop
    return a, b, c, d


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
