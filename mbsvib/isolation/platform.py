"""Geometry of platforms on legs: radius, height, spread and angle of the rings of their ends; all parts of legs follow.

Where the ends of a leg go, its bodies, joints, springs and bushings follow. What belongs to an end keeps its place
against it, and all turn with the line from end to end: by the least rotation R that brings its old direction u0 to the
new one u. With A the start, L the length and s its share of it, a point p0 comes to

    p = A + R (p0 - A0) + s (L - L0) u,    R = exp([w]x),    w = (a / sin a) u0 x u,    cos a = u0 . u.
"""

from __future__ import annotations

import warnings
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from mbsvib.api.model import Model
from mbsvib.common import arguments as check
from mbsvib.common.arrays import Array, Index
from mbsvib.common.display import Displayed
from mbsvib.common.selection import Names
from mbsvib.elements.ports import Port
from mbsvib.equations.batch_values import STEP
from mbsvib.errors import ModelError
from mbsvib.isolation.legs import Leg, legs_between
from mbsvib.isolation.study_scene import check_body
from mbsvib.mechanism.mechanism import GROUND

UNITS = {"radius": "m", "height": "m", "spread": "rad", "angle": "rad"}
ON_AXIS = 1e-9  # distance from the axis, in parts of the ring's size, that counts as zero
SAME = 1e-6  # angles that differ by less are equal [rad]
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
    rounded = np.round(_turn(angle + SAME) / SAME)
    order = np.lexsort((towards, rounded))  # coinciding ends are sorted by the other ends of their legs
    distances = _turn(np.diff(angle[order], append=angle[order[0]]) + SAME) - SAME
    even, odd = distances[0::2].sum(), distances[1::2].sum()
    first = int(np.flatnonzero(order == 0)[0])
    if odd < even - SAME or (abs(odd - even) <= SAME and first % 2):
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


ALIKE = 1e-6  # distance, in parts of the platform's size, of points that are one


@dataclass(frozen=True, repr=False, eq=False)
class Platform(Displayed):
    """A platform whose ``rings`` of leg ends may be changed: variables with their ``start`` and ``units``, and what
    they make of the parameters of the ``legs``.
    """

    legs: tuple[Leg, ...]
    rings: Mapping[str, Ring]
    frame: Array = field(repr=False)
    start: Mapping[str, float]
    units: Mapping[str, str]
    following: Following = field(repr=False)

    @property
    def ties(self) -> dict[str, Platform]:
        """The variables, as ``ties`` of ``optimize``, ``sweep`` and others."""
        return dict.fromkeys(self.start, self)

    def values(self, variables: Mapping[str, Any]) -> dict[str, Any]:
        """Return the values of all parameters of the legs, for ``model.with_values``.

        Parameters
        ----------
        variables : mapping of str to float or array, shape (n,)
            Values of some of the variables [m, rad]; the others are as they start.

        Returns
        -------
        dict of str to float or array, shape (n,)
            Positions and orientations.

        Raises
        ------
        ModelError
            If a variable is unknown or no number, a ring gets no radius, or a leg no length.
        """
        off = self._off(variables)
        for which, ring in self.rings.items():
            radius = ring.at(off[which])[0].real
            if not (radius > 0.0).all():
                leg = self.legs[int(np.argmin(radius) % len(self.legs))].name
                raise ModelError(f"platform: {which}.radius leaves the end of leg '{leg}' at {radius.min():.6g} m from "
                                 f"the axis; expected more than 0.", element=leg, field=f"{which}.radius")  # fmt: skip
        shifts = [ring.shifts(off[which]) @ self.frame.T for which, ring in self.rings.items()]  # of both ends [m]
        low, high = np.broadcast_arrays(*shifts)
        return self.following.values(low, high, variables)

    def rates(self, variables: Mapping[str, float]) -> dict[str, dict[str, float]]:
        """Return the derivatives of these values to the variables that are given.

        Parameters
        ----------
        variables : mapping of str to float
            Values of some of the variables [m, rad].

        Returns
        -------
        dict of str to dict of str to float
            {variable: {parameter: rate}}.

        Raises
        ------
        ModelError
            As ``values`` does.
        """
        steps = STEP * np.eye(len(variables))
        shifted = {name: check.number(value, "platform", name) + 1j * step
                   for (name, value), step in zip(variables.items(), steps, strict=True)}  # fmt: skip
        derivatives = {name: value.imag / STEP for name, value in self.values(shifted).items()} if variables else {}
        return {variable: {name: float(rates[k]) for name, rates in derivatives.items() if rates[k]}
                for k, variable in enumerate(variables)}  # fmt: skip

    def _off(self, variables: Mapping[str, Any]) -> dict[str, dict[str, Any]]:
        """Changes of the variables from their start, by ring."""
        result: dict[str, dict[str, Any]] = {ring: {} for ring in self.rings}
        for name, value in variables.items():
            check.known(name, self.start, f"platform: there is no variable '{name}'", told="Variables are:")
            number = value if isinstance(value, np.ndarray) else check.number(value, "platform", name)
            ring, dimension = name.split(".")
            result[ring][dimension] = number - self.start[name]
        return result

    def __repr__(self) -> str:
        return f"Platform({len(self.legs)} legs: {', '.join(f'{k} {v:.6g}' for k, v in self.start.items())})"


def platform(
    model: Model, body: str, base: str = GROUND, *, legs: Names = None,
    centre: ArrayLike = (0, 0, 0), axis: ArrayLike = (0, 0, 1),
) -> Platform:  # fmt: skip
    """Return the geometry of a platform as variables: radius, height, spread and angle of the rings that the ends of
    its legs make on base and platform, with bodies, joints, springs and bushings of the legs following.

    Variables are ``base.radius``, ``base.height`` [m], ``base.spread``, ``base.angle`` [rad] and those of ``platform``.
    Radius and height are means; where ends have others, they keep the difference. The spread is half the angle between
    neighbours, paired so that they are nearest; the angle turns the complete ring. A leg is a line spring, a rod, or a
    chain of bodies with a joint that slides along it: what is below that goes with the base, what is above with the
    platform, and all turns with the leg. The platform's mass stays where it is, and so do inputs and outputs: a warning
    names those along legs.

    Parameters
    ----------
    model : Model
        The mechanism, for the initial values of the variables.
    body : str
        The platform.
    base : str
        The body or ground that carries the legs.
    legs : str or sequence of str, optional
        Names or patterns of parts, one or more of each leg. Default: every chain between base and platform.
    centre, axis : array-like, shape (3,)
        A point of the axis of both rings, from where heights count, and its direction [m].

    Returns
    -------
    Platform
        ``ties`` for ``optimize``, and ``values`` for ``model.with_values``.

    Raises
    ------
    ModelError
        If there is no leg, one is no chain between base and platform, does not slide, or has an end on the axis.
    """
    check_body(model, body, "platform", "body")
    check_body(model, base, "platform", "base")
    if body == base:
        raise ModelError(f"platform: body and base are both '{body}'; legs lead from one to the other.",
                         element=body, field="base")  # fmt: skip
    origin = np.array(check.vector(centre, "platform", "centre"))
    frame = np.array(check.frame_along(check.axis(axis, "platform", "axis")))
    leg_list = legs_between(model, body, base, legs)
    low, high = ((np.array(ends) - origin) @ frame for ends in
                 ([leg.start for leg in leg_list], [leg.end for leg in leg_list]))  # fmt: skip
    names = [leg.name for leg in leg_list]
    rings = {"base": ring_of(low, high, names, "base"), "platform": ring_of(high, low, names, "platform")}
    start = {f"{ring}.{dimension}": value for ring, ends in rings.items() for dimension, value in ends.start.items()}
    unmoved = _left_behind(model, leg_list)
    if unmoved:
        warnings.warn(f"platform: inputs and outputs along legs stay where they are, {', '.join(unmoved[:4])}"
                      f"{', ...' if unmoved[4:] else ''}; leave them out, and add them to the mechanism that is found.",
                      stacklevel=2)  # fmt: skip
    return Platform(leg_list, rings, frame, start, {name: UNITS[name.split(".")[1]] for name in start},
                    Following.of(leg_list))  # fmt: skip


def _left_behind(model: Model, legs: Sequence[Leg]) -> list[str]:
    """Ports that lie on legs, or act on their bodies along a given direction or at a given point."""
    bodies = {name for leg in legs for name in leg.bodies}
    points = np.array([point for leg in legs for point in leg.points.values()])
    result = []
    for port in (*model.inputs.values(), *model.outputs.values()):
        if isinstance(port, Port):
            at_point = port.position is not None or not isinstance(port.direction, str)
            off = np.inf if port.position is None else np.abs(points - port.position).max(axis=1).min()
            if off <= ALIKE * np.ptp(points) or (at_point and bodies & {port.body, port.relative_to}):
                result.append(port.name)
    return result
