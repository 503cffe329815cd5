"""Discrete-time equations in place of continuous ones."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from mbsvib.common.arrays import Array


def tustin(a: Array, b: Array, c: Array, d: Array, step: float) -> tuple[Array, Array, Array, Array]:
    """Return discrete-time equations by Tustin's rule, s = 2/h (z - 1)/(z + 1), h the ``step`` [s].

    z+ = Ad z + Bd u,  y = Cd z + Dd u  with  L = (1 - h/2 A)^-1,
    Ad = L (1 + h/2 A),  Bd = h L B,  Cd = C L,  Dd = D + h/2 C L B

    Source: Franklin, Powell & Workman, Digital Control of Dynamic Systems (1998), section 6.1.
    """
    half, n = 0.5 * step, len(a)
    left = np.linalg.inv(np.eye(n) - half * a) if n else np.zeros((0, 0))
    gain = c @ left
    return left @ (np.eye(n) + half * a), step * (left @ b), gain, d + half * gain @ b


def inverse_tustin(a: Array, b: Array, c: Array, d: Array, step: float) -> tuple[Array, Array, Array, Array]:
    """Return the continuous equations of which Tustin's rule makes these discrete-time ones.

    A = 2/h (Ad - 1) L,  B = 2/h L Bd,  C = 2 Cd L,  D = Dd - Cd L Bd  with  L = (1 + Ad)^-1

    ``a``, ``b``, ``c``, ``d`` (n, n), (n, i), (o, n), (o, i): discrete-time equations without a pole at z = -1.
    ``step``: time between samples h [s].
    """
    n = len(a)
    left = np.linalg.inv(np.eye(n) + a) if n else np.zeros((0, 0))
    gain = c @ left
    return 2.0 / step * (a - np.eye(n)) @ left, 2.0 / step * (left @ b), 2.0 * gain, d - gain @ b
