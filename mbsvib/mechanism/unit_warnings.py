"""Warnings of values that suggest wrong units; results show them, but they are not refused."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from math import dist, pi, sqrt
from typing import Any, TypeVar

import numpy as np

from mbsvib.elements.body import principal
from mbsvib.errors import ModelError
from mbsvib.mechanism.mechanism import Mechanism

M = TypeVar("M", bound="Mechanism")

# Radius of gyration over the size of the mechanism, beyond which inertia is likely to be in g mm^2 or kg cm^2
FAR = 10.0
# Size [m] beyond which positions are likely to be in mm, if no body has a radius of gyration of this share of it: half
# the diagonal of a box, in mm, is what a body within it has at most.
LARGE, SMALL = 20.0, 5e-4
# Speeds of sound sqrt(E / rho) [m/s] of solids: 30 in soft rubber, 5200 in steel, 18000 in diamond. Moduli in MPa or
# GPa and densities in g/cm^3 are beyond these by their factors of 1000 and more.
SLOWEST, FASTEST = 10.0, 3e4
# Turns of a joint beyond which its angle is likely to be in degrees. Cycles of engines have two.
TURNS, TURNS_OF_CYCLES = 1, 2
# Rounding of angles of whole turns, as numpy.linspace has it.
WHOLE_TURNS = 1e-9


def with_angles(model: M, displacements: Mapping[str, Any], turns: int = TURNS) -> M:
    """Return the model with the doubts of ``angle_warnings``."""
    doubts = angle_warnings(displacements, turns)
    return model.with_doubts(doubts) if doubts else model


@contextmanager
def angles_doubted(displacements: Mapping[str, float]) -> Iterator[None]:
    """Add the doubts of ``angle_warnings`` to refusals, which a joint turned by 90 rad in place of degrees leads to."""
    try:
        yield
    except ModelError as error:
        error.args = (" ".join([str(error), *angle_warnings(displacements)]),)
        raise


def angle_warnings(displacements: Mapping[str, Any], turns: int = TURNS) -> list[str]:
    """Return a sentence on each joint coordinate whose displacements [rad] by name are more than so many turns."""
    largest = {name: float(np.abs(np.asarray(values, dtype=float)).max(initial=0.0))
               for name, values in displacements.items() if name.rpartition(".")[2] in ("rx", "ry", "rz")}  # fmt: skip
    return [f"'{name}' is displaced by {value:.6g} rad, {value / (2.0 * pi):.3g} turns; is it in rad, not in degrees?"
            for name, value in largest.items() if value > (1.0 + WHOLE_TURNS) * 2.0 * pi * turns]  # fmt: skip


def unit_warnings(parts: Sequence[Any], model: Mechanism | None = None) -> list[str]:
    """Return the warnings, one sentence each.

    They are about materials with a speed of sound that no solid has, bodies whose radius of gyration is far larger than
    the mechanism, large mechanisms whose bodies all have a far smaller one, and, of a ``model`` that has moved, joints
    that turned further than around.
    """
    result = [] if model is None else list(model.doubts)
    result += [f"{part.family} '{part.name}': E = {material.E:.3g} and rho = {material.rho:.3g}, a speed of sound of "
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
