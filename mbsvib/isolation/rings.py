"""Rings of leg ends around an axis: radius, height, spread and angle."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from mbsvib.errors import ModelError

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from mbsvib.common.arrays import Array, Index


UNITS = {"radius": "m", "height": "m", "spread": "rad", "angle": "rad"}
ON_AXIS = 1e-9  # distance from the axis, in parts of the ring's size, that counts as zero
ALIKE = 1e-6  # angles that differ by less are equal [rad]


@dataclass(frozen=True, slots=True)
class Ring:
    """Ends of legs around an axis, (legs,) each: ``radius`` and ``height`` [m], ``angle`` [rad], and ``side``, the sign
    of their rotation by the spread, 0 if legs form no pairs; ``half`` of the angle between pairs [rad].
    """

    radius: Array
    height: Array
    angle: Array
    side: Array
    half: float

    @property
    def start(self) -> dict[str, float]:
        """The present ring: means."""
        half_angle = {"spread": self.half} if self.side.any() else {}
        return {"radius": float(self.radius.mean()), "height": float(self.height.mean()), **half_angle, "angle": 0.0}

    def at(self, off: Mapping[str, Any]) -> tuple[Array, Array]:
        """Return radius and angle of the ends (..., legs), for differences of the variables from their start."""
        added = {dimension: np.asarray(off.get(dimension, 0.0), dtype=float)[..., None] for dimension in UNITS}
        return self.radius + added["radius"], self.angle + self.side * added["spread"] + added["angle"]

    def shifts(self, off: Mapping[str, Any]) -> Array:
        """Return the displacements of the ends, (..., legs, 3), with the axis along the last entry."""
        radius, angle = self.at(off)
        across = [radius * turn(angle) - self.radius * turn(self.angle) for turn in (np.cos, np.sin)]
        along = np.asarray(off.get("height", 0.0), dtype=float)[..., None]
        return np.stack(np.broadcast_arrays(*across, along), axis=-1)

    def slope(self, dimension: str, off: Mapping[str, float]) -> Array:
        """Return the derivatives of the ends with respect to a variable, (legs, 3)."""
        radius, angle = self.at(off)
        none, ones = np.zeros_like(radius), np.ones_like(radius)
        if dimension == "height":
            return np.stack([none, none, ones], axis=-1)
        if dimension == "radius":
            return np.stack([np.cos(angle), np.sin(angle), none], axis=-1)
        arm = radius * (self.side if dimension == "spread" else ones)
        return np.stack([-arm * np.sin(angle), arm * np.cos(angle), none], axis=-1)


def ring_of(ends: Array, others: Array, legs: Sequence[str], which: str) -> Ring:
    """Return the ring that the ends of legs make, its axis along z.

    ``ends``, ``others`` (legs, 3): ends on this ring and on the other one [m].
    """
    radius, angle = np.hypot(ends[:, 0], ends[:, 1]), np.arctan2(ends[:, 1], ends[:, 0])
    for leg, r in zip(legs, radius.tolist(), strict=True):
        if r <= ON_AXIS * np.abs(ends).max():
            raise ModelError(f"platform: the end of leg '{leg}' on the {which} is on the axis, and has no "
                             f"direction to move in; give another centre or axis, or legs without it.",
                             element=leg, field="centre")  # fmt: skip
    side, half = np.zeros(len(legs)), 0.0
    if len(legs) % 2 == 0:
        lower, upper = _pairs(angle, np.arctan2(others[:, 1], others[:, 0]))
        side[lower], side[upper] = -1.0, 1.0
        half = 0.5 * float(_turn(angle[upper] - angle[lower]).mean())
    return Ring(radius, ends[:, 2], angle, side, half)


def _pairs(angle: Array, other_end: Array) -> tuple[Index, Index]:
    """Neighbours on a ring, the nearest ones: those at the lower and those at the upper angle."""
    towards = _turn(other_end - angle + np.pi)
    rounded = np.round(_turn(angle + ALIKE) / ALIKE)
    order = np.lexsort((towards, rounded))  # coinciding ends are sorted by the other ends of their legs
    distances = _turn(np.diff(angle[order], append=angle[order[0]]) + ALIKE) - ALIKE
    even, odd = distances[0::2].sum(), distances[1::2].sum()
    first = int(np.flatnonzero(order == 0)[0])
    if odd < even - ALIKE or (abs(odd - even) <= ALIKE and first % 2):
        order = np.roll(order, -1)
    return order[0::2], order[1::2]


def _turn(angle: Array) -> Array:
    """Angles from 0 to a full turn."""
    return np.asarray(np.mod(angle, 2.0 * np.pi))
