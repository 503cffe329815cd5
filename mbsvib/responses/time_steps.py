"""States from sample to sample for held and linear inputs, by exact steps of single modes or by exponentials."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from mbsvib.linalg.discrete import first_order_hold
from mbsvib.linalg.rank import EPS
from mbsvib.responses.modal_steps import Exponentials, Oscillators

if TYPE_CHECKING:
    from collections.abc import Callable

    from mbsvib.common.arrays import Array


CHUNK = 4096  # samples whose states are held in memory at a time
SEGMENTS = 64  # of one chunk, side by side
STEPS_AT_ONCE = 256  # uneven steps whose closed forms are computed at a time


@dataclass(frozen=True, slots=True)
class Block:
    """States of one kind: ``motion`` advances them; ``force`` (k, inputs) are the inputs, ``show`` (outputs, states, k)
    the contributions to the outputs, of which the real part is taken; ``state`` (states, k) is the initial state.
    """

    motion: Oscillators | Exponentials
    force: Any
    show: Any
    state: Any


def run(block: Block, time: Array, u: Array, first: bool) -> Array:
    """Return the outputs of one block of states, (outputs, n)."""
    outputs = len(block.show)
    y = np.empty((outputs, len(time)))
    y[:, 0] = np.tensordot(block.show, block.state, axes=2).real
    steps, even = _steps(time)
    n = len(steps)
    march = _even_steps(block, steps[0]) if even and n > 1 else _uneven_steps(block, steps)
    state = block.state
    for start in range(0, n, CHUNK):
        stop = min(n, start + CHUNK)
        samples, change = u[:, start:stop], np.diff(u[:, start : stop + 1]) if first else None
        y[:, start + 1 : stop + 1], state = march(state, samples, change, start)
    return y


def _steps(time: Array) -> tuple[Array, bool]:
    """Lengths of the steps, and whether all are equal: those that are up to the rounding of times are made so."""
    steps = np.diff(time)
    even = (time[-1] - time[0]) / max(1, len(steps))
    equal = np.abs(time - (time[0] + even * np.arange(len(time)))).max() <= 4.0 * EPS * np.abs(time[[0, -1]]).max()
    return np.full_like(steps, even) if equal else steps, bool(equal)


def _even_steps(block: Block, h: float) -> Callable[[Any, Array, Array | None, int], tuple[Array, Any]]:
    """Return the function that advances a state through a chunk of even steps and computes the outputs."""
    transition, constant, ramp = block.motion.step(np.array([h]))
    hold, grow = constant * block.force, ramp * block.force
    powers: dict[int, Any] = {}

    def march(state: Any, u: Array, change: Array | None, _: int) -> tuple[Array, Any]:
        n = u.shape[1]
        length = -(-n // SEGMENTS)
        count = -(-n // length)
        if length not in powers:
            powers[length] = block.motion.step(h * np.arange(1.0, length + 1.0))[0]
        x = _forced(hold, u, length, count)
        if change is not None:
            x += _forced(grow, change, length, count)
        for j in range(1, length):  # all segments from rest
            x[j] += np.einsum("abk,bkp->akp", transition[..., 0], x[j - 1])
        starts = np.empty((*state.shape, count), dtype=x.dtype)
        for p in range(count):
            starts[..., p] = state
            state = np.einsum("abk,bk->ak", powers[length][..., -1], state) + x[-1, :, :, p]
        for j in range(length):
            x[j] += np.einsum("abk,bkp->akp", powers[length][..., j], starts)
        states, modes = x.shape[1:3]
        y = block.show.reshape(len(block.show), states * modes) @ x.reshape(length, states * modes, count)
        last = n - 1 - (count - 1) * length
        return y.real.transpose(1, 2, 0).reshape(len(y[0]), length * count)[:, :n], x[last, :, :, -1]

    return march


def _forced(gain: Any, u: Array, length: int, count: int) -> Any:
    """Contributions of the inputs to the states at each sample, (length, states, k, count), for parallel segments."""
    padded = np.zeros((len(u), length * count))
    padded[:, : u.shape[1]] = u
    parts = padded.reshape(len(u), count, length).transpose(2, 0, 1)
    return np.matmul(gain, parts[:, None])


def _uneven_steps(block: Block, steps: Array) -> Callable[[Any, Array, Array | None, int], tuple[Array, Any]]:
    """Return the function that advances a state through a chunk of steps of any length and computes the outputs."""

    def march(state: Any, u: Array, change: Array | None, start: int) -> tuple[Array, Any]:
        force = block.force @ u
        growth = None if change is None else block.force @ change
        x = np.empty((*state.shape, u.shape[1]), dtype=np.result_type(state, force))
        for k in range(u.shape[1]):
            at = k % STEPS_AT_ONCE
            if at == 0:
                lengths, which = np.unique(steps[start + k :][:STEPS_AT_ONCE], return_inverse=True)
                transition, constant, ramp = block.motion.step(lengths)
            i = which[at]
            state = np.einsum("abk,bk->ak", transition[..., i], state) + constant[..., i] * force[:, k]
            if growth is not None:
                state += ramp[..., i] * growth[:, k]
            x[..., k] = state
        return np.tensordot(block.show, x, axes=2).real, state

    return march


def stepped(a: Array, b: Array, start: Array, record: tuple[Array, Array, bool]) -> Array:
    """Return the states of x' = a x + b u at all samples, (n, len(time)), by exponentials."""
    time, u, first = record
    x = np.empty((len(a), len(time)))
    x[:, 0] = start
    steps: dict[float, tuple[Array, Array, Array]] = {}
    for i, h in enumerate(_steps(time)[0].tolist()):
        if h not in steps:
            steps[h] = first_order_hold(a, b, h)
        transition, constant, ramp = steps[h]
        x[:, i + 1] = transition @ x[:, i] + constant @ u[:, i]
        if first:
            x[:, i + 1] += ramp @ (u[:, i + 1] - u[:, i])
    return x
