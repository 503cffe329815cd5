"""Discrete-time controllers: sampled, with a zero-order hold and a delay."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any, NoReturn

import numpy as np

from mbsvib.errors import ResponseError
from mbsvib.feedback.closing import transfer
from mbsvib.feedback.excited_period import steady_state
from mbsvib.feedback.feedback_loop import FeedbackLoop
from mbsvib.feedback.loop_rounding import at_poles, refuse_poles
from mbsvib.feedback.sampled_equations import SampledEquations, split_delay
from mbsvib.feedback.sampled_norm import h2_norm
from mbsvib.linalg.lasting import separated
from mbsvib.linalg.rank import EPS
from mbsvib.linalg.spectrum import outside, spectrum
from mbsvib.responses.finite_zeros import first_order_zeros
from mbsvib.responses.first_order_solver import FirstOrderSolver, first_order_solver
from mbsvib.responses.norms import Norm

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

    from mbsvib.common.arrays import Array, Complex, Index
    from mbsvib.common.selection import Names
    from mbsvib.feedback.loop_rounding import Closed
    from mbsvib.linalg.spectrum import Spectrum
    from mbsvib.modes.state_modes import StateModes
    from mbsvib.responses.linear import LinearVerbs


@dataclass(frozen=True, repr=False, eq=False)
class SampledLoop(SampledEquations, FeedbackLoop):
    """A closed loop whose controllers, discretised by Tustin's rule, run at ``rate`` [Hz] and act ``delay`` [s] later.

    Sensors are read before forces change. Poles, margins and stability are exact, those of the mechanism from sample to
    sample; poles as 1/s. Frequency responses are the components at the frequency of the excitation, exact as
    well; what sampling folds from there to other frequencies is not in them. ``continuous`` is the loop with the
    controllers in continuous time.
    """

    def _forces(self, w: Array, plant: tuple[Complex, Complex]) -> tuple[Complex, Array]:
        del plant  # the closed-loop equations are always those that lose no digits
        state = steady_state(self, w, [], self.selected_ports[1])
        hold = np.sinc(w / (2.0 * np.pi * self.rate)) * np.exp(-1j * w * (0.5 / self.rate + self.delay))
        forces, terms = hold * state.value, np.abs(hold) * state.terms
        return forces.transpose(2, 0, 1), EPS * terms.transpose(2, 0, 1)

    def _by_states(self, w: Array) -> Closed:
        def closed(rows: Index, columns: Index, at: Index) -> tuple[Complex, Array]:
            shown, sources = self.selected_ports
            state = steady_state(self, w[at], [shown[k] for k in rows], [sources[k] for k in columns])
            value, terms = state.value[len(self.actuators) :], state.terms[len(self.actuators) :]
            refuse_poles(np.asarray(np.isnan(value).any(axis=(0, 1))), w[at], self.name)
            return value, terms

        return closed

    def _loop_gain(self, w: Array) -> Complex:
        z, plant = np.exp(1j * w / self.rate), self._mechanism
        observed, none = plant.outputs[self.ports[0]], np.zeros((len(self.sensors), len(self.actuators)))
        try:
            with np.errstate(over="ignore", invalid="ignore"):  # so close to a pole that the value overflows
                value = -(transfer(self.discrete, z) @ transfer((plant.a, plant.forces, observed, none), z))
        except np.linalg.LinAlgError:
            value = np.full(1, np.nan, dtype=complex)
        if not np.isfinite(value).all():
            raise ResponseError("closed loop: the plant or a controller has a pole at one of the frequencies (a pure "
                                "integrator at 0 Hz?); leave this frequency out.")  # fmt: skip
        return np.asarray(value)

    def _sensitivity(self, w: Array) -> Complex:
        solver, of_a, ports = self._demands
        z = np.exp(1j * w / self.rate)
        refuse_poles(at_poles(z, of_a), w, self.name)
        return solver.bounded(z, w, ports)[0].transpose(2, 0, 1)

    @cached_property
    def _demands(self) -> tuple[FirstOrderSolver, Spectrum, tuple[Array, Array, Array]]:
        """Solver, spectrum and B, C, D from sample to sample, from what is added to the demanded forces to the sum of
        both, without poles on the unit circle that are not in it.
        """
        a, of_a, demanded = self._at_samples.a, self._spectrum, self._at_samples.gain
        one = np.eye(len(self.actuators))
        forces = self._at_samples.b[:, -len(one) :]
        parts = separated(a, forces, demanded, outside)
        if len(parts.shown) < len(parts.lasting):
            a, forces, demanded = parts.minimal.a, parts.minimal.b, parts.minimal.c
            of_a = spectrum(a)
        return first_order_solver(a, forces, demanded, self.name), of_a, (forces, demanded, one)

    @cached_property
    def continuous(self) -> Any:
        """The loop with the same controllers in continuous time, a ClosedLoop."""
        assert self.continuous_form is not None
        return self.continuous_form(self.plant, self.controllers, self.sensors, self.actuators,
                                    selection=self.selection)  # fmt: skip

    def modes(self) -> StateModes:
        """Return the modes of the loop from sample to sample, as those of continuous equations: s = rate log z.

        Returns
        -------
        StateModes
            Printed as a table.
        """
        from mbsvib.modes.state_modes import state_modes

        at_samples = self.sample_to_sample
        return state_modes(at_samples.A, self.name, at_samples.states, self.rate)

    def transmission_zeros(self, outputs: Names = None, inputs: Names = None) -> Complex:
        """Return the zeros from inputs that are held from sample to sample to outputs at the samples, s = rate log z.

        The finite z at which [[A - z, B], [C, D]] of ``sample_to_sample`` has less than its normal rank, without those
        at 0 that delays have.

        Parameters
        ----------
        outputs, inputs : str or sequence of str, optional
            Names or patterns; default: all. Their numbers may differ.

        Returns
        -------
        array, shape (zeros,)
            Zeros [1/s] in ascending magnitude. Among them are those that sampling adds, with imaginary parts up to pi
            times the rate.

        Raises
        ------
        ResponseError
            If a name is unknown.

        Source: Astrom, Hagander & Sternby, Automatica 20 (1984) 31, for zeros of sampling.
        """
        part = self.with_ports(outputs, inputs).sample_to_sample
        z = first_order_zeros(part.A, part.B, part.C, part.D)
        delays = split_delay(self.rate, self.delay)[0] + 1
        z = z[np.abs(z) > EPS ** (1.0 / (delays + 1))]  # as many delays in a row are a multiple zero at z = 0
        zeros = self.rate * np.log(z)
        return np.asarray(zeros[np.lexsort((-zeros.imag, np.abs(zeros)))])

    def _h2(self, part: SampledLoop) -> Norm:
        return Norm(h2_norm(part))

    def _over_time(self, part: SampledLoop, record: tuple[ArrayLike, ArrayLike, str, Any]) -> Array:
        from mbsvib.feedback.sampled_time import time_response

        t, u, hold, initial = record
        if initial is not None:
            raise ResponseError("time_response: initial: a sampled loop starts at rest; expected None. Initial states "
                                "are those of loop.continuous.")  # fmt: skip
        return time_response(part, t, u, hold)

    def _resolved(self) -> tuple[LinearVerbs, float]:
        return self.continuous, 0.5 * self.rate

    def _first_order(self, realization: str) -> NoReturn:
        raise ResponseError("state_space: a sampled loop has no continuous equations, so that hinf_norm, step_info "
                            "and most exports are refused: ask loop.continuous. For mean squares give a band, or a "
                            "table of densities.")  # fmt: skip

    @property
    def sampled_form(self) -> type[SampledLoop]:
        """The class of the loop with discrete-time controllers."""
        return type(self)
