"""Functions of CasADi at many samples, and in place."""

from __future__ import annotations

from typing import Any

import casadi as ca
import numpy as np

from mbsvib.common.arrays import Array


class Called:
    """A function of CasADi with dense outputs, of its first argument alone, evaluated in place.

    Calls take microseconds where it is short. ``arguments`` (k,) are all its arguments; values of the first do not
    count.
    """

    def __init__(self, function: ca.Function, *arguments: Array) -> None:
        # the buffer must live as long as what evaluates it, and arrays as long as the buffer
        buffer: Any
        buffer, self._evaluate = function.buffer()
        self._arguments = [np.array(array, dtype=float) for array in arguments]
        self._outputs = [np.zeros(function.size_out(i), order="F") for i in range(function.n_out())]
        for i, array in enumerate(self._arguments):
            buffer.set_arg(i, array.data)
        for i, array in enumerate(self._outputs):
            buffer.set_res(i, array.reshape(-1, order="F").data)
        self._buffer = buffer

    def __call__(self, first: Array) -> list[Array]:
        """Return the outputs (rows, columns)."""
        self._arguments[0][:] = first
        self._evaluate()
        return [array.copy() for array in self._outputs]


def evaluated(function: ca.Function, *arguments: Array) -> list[Array]:
    """Return the outputs of a function at every sample, (samples, rows, columns), columns as (samples, rows).

    ``arguments`` (samples, k) or (k,): those of one axis are the same at every sample.
    """
    return [array[:, :, 0] if array.shape[2] == 1 else array for array in matrices(function, *arguments)]


def matrices(function: ca.Function, *arguments: Array) -> list[Array]:
    """Return the outputs of a function at every sample, all as matrices (samples, rows, columns).

    ``arguments`` (samples, k) or (k,): those of one axis are the same at every sample.
    """
    samples = max(len(array) for array in arguments if array.ndim == 2)
    outputs = function.map(samples).call([ca.DM(array.T) for array in arguments])
    shapes = [function.size_out(i) for i in range(len(outputs))]
    return [np.array(output).reshape(rows, samples, width).transpose(1, 0, 2)
            for output, (rows, width) in zip(outputs, shapes, strict=True)]  # fmt: skip
