"""Simulate: from what the user asks to the trace of a run, which ends where a coordinate or output passes a value."""

from __future__ import annotations

import signal
import threading
import warnings
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from types import FrameType
from typing import Any

import numpy as np

from mbsvib.common import arguments as check
from mbsvib.common.arrays import Array
from mbsvib.common.expected import ascending
from mbsvib.common.expected import names as as_names
from mbsvib.common.progress import Progress, counting
from mbsvib.elements.motion_input import MotionInput
from mbsvib.errors import ModelError, SimulationError
from mbsvib.finite_motion.elastic import warn_of_bending
from mbsvib.finite_motion.statement import finite_motion
from mbsvib.mechanism.mechanism import Mechanism
from mbsvib.responses.driven import drives
from mbsvib.simulation.crossings import Instant, crossings
from mbsvib.simulation.initial import initial_state
from mbsvib.simulation.session import session
from mbsvib.simulation.signals import Signals, moved_ends, signals
from mbsvib.simulation.stepping import Sample, march, reached, restarted_sample
from mbsvib.simulation.trace import Trace, trace

# Events this near to the start of a run, as a share of an interval, are where it starts.
SAME = 1e-9


@dataclass(frozen=True)
class Event:
    """Where a run ends: the ``sample`` at which the coordinate or output ``name`` passes its value."""

    name: str
    sample: Sample


class Events:
    """Values at which a run ends; what is compared with them is counted from interval to interval.

    ``start`` is a trace of the first sample alone, ``levels`` are values [m, rad, or the unit of the output] by name.
    """

    def __init__(self, start: Trace, levels: Mapping[str, float]) -> None:
        self._trace, self._levels = start, levels
        self._values = {name: float(start.quantity(name, start.samples)[0][0]) for name in levels}
        self._first = start.samples[0].state.time

    def after(self, first: Sample, last: Sample) -> Event | None:
        """Return the first event in an interval of the inputs, between its first and its last sample."""
        passed: list[tuple[float, str]] = []
        for name, level in self._levels.items():
            values, rates = self._trace.quantity(name, (first, last))
            # a rotation vector counts whole turns from the first of these samples
            values = values + (self._values[name] - values[0])
            self._values[name] = float(values[1])
            ends = [Instant(sample.state.time, float(value), float(rate), sample)
                    for sample, value, rate in zip((first, last), values, rates, strict=True)]  # fmt: skip
            times = crossings(ends, level, self._trace.course(name))
            least = self._first + SAME * (last.state.time - first.state.time)
            passed += [(time, name) for time in times.tolist() if time > least]
        if not passed:
            return None
        time, name = min(passed)
        return Event(name, last if time >= last.state.time else reached(self._trace.session, first, time))


def events(start: Trace, until: Any) -> Events:
    """Return the events that end a run. ``until``: values by name of coordinate or output."""
    if until is not None and not isinstance(until, Mapping):
        raise check.refuse("simulate", "until", until,
                           "a mapping of coordinates or outputs to values, {'elbow.rz': 0.5}")  # fmt: skip
    levels = {}
    for name, value in (until or {}).items():
        known = (*start.names, *start.measured.all_names)
        if name in start.measured.refused:
            raise ModelError(f"simulate: until: {start.measured.refused[name]}.", element=name, field="until")
        check.known(name, known, f"simulate: until: '{name}' is neither a coordinate nor an output of the model",
                    "until")  # fmt: skip
        levels[name] = check.number(value, "simulate", f"until[{name!r}]")
    return Events(start, levels)


# Tolerances for which the integrator is made.
LEAST, MOST = 1e-11, 1e-2


def simulate(
    model: Mechanism, t: Any, inputs: Any, initial: Any, without: Any, tolerance: Any, until: Any, progress: Progress,
    failed: Callable[[Trace], object],
) -> tuple[Trace, bool]:  # fmt: skip
    """Return the trace of a nonlinear time response; see ``Model.simulate``.

    ``t``, ``inputs``, ``initial``, ``without``, ``tolerance``, ``until``, ``progress``: as in ``Model.simulate``.
    ``failed``: makes the run that an error carries of the trace until then. Returns states at the times; whether it
    came to the last one, or to an event.
    """
    time = ascending(t, "simulate", "t", "two or more times in ascending order [s]", ModelError, count=2)
    error = check.number(tolerance, "simulate", "tolerance", f"a number between {LEAST:g} and {MOST:g}")
    if not LEAST <= error <= MOST:
        raise check.refuse("simulate", "tolerance", tolerance, f"a number between {LEAST:g} and {MOST:g}")
    dropped = _dropped(model, without)
    displaced = {str(name).rpartition(".")[0] for name in (initial if isinstance(initial, Mapping) else ())}
    statement = finite_motion(model, bases=True, without=dropped, tree=displaced & model.joints.keys())
    for name in inputs if isinstance(inputs, Mapping) else ():
        if name in model.inputs and model.inputs[name].moves_ground and name not in statement.inputs:
            raise ModelError(f"simulate: base motion '{name}' turns the ground; only translations are simulated. Drive "
                             f"the model by forces.",
                             element=name, field="inputs")  # fmt: skip
    driven = _driven(model, tuple(statement.inputs), inputs, time)
    run = session(model, statement, driven, error)
    last = restarted_sample(run, initial_state(run, initial, float(time[0])), statement.motion.no_turns)
    samples, requested = [last], set(np.searchsorted(driven.breaks, time).tolist())
    start = trace(run, samples, dropped)
    ends, complete, event = events(start, until), True, None
    with counting(progress, len(time) - 1, "simulate") as tell, noticing_interrupts() as interrupted:
        try:
            for k, sample in enumerate(march(run, last, interrupted), 1):
                event, last = ends.after(last, sample), sample
                if event is not None:
                    samples.append(event.sample)
                    break
                if k in requested:
                    samples.append(sample)
                    tell(1)
        except KeyboardInterrupt:
            complete = False
        except SimulationError as stop:
            stop.run = failed(start.with_samples(samples))
            raise
    if not complete:
        warnings.warn(f"simulate: interrupted at t = {samples[-1].state.time:g} s; the run holds what was reached.",
                      RuntimeWarning, stacklevel=3)  # fmt: skip
    result = start.with_samples(samples, None if event is None else event.name)
    q, bases = (np.array(rows) for rows in zip(*((sample.state.q, sample.chart.bases) for sample in result.samples),
                                               strict=True))  # fmt: skip
    warn_of_bending("simulate", statement.bends, statement.motion, q, bases, 4)
    return result, complete


def _driven(model: Mechanism, names: tuple[str, ...], inputs: Any, time: Array) -> Signals:
    """The inputs of the statement over time, of those of the model."""
    known = drives(model)
    if not any(isinstance(part, MotionInput) for part in model.inputs.values()):
        return signals(inputs, names, time)
    for drive in known:
        if isinstance(inputs, Mapping) and drive.name in inputs and not set(drive.columns) <= set(names):
            raise ModelError(f"simulate: motion input '{drive.name}' moves the end of an element with a state, whose "
                             f"damper follows it; runs do not take this. Use the time response of the linear system.",
                             element=drive.name, field="inputs")  # fmt: skip
    return moved_ends(signals(inputs, tuple(model.inputs), time), known, names)


def _dropped(model: Mechanism, without: Any) -> tuple[str, ...]:
    result = tuple(as_names(without, "simulate", "without", ModelError))
    for name in result:
        check.known(name, model.loads, f"simulate: '{name}' is not a load of model '{model.name}'", "without")
    return result


@contextmanager
def noticing_interrupts() -> Iterator[Callable[[], bool]]:
    """Notice interrupts from the keyboard, also those that code in C turns into errors of its own.

    The context gives a function that tells whether there was one. In threads other than the main one there are none.
    """
    noticed = False
    before = signal.getsignal(signal.SIGINT)
    if threading.current_thread() is not threading.main_thread() or not callable(before):
        yield lambda: False
        return

    def handle(number: int, frame: FrameType | None) -> None:
        nonlocal noticed
        noticed = True
        before(number, frame)

    signal.signal(signal.SIGINT, handle)
    try:
        yield lambda: noticed
    finally:
        signal.signal(signal.SIGINT, before)
