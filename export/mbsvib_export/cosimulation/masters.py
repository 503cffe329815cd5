"""One step of each kind of master on exactly discretised equations, how large it may be, and the loop itself.

States, inputs and outputs are those of the plant, then those of the controller. The vector between two steps is
z = (states, outputs), and for linear extrapolation the rates of the outputs too. Inputs that are not connected are
held: e.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.linalg import block_diag

from mbsvib.common.arrays import Array
from mbsvib.linalg.discrete import first_order_hold

Equations = tuple[Array, Array, Array, Array]


MASTERS = {
    "jacobi": "both FMUs step in parallel, inputs held",
    "gauss-seidel": "the plant steps first, the controller takes its new outputs, inputs held",
    "slopes": "both step in parallel, inputs by linear extrapolation of the outputs",
    "iteration": "steps are repeated until inputs, linear in time, meet the outputs",
}
_ROUNDING = 1e-7  # eigenvalues of rigid-body motions come in pairs, which rounding takes apart
_FEW = 60  # numbers in z up to which steps are tried close to each other, so that no unstable range is jumped over
_SHORT = 0.1  # of the shortest time constant: where the search begins, as longer steps may be stable again
_MOST, _LEAST, _DIGITS = 1e2, 1e-6, 10  # of the step asked for: where the search ends; halvings of the last range


@dataclass(frozen=True, slots=True)
class Loop:
    """x' = A x + B u, y = C x + D u,  u = ``coupling`` y + ``outside`` e,  and the step x(h) = phi x + g0 u + g1 u'.

    ``ahead``: number of outputs of the plant, which come first.
    """

    A: Array
    B: Array
    C: Array
    D: Array
    phi: Array
    g0: Array
    g1: Array
    coupling: Array
    outside: Array
    ahead: int
    h: float

    def monolithic(self) -> Equations:
        """Return A, B, C, D of the closed loop with the outputs of both, from the inputs that are free."""
        solved = np.linalg.solve(np.eye(len(self.C)) - self.D @ self.coupling,
                                 np.concatenate((self.C, self.D @ self.outside), axis=1))  # fmt: skip
        c, d = np.split(solved, [len(self.A)], axis=1)
        into = self.B @ self.coupling
        return self.A + into @ c, self.B @ self.outside + into @ d, c, d

    def start(self, x: Array, e: Array, slopes: bool) -> Array:
        """Return z at the beginning, all outputs as they follow from states and inputs at once."""
        _, _, c, d = self.monolithic()
        y = c @ x + d @ e
        rate = self.C @ (self.A @ x + self.B @ (self.coupling @ y + self.outside @ e))
        return np.concatenate((x, y, rate) if slopes else (x, y))

    def step(self, method: str, z: Array, e: Array) -> Array:
        """Return z after a step of a master; z and e may have columns."""
        x, y, rate = np.split(z, np.cumsum((len(self.A), len(self.C))))
        if method == "iteration":
            first = self.sweep(x, y, e, np.zeros_like(y))[1][self.ahead :]
            guess = np.zeros_like(y)
            guess[self.ahead :] = np.linalg.solve(np.eye(len(first)) - self.contraction(), first)
            return np.concatenate(self.sweep(x, y, e, guess))
        u = self.coupling @ y + self.outside @ e
        if method == "slopes":
            slope = self.coupling @ rate
            x, end = self.phi @ x + self.g0 @ u + self.g1 @ slope, u + self.h * slope
            rate = self.C @ (self.A @ x + self.B @ end) + self.D @ slope
            return np.concatenate((x, self.C @ x + self.D @ end, rate))
        if method == "gauss-seidel":  # the controller takes what the plant will answer
            new = self.C @ (self.phi @ x + self.g0 @ u) + self.D @ u
            u = self.coupling @ np.concatenate((new[: self.ahead], y[self.ahead :])) + self.outside @ e
        x = self.phi @ x + self.g0 @ u
        return np.concatenate((x, self.C @ x + self.D @ u))

    def sweep(self, x: Array, y: Array, e: Array, guess: Array) -> tuple[Array, Array]:
        """Return states and outputs at the end of a step in which the controller's outputs run from y to a guess."""
        u = self.coupling @ y + self.outside @ e
        for _ in range(2):  # the plant, then the controller, whose inputs run to the plant's new outputs
            slope = self.coupling @ (guess - y) / self.h
            end = self.phi @ x + self.g0 @ u + self.g1 @ slope
            outputs = self.C @ end + self.D @ (u + self.h * slope)
            guess = np.concatenate((outputs[: self.ahead], guess[self.ahead :]))
        return end, outputs

    def contraction(self) -> Array:
        """Return what one iteration makes of an error of the controller's outputs."""
        guess = np.eye(len(self.C))[:, self.ahead :]
        x, e = (np.zeros((size, guess.shape[1])) for size in (len(self.A), self.outside.shape[1]))
        return self.sweep(x, np.zeros_like(guess), e, guess)[1][self.ahead :]

    def matrix(self, method: str) -> Array:
        """Return the matrix of a master's step."""
        size = len(self.A) + len(self.C) * (2 if method == "slopes" else 1)
        return self.step(method, np.eye(size), np.zeros((self.outside.shape[1], size)))


def loop_of(units: Sequence[Equations], coupling: Array, outside: Array, h: float) -> Loop:
    """Return the loop of a plant and a controller, A, B, C, D each, with the step ``h`` [s]."""
    held = [(phi, now, change * h) for phi, now, change in (first_order_hold(a, b, h) for a, b, _, _ in units)]
    a, b, c, d = (block_diag(*parts) for parts in zip(*units, strict=True))
    phi, g0, g1 = (block_diag(*parts) for parts in zip(*held, strict=True))
    return Loop(a, b, c, d, phi, g0, g1, coupling, outside, len(units[0][2]), h)


def radius(loop: Loop, method: str) -> float:
    """Return the spectral radius of a step [1]; for iteration the contraction factor, if that is larger."""
    largest = _largest(loop.matrix(method))
    return max(largest, _largest(loop.contraction())) if method == "iteration" else largest


def _largest(matrix: Array) -> float:
    return float(np.abs(np.linalg.eigvals(matrix)).max(initial=0.0)) if np.isfinite(matrix).all() else np.inf


def is_stable(spectral_radius: float, growth: float, h: float) -> bool:
    """Return whether a spectral radius is no more than that of the loop itself, whose poles end at ``growth`` [1/s]."""
    return bool(spectral_radius <= np.exp(min(max(growth, 0.0) * h, 50.0)) + _ROUNDING)


def largest_stable_step(make: Callable[[float], Loop], method: str, step: float, growth: float) -> float:
    """Return the largest step [s], to 0.1 %, such that a master is stable with this and all shorter steps:
    infinity if 100 times the requested ``step`` is, 0 if a millionth is not. ``growth``: of the loop itself [1/s].
    """

    def stable(h: float) -> bool:
        return is_stable(radius(make(h), method), growth, h)

    loop = make(step)
    fastest = max(_largest(loop.A), _largest(loop.monolithic()[0]))
    factor = 1.25 if len(loop.A) + len(loop.C) <= _FEW else 2.0
    h = max(min(step, _SHORT / fastest), _LEAST * step) if fastest > 0.0 else step
    if stable(h):
        while stable(h * factor):
            h *= factor
            if h > _MOST * step:
                return float("inf")
        good, bad = h, h * factor
    else:
        while not stable(h / factor):
            h /= factor
            if h < _LEAST * step:
                return 0.0
        good, bad = h / factor, h
    for _ in range(_DIGITS):
        h = (good + bad) / 2
        good, bad = (h, bad) if stable(h) else (good, h)
    return good


def within(step: float, largest: float) -> bool:
    """Return whether a step is no more than the largest stable one, which is known to 0.1 %."""
    return step <= largest * (1.0 + 2.0 * 2.0**-_DIGITS)
