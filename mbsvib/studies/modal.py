"""Quantities of modes, by natural frequency and the sum of the two eigenvalues, also of those that coincide."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Any

import numpy as np

from mbsvib import _checks as check
from mbsvib.errors import ModelError
from mbsvib.studies.quantities import Dual, Leaf

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from mbsvib.batch.modes import BatchModes
    from mbsvib.modes import Modes
    from mbsvib.studies.place import Place
    from mbsvib.system import System

    Array = NDArray[np.float64]
    Complex = NDArray[np.complex128]

# natural frequency [rad/s], sum of the two eigenvalues, and changes of both, to a value and its change
Rule = Callable[["Array", "Array", "Array", "Array"], "tuple[Array, Array]"]

TOGETHER = 1e-9  # eigenvalues nearer to each other than this, relative, coincide


class Modal(Leaf):
    """A quantity of modes: ``numbers`` of them, None for all but rigid-body modes."""

    def __init__(self, what: str, unit: str, mode: Any, rule: Rule) -> None:
        given = None if mode is None else np.ravel(np.array(mode, dtype=object))
        self.numbers = None if given is None else [_number(what, mode, number) for number in given]
        if self.numbers is not None and not self.numbers:
            raise check.refuse(what, "mode", mode, "numbers of modes, from 0")
        self.what, self.rule = what, rule
        if self.numbers is None:
            label = f"all {'frequencies' if what == 'frequency' else 'damping ratios'}"
        else:
            label = f"{what} of mode{'s' if len(self.numbers) > 1 else ''} {', '.join(map(str, self.numbers))}"
        super().__init__(f"{label} [{unit}]", self._at)
        self.unit = unit

    def of(self, modes: Modes, order: Any = None) -> list[int]:
        """Return the numbers of the modes that are meant."""
        count, rigid = len(modes), modes.rigid
        which = list(range(rigid, count)) if self.numbers is None else self.numbers
        if self.numbers is None and order is not None:
            which = np.flatnonzero(order >= rigid).tolist()
        if not which or max(which) >= count:
            raise ModelError(
                f"{self.what}: mode {max(which, default=0)} of '{modes.name}' is asked for, which has modes 0 to "
                f"{count - 1}, {rigid} of them rigid-body modes.", element=self.what,
            )  # fmt: skip
        return which

    def rate(self, value: complex) -> complex:
        """Return c at an eigenvalue: where that moves by d, the quantity moves by Re(c d)."""
        size, total = np.array([abs(value)]), np.array([2.0 * value.real])
        along, across = (self.rule(size, total, np.array([(value.conjugate() * d).real / abs(value)]),
                                   np.array([2.0 * d.real]))[1][0] for d in (1.0 + 0.0j, 1.0j))  # fmt: skip
        return complex(along, -across)

    def in_batch(self, modes: BatchModes, which: list[int]) -> Array:
        """Return the numbers of some modes of all variants, (variants, modes)."""
        one, other = modes.eigenvalues[:, 0::2][:, which], modes.eigenvalues[:, 1::2][:, which]
        natural = np.sqrt(np.abs(one * other))
        return self.rule(natural, (one + other).real, 0.0 * natural, 0.0 * natural)[0]

    def _at(self, place: Place) -> Dual:
        which = self.of(place.modes, place.order)
        values, slopes = place.pairs
        (one, other), (d_one, d_other) = values[which].T, np.moveaxis(slopes[:, which], 2, 0)
        product = one * other
        natural = np.sqrt(np.abs(product))
        with np.errstate(divide="ignore", invalid="ignore"):
            d_natural = (0.5 * natural * ((d_one * other + one * d_other) / product)).real
            value, slope = self.rule(natural, (one + other).real, d_natural, (d_one + d_other).real)
        return place.dual(value, slope.T)


def coinciding(modes: Modes) -> list[list[int]]:
    """Return groups of modes that oscillate and whose eigenvalues coincide."""
    lead = modes.pairs[:, 0]
    groups: list[list[int]] = []
    for i in range(len(modes)):
        if lead[i].imag == 0.0 or any(i in group for group in groups):
            continue
        near = np.flatnonzero((np.abs(lead - lead[i]) <= TOGETHER * abs(lead[i])) & (lead.imag != 0.0)).tolist()
        if len(near) > 1:
            groups.append(near)
    return groups


def parting(system: System, group: list[int], variables: Any) -> Complex:
    """Return how eigenvalues that coincide part: small matrices whose combination has their changes as eigenvalues.

    A = -(X^T (2 lambda M + C) X)^-1 X^T (lambda^2 dM + lambda dC + dK) X

    Parameters
    ----------
    system : System
        The equations of motion, symmetric.
    group : list of int
        Modes whose eigenvalues coincide.
    variables : mapping
        The variables.

    Returns
    -------
    array, shape (variables, modes, modes)
        One matrix for each variable.
    """
    modes = system.modes()
    x, value = modes.shapes[:, group], modes.pairs[group[0], 0]
    change = system.matrix_derivatives(variables)
    gram = x.T @ (2.0 * value * system.M + system.C) @ x
    form = x.T @ (value**2 * change.M + value * change.C + change.K) @ x
    return np.asarray(-np.linalg.solve(gram, form), dtype=complex)


def _number(what: str, mode: Any, number: Any) -> int:
    if not isinstance(number, (int, np.integer)) or isinstance(number, bool) or number < 0:
        raise check.refuse(what, "mode", mode, "numbers of modes, from 0")
    return int(number)
