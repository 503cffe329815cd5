"""The exact step of equations with unknown parameters: a matrix exponential in CasADi's own operations."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from mbsvib.linalg.balancing import exponents

if TYPE_CHECKING:
    from mbsvib.responses.state_space import StateSpace

# Pade approximant of degree 13 and the norm up to which it is right to rounding.
# Source: N. J. Higham, "The scaling and squaring method for the matrix exponential revisited" (2005), table 2.3.
_PADE = (64764752532480000.0, 32382376266240000.0, 7771770303897600.0, 1187353796428800.0, 129060195264000.0,
         10559470521600.0, 670442572800.0, 33522128640.0, 1323241920.0, 40840800.0, 960960.0, 16380.0, 182.0, 1.0)
_NORM = 5.371920351148152
_SPARE = 3  # more squarings than the nominal values need: parameters may make A eight times as large


def exponential_step(casadi: Any, a: Any, b: Any, space: StateSpace, dt: float) -> tuple[Any, Any]:
    """Return phi = e^(A dt) and gamma = int_0^dt e^(A s) ds B as expressions.

    ``a``, ``b`` (n, n) and (n, inputs): expressions of the parameters. ``space``: the same with the parameters' own
    values: it tells the scales of states and the number of squarings. ``dt``: step [s].
    """
    n, i = space.B.shape
    power = exponents(space.A, space.B, space.C)
    nominal = np.ldexp(space.A, power[None, :] - power[:, None]) * dt
    # the size of inputs must not decide how often the exponential is squared
    largest = np.abs(np.ldexp(space.B, -power[:, None])).max(axis=0, initial=0.0)
    scale = np.exp2(-np.round(np.log2(np.where(largest > 0.0, largest, 1.0))))
    norm = float(np.abs(nominal).sum(axis=0).max(initial=0.0))
    squarings = _SPARE + max(0, int(np.ceil(np.log2(norm / _NORM))) if norm > 0.0 else 0)
    to, back = casadi.diag(casadi.DM(np.exp2(-power))), casadi.diag(casadi.DM(np.exp2(power)))
    augmented = casadi.horzcat(to @ a @ back * dt, to @ b @ casadi.diag(casadi.DM(scale)))
    augmented = casadi.vertcat(augmented, casadi.DM(i, n + i)) / 2.0**squarings
    result = _pade(casadi, augmented, n + i)
    for _ in range(squarings):
        result = result @ result
    gamma = back @ result[:n, n:] @ casadi.diag(casadi.DM(dt / scale)) if i else casadi.MX(n, 0)
    return back @ result[:n, :n] @ to, gamma


def _pade(casadi: Any, x: Any, size: int) -> Any:
    c, identity = _PADE, casadi.DM.eye(size)
    x2 = x @ x
    x4 = x2 @ x2
    x6 = x4 @ x2
    odd = x @ (x6 @ (c[13] * x6 + c[11] * x4 + c[9] * x2) + c[7] * x6 + c[5] * x4 + c[3] * x2 + c[1] * identity)
    even = x6 @ (c[12] * x6 + c[10] * x4 + c[8] * x2) + c[6] * x6 + c[4] * x4 + c[2] * x2 + c[0] * identity
    return casadi.solve(even - odd, even + odd, "qr")
