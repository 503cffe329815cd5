"""Discrete-time controllers: sampled, with a zero-order hold and a delay."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, NoReturn, TypeVar

import numpy as np

from mbsvib.errors import ResponseError
from mbsvib.feedback.feedback_loop import FeedbackLoop
from mbsvib.feedback.participation import eigen
from mbsvib.feedback.resolution import Resolution
from mbsvib.linalg.discrete import tustin

if TYPE_CHECKING:
    from mbsvib.common.arrays import Array, Complex


TURN = 2.0  # maximum phase change [rad] of delay and hold in a panel, which its twelve nodes resolve


@dataclass(frozen=True, repr=False, eq=False)
class SampledLoop(FeedbackLoop):
    """A closed loop whose controllers, discretised by Tustin's rule, run at ``rate`` [Hz] and act ``delay`` [s] later.

    Sensors are read before forces change. Poles, margins and stability are exact, those of the mechanism from sample to
    sample; poles as 1/s. Frequency responses are the components at the frequency of the excitation, exact as
    well; what sampling folds from there to other frequencies is not in them.
    """

    rate: float = 1.0
    delay: float = 0.0

    @cached_property
    def discrete(self) -> tuple[Array, Array, Array, Array]:
        """The controller z+ = A z + B y, u = C z + D y, by Tustin's rule."""
        return tustin(self.law.A, self.law.B, self.law.C, self.law.D, 1.0 / self.rate)

    @cached_property
    def _mechanism(self) -> tuple[Array, Array, Array]:
        """A, B, C from forces of the controller to sensors, from sample to sample; the last are delayed forces."""
        from scipy.linalg import expm

        space = self.plant.space
        y, u = self.ports
        n, m = len(space.A), len(u)
        period = 1.0 / self.rate
        periods = int(np.floor(self.delay / period + 1e-9))
        remainder = max(self.delay - periods * period, 0.0)

        def zero_order_hold(time: float) -> tuple[Array, Array]:
            block = np.zeros((n + m, n + m))
            block[:n, :n], block[:n, n:] = space.A * time, space.B[:, u] * time
            result = expm(block)
            return result[:n, :n], result[:n, n:]

        first, previous_force = zero_order_hold(remainder)
        transition, newest_force = zero_order_hold(period - remainder)
        # the newest force is the first of the delayed forces; the last one acts when a sample is taken
        size = n + m * (periods + 1)
        a, b, c = np.zeros((size, size)), np.zeros((size, m)), np.zeros((len(y), size))
        a[:n, :n], a[:n, size - m :] = transition @ first, transition @ previous_force
        if periods:
            a[:n, size - 2 * m : size - m] += newest_force
        else:
            b[:n] = newest_force
        a[n + m :, n : size - m] = np.eye(size - n - m)
        b[n : n + m] = np.eye(m)
        c[:, :n], c[:, size - m :] = space.C[y], space.D[np.ix_(y, u)]
        return a, b, c

    def _loop(self, omega: Array, plant_response: Complex) -> tuple[Complex, Complex, Complex]:
        a, b, c, d = self.discrete
        z = np.exp(1j * omega / self.rate)
        k = np.broadcast_to(d, (len(z), *d.shape)).astype(complex)
        if len(a):
            k = k + c @ _resolved(a, b, z)
        pa, pb, pc = self._mechanism
        hold = np.sinc(omega / (2.0 * np.pi * self.rate)) * np.exp(-1j * omega * (0.5 / self.rate + self.delay))
        return k, k @ (pc @ _resolved(pa, pb, z)), hold

    @cached_property
    def _eigen(self) -> tuple[Complex, Array]:
        a, b, c, d = self.discrete
        pa, pb, pc = self._mechanism
        return eigen(np.block([[pa + pb @ d @ pc, pb @ c], [b @ pc, a]]), self.rate)

    @property
    def title(self) -> str:
        """The controllers' names, and how they run."""
        delay = f", delay {1e3 * self.delay:.3g} ms" if self.delay else ""
        return f"{self.law.name} at {self.rate:g} Hz{delay}"

    @property
    def resolution(self) -> Resolution:
        """Poles and panels of the responses: sampling repeats poles; a delay has none but rotates the phase."""
        return Resolution(self.poles(), TURN / (2.0 * np.pi * (self.delay + 2.0 / self.rate)), self.rate)

    def state_space(self, realization: str = "modal") -> NoReturn:
        """Refuse: samples have no continuous equations.

        Parameters
        ----------
        realization : str
            Any.

        Returns
        -------
        NoReturn
            Nothing.

        Raises
        ------
        ResponseError
            Always.
        """
        raise ResponseError("state_space: a sampled loop has no continuous equations, and white noise no mean square "
                            "in closed form there: give a band, or a table of densities.")  # fmt: skip

    def sampled(self, rate: float, delay: float = 0.0) -> SampledLoop:
        """Return the loop with its controllers at another rate.

        Parameters
        ----------
        rate : float
            Samples a second [Hz].
        delay : float
            Between measuring and acting [s].

        Returns
        -------
        SampledLoop
            The same loop with discrete controllers and a zero-order hold.
        """
        return sampled(self, rate, delay, type(self))


L = TypeVar("L", bound=SampledLoop)


def sampled(loop: FeedbackLoop, rate: float, delay: float, form: type[L]) -> L:
    """Return a loop with discrete-time controllers.

    ``rate``: samples a second [Hz]. ``delay``: between measuring and acting [s].
    """
    if not 0.0 < rate < np.inf or not 0.0 <= delay < np.inf:
        raise ResponseError(f"sampled: rate = {rate!r} Hz, delay = {delay!r} s; expected a positive rate, and a delay "
                            f"that is not negative.")  # fmt: skip
    return form(loop.plant, loop.controllers, loop.sensors, loop.actuators, float(rate), float(delay),
                selection=loop.selection)  # fmt: skip


def _resolved(a: Array, b: Array, z: Complex) -> Complex:
    """(z - A)^-1 B, shape (n, states, columns)."""
    return np.asarray(np.linalg.solve(z[:, None, None] * np.eye(len(a)) - a, b))
