"""Events: a run ends where a coordinate or output passes a value."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from mbsvib.common import arguments as check
from mbsvib.errors import ModelError, nearest
from mbsvib.simulation.crossings import Instant, crossings
from mbsvib.simulation.stepping import Sample, reached

if TYPE_CHECKING:
    from mbsvib.simulation.trace import Trace

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
    """Return the events that end a run.

    ``until``: values by name of coordinate or output.
    """
    if until is not None and not isinstance(until, Mapping):
        raise check.refuse("simulate", "until", until,
                           "a mapping of coordinates or outputs to values, {'elbow.rz': 0.5}")  # fmt: skip
    levels = {}
    for name, value in (until or {}).items():
        known = (*start.names, *start.measured.all_names)
        if name in start.measured.refused:
            raise ModelError(f"simulate: until: {start.measured.refused[name]}.", element=name, field="until")
        if name not in known:
            raise ModelError(f"simulate: until: '{name}' is neither a coordinate nor an output of the model."
                             f"{nearest(str(name), known)} It has {', '.join(known)}.", element=str(name),
                             field="until")  # fmt: skip
        levels[name] = check.number(value, "simulate", f"until[{name!r}]")
    return Events(start, levels)
