"""Discrete-time controllers: sampled, with a zero-order hold and a delay."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property
from typing import TYPE_CHECKING, Any, NoReturn, TypeVar

import numpy as np

from mbsvib.common.display import Displayed
from mbsvib.errors import ResponseError
from mbsvib.feedback.excited_period import steady_state
from mbsvib.feedback.feedback_loop import FeedbackLoop
from mbsvib.feedback.held_mechanism import HeldMechanism, held_mechanism, split_delay
from mbsvib.feedback.loop_rounding import at_poles, refuse_poles
from mbsvib.feedback.participation import eigen
from mbsvib.feedback.resolution import Resolution
from mbsvib.feedback.sampled_norm import h2_norm
from mbsvib.linalg.discrete import tustin
from mbsvib.linalg.lasting import separated
from mbsvib.linalg.rank import EPS
from mbsvib.linalg.spectrum import outside, spectrum
from mbsvib.responses.first_order_solver import FirstOrderSolver, first_order_solver
from mbsvib.responses.first_order_zeros import first_order_zeros
from mbsvib.responses.frequency_grid import frequency_grid
from mbsvib.responses.norms import Norm

if TYPE_CHECKING:

    from numpy.typing import ArrayLike

    from mbsvib.common.arrays import Array, Complex, Index
    from mbsvib.common.selection import Names
    from mbsvib.feedback.loop_rounding import Closed
    from mbsvib.linalg.spectrum import Spectrum
    from mbsvib.modes.state_modes import StateModes



TURN = 2.0  # maximum phase change [rad] of delay and hold in a panel, which its twelve nodes resolve


@dataclass(frozen=True, repr=False, eq=False)
class SampleToSample(Displayed):
    """A loop from one sample to the next, x+ = A x + B w, y = C x + D w, with the names of its ``states``.

    Inputs w and outputs y are those of the loop, in their order and units.
    """

    A: Array
    B: Array
    C: Array
    D: Array
    states: tuple[str, ...]


@dataclass(frozen=True, repr=False, eq=False)
class SampledLoop(FeedbackLoop):
    """A closed loop whose controllers, discretised by Tustin's rule, run at ``rate`` [Hz] and act ``delay`` [s] later.

    Sensors are read before forces change. Poles, margins and stability are exact, those of the mechanism from sample to
    sample; poles as 1/s. Frequency responses are the components at the frequency of the excitation, exact as
    well; what sampling folds from there to other frequencies is not in them. ``continuous`` is the loop with the
    controllers in continuous time.
    """

    rate: float = 1.0
    delay: float = 0.0
    continuous_form: type[Any] | None = field(default=None, repr=False, kw_only=True)

    @property
    def period(self) -> float:
        """Sample time of the controllers [s]."""
        return 1.0 / self.rate

    @cached_property
    def discrete(self) -> tuple[Array, Array, Array, Array]:
        """The controller z+ = A z + B y, u = C z + D y, by Tustin's rule."""
        return tustin(self.law.A, self.law.B, self.law.C, self.law.D, 1.0 / self.rate)

    @cached_property
    def _mechanism(self) -> HeldMechanism:
        return held_mechanism(self.plant.space, self.ports[1], self.rate, self.delay)

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
        a, b, c, d = self.discrete
        z = np.exp(1j * w / self.rate)
        plant, gains = self._mechanism, np.broadcast_to(d, (len(z), *d.shape)).astype(complex)
        try:
            with np.errstate(over="ignore", invalid="ignore"):  # so close to a pole that the value overflows
                if len(a):
                    gains = gains + c @ _resolved(a, b, z)
                value = np.asarray(-(gains @ (plant.outputs[self.ports[0]] @ _resolved(plant.a, plant.forces, z))))
        except np.linalg.LinAlgError:
            value = np.full(1, np.nan, dtype=complex)
        if not np.isfinite(value).all():
            raise ResponseError("closed loop: the plant or a controller has a pole at one of the frequencies (a pure "
                                "integrator at 0 Hz?); leave this frequency out.")  # fmt: skip
        return value

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
        _, _, c, d = self.discrete
        plant, one = self._mechanism, np.eye(len(d))
        forces = np.concatenate((plant.forces, np.zeros((len(c.T), len(d)))))
        demanded = np.concatenate((d @ plant.outputs[self.ports[0]], c), axis=1)
        parts = separated(self.sample_to_sample.A, forces, demanded, outside)
        if len(parts.shown) == len(parts.lasting):
            a, of_a = self.sample_to_sample.A, self._spectrum
        else:
            a, forces, demanded = parts.minimal.a, parts.minimal.b, parts.minimal.c
            of_a = spectrum(a)
        return first_order_solver(a, forces, demanded, self.name), of_a, (forces, demanded, one)

    @cached_property
    def sample_to_sample(self) -> SampleToSample:
        """The loop at its samples, x+ = A x + B w, y = C x + D w, exact for inputs that are held from sample to sample.

        States: those of the mechanism, delayed forces, states of the controllers.
        """
        a, b, c, d = self.discrete
        plant, (y, _), (shown, sources) = self._mechanism, self.ports, self.selected_ports
        observed, direct = plant.outputs[y], plant.direct[np.ix_(y, sources)]
        space, delayed = self.plant.space, len(plant.a) - len(self.plant.space.A)
        states = (*space.states, *[f"force{i + 1}" for i in range(delayed)],
                  *[f"controller{i + 1}" for i in range(len(a))])  # fmt: skip
        return SampleToSample(
            np.block([[plant.a + plant.forces @ d @ observed, plant.forces @ c], [b @ observed, a]]),
            np.concatenate((plant.inputs[:, sources] + plant.forces @ d @ direct, b @ direct)),
            np.concatenate((plant.outputs[shown], np.zeros((len(shown), len(a)))), axis=1),
            plant.direct[np.ix_(shown, sources)], states)  # fmt: skip

    @cached_property
    def _eigen(self) -> tuple[Complex, Array, Array]:
        return eigen(self._spectrum, self.rate)

    @cached_property
    def _spectrum(self) -> Spectrum:
        return spectrum(self.sample_to_sample.A)

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

    def h2_norm(self, outputs: Names = None, inputs: Names = None, parameters: Any = None) -> Norm:
        """Return the H2 norm, the rms of all outputs under white noise, averaged over time, between samples as well.

        What sampling folds from other frequencies is in it.

        Parameters
        ----------
        outputs, inputs : str or sequence of str, optional
            Names or patterns; default: all. Their units are not weighed.
        parameters : None
            Derivatives belong to systems of a mechanism; here there are none.

        Returns
        -------
        Norm
            ``value``.

        Raises
        ------
        ResponseError
            If the norm is infinite, because a pole does not decay, an input acts directly on an output, or noise is
            sampled without a filter; or if a name is unknown.
        ModelError
            If parameters are given.
        """
        self._refuse_parameters("h2_norm", parameters)
        return Norm(h2_norm(self.with_ports(outputs, inputs)))

    def time_response(
        self, t: ArrayLike, u: ArrayLike, hold: str = "first", initial: None = None, outputs: Names = None,
        inputs: Names = None,
    ) -> Array:  # fmt: skip
        """Return the time response from rest, between samples as well; the first sample is taken at t[0].

        Parameters
        ----------
        t : array-like, shape (n,)
            Ascending times [s], which need not be those of the samples.
        u : array-like, shape (inputs, n), or (n,) for a single input
            Inputs w at these times, which add to what the controllers demand.
        hold : str
            "first": linear between these times; "zero": constant from each to the next.
        initial : None
            A sampled loop starts at rest.
        outputs, inputs : str or sequence of str, optional
            Names or patterns; default: all. Rows of ``u`` are those of ``inputs``, other inputs are 0.

        Returns
        -------
        array, shape (outputs, n)
            Outputs at these times.

        Raises
        ------
        ResponseError
            If times do not ascend, shapes do not match, the hold or a name is unknown, initial states are given, or
            there are more than two million samples.
        """
        from mbsvib.feedback.sampled_time import time_response

        if initial is not None:
            raise ResponseError("time_response: initial: a sampled loop starts at rest; expected None. Initial states "
                                "are those of loop.continuous.")  # fmt: skip
        return time_response(self.with_ports(outputs, inputs), t, u, hold)

    @property
    def title(self) -> str:
        """The controllers' names, and how they run."""
        delay = f", delay {1e3 * self.delay:.3g} ms" if self.delay else ""
        return f"{self.law.name} at {self.rate:g} Hz{delay}"

    @property
    def resolution(self) -> Resolution:
        """Poles and panels of the responses: sampling repeats poles; a delay has none but rotates the phase."""
        return Resolution(self.poles(), TURN / (2.0 * np.pi * (self.delay + 2.0 / self.rate)), self.rate)

    def frequency_grid(
        self, outputs: Names = None, inputs: Names = None, n: int | None = None, *, f_min: float | None = None,
        f_max: float | None = None,
    ) -> Array:  # fmt: skip
        """Return angular frequencies that resolve resonances and antiresonances from inputs to outputs.

        Parameters
        ----------
        outputs, inputs : str or sequence of str, optional
            Names or patterns; default: all. The zeros of each pair under continuous controllers count.
        n : int, optional
            Number of points on an even logarithmic spacing, to which the others are added; default: 150 a decade.
        f_min, f_max : float, optional
            First and last frequency [Hz]; default: a tenth of the lowest and three times the highest natural frequency,
            but at most half the rate.

        Returns
        -------
        array, shape (points,)
            Ascending angular frequencies [rad/s].

        Raises
        ------
        ResponseError
            If a name is unknown, n is less than 2, or f_min and f_max are not positive and in ascending order.
        """
        return frequency_grid(self.continuous.with_ports(outputs, inputs), self.poles(), n, f_min=f_min, f_max=f_max,
                              highest=0.5 * self.rate)  # fmt: skip

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
        raise ResponseError("state_space: a sampled loop has no continuous equations, so that hinf_norm, step_info "
                            "and most exports are refused: ask loop.continuous. For mean squares give a band, or a "
                            "table of densities.")  # fmt: skip

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
    """Return a loop with discrete-time controllers; ``rate`` [Hz], ``delay`` [s] between measuring and acting."""
    if not 0.0 < rate < np.inf or not 0.0 <= delay < np.inf:
        raise ResponseError(f"sampled: rate = {rate!r} Hz, delay = {delay!r} s; expected a positive rate, and a delay "
                            f"that is not negative.")  # fmt: skip
    continuous = loop.continuous_form if isinstance(loop, SampledLoop) else type(loop)
    return form(loop.plant, loop.controllers, loop.sensors, loop.actuators, float(rate), float(delay),
                selection=loop.selection, continuous_form=continuous)  # fmt: skip


def _resolved(a: Array, b: Array, z: Complex) -> Complex:
    """(z - A)^-1 B, shape (n, states, columns)."""
    return np.asarray(np.linalg.solve(z[:, None, None] * np.eye(len(a)) - a, b))
