"""Materials of beams: Young's modulus, Poisson's ratio or shear modulus, and density."""

from __future__ import annotations

from dataclasses import dataclass, fields
from typing import Any

from mbsvib.common import arguments as check
from mbsvib.elements.sections import built


@dataclass(frozen=True, slots=True)
class Material:
    """A linear elastic isotropic material: ``E`` [N/m^2], ``rho`` [kg/m^3], and ``nu`` [-] or ``G`` [N/m^2]."""

    E: float
    rho: float
    nu: float | None = None
    G: float | None = None

    def __post_init__(self) -> None:
        for item in fields(self):
            value = getattr(self, item.name)
            if value is not None:
                object.__setattr__(self, item.name, check.number(value, "material", item.name))
        for key in ("E", "rho", "G"):
            value = getattr(self, key)
            if value is not None and value <= 0.0:
                raise check.refuse("material", key, value, "a positive number")
        if (self.nu is None) == (self.G is None):
            raise check.refuse("material", "nu", self.nu, "one of nu (Poisson's ratio) and G (shear modulus)")
        if self.nu is not None and not -1.0 < self.nu <= 0.5:
            raise check.refuse("material", "nu", self.nu, "Poisson's ratio, above -1 and up to 0.5")

    @property
    def shear_modulus(self) -> float:
        """G, or E / (2 (1 + nu)) if nu is given [N/m^2]."""
        return self.G if self.G is not None else self.E / (2.0 * (1.0 + self.poisson))

    @property
    def poisson(self) -> float:
        """Poisson's ratio nu, or E / (2 G) - 1 if G is given."""
        return self.nu if self.nu is not None else self.E / (2.0 * self.shear_modulus) - 1.0

    def constructor_kwargs(self) -> dict[str, Any]:
        """Return the dict from which ``make`` makes the same material."""
        return {item.name: value for item in fields(self) if (value := getattr(self, item.name)) is not None}


def make(value: Any, who: str) -> Material:
    """Return a material from an object or from a dict such as {"E": 2.1e11, "nu": 0.3, "rho": 7800}."""
    if isinstance(value, Material):
        return value
    if not hasattr(value, "keys"):
        raise check.refuse(who, "material", value, "a Material or a dict, such as "
                           "{'E': 2.1e11, 'nu': 0.3, 'rho': 7800}")  # fmt: skip
    result: Material = built(Material, dict(value), who, "material")
    return result
