"""The trace of a run: states at the times asked for, and the values and poses there."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import casadi as ca
import numpy as np

from mbsvib.common.arrays import Array
from mbsvib.finite_motion.statement import finite_motion
from mbsvib.mechanism.mechanism import Mechanism
from mbsvib.simulation.crossings import Course, Instant, crossings
from mbsvib.simulation.outputs import Measured, cut_coordinates, measured
from mbsvib.simulation.session import Session, session
from mbsvib.simulation.signals import Signals
from mbsvib.simulation.states import as_described
from mbsvib.simulation.stepping import Sample, reached

# The largest s^2 (1 - s)^3, and what the fifth degree may add to a smooth motion as a share of how far that goes.
FIFTH, SMOOTH = 0.0346, 1e-3
# Largest change of a rate of rotation times an interval [rad] over which whole turns are counted, and smallest interval
# as a share of the time.
LARGEST_TURN, LEAST_STEP = 2.0, 1e-9


@dataclass(frozen=True)
class TraceValues:
    """Values at states side by side: ``coordinates`` and ``rates`` (n, samples), ``outputs`` and
    ``output_rates`` by name (samples,), ``kinetic`` and ``potential`` energies (parts, samples) [J], and ``work`` (3,
    samples) [J].
    """

    coordinates: Array
    rates: Array
    outputs: dict[str, Array]
    output_rates: dict[str, Array]
    kinetic: Array
    potential: Array
    work: Array


@dataclass(frozen=True)
class Trace:
    """Samples of a run at ``time`` (n,) [s]; ``measured`` are its outputs, ``cut`` coordinates of joints at which loops
    are cut.

    ``ended_by`` is the coordinate or output that ended the run, if one did: the last sample is then where it did so.
    """

    session: Session
    samples: tuple[Sample, ...]
    measured: Measured
    cut: Measured
    parts: tuple[str, ...]
    energies: Any
    without: tuple[str, ...]
    ended_by: str | None = None

    def __reduce__(self) -> tuple[Any, tuple[Any, ...]]:
        """Return what a pickle holds: what CasADi compiled is made again of the model."""
        run = self.session
        return retraced, (run.model, self.without, run.signals, run.integrator.tolerance, self.samples, self.ended_by)

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the coordinates, those of the tree before those of joints at which loops are cut."""
        return (*self.session.names, *self.cut.names)

    @property
    def time(self) -> Array:
        """Times (n,) [s]."""
        return np.array([sample.state.time for sample in self.samples])

    def with_samples(self, samples: Sequence[Sample], ended_by: str | None = None) -> Trace:
        """Return the trace of other samples of the same run."""
        return replace(self, samples=tuple(samples), ended_by=ended_by)

    def values(self, samples: Sequence[Sample] | None = None) -> TraceValues:
        """Return the values at the samples of the run, or at others.

        Whole turns of rotation vectors are counted over samples between them where these are far apart.
        """
        samples = self.samples if samples is None else samples
        between, wanted = self._with_turns(samples)
        result = self._values(between)
        if len(between) == len(samples):
            return result
        outputs, slopes = ({name: array[wanted] for name, array in part.items()}
                           for part in (result.outputs, result.output_rates))  # fmt: skip
        return TraceValues(result.coordinates[:, wanted], result.rates[:, wanted], outputs, slopes,
                           result.kinetic[:, wanted], result.potential[:, wanted], result.work[:, wanted])  # fmt: skip

    def _with_turns(self, samples: Sequence[Sample]) -> tuple[Sequence[Sample], list[int]]:
        """The samples with others between them, so close that their rates tell the turns, and where they are there.

        The trapezoid of the rates is off by less than their change times the interval.
        """
        turns = [name.rpartition(".")[2].startswith("r") for name in self.session.names]
        counted = self.session.free_rotations or self.measured.turns or self.cut.turns
        if not counted or not any(turns):
            return samples, list(range(len(samples)))
        result, wanted = list(samples[:1]), [0]
        for target in samples[1:]:
            stack = [target]
            while stack:
                last, following = result[-1].state, stack[-1].state
                step = following.time - last.time
                change = float(np.abs(following.qd - last.qd)[turns].max())
                if step * change <= LARGEST_TURN or step <= LEAST_STEP * abs(following.time):
                    result.append(stack.pop())
                else:
                    stack.append(reached(self.session, result[-1], last.time + 0.5 * step))
            wanted.append(len(result) - 1)
        return result, wanted

    def _values(self, samples: Sequence[Sample]) -> TraceValues:
        """The values at samples in whose order whole turns are counted."""
        states, bases = [sample.state for sample in samples], [sample.chart.bases for sample in samples]
        run = self.session
        q, qd, y = (np.array([getattr(state, name) for state in states]).T for name in ("q", "qd", "y"))
        base = np.array(bases).T
        qdd = np.zeros(q.shape)
        if self.measured.needs_accelerations or run.equations.first:
            qd, qdd = self._derivatives(samples)
        kinetic, potential = (np.asarray(array) for array in self.energies(q, qd, y, base))
        time = np.array([state.time for state in states])
        arguments = q, qd, qdd, y, base, run.signals.at(time)
        outputs, slopes = self.measured.values(time, arguments)
        tree, cut = as_described(q.T, qd.T, time, bases, run.free_rotations), self.cut.values(time, arguments)
        where, rates = (np.concatenate((array.T, np.reshape([*part.values()], (-1, len(time)))))
                        for array, part in zip(tree, cut, strict=True))  # fmt: skip
        work = np.array([state.work for state in states]).T
        return TraceValues(where, rates, outputs, slopes, kinetic, potential, work)

    def _derivatives(self, samples: Sequence[Sample]) -> tuple[Array, Array]:
        """First and second derivatives (n, samples) of the tree coordinates."""
        run, result = self.session, []
        signals = run.signals.at(np.array([sample.state.time for sample in samples]))
        for k, sample in enumerate(samples):
            state, chart = sample.state, sample.chart
            v = state.qd[chart.independent]
            result.append(run.equations.unfolded(state.q, v, state.y, chart.order, chart.rows, chart.bases,
                                                 signals[:, k]))  # fmt: skip
        rates, accelerations = np.moveaxis(np.array([[np.asarray(one)[:, 0] for one in both] for both in result]), 0, 2)
        return rates, accelerations

    def quantity(self, name: str, samples: Sequence[Sample]) -> tuple[Array, Array]:
        """Return values and rates (samples,) of a coordinate or an output."""
        states, names = self.values(samples), self.names
        if name in names:
            return states.coordinates[names.index(name)], states.rates[names.index(name)]
        return states.outputs[name], states.output_rates[name]

    def _onward(self, name: str, instant: Instant, time: float) -> Instant:
        """Return a quantity at a time after an instant, whole turns of rotation vectors being counted from there."""
        sample = reached(self.session, instant.sample, time)
        values, rates = self.quantity(name, (instant.sample, sample))
        return Instant(time, float(instant.value + values[1] - values[0]), float(rates[1]), sample)

    def crossings(self, name: str, level: float) -> Array:
        """Return the times [s] at which a coordinate or an output passes a level."""
        values, rates = self.quantity(name, self.samples)
        rows = zip(self.samples, values.tolist(), rates.tolist(), strict=True)
        instants = [Instant(sample.state.time, value, rate, sample) for sample, value, rate in rows]
        return crossings(instants, level, self.course(name))

    def course(self, name: str) -> Course:
        """Return how a coordinate or an output goes on from an instant."""
        return Course(partial(self._onward, name), self._smooth)

    def _smooth(self, first: Instant, last: Instant) -> bool:
        """Whether cubics through coordinates and rates at two instants fit the accelerations there, too.

        What the fifth degree adds to a cubic is h^2 / 2 ((a0 - c0) s^2 (1 - s)^3 + (a1 - c1) s^3 (1 - s)^2), c0 and c1
        being the second derivatives of the cubic.
        """
        samples = first.sample, last.sample
        if not np.array_equal(samples[0].chart.bases, samples[1].chart.bases):
            return False
        (q0, q1), (v0, v1), h = ([sample.state.q for sample in samples], [sample.state.qd for sample in samples],
                                 last.time - first.time)  # fmt: skip
        a0, a1 = self._derivatives(samples)[1].T
        travel, units = q1 - q0, self.session.loops.coordinate_scale
        left = a0 - (6.0 * travel / h - 4.0 * v0 - 2.0 * v1) / h
        right = a1 - (-6.0 * travel / h + 2.0 * v0 + 4.0 * v1) / h
        added = 0.5 * h**2 * FIFTH * (np.abs(left) + np.abs(right)) / units
        moved = (np.abs(travel) + h * (np.abs(v0) + np.abs(v1))) / units
        return float(added.max()) <= SMOOTH * float(moved.max())


def retraced(
    model: Mechanism, without: tuple[str, ...], signals: Signals, tolerance: float, samples: Sequence[Sample],
    ended_by: str | None,
) -> Trace:  # fmt: skip
    """Return the trace of a run that was done before; arguments as in ``session`` and ``Trace``."""
    again = session(model, finite_motion(model, bases=True, without=without), signals, tolerance)
    return trace(again, samples, without).with_samples(samples, ended_by)


def trace(run: Session, samples: Sequence[Sample], without: tuple[str, ...]) -> Trace:
    """Return the trace of a run; ``without``: loads that are dropped."""
    statement = run.statement
    parts = tuple(dict.fromkeys((*statement.kinetic, *statement.potential)))
    none = ca.SX(0.0)
    arguments = [statement.motion.q, statement.motion.qd, statement.yields, statement.motion.bases]
    energies = ca.Function("energies", arguments, [
        ca.vertcat(*(statement.kinetic.get(name, none) for name in parts)),
        ca.vertcat(*(statement.potential.get(name, none) for name in parts))])  # fmt: skip
    return Trace(run, tuple(samples), measured(run.model, statement), cut_coordinates(run.model, statement), parts,
                 energies, without)  # fmt: skip


def frames(run: Trace) -> dict[str, tuple[Array, Array]]:
    """Return rotations (samples, 3, 3) and shifts (samples, 3) [m] of all bodies and nodes since the pose as described.

    The keys are the names of bodies, ground and nodes of beams and superelements among them.
    """
    statement = run.session.statement
    motion = statement.motion
    frames = statement.frames
    function = ca.Function("frames", [motion.q, motion.bases], [
        ca.vertcat(*(ca.vec(frame.rotation) for frame in frames.values())),
        ca.vertcat(*(frame.shift for frame in frames.values()))])  # fmt: skip
    q = np.array([sample.state.q for sample in run.samples]).T
    bases = np.array([sample.chart.bases for sample in run.samples]).T
    rotations, shifts = (np.asarray(array) for array in function(q, bases))
    samples = len(run.samples)
    return {
        name: (rotations[9 * i : 9 * i + 9].reshape(3, 3, samples, order="F").transpose(2, 0, 1),
               shifts[3 * i : 3 * i + 3].T)
        for i, name in enumerate(frames)
    }  # fmt: skip
