"""Warnings of values that suggest wrong units; ``explain`` shows them, but they are not refused."""

from __future__ import annotations

from math import dist, sqrt
from typing import TYPE_CHECKING, Any

from mbsvib.elements.body import principal

if TYPE_CHECKING:
    from collections.abc import Sequence

# Radius of gyration over the size of the mechanism, beyond which inertia is likely to be in g mm^2 or kg cm^2
FAR = 10.0
# Size [m] beyond which positions are likely to be in mm, if no body has a radius of gyration of this share of it.
LARGE, SMALL = 20.0, 2e-3
# Speeds of sound sqrt(E / rho) [m/s] of solids: 30 in soft rubber, 5200 in steel, 18000 in diamond. Moduli in MPa or
# GPa and densities in g/cm^3 are beyond these by their factors of 1000 and more.
SLOWEST, FASTEST = 10.0, 3e4


def unit_warnings(parts: Sequence[Any]) -> list[str]:
    """Return the warnings, one sentence each.

    They are about materials with a speed of sound that no solid has, bodies whose radius of gyration is far larger than
    the mechanism, and large mechanisms whose bodies all have a far smaller one.
    """
    result = [f"{part.family} '{part.name}': E = {material.E:.3g} and rho = {material.rho:.3g}, a speed of sound of "
              f"{speed:.3g} m/s; are they in N/m^2 and kg/m^3?"
              for part in parts if (material := getattr(part, "material", None)) is not None
              if not SLOWEST < (speed := sqrt(material.E / material.rho)) < FASTEST]  # fmt: skip
    points = [getattr(part, field, None) for part in parts for field in ("position", "start", "end")]
    known = [point for point in points if point is not None]
    if not known:
        return result
    size = dist([min(axis) for axis in zip(*known, strict=True)], [max(axis) for axis in zip(*known, strict=True)])
    radii = {part.name: sqrt(max(principal(*part.inertia)[2], 0.0) / part.mass) for part in parts
             if part.symbol == "body" and part.mass > 0.0}  # fmt: skip
    result += [f"body '{name}': a radius of gyration of {radius:.3g} m in a mechanism of {size:.3g} m; is its inertia "
               f"in kg m^2?" for name, radius in radii.items() if radius > FAR * size > 0.0]  # fmt: skip
    if size > LARGE and 0.0 < max(radii.values(), default=0.0) < SMALL * size:
        result.append(f"a mechanism of {size:.3g} m, in which no body has a radius of gyration above "
                      f"{max(radii.values()):.3g} m; are positions in m?")  # fmt: skip
    return result
