"""Time responses of loops with discrete-time controllers: exact between samples, as the plant is."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from mbsvib.errors import ResponseError
from mbsvib.linalg.rank import EPS
from mbsvib.responses.time_response import checked_record

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

    from mbsvib.common.arrays import Array
    from mbsvib.feedback.sampled_plant import Sampled

SAME = 1e-9  # share of a period within which an instant of the controllers and a time of the record are one
MOST_SAMPLES = 2_000_000  # of the controllers in one record
# The parts that are added up grow with an unstable plant, and their sum does not: at most six digits are lost.
MOST_GROWTH = 1e6
LOST = 1e-3  # share of a response that their rounding may reach, one rounding of the largest for each sample


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


def time_response(loop: Sampled, t: ArrayLike, u: ArrayLike, hold: str) -> Array:
    """Return the outputs of a sampled loop from rest; the controllers take their first sample at t[0].

    y = y_w + y_f, the responses of the plant to the inputs w and to the forces f of the controllers, which are constant
    from each time they act to the next

    ``t`` (n,): ascending times [s]. ``u`` (inputs, n), or (n,) for a single input: inputs at these times. ``hold``:
    "first" or "zero". Returns (outputs, n): outputs at these times.
    """
    record = Record(*checked_record(loop.inputs, t, u, hold), hold == "first")
    time, period = record.time, 1.0 / loop.rate
    plant: Any = loop.plant.system
    span = float(time[-1] - time[0])
    if span > MOST_SAMPLES * period:
        raise ResponseError(f"time_response: {span:g} s are {span / period:.3g} samples at {loop.rate:g} Hz; expected "
                            f"at most {MOST_SAMPLES:,}.")  # fmt: skip
    growth = float(plant.poles().real.max(initial=0.0)) * span
    if growth > np.log(MOST_GROWTH):
        raise ResponseError(f"time_response: '{plant.name}' is unstable with open loops and would grow {growth:.3g} "
                            f"e-folds in {span:g} s, which leaves no digits; give a shorter record, or ask "
                            f"loop.continuous.")  # fmt: skip
    samples = _merged(time[0] + period * np.arange(int(np.floor(span / period + SAME)) + 1), time, period)
    acts = _merged(samples + loop.delay, time, period)
    both = np.unique(np.concatenate((time, samples)))
    passive = plant.time_response(both, record.at(both), hold, None, loop.sensors, loop.inputs)
    forces = loop.demanded(passive[:, np.searchsorted(both, samples)])
    both = np.unique(np.concatenate((time, acts[acts <= time[-1]])))
    latest = np.searchsorted(acts, both, side="right") - 1
    held = np.where(latest >= 0, forces[:, np.maximum(latest, 0)], 0.0)
    active = plant.time_response(both, held, "zero", None, loop.outputs, loop.actuators)
    passive = plant.time_response(time, record.u, hold, None, loop.outputs, loop.inputs)
    active = active[:, np.searchsorted(both, time)]
    result: Array = np.asarray(passive + active)
    rounding = EPS * len(samples) * (np.abs(passive) + np.abs(active)).max(axis=1, initial=0.0)
    lost = np.flatnonzero(rounding > LOST * np.abs(result).max(axis=1, initial=0.0))
    if len(lost):
        raise ResponseError(f"time_response: without control '{loop.outputs[lost[0]]}' of '{plant.name}' would move so "
                            f"far in {span:g} s that rounding of {len(samples)} samples leaves no three digits of the "
                            f"closed loop; give a shorter record, or ask loop.continuous.")  # fmt: skip
    return result


def _merged(instants: Array, time: Array, period: float) -> Array:
    """The instants, those that are a time of the record but for rounding as this time."""
    nearest = time[np.clip(np.searchsorted(time, instants - SAME * period), 0, len(time) - 1)]
    return np.where(np.abs(nearest - instants) <= SAME * period, nearest, instants)
