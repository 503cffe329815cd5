"""Rings of leg ends around an axis, and the parts of legs that follow their ends: positions and orientations."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from mbsvib.errors import ModelError

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from numpy.typing import NDArray

    from mbsvib.common.arrays import Array, Index
    from mbsvib.isolation.legs import Leg


UNITS = {"radius": "m", "height": "m", "spread": "rad", "angle": "rad"}
ON_AXIS = 1e-9  # distance from the axis, in parts of the ring's size, that counts as zero
ALIKE = 1e-6  # angles that differ by less are equal [rad]
SHORT = 1e-9  # length, in parts of the original one, that counts as zero
FLIPPED = 1e-9  # 1 + cosine of a leg's rotation angle, below which the smallest rotation is not unique
SMALL = 1e-3  # tangent of half an angle, below which three terms of a series are accurate


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
        added = {dimension: np.asarray(off.get(dimension, 0.0))[..., None] for dimension in UNITS}
        return self.radius + added["radius"], self.angle + self.side * added["spread"] + added["angle"]

    def shifts(self, off: Mapping[str, Any]) -> Array:
        """Return the displacements of the ends, (..., legs, 3), with the axis along the last entry."""
        radius, angle = self.at(off)
        across = [radius * turn(angle) - self.radius * turn(self.angle) for turn in (np.cos, np.sin)]
        along = np.asarray(off.get("height", 0.0))[..., None]
        return np.stack(np.broadcast_arrays(*across, along), axis=-1)


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


@dataclass(frozen=True, slots=True)
class Following:
    """Legs (l) by their ``names``, from ``start`` along ``line`` (l, 3); their ``points`` (p, 3) with the leg that is
    the ``owner`` of each (p,) and their ``shares`` (p,), and the leg ``turns`` (t,) that each orientation goes with.
    ``parameters`` are the names of all coordinates of points and of all components of orientations.
    """

    names: tuple[str, ...]
    start: Array
    line: Array
    points: Array
    owner: Index
    shares: Array
    turns: Index
    parameters: tuple[str, ...]

    @classmethod
    def of(cls, legs: Sequence[Leg]) -> Following:
        """Return the parts that follow the ends of some legs."""
        points = [(name, i, point, leg.shares[name]) for i, leg in enumerate(legs)
                  for name, point in leg.points.items()]  # fmt: skip
        oriented = [(name, i) for i, leg in enumerate(legs) for name in leg.orientations]
        names = [f"{name}.{axis}" for name, *_ in points for axis in "xyz"]
        names += [f"{name}.{axis}" for name, _ in oriented for axis in ("rx", "ry", "rz")]
        start = np.array([leg.start for leg in legs])
        return cls(
            tuple([leg.name for leg in legs]), start, np.array([leg.end for leg in legs]) - start,
            np.array([point for _, _, point, _ in points]), np.array([i for _, i, _, _ in points], dtype=np.intp),
            np.array([share for _, _, _, share in points]), np.array([i for _, i in oriented], dtype=np.intp),
            tuple(names),
        )  # fmt: skip

    def values(self, low: Array, high: Array, variables: Mapping[str, Any]) -> dict[str, Any]:
        """Return the parameters (...) for shifted ends: positions [m] and rotation vectors [rad]; ends may be complex,
        for derivatives by a complex step.

        ``low``, ``high`` (..., l, 3): displacements of the starts and ends of the legs [m].
        """
        leg, before = self.owner, _norm(self.line)
        line = self.line + high - low
        length = _norm(line)
        self._refuse(~(length.real > SHORT * before), "no length", variables)
        direction, along = self.line / before[:, None], line / length[..., None]
        cosine = (direction * along).sum(axis=-1)
        self._refuse(1.0 + cosine.real <= FLIPPED, "been turned end for end", variables)
        cross = np.cross(direction, along)
        turns = (_turn_factor((cross * cross).sum(axis=-1), cosine)[..., None] * cross)[..., self.turns, :]
        once = np.cross(cross[..., leg, :], self.points - self.start[leg])
        longer = self.shares * (length - before)[..., leg]
        points = (self.points + low[..., leg, :] + once
                  + np.cross(cross[..., leg, :], once) / (1.0 + cosine[..., leg, None])
                  + longer[..., None] * along[..., leg, :])  # fmt: skip
        lead = low.shape[:-2]
        coordinates = np.concatenate([points.reshape(*lead, -1), turns.reshape(*lead, -1)], axis=-1)
        columns = np.moveaxis(coordinates, -1, 0) if lead else coordinates.tolist()
        return dict(zip(self.parameters, columns, strict=True))

    def _refuse(self, bad: NDArray[np.bool_], fault: str, variables: Mapping[str, Any]) -> None:
        if not bad.any():
            return
        *point, leg = np.argwhere(bad)[0].tolist()
        values = {name: np.asarray(value).real for name, value in variables.items()}
        shown = ", ".join(f"{name} = {float(value[tuple(point)] if value.ndim else value):.6g}"
                          for name, value in values.items())  # fmt: skip
        raise ModelError(f"platform: leg '{self.names[leg]}' has {fault} where {shown}; give bounds that keep away "
                         f"from there.", element=self.names[leg], field="variables")  # fmt: skip


def _norm(vectors: Array) -> Array:
    """Lengths of vectors (..., 3), also of complex ones, as an analytic function."""
    return np.asarray(np.sqrt((vectors * vectors).sum(axis=-1)))


def _turn_factor(square: Array, cosine: Array) -> Array:
    """Angle over sine of a rotation less than half a turn, from the square of its sine and its cosine.

    a / sin a = 2 atan(t) / t / (1 + cos a),  t = tan(a / 2) = sin a / (1 + cos a)
    """
    t2 = square / (1.0 + cosine) ** 2
    close = np.abs(t2) < SMALL**2
    t = np.sqrt(np.where(close, 1.0, t2))
    return np.asarray(2.0 * np.where(close, 1.0 - t2 / 3.0 + t2**2 / 5.0, np.arctan(t) / t) / (1.0 + cosine))
