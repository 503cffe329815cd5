"""All data of a fit, and sums over their residuals: cost, gradient and normal matrix."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from mbsvib.fitting.mode_data import ModeData
from mbsvib.fitting.response_data import Block, ResponseData

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

    from mbsvib.common.arrays import Array, Complex, Index
    from mbsvib.fitting.record_data import RecordData
    from mbsvib.fitting.variables import Variables

    # parameters (p,) and directions (p, v) to the equations there and their derivatives (v, ...) by name
    Scene = Callable[[Array, Array | None], tuple[Any, dict[str, Array] | None]]


# Standard deviation of logarithms of positive values around their start, from afar: a damping that the first steps take
# to zero would not come back.
LEASH = 2.0


class Sums(NamedTuple):
    """Half the sum of squares, its gradient to x (v,) and J^T J (v, v)."""

    cost: float
    gradient: Array
    normal: Array


@dataclass(frozen=True, eq=False)
class Problem:
    """What a fit minimises: residuals of all data, each in one of the ``scenes``, and of prior knowledge."""

    variables: Variables
    scenes: tuple[Scene, ...]
    data: tuple[ResponseData | RecordData | ModeData, ...]

    def blocks(self, x: Array, far: bool = False, slopes: bool = True) -> Iterator[tuple[int, Block]]:
        """Yield the number of the data with residuals and their derivatives to x, some lines at a time."""
        variables = self.variables
        values = variables.values(x)
        rates, parameters = variables.rates(values), variables.map @ values
        moved = np.flatnonzero(variables.map.any(axis=0))
        directions = variables.map[:, moved] * rates[moved] if slopes else None
        known = [scene(parameters, directions) for scene in self.scenes]
        other = np.delete(rates, moved)
        for k, data in enumerate(self.data):
            for block in data.blocks(*known[data.scene], values, far):
                if block.slopes is None:
                    yield k, block
                else:
                    block.slopes[len(moved) :] *= other.reshape(-1, *[1] * block.residual.ndim)
                    yield k, block
        if np.isfinite(variables.prior).any():
            yield -1, self._prior(values, rates)
        if far:
            held = np.flatnonzero(variables.positive)
            away = (np.asarray(x) - variables.unknowns(variables.start))[held]
            yield -1, _diagonal(held, away / LEASH, np.full(len(held), 1.0 / LEASH), len(x))

    def _prior(self, values: Array, rates: Array) -> Block:
        known = np.flatnonzero(np.isfinite(self.variables.prior[:, 1]))
        value, deviation = self.variables.prior[known].T
        return _diagonal(known, (values[known] - value) / deviation, rates[known] / deviation, len(values))

    def cost(self, x: Array, far: bool) -> float:
        """Return half the sum of squares, of logarithms in the robust measure 2 (sqrt(1 + |r|^2) - 1)."""
        return sum(_cost(block.residual, far and k >= 0) for k, block in self.blocks(x, far, slopes=False))

    def sums(self, x: Array, far: bool) -> Sums:
        """Return cost, gradient and normal matrix."""
        v = len(x)
        cost, gradient, normal = 0.0, np.zeros(v), np.zeros((v, v))
        for k, block in self.blocks(x, far):
            robust = far and k >= 0
            cost += _cost(block.residual, robust)
            slopes, residual = real_rows(block)
            if robust:
                weight = np.repeat((1.0 + np.abs(block.residual.reshape(-1)) ** 2) ** -0.25, 2)
                slopes, residual = slopes * weight, residual * weight
            gradient += slopes @ residual
            normal += slopes @ slopes.T
        return Sums(cost, gradient, normal)

    @property
    def known(self) -> bool:
        """Whether the noise of all data is known."""
        return all(data.known for data in self.data)

    @property
    def numbers(self) -> int:
        """How many real numbers were measured, prior knowledge among them."""
        return sum(data.numbers for data in self.data) + int(np.isfinite(self.variables.prior[:, 1]).sum())

    def reweighted(self, x: Array) -> Problem:
        """Return the same with the noise of data as large as their residuals tell, where it is not known."""
        residuals = self.residuals(x)
        share = self.numbers / max(1, self.numbers - len(x))
        return replace(self, data=tuple([
            data.reweighted(residual, share) if not isinstance(data, ModeData) and not data.known else data
            for data, residual in zip(self.data, residuals, strict=True)]))  # fmt: skip

    def residuals(self, x: Array) -> list[Complex]:
        """Return the residuals (n, ...) of each of the data."""
        parts: list[list[Complex]] = [[] for _ in self.data]
        for k, block in self.blocks(x, slopes=False):
            if k >= 0:
                parts[k].append(block.residual)
        return [np.concatenate(part) for part in parts]


    def fitted(self, x: Array, number: int) -> Complex:
        """Return fitted responses (n, outputs, inputs) of one of the data."""
        values, data = self.variables.values(x), self.data[number]
        assert isinstance(data, ResponseData)
        return data.fitted(self.scenes[data.scene](self.variables.map @ values, None)[0], values)


def _diagonal(which: Index, residual: Array, slopes: Array, count: int) -> Block:
    """Residuals that depend on one unknown each."""
    full = np.zeros((count, len(which)), dtype=complex)
    full[which, np.arange(len(which))] = slopes
    return Block(residual.astype(complex), full)


def real_rows(block: Block) -> tuple[Array, Array]:
    """Return derivatives (v, N) and residuals (N,), real and imaginary parts one beside the other."""
    assert block.slopes is not None
    slopes = np.ascontiguousarray(block.slopes).reshape(len(block.slopes), -1).view(float)
    return slopes, np.ascontiguousarray(block.residual).reshape(-1).view(float)


def _cost(residual: Complex, robust: bool) -> float:
    power = residual.real**2 + residual.imag**2
    return float((np.sqrt(1.0 + power) - 1.0).sum() if robust else 0.5 * power.sum())
