"""Systems, and mechanisms with closed loops: the linear equations of figures and mean squares."""

from __future__ import annotations

from typing import TYPE_CHECKING, TypeAlias

import numpy as np

from mbsvib.api.system import System
from mbsvib.feedback.feedback_loop import FeedbackLoop

if TYPE_CHECKING:
    from collections.abc import Iterable

    from mbsvib.common.arrays import Array, Complex


Linear: TypeAlias = System | FeedbackLoop


def numbers(linear: Linear, outputs: Iterable[str], inputs: Iterable[str]) -> tuple[list[int], list[int]]:
    """Return the numbers of some outputs and inputs."""
    return [linear.outputs.index(name) for name in outputs], [linear.inputs.index(name) for name in inputs]


def responses(linear: Linear, omega: Array, outputs: Iterable[str], inputs: Iterable[str]) -> Complex:
    """Return responses (outputs, inputs, n) at angular frequencies (n,) [rad/s], of all ports at once."""
    return np.asarray(linear.frequency_response(omega)[np.ix_(*numbers(linear, outputs, inputs))])
