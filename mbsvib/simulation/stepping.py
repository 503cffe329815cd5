"""The march through time: blocks of intervals, independent coordinates chosen anew between them."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from math import comb
from typing import TYPE_CHECKING

import numpy as np

from mbsvib.common.arrays import Array
from mbsvib.errors import SimulationError
from mbsvib.linalg.dead_points import no_dead_point
from mbsvib.simulation.states import (
    LONG_TURN,
    LONGEST_TURN,
    POOR_IN_BLOCK,
    Chart,
    State,
    chart_at,
    conditioning,
    restarted,
)

if TYPE_CHECKING:
    from mbsvib.simulation.session import Session

# Intervals in one call of the integrator at most, and at first.
BLOCK, FIRST_BLOCK = 64, 8
# An interval that cannot be taken is halved at most so often.
HALVINGS = 12
# Independent coordinates are chosen anew between blocks where they have become worse by this factor.
POOR_BETWEEN_BLOCKS = 0.5
# Where the integrator takes no step, shorter ones are not tried this near to a singular pose: ten times what is_unknown
# refuses of closed loops.
NEXT_TO = 1e-5
SINGULAR = ("the loops come to a singular pose, from which they could go on in several ways; change a length a little "
            "so that they pass it by, or end the run before it")  # fmt: skip


@dataclass(frozen=True, slots=True)
class Sample:
    """A state of a run with the independent coordinates from there on."""

    state: State
    chart: Chart


def restarted_sample(run: Session, state: State, bases: Array) -> Sample:
    """Return a state with its loops closed, rotation vectors started anew and coordinates chosen."""
    state, bases = restarted(state, bases, run.free_rotations, LONG_TURN)
    q, opening = run.loops.projected(state.q, bases)
    if not np.isfinite(opening) or opening > 1e-6:
        raise _stopped(run, state, f"the loops stay open by {opening:.1e} of the mechanism's size")
    return Sample(replace(state, q=q, qd=run.loops.rates(q, bases, state.qd)), chart_at(run.loops, q, bases))


def march(run: Session, start: Sample, interrupted: Callable[[], bool]) -> Iterator[Sample]:
    """Go through the intervals of the inputs and yield the state at the end of each.

    ``interrupted``: whether there was an interrupt from the keyboard, which the integrator turns into an error of its
    own.
    """
    breaks, coefficients = run.signals.breaks, run.signals.coefficients
    sample, k, count = start, 0, FIRST_BLOCK
    while k < len(coefficients):
        end = min(k + count, len(coefficients))
        states = _block(run, sample, breaks[k + 1 : end + 1], coefficients[k:end])
        if interrupted():
            raise KeyboardInterrupt
        if not states:
            if end - k > 1:
                count = max(1, (end - k) // 4)
                continue
            sample = _halved(run, sample, float(breaks[k + 1]), coefficients[k], HALVINGS, interrupted)
            k += 1
            yield sample
            continue
        for state in states[:-1]:
            yield Sample(_closed(run, state, sample.chart), sample.chart)
        sample = _next(run, states[-1], sample.chart)
        yield sample
        count = min(BLOCK, 2 * count) if k + len(states) == end else max(1, len(states))
        k += len(states)


def reached(run: Session, sample: Sample, time: float) -> Sample:
    """Return the state at a time after a sample."""
    breaks = run.signals.breaks
    while sample.state.time < time:
        k = min(int(np.searchsorted(breaks, sample.state.time, side="right")) - 1, len(breaks) - 2)
        length, end = float(breaks[k + 1] - breaks[k]), min(time, float(breaks[k + 1]))
        share = (sample.state.time - breaks[k]) / length
        powers = _part(run.signals.coefficients[k], share, (end - sample.state.time) / length)
        states = _block(run, sample, np.array([end]), powers[None])
        sample = _next(run, states[0], sample.chart) if states else \
            _halved(run, sample, end, powers, HALVINGS, lambda: False)  # fmt: skip
    return sample


def _part(coefficients: Array, start: float, length: float) -> Array:
    """Coefficients (inputs, degree + 1) of powers of the share of a part of an interval: (start + length s)^p."""
    degrees = range(coefficients.shape[1])
    shift = [[comb(p, j) * start ** max(p - j, 0) * length**j for p in degrees] for j in degrees]
    return np.asarray(coefficients @ np.array(shift).T)


def _block(run: Session, sample: Sample, grid: Array, coefficients: Array) -> list[State]:
    """The states at the ends of intervals, as far as the choice of coordinates holds; none if it cannot be taken."""
    try:
        states = run.integrator.block(sample.state, sample.chart, grid, coefficients)
    except RuntimeError:
        return []
    before, good = conditioning(run.loops, sample.chart, sample.state.q), 0
    least = POOR_IN_BLOCK * before.share
    within = run.within_limits([sample.state.q, *(state.q for state in states)], sample.chart.bases)
    for state, defined in zip(states, within, strict=True):
        after = conditioning(run.loops, sample.chart, state.q)
        if not defined or _angles(run, state.q) > LONGEST_TURN or (after.share < least and not after.is_singular):
            break
        good += 1
        if after.is_singular:  # the next block ends the run there
            break
    return states[:good]


def _angles(run: Session, q: Array) -> float:
    return max((float(np.linalg.norm(q[joint.rotations])) for joint in run.free_rotations), default=0.0)


def _halved(
    run: Session, sample: Sample, end: float, coefficients: Array, halvings: int, interrupted: Callable[[], bool]
) -> Sample:
    """The state at the end of an interval that has to be gone in parts."""
    if interrupted():
        raise KeyboardInterrupt
    next_to = conditioning(run.loops, sample.chart, sample.state.q).smallest < NEXT_TO
    if (not halvings or next_to) and _singular_before(run, sample, end):
        raise _stopped(run, sample.state, SINGULAR)
    if not halvings:
        name = run.at_limit(sample.state.q, sample.chart.bases)
        raise _stopped(run, sample.state, "the integrator takes no step, however short" if name is None else
                       f"'{name}' is turned so far that its moment is no longer defined")  # fmt: skip
    middle = 0.5 * (sample.state.time + end)
    for time, powers in ((middle, _part(coefficients, 0.0, 0.5)), (end, _part(coefficients, 0.5, 0.5))):
        states = _block(run, sample, np.array([time]), powers[None])
        if states:
            sample = _next(run, states[0], sample.chart)
        else:
            sample = _halved(run, sample, time, powers, halvings - 1, interrupted)
    return sample


def _singular_before(run: Session, sample: Sample, end: float) -> bool:
    """Whether loops come to a singular pose about as soon as ``end``, if they go on at the rates they have."""
    if not run.loops.rank:
        return False
    state, chart = sample.state, sample.chart
    ends = state.q, state.q + 2.0 * (end - state.time) * state.qd
    before, after = (run.loops.scaled(q, chart.bases)[1][:, chart.dependent] for q in ends)
    return not no_dead_point(before, after)


def _closed(run: Session, state: State, chart: Chart) -> State:
    """The state with what the integrator has left of openings taken away."""
    q, _ = run.loops.projected(state.q, chart.bases)
    return replace(state, q=q, qd=run.loops.rates(q, chart.bases, state.qd))


def _next(run: Session, state: State, chart: Chart) -> Sample:
    """Where the next block starts: loops closed, and coordinates chosen anew if that pays."""
    current = conditioning(run.loops, chart, state.q)
    if current.is_singular:
        raise _stopped(run, state, SINGULAR)
    best = conditioning(run.loops, chart_at(run.loops, state.q, chart.bases), state.q)
    poor = current.share < POOR_BETWEEN_BLOCKS * best.share or current.smallest < POOR_BETWEEN_BLOCKS * best.smallest
    if _angles(run, state.q) > LONG_TURN or poor:
        return restarted_sample(run, state, chart.bases)
    return Sample(_closed(run, state, chart), chart)


def _stopped(run: Session, state: State, why: str) -> SimulationError:
    name = run.names[int(np.argmax(np.abs(state.qd / run.loops.coordinate_scale)))]
    return SimulationError(
        f"simulate: model '{run.model.name}' stops at t = {state.time:.9g} s: {why}. The fastest coordinate there is "
        f"'{name}'. The attribute 'run' of this error has what was reached; ask for a time before, or change what "
        f"leads there.", time=state.time, coordinate=name,
    )  # fmt: skip
