"""Several controllers as one, whose outputs on the same actuator add up."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from scipy.linalg import block_diag

from mbsvib.feedback.controller import Controller

if TYPE_CHECKING:
    from collections.abc import Sequence


def combined(controllers: Sequence[Controller], sensors: tuple[str, ...], actuators: tuple[str, ...]) -> Controller:
    """Return one controller, from all ``sensors`` to all ``actuators``, that does what several do."""
    a = block_diag(*[part.A for part in controllers])
    b, c = np.zeros((len(a), len(sensors))), np.zeros((len(actuators), len(a)))
    d, start = np.zeros((len(actuators), len(sensors))), 0
    for part in controllers:
        states = slice(start, start + len(part.A))
        into, out = [sensors.index(name) for name in part.inputs], [actuators.index(name) for name in part.outputs]
        b[states, into], c[out, states] = part.B, part.C
        d[np.ix_(out, into)] += part.D
        start += len(part.A)
    return Controller(" + ".join(part.name for part in controllers), a, b, c, d, sensors, actuators)
