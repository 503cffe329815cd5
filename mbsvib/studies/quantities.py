"""Quantities: numbers of a system that know their gradients; sums, products, bounds and extremes of these."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import partial
from operator import add, itemgetter, methodcaller, mul, neg, sub, truediv
from typing import Any

import numpy as np

from mbsvib.api.system import System
from mbsvib.common import arguments as check
from mbsvib.common.arrays import Array
from mbsvib.common.display import Displayed
from mbsvib.common.expected import reals
from mbsvib.errors import ModelError
from mbsvib.studies.evaluation import DesignPoint, Dual, stacked


class Quantity(Displayed):
    """One or several numbers of a system, with exact derivatives with respect to any variables.

    Quantities are added, multiplied, divided and raised to powers like numbers; ``q[i]`` picks one of several. ``<=``,
    ``>=``, ``between`` and ``equals`` make constraints of them. ``q(system)`` is the number itself. All of them pickle.
    """

    __array_ufunc__ = None  # numpy's numbers leave arithmetic to this class

    def __init__(
        self, label: str, parts: tuple[Quantity, ...], rule: Callable[..., Dual], equations: bool = True
    ) -> None:
        self.label, self.parts, self._rule = label, parts, rule
        self._equations = equations  # whether it asks for the equations of motion, where it has no parts that tell

    def at(self, point: DesignPoint) -> Dual:
        """Return numbers and derivatives.

        Parameters
        ----------
        point : DesignPoint
            A system with the variables of a study.

        Returns
        -------
        Dual
            Numbers, and their derivatives to these.
        """
        return self._rule(*[part.at(point) for part in self.parts])

    def __call__(self, system: System) -> Any:
        value = self.at(DesignPoint.of(system, (), self.needs_equations)).value
        return value if len(value) != 1 else float(value[0])

    def gradient(self, system: System, variables: Any) -> Array:
        """Return the derivatives to parameters.

        Parameters
        ----------
        system : System
            The equations of motion.
        variables : str, iterable of str or mapping
            Names, patterns or linear maps of parameters, as for sensitivities.

        Returns
        -------
        array, shape (numbers, variables)
            Derivatives [per unit of the variable].
        """
        return self.at(DesignPoint.of(system, variables, self.needs_equations)).slope

    @property
    def needs_equations(self) -> bool:
        """Whether it is a number of the linear equations, rather than of the model itself."""
        return any(part.needs_equations for part in self.parts) if self.parts else self._equations

    def inner(self) -> Iterator[Quantity]:
        """Iterate over this quantity and all its parts."""
        yield self
        for part in self.parts:
            yield from part.inner()

    def __add__(self, other: Any) -> Quantity:
        return _joined("+", self, quantity(other), add)

    def __sub__(self, other: Any) -> Quantity:
        return _joined("-", self, quantity(other), sub)

    def __mul__(self, other: Any) -> Quantity:
        return _joined("*", self, quantity(other), mul)

    def __truediv__(self, other: Any) -> Quantity:
        return _joined("/", self, quantity(other), truediv)

    def __radd__(self, other: Any) -> Quantity:
        return quantity(other) + self

    def __rsub__(self, other: Any) -> Quantity:
        return quantity(other) - self

    def __rmul__(self, other: Any) -> Quantity:
        return quantity(other) * self

    def __rtruediv__(self, other: Any) -> Quantity:
        return quantity(other) / self

    def __neg__(self) -> Quantity:
        return Quantity(f"-{_bracketed(self)}", (self,), neg)

    def __pow__(self, power: float) -> Quantity:
        p = check.number(power, self.label, "power")
        return Quantity(f"{_bracketed(self)}^{p:g}", (self,), methodcaller("__pow__", p))

    def __getitem__(self, which: Any) -> Quantity:
        return Quantity(f"{self.label}[{which}]", (self,), itemgetter(which))

    def log(self) -> Quantity:
        """Return the natural logarithm."""
        return Quantity(f"log {_bracketed(self)}", (self,), methodcaller("log"))

    def sum(self) -> Quantity:
        """Return the sum of several numbers."""
        return Quantity(f"sum of {self.label}", (self,), methodcaller("sum"))

    def __le__(self, bound: Any) -> Constraint:
        return _between(self, None, bound)

    def __ge__(self, bound: Any) -> Constraint:
        return _between(self, bound, None)

    def __lt__(self, bound: Any) -> Constraint:
        raise ModelError(f"'{self.label}' < {bound!r}: a search cannot tell < from <=; write <=.", field="constraints")

    def __gt__(self, bound: Any) -> Constraint:
        raise ModelError(f"'{self.label}' > {bound!r}: a search cannot tell > from >=; write >=.", field="constraints")

    def between(self, low: float, high: float) -> Constraint:
        """Return the constraint that all numbers lie between two bounds.

        Parameters
        ----------
        low, high : float
            The bounds.

        Returns
        -------
        Constraint
            The constraint.
        """
        return _between(self, low, high)

    def equals(self, value: float) -> Constraint:
        """Return the constraint that all numbers have a value.

        Parameters
        ----------
        value : float
            The value.

        Returns
        -------
        Constraint
            The constraint.
        """
        return _between(self, value, value)

    def __repr__(self) -> str:
        return f"Quantity({self.label})"


class Leaf(Quantity):
    """A quantity that is computed directly at a point; ``equations``: whether it takes those of small motion."""

    def __init__(self, label: str, ask: Callable[[DesignPoint], Dual], equations: bool = True) -> None:
        super().__init__(label, (), ask, equations)

    def at(self, point: DesignPoint) -> Dual:
        return self._rule(point)


@dataclass(frozen=True, slots=True, eq=False)
class Constraint(Displayed):
    """A quantity no less than ``low`` and no more than ``high``; None: no such bound. Equal: it has that value."""

    quantity: Quantity
    """What is bounded."""
    low: float | None
    high: float | None

    @property
    def label(self) -> str:
        """The constraint in words."""
        if self.low == self.high:
            return f"{self.quantity.label} = {self.low:g}"
        left = "" if self.low is None or self.high is None else f"{self.low:g} <= "
        return left + self.quantity.label + (f" <= {self.high:g}" if self.high is not None else f" >= {self.low:g}")

    @property
    def equal(self) -> bool:
        """Whether it is an equality constraint."""
        return self.low == self.high

    def __bool__(self) -> bool:
        raise ModelError(f"constraint '{self.label}' is neither true nor false before it is solved for; bounds on both "
                         f"sides are q.between(low, high).", field="constraints")  # fmt: skip

    def __repr__(self) -> str:
        return f"Constraint({self.label})"


def quantity(value: Any) -> Quantity:
    """Return a quantity; a number () or (k,) becomes a constant one."""
    if isinstance(value, Quantity):
        return value
    fixed = np.array(reals(value, "quantity", "value", "a quantity or numbers", ModelError), ndmin=1)
    if fixed.ndim != 1 or not np.isfinite(fixed).all():
        raise check.refuse("quantity", "value", value, "a quantity or finite numbers")
    label = f"{fixed[0]:g}" if len(fixed) == 1 else check.shown(fixed)
    return Quantity(label, (), partial(Dual, fixed, np.zeros((len(fixed), 1))), equations=False)


def _joined(sign: str, a: Quantity, b: Quantity, rule: Callable[[Dual, Dual], Dual]) -> Quantity:
    left, right = (a.label, b.label) if sign == "+" else (_bracketed(a), _bracketed(b))
    return Quantity(f"{left} {sign} {right}", (a, b), rule)


def _bracketed(part: Quantity) -> str:
    return f"({part.label})" if any(sign in part.label for sign in (" + ", " - ", " * ", " / ")) else part.label


def _between(constrained: Quantity, low: Any, high: Any) -> Constraint:
    if isinstance(low, Quantity) or isinstance(high, Quantity):
        bound = low if isinstance(low, Quantity) else high
        difference = constrained - bound
        return Constraint(difference, None, 0.0) if high is not None else Constraint(difference, 0.0, None)
    least = None if low is None else check.number(low, constrained.label, "low", "a finite bound")
    most = None if high is None else check.number(high, constrained.label, "high", "a finite bound")
    if least is not None and most is not None and least > most:
        raise check.refuse(constrained.label, "low", least, f"no more than high = {most:g}")
    return Constraint(constrained, least, most)


class Largest(Quantity):
    """The largest of several numbers; a search bounds all of them at once, because their maximum is not smooth.

    ``members`` are the numbers; if there are infinitely many, those at the points of ``active``, which are initially
    the ``seeds`` and later include the ``tops``, the local maxima.
    """

    def at(self, point: DesignPoint) -> Dual:
        """Return the largest, or the bound that replaces it in a search."""
        return point.level(self) or self.true(point)

    def true(self, point: DesignPoint) -> Dual:
        """Return the largest itself."""
        members = self.members(point, None)
        which = [int(members.value.argmax())]
        return Dual(members.value[which], members.slope[which])

    def members(self, point: DesignPoint, active: Array | None) -> Dual:
        """Return the numbers."""
        return self.parts[0].at(point)

    def seeds(self, point: DesignPoint) -> Array | None:
        """Return the initial points; None if there are finitely many numbers."""
        return None

    def tops(self, point: DesignPoint) -> tuple[Array, Array]:
        """Return points at which numbers are largest, and these numbers."""
        return np.zeros(0), np.zeros(0)


def largest(*quantities: Any) -> Quantity:
    """Return the largest of all numbers of some quantities.

    Parameters
    ----------
    *quantities : Quantity
        What to look at; ``minimax`` objectives and bounds of it are solved without kinks.

    Returns
    -------
    Quantity
        One number.
    """
    quantity = _stacked(quantities)
    return Largest(f"largest of {quantity.label}", (quantity,), stacked)


def smallest(*quantities: Any) -> Quantity:
    """Return the smallest of all numbers of some quantities.

    Parameters
    ----------
    *quantities : Quantity
        What to look at.

    Returns
    -------
    Quantity
        One number, as large as its constraints let it be where its negative is minimised.
    """
    quantity = _stacked(quantities)
    result = -Largest(f"largest of {(-quantity).label}", (-quantity,), stacked)
    result.label = f"smallest of {quantity.label}"
    return result


def _stacked(quantities: tuple[Any, ...]) -> Quantity:
    parts = tuple([quantity(item) for item in quantities])
    if not parts:
        raise check.refuse("largest", "quantities", quantities, "at least one quantity")
    if len(parts) == 1:
        return parts[0]
    return Quantity(", ".join(part.label for part in parts), parts, stacked)
