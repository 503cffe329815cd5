"""Time response: exact for inputs that are held or vary linearly between samples, whatever the step.

The matrix exponential of the state equations together with the inputs' own equations (constant, or a ramp) carries the
state from one sample to the next; a step that recurs is computed once.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from mbsvib.errors import ResponseError

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray

    from mbsvib.system import System

    Array = NDArray[np.float64]

HOLDS = ("zero", "first")


def time_response(
    system: System, t: ArrayLike, u: ArrayLike, hold: str = "first",
    initial: tuple[ArrayLike, ArrayLike] | None = None,
) -> Array:  # fmt: skip
    """Return the outputs at the times ``t``.

    x(t + h) = exp(A h) x(t) + integral over the step of exp(A (h - s)) B u(t + s) ds

    Parameters
    ----------
    system : System
        The equations of motion.
    t : array-like, shape (n,)
        Ascending times [s].
    u : array-like, shape (inputs, n), or (n,) for a single input
        Inputs at these times.
    hold : str
        "first" (linear between samples) or "zero" (constant from each sample to the next).
    initial : pair of array-like, shape (m,), optional
        q and q' at t[0]; default: rest.

    Returns
    -------
    array, shape (outputs, n)
        Outputs at these times.

    Raises
    ------
    ResponseError
        If times do not ascend, shapes do not match, or the hold is unknown.
    """
    time, inputs, state = _checked(system, t, u, hold, initial)
    modal = system._modal
    phi, m = modal.shapes, system.dof
    gamma = np.diag(modal.gamma) if modal.gamma.ndim == 1 else modal.gamma
    a = np.block([[np.zeros((m, m)), np.eye(m)], [-np.diag(modal.square), -gamma]])
    b = np.concatenate((np.zeros((m, system.B.shape[1])), phi.T @ system.B))
    x = np.empty((2 * m, len(time)))
    if m:
        rows = phi.T @ system.M
        x[:, 0] = np.concatenate((rows @ state[0], rows @ state[1]))
        _march(x, a, b, time, inputs, first=hold == "first")
    q, rate = phi @ x[:m], phi @ x[m:]
    y = system.Cq @ q + system.Cv @ rate + system.D @ inputs
    if system.Ca.any():
        y += (system.Ca @ phi) @ (a[m:] @ x + b[m:] @ inputs)
    return y


def _march(x: Array, a: Array, b: Array, time: Array, u: Array, first: bool) -> None:
    """Fill x[:, 1:] from x[:, 0]; the step matrices of each length are made once."""
    from scipy.linalg import expm

    n, k = b.shape
    steps: dict[float, tuple[Array, Array, Array]] = {}
    # lengths that differ by the rounding of the time stamps are one length
    resolution = 4.0 * np.finfo(float).eps * max(abs(time[0]), abs(time[-1]))
    last = 0.0
    for i, h in enumerate(np.diff(time).tolist()):
        if abs(h - last) > resolution:
            last = next((known for known in steps if abs(known - h) <= resolution), h)
        if last not in steps:
            whole = np.zeros((n + 2 * k, n + 2 * k))
            whole[:n, :n], whole[:n, n : n + k] = a * last, b * last
            whole[n : n + k, n + k :] = np.eye(k)
            power = expm(whole)
            steps[last] = power[:n, :n], power[:n, n : n + k], power[:n, n + k :]
        carry, held, ramp = steps[last]
        x[:, i + 1] = carry @ x[:, i] + held @ u[:, i]
        if first:
            x[:, i + 1] += ramp @ (u[:, i + 1] - u[:, i])


def _checked(
    system: System, t: ArrayLike, u: ArrayLike, hold: str, initial: tuple[ArrayLike, ArrayLike] | None
) -> tuple[Array, Array, Array]:
    if hold not in HOLDS:
        raise ResponseError(f"time_response: hold = {hold!r}; expected 'zero' or 'first'.")
    time = np.asarray(t, dtype=float)
    if time.ndim != 1 or not len(time) or not np.isfinite(time).all() or (np.diff(time) <= 0.0).any():
        raise ResponseError(f"time_response: t has shape {time.shape}; expected a vector of finite times [s], each "
                            f"later than the one before.")  # fmt: skip
    inputs = np.asarray(u, dtype=float)
    if inputs.ndim == 1 and len(system.inputs) == 1:
        inputs = inputs[None, :]
    if inputs.shape != (len(system.inputs), len(time)) or not np.isfinite(inputs).all():
        raise ResponseError(
            f"time_response: u has shape {np.shape(u)}; expected finite values of shape ({len(system.inputs)}, "
            f"{len(time)}), one row for each of the inputs {', '.join(system.inputs) or '(none)'}."
        )
    state = np.zeros((2, system.dof)) if initial is None else np.array([np.asarray(part, float) for part in initial])
    if state.shape != (2, system.dof):
        raise ResponseError(f"time_response: initial has shape {state.shape}; expected q and q' of {system.dof} each.")
    return time, inputs, state
