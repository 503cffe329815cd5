"""Discrete-time controllers: sampled, with a zero-order hold and a delay.

Over time the closed loop steps from event to event. Within a stretch, from a sample to the action of the controllers or
from there to the next sample, the plant moves by what inputs do from rest and by what its state at the beginning does.
Responses with open loops, which may grow where those of the loop do not, are not formed.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any, NamedTuple, NoReturn

import numpy as np
from numpy.typing import ArrayLike
from scipy.linalg import expm

from mbsvib.common.arrays import Array, Complex, Index
from mbsvib.common.selection import Names
from mbsvib.errors import ResponseError
from mbsvib.feedback.closing import transfer
from mbsvib.feedback.excited_period import Period, period, steady_state
from mbsvib.feedback.feedback_loop import FeedbackLoop
from mbsvib.feedback.loop_rounding import Closed, at_poles, refuse_poles
from mbsvib.feedback.sampled_delay import sampled_delay_margin
from mbsvib.feedback.sampled_equations import SampledEquations, split_delay
from mbsvib.feedback.sampled_norm import h2_norm
from mbsvib.linalg.balancing import column_units
from mbsvib.linalg.lasting import separated
from mbsvib.linalg.lyapunov import steps
from mbsvib.linalg.rank import EPS
from mbsvib.linalg.spectrum import Spectrum, outside, spectrum
from mbsvib.modes.state_modes import StateModes, state_modes
from mbsvib.responses.finite_zeros import first_order_zeros
from mbsvib.responses.first_order_solver import FirstOrderSolver, first_order_solver
from mbsvib.responses.linear import LinearVerbs
from mbsvib.responses.norms import Norm
from mbsvib.responses.time_response import checked_record


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

    def delay_limit(
        self, actuator: int, by_phase: tuple[float, float], band: tuple[float, float]
    ) -> tuple[float, float]:  # fmt: skip
        low, high = band[0], min(band[1], 0.5 * self.rate)
        return sampled_delay_margin(self, actuator, low, high) if by_phase[0] and low < high else by_phase

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
            If a name is unknown, or no output responds to any input.

        Source: Astrom, Hagander & Sternby, Automatica 20 (1984) 31, for zeros of sampling.
        """
        loop = self.with_ports(outputs, inputs)
        part = loop.sample_to_sample
        z = first_order_zeros(part.A, part.B, part.C, part.D, loop)
        delays = split_delay(self.rate, self.delay)[0] + 1
        z = z[np.abs(z) > EPS ** (1.0 / (delays + 1))]  # as many delays in a row are a multiple zero at z = 0
        zeros = self.rate * np.log(z)
        return np.asarray(zeros[np.lexsort((-zeros.imag, np.abs(zeros)))])

    def _h2(self, part: SampledLoop) -> Norm:
        return Norm(h2_norm(part))

    def _over_time(self, part: SampledLoop, record: tuple[ArrayLike, ArrayLike, str, Any]) -> Array:
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


SAME = 1e-9  # share of a period within which an instant of the controllers and a time of the record are one
MOST_SAMPLES = 2_000_000  # of the controllers in one record
CHUNK = 4096  # periods whose states are held in memory at a time


class Record(NamedTuple):
    """Inputs (inputs, n) of a loop at times (n,) [s], and whether they are linear between these."""

    time: Array
    u: Array
    linear: bool

    def at(self, times: Array) -> Array:
        """Return the inputs at other times, (inputs, times)."""
        if self.linear:
            return np.array([np.interp(times, self.time, row) for row in self.u]).reshape(len(self.u), len(times))
        return self.u[:, np.searchsorted(self.time, times, side="right") - 1]


class Held(NamedTuple):
    """The plant between events, z' = ``a`` z: its n ``states``, the forces that act, inputs w, and slopes of these.

    ``units`` (2 inputs,): inputs and slopes are as large as states in these units.
    """

    a: Array
    states: int
    units: Array

    def driven(self, w: Array, slope: Array) -> Array:
        """Return z (z, columns) at rest under inputs and slopes (inputs, columns)."""
        inputs = np.concatenate((w, slope)) / self.units[:, None]
        return np.concatenate((np.zeros((len(self.a) - len(inputs), w.shape[1])), inputs))


def time_response(loop: SampledEquations, t: ArrayLike, u: ArrayLike, hold: str) -> Array:
    """Return the outputs of a sampled loop from rest; the controllers take their first sample at t[0].

    ``t`` (n,): ascending times [s]. ``u`` (inputs, n), or (n,) for a single input: inputs at these times. ``hold``:
    "first" or "zero". Returns (outputs, n): outputs at these times.
    """
    record = Record(*checked_record(loop.inputs, t, u, hold), hold == "first")
    time, step = record.time, 1.0 / loop.rate
    span = float(time[-1] - time[0])
    if span > MOST_SAMPLES * step:
        raise ResponseError(f"time_response: {span:g} s are {span / step:.3g} samples at {loop.rate:g} Hz; expected "
                            f"at most {MOST_SAMPLES:,}.")  # fmt: skip
    at = period(loop, *loop.selected_ports)
    samples = time[0] + step * np.arange(int(np.floor(span / step + SAME)) + 1)
    beyond = np.nextafter(time[-1], np.inf)
    events = _merged(np.stack((samples, samples + at.waiting), axis=1).ravel(), time, step)
    ends = np.append(np.minimum(events, beyond), beyond)
    cuts = np.searchsorted(time, ends[:: 2 * CHUNK])
    x, outputs = np.zeros(at.sample.shape[1]), []
    for k, start in enumerate(range(0, len(events), 2 * CHUNK)):
        shown = time[cuts[k] : cuts[k + 1] if k + 1 < len(cuts) else None]
        y, x = _chunk(at, record, (ends[start : start + 2 * CHUNK + 1], shown), x)
        outputs.append(y)
    return np.concatenate(outputs, axis=1)


def _chunk(at: Period, record: Record, instants: tuple[Array, Array], x: Array) -> tuple[Array, Array]:
    """Outputs (outputs, n) and the state at the last end.

    ``instants``: ends (stretches + 1,) of stretches of time and times (n,) of outputs. ``x``: the state at the first
    end.
    """
    ends, time = instants
    plant, latest = _held(at), float(np.abs(record.time[[0, -1]]).max())
    cuts = np.unique(np.concatenate((ends, time)))  # of stretches into pieces
    w = record.at(cuts)
    rise = np.diff(w) / np.diff(cuts) if record.linear else np.zeros((len(w), len(cuts) - 1))
    stretch = np.searchsorted(ends, cuts[:-1], side="right") - 1
    places = np.arange(len(stretch)) - np.searchsorted(stretch, stretch)
    added = _from_rest(plant, cuts, plant.driven(w[:, :-1], rise), places, latest)
    last = np.searchsorted(stretch, np.arange(len(ends) - 1), side="right") - 1
    through = np.where(ends[:-1] < ends[1:], added[:, last], 0.0)
    state, x = _states(at, x, record.at(ends[:-1:2]), through)
    own = np.searchsorted(ends, time, side="right") - 1
    elapsed, begun = time - ends[own], state[:, own]
    moved = steps(plant.a[: len(begun), : len(begun)], elapsed, latest)(begun)[: plant.states]
    inside = np.flatnonzero(elapsed > 0.0)
    moved[:, inside] += added[:, np.searchsorted(cuts, time[inside]) - 1]
    forces = at.seen[:, at.acting] @ begun[plant.states :]
    return at.seen[:, : plant.states] @ moved + forces + at.direct @ record.at(time), x


def _held(at: Period) -> Held:
    n, (m, inputs) = at.start, (len(at.unit), at.driven.shape[1])
    a = at.flow[:n, :n]
    speed = float(np.exp2(np.round(np.log2(np.abs(a).max(initial=0.0) or 1.0 / (at.waiting + at.rest)))))
    units = column_units(at.driven[:n], speed)
    whole = np.zeros((n + m + 2 * inputs,) * 2)
    whole[:n, :n], whole[:n, n : n + m] = a, at.flow[:n, at.acting]
    whole[:n, n + m : n + m + inputs] = at.driven[:n] * units
    whole[n + m : n + m + inputs, n + m + inputs :] = speed * np.eye(inputs)
    return Held(whole, n, np.concatenate((units, speed * units)))


def _from_rest(plant: Held, ends: Array, driven: Array, places: Index, latest: float) -> Array:
    """States (states, pieces) at the end of each piece of time, from rest at the beginning of its stretch.

    ``ends`` (pieces + 1,): where they begin and end [s]. ``driven`` (z, pieces): inputs of each. ``places`` (pieces,):
    how many come before in the same stretch. ``latest``: size of times [s].
    """
    n = plant.states
    free = plant.a[:n, :n]
    added, reach = steps(plant.a, np.diff(ends), latest)(driven)[:n], 1
    while True:  # sums over the last 1, 2, 4, ... pieces
        at = np.flatnonzero(places >= reach)
        if not len(at):
            return added
        added[:, at] += steps(free, ends[at + 1] - ends[at + 1 - reach], latest)(added[:, at - reach])
        reach *= 2


def _states(at: Period, x: Array, w: Array, through: Array) -> tuple[Array, Array]:
    """States of the plant and forces that act at the beginning of each stretch, (states + forces, stretches), and the
    state at the end.

    ``x``: the state before the first sample. ``w`` (inputs, periods): inputs at samples. ``through`` (states,
    stretches): what inputs add to the states of the plant in a stretch.
    """
    n, m = at.start, len(at.unit)
    waiting, rest = expm(at.flow * at.waiting), expm(at.after_action()[0] * at.rest)
    measured = at.measured @ w
    late = at.action @ (waiting @ measured)
    late[:n] += through[:, ::2]
    late = rest @ late
    late[:n] += through[:, 1::2]
    transition, late = rest @ at.action @ waiting @ at.sample, late.T.copy()
    before = np.empty((len(late), len(x)))
    for k, driven in enumerate(late):
        before[k] = x
        x = transition @ x + driven
    sampled = at.sample @ before.T + measured
    acted = at.action @ (waiting @ sampled)
    acted[:n] += through[:, ::2]
    state = np.empty((n + m, through.shape[1]))
    state[:n, ::2], state[n:, ::2] = sampled[:n], sampled[at.acting]
    state[:n, 1::2], state[n:, 1::2] = acted[:n], acted[at.acting.start - m : at.acting.stop - m]
    return state, x


def _merged(instants: Array, time: Array, step: float) -> Array:
    """The instants, those that are a time of the record but for rounding as this time."""
    nearest = time[np.clip(np.searchsorted(time, instants - SAME * step), 0, len(time) - 1)]
    return np.where(np.abs(nearest - instants) <= SAME * step, nearest, instants)
