"""Ranges of values on the command line."""

from __future__ import annotations

from typing import TYPE_CHECKING

from mbsvib.cli._shell import UsageProblem
from mbsvib.common.number_text import integer, real

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray


def range_of(text: str, option: str, example: str, log: bool = False) -> tuple[str, NDArray[np.float64]]:
    """Return the name and the values (COUNT,) of NAME=FROM:TO[:COUNT]; 11 of them by default."""
    import numpy as np

    expected = f"'{text}': expected {option}=FROM:TO or {option}=FROM:TO:COUNT, such as {example}."
    name, _, words = text.partition("=")
    try:
        first, last, *more = words.split(":")
        start, end, count = real(first), real(last), integer(more[0]) if more else 11
    except ValueError:
        raise UsageProblem(expected) from None
    if len(more) > 1 or count < 2 or not name:
        raise UsageProblem(expected)
    if log and min(start, end) <= 0.0:
        raise UsageProblem(f"'{text}': --log needs positive ends; leave --log out, or give others.")
    return name, np.geomspace(start, end, count) if log else np.linspace(start, end, count)
