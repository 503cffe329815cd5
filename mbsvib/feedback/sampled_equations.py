"""Loops with discrete-time controllers from sample to sample: mechanisms under inputs and forces that are held."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np

from mbsvib.common.arrays import Array, Complex
from mbsvib.common.display import Displayed
from mbsvib.common.units import prefix, time_unit
from mbsvib.feedback.closing import ClosedSpace, closed_space
from mbsvib.feedback.loop import Loop, Resolution
from mbsvib.feedback.participation import eigen
from mbsvib.linalg.discrete import first_order_hold, tustin
from mbsvib.linalg.spectrum import Spectrum, spectrum
from mbsvib.responses.state_space import StateSpace

TURN = 2.0  # maximum phase change [rad] of delay and hold in a panel, which its twelve nodes resolve
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


@dataclass(frozen=True, repr=False, eq=False)
class SampleToSample(Displayed):
    """A loop from one sample to the next, x+ = A x + B w, y = C x + D w, with the names of its ``states``.

    Inputs w and outputs y are those of the loop, in their order and units.
    """

    A: Array
    """State matrix (n, n) from one sample to the next."""
    B: Array
    """Input matrix (n, inputs)."""
    C: Array
    """Output matrix (outputs, n)."""
    D: Array
    """Direct response of outputs to inputs (outputs, inputs)."""
    states: tuple[str, ...]


@dataclass(frozen=True, repr=False, eq=False)
class SampledEquations(Loop):
    """A loop whose controllers, discretised by Tustin's rule, run at ``rate`` [Hz] and act ``delay`` [s] later."""

    rate: float = 1.0
    delay: float = 0.0
    continuous_form: type[Any] | None = field(default=None, repr=False, kw_only=True)

    @property
    def period(self) -> float:
        """Sample time of the controllers [s]."""
        return 1.0 / self.rate

    @property
    def late(self) -> float:
        """The delay in periods, a whole number where rounding alone makes it miss one."""
        periods, remainder = split_delay(self.rate, self.delay)
        return periods + remainder * self.rate

    @cached_property
    def discrete(self) -> tuple[Array, Array, Array, Array]:
        """The controller z+ = A z + B y, u = C z + D y, by Tustin's rule."""
        return tustin(self.law.A, self.law.B, self.law.C, self.law.D, 1.0 / self.rate)

    @cached_property
    def _mechanism(self) -> HeldMechanism:
        return held_mechanism(self.plant.space, self.ports[1], self.rate, self.delay)

    @cached_property
    def _at_samples(self) -> ClosedSpace:
        """The loop from sample to sample, under inputs that are held and under forces added to the demanded ones."""
        plant, law, (y, u) = self._mechanism, self.discrete, self.ports
        inputs = plant.inputs.shape[1]
        held = (plant.a, np.concatenate((plant.inputs, plant.forces), axis=1), plant.outputs,
                np.concatenate((plant.direct, np.zeros((len(plant.outputs), len(u)))), axis=1))  # fmt: skip
        return closed_space(held, law, y, list(range(inputs, inputs + len(u))))

    @cached_property
    def sample_to_sample(self) -> SampleToSample:
        """The loop at its samples, x+ = A x + B w, y = C x + D w, exact for inputs that are held from sample to sample.

        States: those of the mechanism, delayed forces, states of the controllers.
        """
        closed, space, (shown, sources) = self._at_samples, self.plant.space, self.selected_ports
        delayed = len(self._mechanism.a) - len(space.A)
        states = (*space.states, *[f"force{i + 1}" for i in range(delayed)],
                  *[f"controller{i + 1}" for i in range(len(self.discrete[0]))])  # fmt: skip
        return SampleToSample(closed.a, closed.b[:, sources], closed.c[shown], closed.d[np.ix_(shown, sources)], states)

    @cached_property
    def _eigen(self) -> tuple[Complex, Array, Array]:
        return eigen(self._spectrum, self.rate)

    @cached_property
    def _spectrum(self) -> Spectrum:
        return spectrum(self.sample_to_sample.A)

    @property
    def title(self) -> str:
        """The controllers' names, and how they run."""
        factor, unit = time_unit(self.delay)
        delay = f", delay {factor * self.delay:.3g} {unit}" if self.delay else ""
        factor, unit = prefix("Hz", self.rate) if self.rate >= 1e6 else (1.0, "Hz")
        return f"{self.law.name} at {factor * self.rate:g} {unit}{delay}"

    @property
    def resolution(self) -> Resolution:
        """Poles and panels of the responses: sampling repeats poles; a delay has none but rotates the phase."""
        return Resolution(self.poles(), TURN / (2.0 * np.pi * (self.delay + 2.0 / self.rate)), self.rate)
