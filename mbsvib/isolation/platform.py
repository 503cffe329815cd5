"""Geometry of platforms on legs: radius, height, spread and angle of the rings of their ends, legs following.

Where the ends of a leg go, its bodies, joints, springs and bushings follow. What belongs to an end keeps its place
against it, and all turn with the line from end to end: by the least rotation R that brings its old direction u0 to the
new one u. With A the start, L the length and s its share of it, a point p0 comes to

    p = A + R (p0 - A0) + s (L - L0) u,    R = exp([w]x),    w = (a / sin a) u0 x u,    cos a = u0 . u.
"""

from __future__ import annotations

import warnings
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np

from mbsvib.common import arguments as check
from mbsvib.common.display import Displayed
from mbsvib.elements.ports import Port
from mbsvib.equations.batch_values import STEP
from mbsvib.errors import ModelError, nearest
from mbsvib.isolation.leg_motion import UNITS, Following, ring_of
from mbsvib.isolation.legs import legs_between
from mbsvib.isolation.study_scene import check_body
from mbsvib.mechanism.mechanism import GROUND

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from numpy.typing import ArrayLike

    from mbsvib.api.model import Model
    from mbsvib.common.arrays import Array
    from mbsvib.common.selection import Names
    from mbsvib.isolation.leg_motion import Ring
    from mbsvib.isolation.legs import Leg


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
        low, high = np.broadcast_arrays(*self._shifts(off))
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
            if name not in self.start:
                raise ModelError(f"platform: there is no variable '{name}'.{nearest(str(name), self.start)} Variables "
                                 f"are: {', '.join(self.start)}.", element=str(name))  # fmt: skip
            number = value if isinstance(value, np.ndarray) else check.number(value, "platform", name)
            ring, dimension = name.split(".")
            result[ring][dimension] = number - self.start[name]
        return result

    def _shifts(self, off: Mapping[str, Mapping[str, Any]]) -> list[Array]:
        """Displacements of the starts and ends of legs [m], world axes."""
        for which, ring in self.rings.items():
            radius = ring.at(off[which])[0].real
            if not (radius > 0.0).all():
                leg = self.legs[int(np.argmin(radius) % len(self.legs))].name
                raise ModelError(f"platform: {which}.radius leaves the end of leg '{leg}' at {radius.min():.6g} m from "
                                 f"the axis; expected more than 0.", element=leg, field=f"{which}.radius")  # fmt: skip
        return [ring.shifts(off[which]) @ self.frame.T for which, ring in self.rings.items()]

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
