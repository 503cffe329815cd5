"""Exact discretisation: what a linear system does in one step while its inputs are held or vary linearly."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from mbsvib.errors import ExportError
from mbsvib.linalg.balancing import exponents

if TYPE_CHECKING:
    from mbsvib.common.arrays import Array
    from mbsvib.responses.state_space import StateSpace


@dataclass(frozen=True, slots=True, eq=False)
class Step:
    """x(t + dt) = phi x(t) + gamma u(t) + slope (u(t + dt) - u(t)) for an input that is linear over the step.

    ``phi`` (n, n), ``gamma`` and ``slope`` (n, inputs); an input that is held has no third term.
    """

    dt: float
    phi: Array
    gamma: Array
    slope: Array


def step_of(space: StateSpace, dt: float, caller: str = "step_of") -> Step:
    """Return the exact step of a state space, by the matrix exponential of balanced states.

    phi = e^(A dt),  gamma = int_0^dt e^(A s) ds B,  slope = int_0^dt e^(A s) (dt - s)/dt ds B

    Parameters
    ----------
    space : StateSpace
        Continuous equations.
    dt : float
        Step [s].
    caller : str
        Name of the public function, for messages.

    Returns
    -------
    Step
        Matrices in the states that were given.

    Raises
    ------
    ExportError
        If the step is no positive number.
    """
    from scipy.linalg import expm

    if isinstance(dt, bool) or not isinstance(dt, (int, float, np.floating, np.integer)) or not 0.0 < dt < np.inf:
        raise ExportError(f"{caller}: step = {dt!r}; expected a positive number of seconds.")
    n, i = space.B.shape
    power = exponents(space.A, space.B, space.C)
    b = np.ldexp(space.B, -power[:, None])
    # the size of inputs must not decide how often expm squares
    largest = np.abs(b).max(axis=0, initial=0.0)
    scale = np.where(largest > 0.0, np.exp2(-np.round(np.log2(np.where(largest > 0.0, largest, 1.0)))), 1.0)
    augmented = np.zeros((n + 2 * i, n + 2 * i))
    augmented[:n, :n] = np.ldexp(space.A, power[None, :] - power[:, None]) * dt
    augmented[:n, n : n + i] = b * scale
    augmented[n : n + i, n + i :] = np.eye(i)
    result = expm(augmented)
    phi = np.ldexp(result[:n, :n], power[:, None] - power[None, :])
    gamma, slope = (np.ldexp(result[:n, part], power[:, None]) * (dt / scale)
                    for part in (slice(n, n + i), slice(n + i, None)))  # fmt: skip
    return Step(float(dt), phi, gamma, slope)
