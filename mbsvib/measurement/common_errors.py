"""Errors of responses with common causes, as those of sensors from which several channels were computed.

n = A e B^T with independent e, E|e|^2 = v, so that E|n|^2 = |A|^2 v |B^T|^2
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from mbsvib.common.arrays import Array, Complex


@dataclass(frozen=True, slots=True, eq=False)
class CommonErrors:
    """``rows`` A (outputs, a, n), ``variance`` v (a, b, n) and ``columns`` B (inputs, b, n), of n lines each."""

    rows: Array | Complex
    variance: Array
    columns: Array | Complex

    def of(self, outputs: Any, inputs: Any) -> CommonErrors:
        """Return the errors of some outputs and inputs."""
        return CommonErrors(self.rows[outputs], self.variance, self.columns[inputs])

    def at(self, lines: Any) -> CommonErrors:
        """Return the errors at some lines."""
        return CommonErrors(self.rows[..., lines], self.variance[..., lines], self.columns[..., lines])

    def power(self) -> Array:
        """Return E|n|^2 (outputs, inputs, n)."""
        rows, variance, columns = (np.moveaxis(one, -1, 0) for one in (self.rows, self.variance, self.columns))
        left, right = (np.nan_to_num(np.abs(one) ** 2) for one in (rows, columns))
        return np.moveaxis(left @ variance @ right.swapaxes(1, 2), 0, -1)

    def matrices(self) -> Complex:
        """Return the covariances (n, pairs, pairs) of all pairs of outputs and inputs, inputs within outputs."""
        rows, variance, columns = (np.nan_to_num(np.moveaxis(one, -1, 0))
                                   for one in (self.rows, self.variance, self.columns))  # fmt: skip
        shared = np.einsum("nib,njb,nab->naij", columns, columns.conj(), variance, optimize=True)
        result = np.einsum("noa,npa,naij->noipj", rows, rows.conj(), shared, optimize=True)
        pairs = rows.shape[1] * columns.shape[1]
        return np.asarray(result.reshape(-1, pairs, pairs)) + 0j

    def combined(self, outputs: Array, inputs: Array) -> CommonErrors:
        """Return the errors of T_o G T_i^T, of real matrices (new outputs, outputs) and (new inputs, inputs)."""
        return CommonErrors(np.tensordot(outputs, self.rows, 1), self.variance, np.tensordot(inputs, self.columns, 1))


def errors_of(data: Any) -> CommonErrors | None:
    """Return the errors of a measurement; None where no variance is known."""
    if data.common_errors is not None or data.variance is None:
        return data.common_errors  # type: ignore[no-any-return]
    if data.covariance is None:
        return independent_errors(np.nan_to_num(data.variance))
    power, axes = np.linalg.eigh(np.moveaxis(data.covariance, -1, 0))
    rows = np.moveaxis(axes * np.sqrt(np.maximum(power, 0.0))[:, None], 0, -1)
    return replace(independent_errors(np.ones(data.responses.shape)), rows=rows)


def independent_errors(variance: Array) -> CommonErrors:
    """Return independent errors of responses with a variance (outputs, inputs, n)."""
    outputs, inputs, lines = variance.shape
    return CommonErrors(_same(outputs, lines), variance, _same(inputs, lines))


def no_errors(outputs: int, inputs: int, lines: int) -> CommonErrors:
    """Return errors of responses that are exact."""
    return CommonErrors(np.zeros((outputs, 0, lines)), np.zeros((0, 0, lines)), np.zeros((inputs, 0, lines)))


def side_by_side(errors: Sequence[CommonErrors]) -> CommonErrors:
    """Return the errors of the responses of parts side by side."""
    return CommonErrors(*(_blocks([getattr(one, side) for one in errors]) for side in ("rows", "variance", "columns")))


def joined(first: CommonErrors, second: CommonErrors) -> CommonErrors:
    """Return the sum of two independent errors of the same responses."""
    rows, columns = (np.concatenate((getattr(first, side), getattr(second, side)), axis=1)
                     for side in ("rows", "columns"))  # fmt: skip
    return CommonErrors(rows, _blocks([first.variance, second.variance]), columns)


def _blocks(arrays: Sequence[Any]) -> Any:
    """A block diagonal array (m, n, lines) for each line."""
    ends = np.cumsum([array.shape[:2] for array in arrays], axis=0)
    result = np.zeros((*ends[-1], arrays[0].shape[2]), dtype=np.result_type(*arrays))
    for array, (row, column) in zip(arrays, ends, strict=True):
        result[row - array.shape[0] : row, column - array.shape[1] : column] = array
    return result


def _same(size: int, lines: int) -> Array:
    return np.broadcast_to(np.eye(size)[:, :, None], (size, size, lines))
