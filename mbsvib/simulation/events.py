"""Events: a run ends where a coordinate or output passes a value."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from mbsvib.common import arguments as check
from mbsvib.errors import ModelError, nearest
from mbsvib.simulation.crossings import crossings
from mbsvib.simulation.stepping import Sample, reached

if TYPE_CHECKING:
    from mbsvib.common.arrays import Array
    from mbsvib.simulation.trace import Trace, TraceValues

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
        states = start.values()
        self._values = {name: float(self._quantity(states, name)[0][0]) for name in levels}
        self._first = start.samples[0].state.time

    def after(self, first: Sample, last: Sample, interval: int) -> Event | None:
        """Return the first event in an interval of the inputs, between its first and its last sample."""
        if not self._levels:
            return None
        states = self._trace.values([first, last])
        passed: list[tuple[float, str]] = []
        for name, level in self._levels.items():
            values, rates = self._quantity(states, name)
            # a rotation vector counts whole turns from the first of these samples
            turns = self._values[name] - values[0]
            self._values[name] = float(values[1] + turns)
            ends = np.array([first.state.time, last.state.time])

            def at(_: int, time: float, name: str = name, turns: float = turns) -> tuple[float, float]:
                return self._at(first, interval, time, name, turns)

            times = crossings(ends, values + turns, rates, level, at)
            passed += [(time, name) for time in times.tolist() if time - self._first > SAME * (ends[1] - ends[0])]
        if not passed:
            return None
        time, name = min(passed)
        return Event(name, last if time >= last.state.time else self._sample(first, interval, time))

    def _sample(self, first: Sample, interval: int, time: float) -> Sample:
        return Sample(reached(self._trace.session, first, interval, time), first.chart)

    def _at(self, first: Sample, interval: int, time: float, name: str, turns: float) -> tuple[float, float]:
        values, rates = self._quantity(self._trace.values([first, self._sample(first, interval, time)]), name)
        return float(values[1] + turns), float(rates[1])

    def _quantity(self, states: TraceValues, name: str) -> tuple[Array, Array]:
        """Values and rates of a coordinate or output."""
        names = self._trace.session.names
        if name in names:
            i = names.index(name)
            return states.coordinates[i], states.rates[i]
        return states.outputs[name], states.output_rates[name]


def events(start: Trace, until: Any) -> Events:
    """Return the events that end a run.

    ``until``: values by name of coordinate or output.
    """
    if until is not None and not isinstance(until, Mapping):
        raise check.refuse("simulate", "until", until,
                           "a mapping of coordinates or outputs to values, {'elbow.rz': 0.5}")  # fmt: skip
    levels = {}
    for name, value in (until or {}).items():
        known = (*start.session.names, *start.measured.all_names)
        if name in start.measured.refused:
            raise ModelError(f"simulate: until: {start.measured.refused[name]}.", element=name, field="until")
        if name not in known:
            raise ModelError(f"simulate: until: '{name}' is neither a coordinate nor an output of the model."
                             f"{nearest(str(name), known)} It has {', '.join(known)}.", element=str(name),
                             field="until")  # fmt: skip
        levels[name] = check.number(value, "simulate", f"until[{name!r}]")
    return Events(start, levels)
