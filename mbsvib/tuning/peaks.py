"""Weights of goals over frequency, and highest peaks of responses of small state spaces, as a search asks for them
thousands of times.

In states that are eigenvectors, G(i w) = C V (i w - Lambda)^-1 V^-1 B + D costs little at hundreds of frequencies. They
lie about all poles; tops are refined. Frequencies at which the norm on panels found higher peaks are known beside them:
a search drives towards peaks between the points.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from scipy.linalg import matrix_balance

from mbsvib.common import arguments as check
from mbsvib.common.arrays import Array, Complex
from mbsvib.errors import ModelError, ResponseError
from mbsvib.feedback.closing import Matrices, on_axis, transfer
from mbsvib.linalg.bands import within
from mbsvib.linalg.diagonal_norms import diagonal_norms, highest_norms
from mbsvib.responses.densities import Shaped, Table, table
from mbsvib.responses.first_order_solver import gain_slope
from mbsvib.responses.from_control import is_control, is_transfer_function
from mbsvib.responses.state_space import StateSpace

Eigen = tuple[Complex, Complex, Complex | None]


EXPECTED = ("a positive number, isolation.shaped(numerator, denominator), a transfer function of python-control, a "
            "stable StateSpace, or pairs (frequency [Hz], gain)")  # fmt: skip


@dataclass(frozen=True, eq=False)
class Weight:
    """Gains W(i w) of outputs: by a ``space`` A, B, C, D, or by a ``table`` over frequencies [Hz], zero beyond it.

    ``inputs``, ``units``: names of the outputs that W takes, none where it takes each of them, and their units.
    """

    space: Matrices | None
    table: Table | None = None
    inputs: tuple[str, ...] = ()
    units: tuple[str, ...] = ("",)

    def for_outputs(self, outputs: Sequence[str], units: Sequence[str]) -> Weight:
        """Return the weight for some outputs with their units, refused if it is none of these."""
        order = [self.inputs.index(name) if name in self.inputs else -1 for name in outputs]
        if self.inputs and sorted(order) != list(range(len(self.inputs))):
            raise ResponseError(f"goals.hinf: the weight has the inputs {', '.join(self.inputs)}; expected one, or "
                                f"the outputs of the goal: {', '.join(outputs)}.")  # fmt: skip
        for name, unit, k in zip(outputs, units, order, strict=True):
            if unit and self.units[k] and unit != self.units[k]:
                raise ResponseError(f"goals.hinf: the weight takes '{name}' in {self.units[k]}; the output has the "
                                    f"unit {unit}. Give a weight for {unit}.")  # fmt: skip
        if not self.inputs or self.space is None:
            return self
        a, b, c, d = self.space
        return Weight((a, b[:, order], c, d[:, order]), None, tuple(outputs), tuple(units))

    def at(self, w: Array) -> Complex | Array:
        """Return W (n, rows, outputs), (n, 1, 1) where it is the same for all outputs, at frequencies [rad/s]."""
        if self.space is not None:
            return transfer(self.space, on_axis(w))
        assert self.table is not None
        f, (low, high) = w / (2.0 * np.pi), self.table.span
        return np.asarray(np.where(within(f, low, high), self.table.at(np.clip(f, low, high)), 0.0)[:, None, None])

    @property
    def poles(self) -> Complex:
        """Poles [1/s]."""
        return np.linalg.eigvals(self.space[0]).astype(complex) if self.space else np.zeros(0, dtype=complex)

    @property
    def marks(self) -> Array:
        """Frequencies [rad/s] at which it is not smooth."""
        return np.zeros(0) if self.table is None else 2.0 * np.pi * self.table.breaks

    @property
    def span(self) -> tuple[float, float]:
        """First and last frequency [rad/s] at which it is not 0."""
        return (0.0, np.inf) if self.table is None else (float(self.marks[0]), float(self.marks[-1]))


def apply(weight: Array | Complex, response: Array | Complex) -> Complex:
    """Return W G (n, rows, inputs) of a response G (n, outputs, inputs)."""
    return np.asarray(weight * response if weight.shape[1:] == (1, 1) else weight @ response)


def over_frequency(value: Any, who: str) -> Weight:
    """Return the weight that a user gave."""
    if is_control(value) or is_transfer_function(value):
        value = StateSpace.from_control(value)
    if isinstance(value, Shaped):
        gain = np.sqrt(value.level)
        return _stable(Weight((value.a, value.b, gain * value.c, gain * np.array([[value.d]])), units=(value.unit,)),
                       who)  # fmt: skip
    if isinstance(value, StateSpace):
        single = value.D.shape == (1, 1)
        return _stable(Weight((value.A, value.B, value.C, value.D), None, () if single else value.inputs,
                              value.input_units), who)  # fmt: skip
    if value is None or isinstance(value, str) or callable(value):
        raise check.refuse(who, "weight", value, EXPECTED)
    try:
        return Weight(None, value if isinstance(value, Table) else table(value, f"{who}: weight"))
    except ResponseError as error:
        raise ModelError(f"{error} Or another weight: {EXPECTED}.", field="weight") from None


def _stable(weight: Weight, who: str) -> Weight:
    slow = weight.poles[weight.poles.real >= 0.0]
    if len(slow):
        raise ModelError(f"{who}: the weight has the pole {slow[0]:.4g} 1/s, which does not decay; expected "
                         f"{EXPECTED}.", field="weight")  # fmt: skip
    return weight


# Distances from a pole at which responses are sampled, in parts of its real part.
BESIDE = np.array([-8.0, -3.0, -1.5, -0.8, -0.4, 0.0, 0.4, 0.8, 1.5, 3.0, 8.0])
COARSE = np.linspace(0.0, 1.0, 40)  # further frequencies, on the way of logarithms between the next two
BEYOND = 10.0  # the fastest pole times this, and the slowest over this
CLOSE = 0.15  # distance of frequencies, in parts of that to the nearest pole, of which one is enough
TOP = 0.9  # singular values are computed where they may be this share of the highest
ROUNDS, POINTS = 3, np.linspace(0.0, 1.0, 17)  # of refinement: each shrinks the bracket by 8
TINY = 1e-300  # divisor of nothing
DEPENDENT = 1e9  # condition of the eigenvectors above which equations are solved in the given states


class Response:
    """A response W (C (i w - A)^-1 B + D) of a stable A with known ``eigen``; time is in units of 1 / ``rate``."""

    def __init__(self, space: Matrices, eigen: Eigen, weight: Weight | None = None, rate: float = 1.0) -> None:
        self.space, self.weight, self.rate = space, weight, rate
        self.eigen = eigen
        self.values, vectors, inverse = eigen
        self.modal = None if inverse is None else (space[2] @ vectors, inverse @ space[1])

    def weights(self, w: Array) -> Complex | Array | None:
        """Return W (n, rows, outputs), None for 1."""
        return None if self.weight is None else self.weight.at(w * self.rate)

    def at(self, w: Array) -> Array | Complex:
        """Return the response (n, rows, inputs)."""
        a, b, c, d = self.space
        if self.modal is None:
            s = 1j * w[:, None, None] * np.eye(len(a)) - a
            g = np.asarray(c @ np.linalg.solve(s, b.astype(complex)) + d)
        else:
            left, right = self.modal
            g = np.asarray((left / (1j * w[:, None] - self.values)[:, None, :]) @ right + d)
        return self._weighted(w, g)

    def _weighted(self, w: Array, g: Array | Complex) -> Array | Complex:
        weight = self.weights(w)
        return g if weight is None else apply(weight, g)

    def sizes(self, w: Array) -> Array:
        """Return the largest singular values (n,), those that cannot be among the largest by a lower bound."""
        g = self.at(w)
        if g.shape[1:] == (1, 1):
            return np.asarray(np.abs(g[:, 0, 0]))
        frobenius = np.sqrt((g.real**2 + g.imag**2).sum(axis=(1, 2)))
        if min(g.shape[1:]) == 1:
            return np.asarray(frobenius)
        result = frobenius / np.sqrt(min(g.shape[1:]))
        near = frobenius >= TOP * result.max()
        result[near] = _largest(g[near])
        return np.asarray(result)

    @cached_property
    def span(self) -> tuple[float, float]:
        """First and last frequency at which the weight is not 0."""
        low, high = (0.0, np.inf) if self.weight is None else self.weight.span
        return low / self.rate, high / self.rate

    @property
    def far(self) -> float:
        """The largest singular value at infinite frequency, 0 where the weight ends before."""
        if self.span[1] < np.inf or not self.space[3].any():
            return 0.0
        return float(np.linalg.norm(self._weighted(np.array([np.inf]), self.space[3][None])[0], 2))

    def sampled(self, known: Sequence[float]) -> Array:
        """Return frequencies about all poles and beyond, no closer than the response can change, and those known."""
        marks, poles = np.array(known), self.values
        if self.weight is not None:
            poles = np.concatenate((poles, self.weight.poles / self.rate))
            marks = np.concatenate((marks, self.weight.marks / self.rate))
        poles = poles[poles.imag >= 0.0]
        size = np.abs(poles)
        slow, fast = max(float(size.min(initial=1.0)), TINY), float(size.max(initial=1.0))
        low, high = self.span
        w = np.concatenate(([0.0], np.ravel(poles.imag[:, None] + np.abs(poles.real)[:, None] * BESIDE), size,
                            slow / BEYOND * (BEYOND**2 * fast / slow) ** COARSE))  # fmt: skip
        w = np.sort(w[(w >= low) & (w <= high)])
        if len(poles) and len(w):
            change = np.diff(w) / (CLOSE * np.abs(1j * w[1:, None] - poles).min(axis=1) + TINY)
            step = np.floor(np.concatenate(([0.0], np.cumsum(np.minimum(change, 1.0)))))
            w = w[np.concatenate(([True], np.diff(step) > 0.0))]
        return np.unique(np.concatenate((w, np.clip(marks[within(marks, low, high)], low, high))))

    def slope(self, w: float) -> Array:
        """Return the gradient of the largest singular value at a frequency to [A B; C D]."""
        weight = self.weights(np.array([w]))
        return gain_slope(self.space, w, None if weight is None else weight[0])[1]


class Structured(Response):
    """A response whose size is the least bound of the structured singular value for diagonal blocks."""

    def sizes(self, w: Array) -> Array:
        """Return the bounds (n,), larger ones where they are not the highest."""
        return highest_norms(np.asarray(self.at(w), dtype=complex))

    @property
    def far(self) -> float:
        """The bound at infinite frequency."""
        return float(highest_norms(self.space[3][None].astype(complex))[0])


def structured_peak(response: Response, known: Sequence[float]) -> tuple[float, float]:
    """Return the highest peak of the least bound of mu for diagonal blocks and its frequency, inf where at infinity."""
    return peak(Structured(response.space, response.eigen), known)


def structured_slope(response: Response, w: float) -> Array:
    """Return the gradient of the least bound of mu for diagonal blocks at a frequency to [A B; C D]."""

    def norm(g: Complex) -> tuple[float, Complex, Complex]:
        value, _, slopes = diagonal_norms(g[None])
        return float(value[0]), slopes[0], np.eye(len(g), dtype=complex)

    return gain_slope(response.space, w, norm=norm)[1]


def _largest(g: Array | Complex) -> Array:
    rows, columns = g.shape[1:]
    h = g.conj().swapaxes(1, 2)
    return np.asarray(np.sqrt(np.maximum(np.linalg.eigvalsh(g @ h if rows < columns else h @ g)[:, -1], 0.0)))


def eigen(a: Array) -> Eigen:
    """Return eigenvalues, eigenvectors and their inverse, None where they are nearly dependent in balanced states."""
    values, vectors = np.linalg.eig(a)
    units = matrix_balance(a, permute=False, separate=True)[1][0][:, None] if len(a) else np.ones((0, 1))
    even: Complex = np.asarray(vectors / units, dtype=complex)
    even /= np.linalg.norm(even, axis=0)
    try:
        inverse: Complex = np.asarray(np.linalg.inv(even))
    except np.linalg.LinAlgError:
        return values, units * even, None
    condition = len(a) * float(np.abs(inverse).max(initial=0.0))
    return values, units * even, inverse / units.T if condition < DEPENDENT else None


def peak(response: Response, known: Sequence[float]) -> tuple[float, float]:
    """Return the highest peak of a response and its frequency, inf where it is at infinity."""
    w = response.sampled(known)
    value = response.sizes(w)
    best = int(value.argmax())
    before, after = np.concatenate(([-np.inf], value[:-1])), np.concatenate((value[1:], [-np.inf]))
    # above the larger neighbour by no more than as far as that is above the other one: parabolas
    rise = 0.5 * np.maximum(2.0 * value - before - after, 0.0)
    tops = np.flatnonzero((value >= before) & (value >= after) & (value + rise >= value[best]))
    tops = np.union1d(tops, [best])
    where, highest = float(w[best]), float(value[best])
    low, high = w[np.maximum(tops - 1, 0)], w[np.minimum(tops + 1, len(w) - 1)]
    for _ in range(ROUNDS):
        grid = low[:, None] + (high - low)[:, None] * POINTS
        values = response.sizes(grid.ravel()).reshape(grid.shape)
        row, at = np.unravel_index(int(values.argmax()), values.shape)
        if values[row, at] > highest:
            where, highest = float(grid[row, at]), float(values[row, at])
        k, rows = values.argmax(axis=1), np.arange(len(values))
        before, after = np.maximum(k - 1, 0), np.minimum(k + 1, len(POINTS) - 1)
        low, high = grid[rows, before], grid[rows, after]
        fall = values.max(axis=1) - np.minimum(values[rows, before], values[rows, after])
        near = values.max(axis=1) + fall >= highest
        near[row] = True
        low, high = low[near], high[near]
    where, highest = _polished(response, where, highest, grid[row], values[row])
    far = response.far
    return (far, np.inf) if far >= highest else (highest, where)


def _polished(response: Response, where: float, highest: float, grid: Array, values: Array) -> tuple[float, float]:
    """The top of the parabola through the three highest of a grid, as gradients ask for the peak itself."""
    k = int(values.argmax())
    if not 0 < k < len(grid) - 1 or values[k] < highest:
        return where, highest
    fall, curvature = values[k + 1] - values[k - 1], values[k + 1] - 2.0 * values[k] + values[k - 1]
    if not curvature < 0.0:
        return where, highest
    w = float(grid[k] - 0.5 * (grid[k + 1] - grid[k]) * fall / curvature)
    value = float(response.sizes(np.array([w]))[0])
    return w, max(value, highest)
