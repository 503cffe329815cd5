"""Weights of goals over frequency: transfer functions, state spaces, and tables."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from mbsvib.common import arguments as check
from mbsvib.errors import ModelError, ResponseError
from mbsvib.feedback.closing import on_axis, transfer
from mbsvib.responses.densities import Shaped, Table, table
from mbsvib.responses.from_control import is_control, is_transfer_function
from mbsvib.responses.state_space import StateSpace

if TYPE_CHECKING:
    from collections.abc import Sequence

    from mbsvib.common.arrays import Array, Complex
    from mbsvib.feedback.closing import Matrices

EXPECTED = ("a positive number, isolation.shaped(numerator, denominator), a transfer function of python-control, a "
            "stable StateSpace, or pairs (frequency [Hz], gain)")  # fmt: skip
END = 1e-12  # share of a frequency by which it may be beyond the end of a table and belong to it


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
        inside = (f >= low * (1.0 - END)) & (f <= high * (1.0 + END))
        return np.asarray(np.where(inside, self.table.at(np.clip(f, low, high)), 0.0)[:, None, None])

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
