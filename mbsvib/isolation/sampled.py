"""Controllers on a computer: sampled, with a zero-order hold and a delay."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from mbsvib.errors import ResponseError
from mbsvib.isolation.closed_loop import ClosedLoop

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from mbsvib.kinematics import Array

    Complex = NDArray[np.complex128]


@dataclass(frozen=True, repr=False, eq=False)
class SampledLoop(ClosedLoop):
    """A closed loop whose controllers, discretised by Tustin's rule, run at ``rate`` [Hz] and act ``delay`` [s] later.

    Poles are exact, those of the mechanism from sample to sample, as 1/s. Frequency responses are those from
    continuous to continuous signals, without what sampling folds back from above half the rate.
    """

    rate: float = 1.0
    delay: float = 0.0

    @cached_property
    def discrete(self) -> tuple[Array, Array, Array, Array]:
        """The law z+ = A z + B y, u = C z + D y, by Tustin's rule."""
        law, half = self.law, 0.5 / self.rate
        n = len(law.A)
        left = np.linalg.inv(np.eye(n) - half * law.A) if n else np.zeros((0, 0))
        a, b = left @ (np.eye(n) + half * law.A), left @ law.B / self.rate
        c = law.C @ left
        return a, b, c, law.D + half * c @ law.B

    def gains(self, omega: Array) -> Complex:
        """Return the controllers' gains over frequency, with hold and delay.

        Parameters
        ----------
        omega : array, shape (n,)
            Angular frequencies [rad/s].

        Returns
        -------
        array, shape (n, actuators, sensors)
            K(e^(i w T)) times what hold and delay make of it.
        """
        a, b, c, d = self.discrete
        s = 1j * np.asarray(omega, dtype=float)
        z = np.exp(s / self.rate)
        k = np.broadcast_to(d, (len(s), *d.shape)).astype(complex)
        if len(a):
            k = k + c @ np.linalg.solve(z[:, None, None] * np.eye(len(a)) - a, b)
        hold = np.sinc(s.imag / (2.0 * np.pi * self.rate)) * np.exp(-s * (0.5 / self.rate + self.delay))
        return np.asarray(k * hold[:, None, None])

    @cached_property
    def _transition(self) -> Array:
        """From sample to sample: states of mechanism and law, and the forces that are on their way."""
        from scipy.linalg import expm

        space = self.plant._space
        y, u = self._ports()
        n, m = len(space.A), len(u)
        period = 1.0 / self.rate
        whole = int(np.floor(self.delay / period + 1e-9))
        late = max(self.delay - whole * period, 0.0)

        def held(time: float) -> tuple[Array, Array]:
            block = np.zeros((n + m, n + m))
            block[:n, :n], block[:n, n:] = space.A * time, space.B[:, u] * time
            result = expm(block)
            return result[:n, :n], result[:n, n:]

        step, new = held(period - late)
        first, old = held(late)
        a, b, c, d = self.discrete
        k, waiting = len(a), m * (whole + 1)
        total = np.zeros((n + k + waiting, n + k + waiting))
        # the newest force waits in front; what acts when a sample is taken is the one at the end
        acts = slice(n + k + m * whole, n + k + waiting)
        before = slice(n + k + m * (whole - 1), n + k + m * whole) if whole else None
        seen = np.zeros((len(y), len(total)))
        seen[:, :n], seen[:, acts] = space.C[y], space.D[np.ix_(y, u)]
        pushes = d @ seen
        pushes[:, n : n + k] += c
        total[:n, :n] = step @ first
        total[:n, acts] = step @ old
        if before is None:
            total[:n] += new @ pushes
        else:
            total[:n, before] += new
        total[n : n + k] = b @ seen
        total[n : n + k, n : n + k] += a
        total[n + k : n + k + m] = pushes
        for i in range(whole):
            total[n + k + m * (i + 1) : n + k + m * (i + 2), n + k + m * i : n + k + m * (i + 1)] = np.eye(m)
        return total

    @cached_property
    def _eigen(self) -> tuple[Complex, Complex]:
        from scipy.linalg import eig, matrix_balance

        balanced, (scale, _) = matrix_balance(self._transition, permute=False, separate=True)
        z, vectors = eig(balanced)
        vectors = vectors * scale[:, None]
        kept = np.abs(z) > np.finfo(float).eps ** 0.5  # what a delay forgets within a few samples
        values = np.log(z[kept]) * self.rate
        order = np.lexsort((-values.imag, np.abs(values)))
        return values[order], vectors[:, kept][:, order]

    def state_space(self, realization: str = "modal") -> object:  # type: ignore[override]
        """Refuse: samples have no continuous equations.

        Parameters
        ----------
        realization : str
            Any.

        Raises
        ------
        ResponseError
            Always.
        """
        raise ResponseError("state_space: a sampled loop has no continuous equations, and white noise no mean square "
                            "in closed form there: give a band, or a table of densities.")  # fmt: skip


def sampled(loop: ClosedLoop, rate: float, delay: float = 0.0) -> SampledLoop:
    """Return a loop with its controllers on a computer.

    Parameters
    ----------
    loop : ClosedLoop
        The loop with continuous controllers.
    rate : float
        Samples a second [Hz].
    delay : float
        Between measuring and acting [s].

    Returns
    -------
    SampledLoop
        The same loop with discrete controllers.

    Raises
    ------
    ResponseError
        If the rate is not positive or the delay negative.
    """
    if not 0.0 < rate < np.inf or not 0.0 <= delay < np.inf:
        raise ResponseError(f"sampled: rate = {rate!r} Hz, delay = {delay!r} s; expected a positive rate, and a delay "
                            f"that is not negative.")  # fmt: skip
    return SampledLoop(loop.plant, loop.controllers, loop.sensors, loop.actuators, float(rate), float(delay))
