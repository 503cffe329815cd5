"""The trace of a run: states at the times asked for, and the values there."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import casadi as ca
import numpy as np

from mbsvib.simulation.outputs import Measured, measured
from mbsvib.simulation.states import as_described
from mbsvib.simulation.stepping import Sample, reached

if TYPE_CHECKING:
    from collections.abc import Sequence

    from mbsvib.common.arrays import Array
    from mbsvib.simulation.session import Session


@dataclass(frozen=True)
class TraceValues:
    """Values at states side by side: tree ``coordinates`` and ``rates`` (n, samples), ``outputs`` and
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
    """Samples of a run at ``time`` (n,) [s]; ``intervals`` (n,) number the intervals of the inputs that start there.

    ``ended_by`` is the coordinate or output that ended the run, if one did: the last sample is then where it did so.
    """

    session: Session
    samples: tuple[Sample, ...]
    intervals: tuple[int, ...]
    measured: Measured
    parts: tuple[str, ...]
    energies: Any
    ended_by: str | None = None

    @property
    def time(self) -> Array:
        """Times (n,) [s]."""
        return np.array([sample.state.time for sample in self.samples])

    def with_samples(
        self, samples: Sequence[Sample], intervals: Sequence[int], ended_by: str | None = None
    ) -> Trace:  # fmt: skip
        """Return the trace of other samples of the same run."""
        return replace(self, samples=tuple(samples), intervals=tuple(intervals), ended_by=ended_by)

    def values(self, samples: Sequence[Sample] | None = None) -> TraceValues:
        """Return the values at the samples of the run, or at others."""
        samples = self.samples if samples is None else samples
        states, bases = [sample.state for sample in samples], [sample.chart.bases for sample in samples]
        run = self.session
        q, qd, y = (np.array([getattr(state, name) for state in states]).T for name in ("q", "qd", "y"))
        base = np.array(bases).T
        qdd = self._accelerations(samples) if self.measured.needs_accelerations else np.zeros(q.shape)
        kinetic, potential = (np.asarray(array) for array in self.energies(q, qd, y, base))
        time = np.array([state.time for state in states])
        outputs, slopes = self.measured.values(time, (q, qd, qdd, y, base, run.signals.at(time)))
        where, rates = (array.T for array in as_described(q.T, qd.T, time, bases, run.free_rotations))
        work = np.array([state.work for state in states]).T
        return TraceValues(where, rates, outputs, slopes, kinetic, potential, work)

    def _accelerations(self, samples: Sequence[Sample]) -> Array:
        """Second derivatives (n, samples) of the tree coordinates."""
        run, columns = self.session, []
        signals = run.signals.at(np.array([sample.state.time for sample in samples]))
        for k, sample in enumerate(samples):
            state, chart = sample.state, sample.chart
            v = state.qd[chart.independent]
            second = run.equations.unfolded(state.q, v, state.y, chart.order, chart.rows, chart.bases, signals[:, k])
            columns.append(np.asarray(second[1])[:, 0])
        return np.array(columns).T

    def at(self, k: int, time: float) -> Sample:
        """Return the state at a time between the samples k and k + 1."""
        run, sample, interval = self.session, self.samples[k], self.intervals[k]
        breaks = run.signals.breaks
        last = sample
        while interval + 1 < len(breaks) - 1 and breaks[interval + 1] < time:
            last = Sample(reached(run, last, interval, float(breaks[interval + 1])), last.chart)
            interval += 1
        return Sample(reached(run, last, interval, time), last.chart)


def trace(session: Session, samples: Sequence[Sample], intervals: Sequence[int]) -> Trace:
    """Return the trace of a run."""
    statement = session.statement
    parts = tuple(dict.fromkeys((*statement.kinetic, *statement.potential)))
    none = ca.SX(0.0)
    arguments = [statement.motion.q, statement.motion.qd, statement.yields, statement.motion.bases]
    energies = ca.Function("energies", arguments, [
        ca.vertcat(*(statement.kinetic.get(name, none) for name in parts)),
        ca.vertcat(*(statement.potential.get(name, none) for name in parts))])  # fmt: skip
    return Trace(session, tuple(samples), tuple(intervals), measured(session.model, statement), parts, energies)
