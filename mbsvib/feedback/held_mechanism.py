"""Mechanisms from sample to sample, under inputs and delayed forces that a zero-order hold keeps constant."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from mbsvib.linalg.discrete import first_order_hold

if TYPE_CHECKING:
    from mbsvib.common.arrays import Array
    from mbsvib.responses.state_space import StateSpace

WHOLE = 1e-9  # share of a period by which a delay may miss a whole number of periods and be one


class HeldMechanism(NamedTuple):
    """x+ = A x + B_f f + B_w w,  y = C x + D w; behind the states of the mechanism, x has the delayed forces.

    ``a`` (n, n), ``forces`` (n, actuators), ``inputs`` (n, inputs), ``outputs`` (outputs, n), ``direct`` (outputs,
    inputs). The newest of the delayed forces comes first, the last ones act when a sample is taken.
    """

    a: Array
    forces: Array
    inputs: Array
    outputs: Array
    direct: Array


def split_delay(rate: float, delay: float) -> tuple[int, float]:
    """Return a delay [s] as a number of whole periods and the remainder [s]."""
    periods = int(np.floor(delay * rate + WHOLE))
    return periods, max(delay - periods / rate, 0.0)


def held_mechanism(space: StateSpace, actuators: list[int], rate: float, delay: float) -> HeldMechanism:
    """Return the mechanism whose ``actuators``, numbers of inputs, act ``delay`` [s] after samples at ``rate`` [Hz]."""
    n, m = len(space.A), len(actuators)
    periods, remainder = split_delay(rate, delay)
    first, held_before, _ = first_order_hold(space.A, space.B, remainder)
    transition, held_after, _ = first_order_hold(space.A, space.B, 1.0 / rate - remainder)
    size = n + m * (periods + 1)
    a, forces, inputs = np.zeros((size, size)), np.zeros((size, m)), np.zeros((size, space.B.shape[1]))
    a[:n, :n], a[:n, size - m :] = transition @ first, transition @ held_before[:, actuators]
    inputs[:n] = transition @ held_before + held_after
    if periods:
        a[:n, size - 2 * m : size - m] += held_after[:, actuators]
    else:
        forces[:n] = held_after[:, actuators]
    a[n + m :, n : size - m] = np.eye(size - n - m)
    forces[n : n + m] = np.eye(m)
    outputs = np.zeros((len(space.C), size))
    outputs[:, :n], outputs[:, size - m :] = space.C, space.D[:, actuators]
    return HeldMechanism(a, forces, inputs, outputs, space.D)
