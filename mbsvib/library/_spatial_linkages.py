"""The RSSR linkage and its equivalent of seven revolute joints; slender bars between two points."""

from __future__ import annotations

from math import atan2, cos, hypot, sin

from numpy.typing import ArrayLike

from mbsvib.api.model import Model
from mbsvib.common import arguments as check
from mbsvib.common.arguments import Vector
from mbsvib.common.expected import one_of
from mbsvib.errors import ModelError

Point = tuple[float, float]
# Moment of inertia of a planar bar about its own line as a share of that across it; it has no effect in the plane.
THICKNESS = 0.01


def add_planar_bar(model: Model, name: str, start: Point, end: Point, per_length: float) -> None:
    """Add a slender bar in the x-y plane, its x along its line."""
    length = hypot(end[0] - start[0], end[1] - start[1])
    moment = per_length * length**3 / 12.0
    model.add_body(name, per_length * length, (THICKNESS * moment, moment, moment),
                   (0.5 * (start[0] + end[0]), 0.5 * (start[1] + end[1]), 0.0),
                   (0.0, 0.0, atan2(end[1] - start[1], end[0] - start[0])))  # fmt: skip


def add_bar(model: Model, name: str, start: Vector, end: Vector, mass: float, axial_inertia: float) -> None:
    """Add a slender bar in space, its z along its line."""
    line = (end[0] - start[0], end[1] - start[1], end[2] - start[2])
    length = hypot(*line)
    moment = mass * length**2 / 12.0
    model.add_body(name, mass, (moment, moment, axial_inertia),
                   (0.5 * (start[0] + end[0]), 0.5 * (start[1] + end[1]), 0.5 * (start[2] + end[2])),
                   check.frame_along((line[0] / length, line[1] / length, line[2] / length)))  # fmt: skip


def meeting(first: Point, first_length: float, second: Point, second_length: float, who: str, field: str) -> Point:
    """Return where two bars from two pins meet, on the left of the line from the first pin to the second."""
    x, y = second[0] - first[0], second[1] - first[1]
    distance = hypot(x, y)
    if not abs(first_length - second_length) < distance < first_length + second_length:
        raise check.refuse(who, field, None, f"lengths that meet: bars of {first_length:g} m and {second_length:g} m "
                           f"start from pins {distance:g} m apart")  # fmt: skip
    along = 0.5 * (distance**2 + first_length**2 - second_length**2) / distance
    across = (first_length**2 - along**2) ** 0.5
    return (first[0] + (along * x - across * y) / distance, first[1] + (along * y + across * x) / distance)


def turned(length: float, angle: float) -> Point:
    """Return the end of a bar from the origin, at an angle from x towards y."""
    return (length * cos(angle), length * sin(angle))


X, Z = (1.0, 0.0, 0.0), (0.0, 0.0, 1.0)
ROCKER_BALLS = ("spherical", "universal")


def rssr(
    *, rocker_ball: str = "spherical", crank: float = 0.1, crank_angle: float = 0.7, rocker: float = 0.2,
    rocker_angle: float = 1.1, rocker_pivot: ArrayLike = (0.3, 0.1, 0.0), masses: ArrayLike = (0.5, 1.0, 0.8),
    axial_inertia: float = 1e-4, drive_stiffness: float = 10.0, drive_damping: float = 0.0,
    gravity: ArrayLike | None = None,
) -> Model:  # fmt: skip
    """Build an RSSR linkage: crank and rocker on crossed axes, joined by a coupler with a ball at either end.

    The crank ``link1`` turns about z on the joint ``crank`` at the origin, the rocker ``link3`` about x on ``rocker``;
    the coupler ``link2`` joins their ends by ``ball12`` and ``ball23``. Two spherical joints leave it free to turn
    about its own line, with no stiffness against it: 2 degrees of freedom. A universal joint at the rocker locks that:
    1 degree of freedom.

    Parameters
    ----------
    rocker_ball : str
        The joint ``ball23``: "spherical", or "universal" with both axes across the coupler.
    crank, rocker : float
        Lengths [m].
    crank_angle, rocker_angle : float
        Of the crank from x towards y, of the rocker from y towards z [rad].
    rocker_pivot : array-like, shape (3,)
        Point of the joint ``rocker`` [m].
    masses : array-like, shape (3,)
        Of crank, coupler and rocker [kg], slender bars.
    axial_inertia : float
        Moment of inertia of each about its own line [kg m^2].
    drive_stiffness, drive_damping : float
        Of the torsion spring ``drive`` between ground and crank [N m/rad, N m s/rad]; both 0: none.
    gravity : array-like, shape (3,), optional
        As for a model.

    Returns
    -------
    Model
        The linkage; input ``torque`` on the crank, outputs ``crank.angle`` and ``rocker.angle``.

    Raises
    ------
    ModelError
        If a value is refused by the part it is for.

    Source: H. Chaudhary, S. K. Saha, "Dynamics and Balancing of Multibody Systems" (2009), section 4.6.
    """
    one_of(rocker_ball, ROCKER_BALLS, "rssr", "rocker_ball", ModelError)
    model, a, b, line = _linkage("rssr", crank, crank_angle, rocker, rocker_angle, rocker_pivot, masses,
                                 axial_inertia, gravity)  # fmt: skip
    model.add_joint("ball12", "spherical", "link1", "link2", a)
    model.add_joint("ball23", rocker_ball, "link2", "link3", b, check.frame_along(line))
    _add_drive(model, drive_stiffness, drive_damping)
    return model


def seven_r(
    *, crank: float = 0.1, crank_angle: float = 0.7, rocker: float = 0.2, rocker_angle: float = 1.1,
    rocker_pivot: ArrayLike = (0.3, 0.1, 0.0), masses: ArrayLike = (0.5, 1.0, 0.8), axial_inertia: float = 1e-4,
    drive_stiffness: float = 10.0, drive_damping: float = 0.0, gravity: ArrayLike | None = None,
) -> Model:  # fmt: skip
    """Build the RSSR linkage of seven revolute joints: 1 degree of freedom, one loop without redundant constraints.

    As ``rssr`` with a universal joint at the rocker. The spherical joint at the crank is three revolute joints with
    bodies without mass between them, ``ball12.1`` to ``ball12.3``, the universal joint is two, ``ball23.1`` and
    ``ball23.2``.

    Parameters
    ----------
    crank, crank_angle, rocker, rocker_angle, rocker_pivot, masses, axial_inertia : as for ``rssr``
        Lengths [m], angles [rad], point [m], masses [kg] and moment of inertia [kg m^2] of the bars.
    drive_stiffness, drive_damping, gravity : as for ``rssr``
        Of the torsion spring ``drive`` [N m/rad, N m s/rad], and of the model [m/s^2].

    Returns
    -------
    Model
        The linkage; ports as those of ``rssr``.

    Raises
    ------
    ModelError
        If a value is refused by the part it is for.

    Source: H. Chaudhary, S. K. Saha, "Dynamics and Balancing of Multibody Systems" (2009), section 4.6.
    """
    model, a, b, line = _linkage("seven_r", crank, crank_angle, rocker, rocker_angle, rocker_pivot, masses,
                                 axial_inertia, gravity)  # fmt: skip
    x, y, z = zip(*check.frame_along(line), strict=True)
    _add_chain(model, "ball12", "link1", "link2", a, (x, y, z))
    _add_chain(model, "ball23", "link2", "link3", b, (x, y))
    _add_drive(model, drive_stiffness, drive_damping)
    return model


def _linkage(
    who: str, crank: float, crank_angle: float, rocker: float, rocker_angle: float, rocker_pivot: ArrayLike,
    masses: ArrayLike, axial_inertia: float, gravity: ArrayLike | None,
) -> tuple[Model, Vector, Vector, Vector]:  # fmt: skip
    """Crank, coupler and rocker on their pivots; the coupler's ends and its direction."""
    r1, r3 = check.positive(crank, who, "crank", "m"), check.positive(rocker, who, "rocker", "m")
    first, third = (check.number(value, who, field, "an angle [rad]")
                    for value, field in ((crank_angle, "crank_angle"), (rocker_angle, "rocker_angle")))  # fmt: skip
    pivot = check.vector(rocker_pivot, who, "rocker_pivot")
    three = check.numbers(masses, (3,), who, "masses", "three masses [kg]: crank, coupler, rocker")
    axial = check.number(axial_inertia, who, "axial_inertia", "a moment of inertia [kg m^2]")
    a = (r1 * cos(first), r1 * sin(first), 0.0)
    b = (pivot[0], pivot[1] + r3 * cos(third), pivot[2] + r3 * sin(third))
    line = (b[0] - a[0], b[1] - a[1], b[2] - a[2])
    length = hypot(*line)
    if length == 0.0:
        raise check.refuse(who, "rocker_pivot", rocker_pivot, "a pivot for which the rocker does not end at the crank")
    model = Model(who, gravity)
    for name, start, end, mass in (("link1", (0.0, 0.0, 0.0), a, three[0]), ("link2", a, b, three[1]),
                                   ("link3", pivot, b, three[2])):  # fmt: skip
        add_bar(model, name, start, end, mass, axial)
    model.add_joint("crank", "revolute", "ground", "link1", (0.0, 0.0, 0.0), axis=Z)
    model.add_joint("rocker", "revolute", "ground", "link3", pivot, axis=X)
    return model, a, b, (line[0] / length, line[1] / length, line[2] / length)


def _add_chain(model: Model, name: str, first: str, last: str, point: Vector, axes: tuple[ArrayLike, ...]) -> None:
    """Join two bodies by revolute joints in one point, with bodies without mass between them."""
    previous = first
    for i, axis in enumerate(axes, 1):
        after = last if i == len(axes) else f"{name}.part{i}"
        if after != last:
            model.add_body(after, 0.0, (0.0, 0.0, 0.0), point)
        model.add_joint(f"{name}.{i}", "revolute", previous, after, point, axis=axis)
        previous = after


def _add_drive(model: Model, stiffness: float, damping: float) -> None:
    if stiffness or damping:
        model.add_torsion_spring("drive", "ground", "link1", axis=Z, stiffness=stiffness, damping=damping)
    model.add_input("torque", "link1", "rz")
    model.add_output("crank.angle", "link1", "rz")
    model.add_output("rocker.angle", "link3", "rx")
