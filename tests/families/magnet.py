"""A magnet, a family that mbsvib does not have: a force law of one file and one row.

Two poles attract each other with F = strength / gap^power along the line between them.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from mbsvib.common import arguments as check
from mbsvib.elements.connection import ENDS, LINE, Connection, check_ends, line_between
from mbsvib.elements.deformations import Law, length
from mbsvib.elements.families import Family
from mbsvib.elements.roles import number, stated
from mbsvib.errors import ModelError

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

    from mbsvib.elements import Body


def energy(deformation, fields):
    """V = -strength / ((power - 1) gap^(power - 1)), so that dV/dgap = strength / gap^power."""
    (gap,) = deformation
    return -fields.strength / (fields.power - 1.0) * gap ** (1.0 - fields.power)


@dataclass(frozen=True, slots=True)
class Magnet(Connection):
    """Two poles at ``start`` on ``first`` and ``end`` on ``second`` [m] that attract each other."""

    law = Law(length, damping="damping", energy=energy)
    roles = stated(**ENDS, strength=number("N m^n"), power=number("-", signed=False), damping=number("N s/m"), **LINE)

    start: tuple[float, ...]
    end: tuple[float, ...]
    strength: float
    power: float = 2.0
    damping: float = 0.0


def make(name, first, second, start, end, strength, power=2.0, damping=0.0):
    """Check the values of a magnet and build it."""
    who = f"magnet '{name}'"
    check_ends(who, first, second)
    a, b, _, _ = line_between(who, start, end, "Poles without a gap have no finite force.")
    exponent = check.number(power, who, "power", "an exponent above 1")
    if exponent <= 1.0:
        raise ModelError(f"{who}: power = {power}; expected an exponent above 1.", element=name, field="power")
    strength = check.number(strength, who, "strength", "a finite number [N m^n]")
    return Magnet(name, first, second, a, b, strength, exponent, check.number(damping, who, "damping", "a number"))


def add_magnet(
    self, name: str, first: str | Body, second: str | Body, start: ArrayLike, end: ArrayLike,
    strength: float, power: float = 2.0, damping: float = 0.0,
):  # fmt: skip
    """Add a magnet."""
    a, b = self._between("magnet", name, first, second)
    return self._keep(self._springs, make(name, a, b, start, end, strength, power, damping))


ROW = Family(Magnet, "magnet", "springs", make)
