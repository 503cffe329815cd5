"""Discrete-time equations in place of continuous ones."""

from __future__ import annotations

import numpy as np
from scipy.linalg import expm

from mbsvib.common.arrays import Array, Complex
from mbsvib.linalg.balancing import column_units

# Periods of the slowest pole in a step, beyond which a rate [Hz] is likely to be given as a step [s] or the reverse.
# Steps of fewer periods may be those of slow loops around a fast plant.
LONG = 100.0


def implausible_step(step: float, poles: Complex) -> str:
    """Return what tells that a ``step`` [s] is implausibly long for ``poles`` (n,) [1/s]; "" where it is not.

    Poles at 0 are not considered.
    """
    slowest = float(np.abs(poles[poles != 0.0]).min(initial=np.inf))
    count = step * slowest / (2.0 * np.pi)
    return f"a step of {step:g} s is {count:.3g} periods of the slowest pole" if LONG < count < np.inf else ""


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


def tustin_gradient(a: Array, b: Array, c: Array, gradient: Array, step: float) -> Array:
    """Return the gradient to [A B; C D], of one to [Ad Bd; Cd Dd] by Tustin's rule (states + outputs, states + inputs).

    ``a``, ``b``, ``c``, ``step``: as of ``tustin``.
    """
    n, half = len(a), 0.5 * step
    left = np.linalg.inv(np.eye(n) - half * a)
    to_a, to_b, to_c, to_d = gradient[:n, :n], gradient[:n, n:], gradient[n:, :n], gradient[n:, n:]
    to_left = 2.0 * to_a + step * to_b @ b.T + c.T @ (to_c + half * to_d @ b.T)
    result = gradient.copy()
    result[:n, :n] = half * left.T @ to_left @ left.T
    result[:n, n:] = left.T @ (step * to_b + half * c.T @ to_d)
    result[n:, :n] = (to_c + half * to_d @ b.T) @ left.T
    return result


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


def first_order_hold(a: Array, b: Array, step: float) -> tuple[Array, Array, Array]:
    """Return the exact step of x' = A x + B u where u is linear in time: from u to u + du within the ``step`` h [s].

    x+ = exp(A h) x + h phi_1(A h) B u + h phi_2(A h) B du,  phi_k(z) = sum of z^j / (j + k)!,  by one exponential

    ``a``, ``b`` (n, n), (n, i). Returns exp(A h) (n, n) and the factors of u and du, (n, i) each. Inputs that are held
    need no du.

    Source: C. F. Van Loan, IEEE Trans. Automatic Control 23 (1978) 395: integrals of the matrix exponential.
    """
    n, i = b.shape
    # the size of inputs must not decide how often expm squares; powers of two round nothing
    scale = column_units(b, 1.0)
    augmented = np.zeros((n + 2 * i, n + 2 * i))
    augmented[:n, :n], augmented[:n, n : n + i] = a * step, b * scale
    augmented[n : n + i, n + i :] = np.eye(i)
    result = expm(augmented)[:n]
    return result[:, :n], result[:, n : n + i] * (step / scale), result[:, n + i :] * (step / scale)
