"""Discretisation: exact while inputs are held or vary linearly over a step, or by Tustin's rule."""

from __future__ import annotations

import warnings

import numpy as np

from mbsvib.common.arrays import Array
from mbsvib.common.expected import one_of
from mbsvib.errors import AccuracyWarning, ExportError
from mbsvib.linalg.balancing import exponents, scaled_by
from mbsvib.linalg.discrete import first_order_hold, implausible_step, tustin
from mbsvib.linalg.groups import part_numbers
from mbsvib.responses.modal_steps import Oscillators
from mbsvib.responses.state_space import StateSpace
from mbsvib_export.responses import poles

METHODS = ("zoh", "foh", "tustin")


def step_of(space: StateSpace, dt: float, caller: str) -> tuple[Array, Array, Array]:
    """Return the exact step of length ``dt`` [s] of a state space, by the matrix exponential of balanced states.

    x(t + dt) = phi x(t) + gamma u(t) + slope (u(t + dt) - u(t)) for an input that is linear over the step,
    phi = e^(A dt),  gamma = int_0^dt e^(A s) ds B,  slope = int_0^dt e^(A s) (dt - s)/dt ds B

    ``phi`` (n, n), ``gamma`` and ``slope`` (n, inputs); an input that is held has no third term.
    """
    check_step(dt, caller)
    n, i = space.B.shape
    phi, gamma, slope = np.zeros((n, n)), np.zeros((n, i)), np.zeros((n, i))
    block = part_numbers(space.A != 0.0)
    # modes one by one: a fast one must not decide how often a slow one is squared
    for number in range(block.max(initial=-1) + 1):
        states = np.flatnonzero(block == number)
        within = np.ix_(states, states)
        of_block = _oscillator if _is_oscillator(space.A[within], space.B[states]) else _exponential
        with np.errstate(over="ignore", invalid="ignore"):
            parts = of_block(space.A[within], space.B[states], space.C[:, states], dt)
        if not all(np.isfinite(part).all() for part in parts):
            raise ExportError(f"{caller}: '{space.name}' grows beyond all numbers within step = {dt:g} s; take a "
                              f"shorter one.")  # fmt: skip
        phi[within], gamma[states], slope[states] = parts
    return phi, gamma, slope


def _is_oscillator(a: Array, b: Array) -> bool:
    """Tell whether two states are a mode and its rate, on which forces act."""
    return len(a) == 2 and a[0, 0] == 0.0 and a[0, 1] == 1.0 and not b[0].any()


def _oscillator(a: Array, b: Array, _: Array, dt: float) -> tuple[Array, Array, Array]:
    """phi, gamma and slope of a mode, in closed form, as the time responses of the core have them."""
    transition, constant, ramp = Oscillators(-a[1, :1], -a[1, 1:]).step(np.array([dt]))
    return transition[:, :, 0, 0], constant[:, 0] * b[1], ramp[:, 0] * b[1]


def _exponential(a: Array, b: Array, c: Array, dt: float) -> tuple[Array, Array, Array]:
    """phi, gamma and slope of coupled states."""
    power = exponents(a, b, c)
    a, b, _ = scaled_by(power, a, b, c)
    phi, gamma, slope = first_order_hold(a, b, dt)
    back = power[:, None]
    return np.ldexp(phi, back - power), np.ldexp(gamma, back), np.ldexp(slope, back)


def check_step(dt: float, caller: str, name: str = "step") -> None:
    """Refuse a time that is no positive number."""
    if isinstance(dt, bool) or not isinstance(dt, (int, float, np.floating, np.integer)) or not 0.0 < dt < np.inf:
        raise ExportError(f"{caller}: {name} = {dt!r}; expected a positive number of seconds.")


def doubt_step(space: StateSpace, dt: float, caller: str, name: str = "step", stacklevel: int = 3) -> None:
    """Warn the user of ``caller`` if the step ``dt`` [s], its argument ``name``, is implausibly long for the poles."""
    if doubt := implausible_step(dt, poles(space.A)):
        warnings.warn(f"{caller}: {name} = {dt:g}: {doubt} of '{space.name}'; is it in s, not a rate in Hz?",
                      AccuracyWarning, stacklevel=stacklevel)  # fmt: skip


def discretised(space: StateSpace, dt: float, method: str, caller: str) -> tuple[Array, Array, Array, Array]:
    """Return the discrete-time equations x+ = A x + B u, y = C x + D u of a state space, with the step ``dt`` [s].

    ``method``: "zoh": exact for inputs that are held over each step; "foh": exact for inputs that are linear over each
    step, with the states x - slope u; "tustin": s = 2/dt (z - 1)/(z + 1), for controllers, whose frequency response
    counts.
    """
    check_step(dt, caller)
    if one_of(method, METHODS, caller, "method", ExportError) == "tustin":
        power = exponents(space.A, space.B, space.C)
        try:
            a, b, c, d = tustin(*scaled_by(power, space.A, space.B, space.C), space.D, dt)
        except np.linalg.LinAlgError:
            raise ExportError(f"{caller}: '{space.name}' has a pole at 2/step = {2.0 / dt:g} 1/s, where Tustin's rule "
                              f"divides by zero; take another step.") from None  # fmt: skip
        return (np.ldexp(a, power[:, None] - power[None, :]), np.ldexp(b, power[:, None]),
                np.ldexp(c, -power[None, :]), d)  # fmt: skip
    phi, gamma, slope = step_of(space, dt, caller)
    if method == "zoh":
        return phi, gamma, space.C, space.D
    return phi, gamma - slope + phi @ slope, space.C, space.D + space.C @ slope
