"""Quantities of modes, by natural frequency and the sum of the two eigenvalues, also for repeated eigenvalues."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Any

import numpy as np

from mbsvib.common import arguments as check
from mbsvib.common.expected import mode_index
from mbsvib.errors import ModelError, counted
from mbsvib.studies.dual import Dual
from mbsvib.studies.quantities import Leaf

if TYPE_CHECKING:
    from mbsvib.common.arrays import Array, Complex
    from mbsvib.modes import Modes
    from mbsvib.modes.batch import BatchModes
    from mbsvib.studies.evaluation import DesignPoint


# natural frequency [rad/s], sum of the two eigenvalues, and changes of both, to a value and its change
Rule = Callable[["Array", "Array", "Array", "Array"], "tuple[Array, Array]"]

TOGETHER = 1e-9  # eigenvalues nearer to each other than this, relative, coincide
NEAR = 6.0  # standard deviations


class Modal(Leaf):
    """A quantity of modes: those with these ``indices`` in arrays, None for all but rigid-body modes."""

    def __init__(self, quantity: str, unit: str, mode: Any, rule: Rule) -> None:
        numbers = None if mode is None else np.ravel(np.array(mode, dtype=object)).tolist()
        self.indices = None if numbers is None else [mode_index(n, quantity, error=ModelError) for n in numbers]
        self.quantity, self.rule = quantity, rule
        if numbers is None:
            label = f"all {'frequencies' if quantity == 'frequency' else 'damping ratios'}"
        elif not numbers:
            raise check.refuse(quantity, "mode", mode,
                               "numbers of modes, 1, 2, ... as print(system.modes()) lists them")  # fmt: skip
        else:
            label = f"{quantity} of mode{'s' if len(numbers) > 1 else ''} {', '.join(map(str, numbers))}"
        super().__init__(f"{label} [{unit}]", self._at)
        self.unit = unit

    def of(self, modes: Modes, order: Any = None) -> list[int]:
        """Return the indices of the modes."""
        count, rigid = len(modes), modes.rigid
        which = list(range(rigid, count)) if self.indices is None else self.indices
        if self.indices is None and order is not None:
            which = np.flatnonzero(order >= rigid).tolist()
        if not which:
            raise ModelError(f"{self.quantity}: '{modes.name}' has no modes but {counted(rigid, 'rigid-body mode')}.",
                             element=self.quantity)  # fmt: skip
        if max(which) >= count:
            raise ModelError(f"{self.quantity}: mode {max(which) + 1} of '{modes.name}' is asked for, which has modes "
                             f"1 to {count}, {rigid} of them rigid-body modes.", element=self.quantity)  # fmt: skip
        return which

    def rate(self, value: complex) -> complex:
        """Return c at an eigenvalue: where that moves by d, the quantity moves by Re(c d)."""
        size, total = np.array([abs(value)]), np.array([2.0 * value.real])
        along, across = (self.rule(size, total, np.array([(value.conjugate() * d).real / abs(value)]),
                                   np.array([2.0 * d.real]))[1][0] for d in (1.0 + 0.0j, 1.0j))  # fmt: skip
        return complex(along, -across)

    def in_batch(self, modes: BatchModes, which: list[int]) -> Array:
        """Return the numbers of some modes of all variants, (variants, modes)."""
        first, second = np.moveaxis(modes.pairs[:, which], 2, 0)
        natural = np.sqrt(np.abs(first * second))
        return self.rule(natural, (first + second).real, 0.0 * natural, 0.0 * natural)[0]

    def _at(self, point: DesignPoint) -> Dual:
        which = self.of(point.modes, point.order)
        values, slopes = point.pairs
        (first, second), (d_first, d_second) = values[which].T, np.moveaxis(slopes[:, which], 2, 0)
        product = first * second
        natural = np.sqrt(np.abs(product))
        with np.errstate(divide="ignore", invalid="ignore"):
            d_natural = (0.5 * natural * ((d_first * second + first * d_second) / product)).real
            value, slope = self.rule(natural, (first + second).real, d_natural, (d_first + d_second).real)
        return point.dual(value, slope.T)


def together(values: Complex, scatter: Array, largest: int = 30) -> list[list[int]]:
    """Return groups of modes whose eigenvalues are close compared with their scatter.

    ``values`` (modes,): eigenvalues with positive imaginary parts; others are in no group. ``scatter`` (modes,):
    standard deviations of the single eigenvalues. ``largest``: maximum number of modes in a group; larger groups are
    omitted. A group has two modes at least, neighbours within ``NEAR`` standard deviations.
    """
    turns = np.flatnonzero(values.imag > 0.0)
    gap = np.abs(values[turns][:, None] - values[turns])
    limit = NEAR * np.hypot(scatter[turns][:, None], scatter[turns]) + TOGETHER * np.abs(values[turns])
    label = np.arange(len(turns))
    for i, j in np.argwhere(np.triu(gap <= limit, 1)):
        label[label == label[j]] = label[i]
    groups = [turns[label == name].tolist() for name in dict.fromkeys(label.tolist())]
    return [group for group in groups if 1 < len(group) <= largest]
