"""Loop gains of single actuators, on frequencies that resolve their peaks."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from mbsvib.common.expected import kind_of
from mbsvib.common.selection import selected
from mbsvib.errors import ResponseError
from mbsvib.plots._choice import MOST_PANELS
from mbsvib.plots._curves import positive_frequencies
from mbsvib.responses.frequency_grid import resolving_frequencies
from mbsvib.responses.frequency_grid import span as range_of

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

    from mbsvib.common.arrays import Array, Complex
    from mbsvib.common.selection import Names
    from mbsvib.feedback.feedback_loop import FeedbackLoop


def closed(loop: Any, who: str) -> FeedbackLoop:
    """Return a closed loop; refuse anything else."""
    if kind_of(loop) not in ("closed loop", "sampled loop") or not hasattr(loop, "sensitivity"):
        raise ResponseError(f"{who}: loop = {type(loop).__name__}; expected a closed loop, as system.feedback(...) "
                            f"returns it.")  # fmt: skip
    result: FeedbackLoop = loop
    return result


def numbers(loop: FeedbackLoop, actuators: Names) -> list[int]:
    """Return the numbers of the actuators to draw, a panel each."""
    which = selected(actuators, loop.actuators, "actuator", loop.name, ())
    if not 0 < len(which) <= MOST_PANELS:
        raise ResponseError(f"{len(which)} actuators; a figure holds 1 to {MOST_PANELS} panels: choose some by "
                            f"actuators=[...] out of {', '.join(loop.actuators)}.")  # fmt: skip
    return which


def grid(
    loop: FeedbackLoop, frequencies: ArrayLike | None, span: tuple[float | None, float | None], who: str
) -> Array:
    """Return frequencies [Hz]: as given, or such that no pole of the plant, the controllers or the loop is missed."""
    if frequencies is not None:
        return positive_frequencies(frequencies, who)
    poles = np.concatenate((loop.resolution.poles, loop.open_loop.poles()))
    low, high = range_of(poles, *span)
    return resolving_frequencies(np.concatenate((poles, np.linalg.eigvals(loop.law.A))), poles, low,
                  min(high, 0.499 * loop.resolution.period))  # fmt: skip


def gains(loop: FeedbackLoop, which: list[int], frequencies: Array) -> Complex:
    """Return the gain L (actuators, n) of each loop with the others closed, 1 + L = 1 / S."""
    s = loop.sensitivity(2.0 * np.pi * frequencies)
    return np.array([1.0 / s[i, i] - 1.0 for i in which])


def columns_of(count: int) -> int:
    """Return how many of so many panels stand in a row."""
    return 2 if count in (2, 4) else min(count, 3)
