"""Platforms on legs: Stewart platforms with extensible legs, the cubic hexapod, which decouples, and a wafer stage."""

from __future__ import annotations

from collections.abc import Sequence
from math import cos, pi, radians, sin, sqrt
from typing import Any

from numpy.typing import ArrayLike

from mbsvib.api.model import Model
from mbsvib.common import arguments as check
from mbsvib.common.arguments import DIRECTIONS, Vector
from mbsvib.common.expected import one_of
from mbsvib.errors import ModelError

GROUPS = ("platform", "legs", "base")
LEGS = ("leg1", "leg2", "leg3", "leg4", "leg5", "leg6")
LOADS = ("Fx", "Fy", "Fz", "Mx", "My", "Mz")


def cylinder(mass: float, radius: float, length: float) -> Vector:
    """Return the principal moments of a solid cylinder about its centre, axis along z [kg m^2]."""
    across = mass * (3.0 * radius * radius + length * length) / 12.0
    return (across, across, 0.5 * mass * radius * radius)


def rod(principal: Vector, line: Vector) -> tuple[float, ...]:
    """Return the inertia in world axes, xx yy zz xy xz yz, of a body whose axis of symmetry z lies along ``line``."""
    across, _, along = principal
    x, y, z = line
    d = along - across
    return (across + d * x * x, across + d * y * y, across + d * z * z, d * x * y, d * x * z, d * y * z)


def box(mass: float, x: float, y: float, z: float) -> Vector:
    """Return the principal moments of a solid box with these edges about its centre [kg m^2]."""
    return (mass * (y * y + z * z) / 12.0, mass * (x * x + z * z) / 12.0, mass * (x * x + y * y) / 12.0)


def circle(radius: Any, height: Any, angles: Any, who: str, ring: str) -> list[Vector]:
    """Return six points on a horizontal circle about the z axis."""
    r = check.number(radius, who, f"{ring}_radius", "a radius [m]")
    z = check.number(height, who, f"{ring}_height", "a height [m]")
    turns = check.numbers(angles, (6,), who, f"{ring}_angles", "six angles [rad]")
    return [(r * cos(a), r * sin(a), z) for a in turns]


def port_groups(ports: Any, who: str) -> tuple[str, ...]:
    """Return the requested groups of ports."""
    if ports == "all":
        return GROUPS
    if ports == "none":
        return ()
    groups = (ports,) if isinstance(ports, str) or not hasattr(ports, "__iter__") else tuple(ports)
    if all(group in GROUPS for group in groups):
        return groups
    raise check.refuse(who, "ports", ports, "'platform', 'legs' or 'base', several of them, 'all' or 'none'")


def add_ports(model: Model, groups: Sequence[str], legs: Sequence[tuple[str, str, Vector, Vector]]) -> None:
    """Add the groups of ports; a leg is (first body, second body, point, direction), its spring ``leg1.k``..."""
    if "platform" in groups:
        for load, direction in zip(LOADS, DIRECTIONS, strict=True):
            model.add_input(load, "platform", direction)
            model.add_output(direction, "platform", direction)
    if "legs" in groups:
        for leg, (first, second, point, line) in zip(LEGS, legs, strict=True):
            model.add_input(f"{leg}.f", second, line, point, relative_to=first)
            model.add_output(f"{leg}.elongation", second, line, point, relative_to=first)
            model.add_force_output(f"{leg}.force", f"{leg}.k")
    if "base" in groups:
        for direction in "xyz":
            model.add_base_motion(f"a{direction}", direction)
        for direction in DIRECTIONS:
            model.add_output(f"platform.a{direction}", "platform", direction, quantity="acceleration")


BASE_ANGLES = tuple(map(radians, (-10.0, 10.0, 110.0, 130.0, 230.0, 250.0)))
PLATFORM_ANGLES = tuple(map(radians, (-50.0, 50.0, 70.0, 170.0, 190.0, 290.0)))
PAYLOAD_RADIUS, PAYLOAD_THICKNESS = 0.1, 0.01  # [m]


def stewart(
    *, leg_stiffness: float = 20e6, leg_damping: float = 20.0, payload_mass: float = 1.0,
    payload_inertia: ArrayLike | None = None, payload_height: float = 0.085, base_radius: float = 0.115,
    base_height: float = 0.015, base_angles: ArrayLike = BASE_ANGLES, platform_radius: float = 0.090,
    platform_height: float = 0.075, platform_angles: ArrayLike = PLATFORM_ANGLES, part_mass: float = 0.1,
    part_length: float = 0.05, part_radius: float = 0.005, foot: str = "universal", torsion_stiffness: float = 0.0,
    torsion_damping: float = 0.0, ports: str | Sequence[str] = "platform",
) -> Model:  # fmt: skip
    """Build a Stewart platform: 13 moving bodies, 6 degrees of freedom.

    Leg i goes from the joint ``leg<i>.foot`` on the base (universal, the spin about the leg is locked) by way of the
    prismatic ``leg<i>.slide`` to the spherical joint ``leg<i>.head`` on the platform. Its two cylinders
    ``leg<i>.lower`` and ``leg<i>.upper`` begin at those end joints; the spring-damper ``leg<i>.k`` acts along it.

    Parameters
    ----------
    leg_stiffness, leg_damping : float
        Of a leg, along its line [N/m, N s/m].
    payload_mass : float
        Mass of the platform with what it carries [kg].
    payload_inertia : array-like, shape (3,), (6,) or (3, 3), optional
        About its centre of mass [kg m^2], world axes; default: a cylinder of radius 0.1 and height 0.01 m.
    payload_height : float
        Height of its centre of mass [m].
    base_radius, platform_radius : float
        Radius of the circle of the lower and upper joints [m].
    base_height, platform_height : float
        Height of the lower and upper joints [m].
    base_angles, platform_angles : array-like, shape (6,)
        Where on its circle the lower and upper joint of each leg is [rad].
    part_mass, part_length, part_radius : float
        Of each of the two cylinders of a leg [kg, m, m].
    foot : str
        Joint between base and leg: universal, or spherical, which leaves the leg free to spin.
    torsion_stiffness, torsion_damping : float
        About all three axes of both end joints of a leg [N m/rad, N m s/rad], as flexures have it; bushings
        ``leg<i>.foot.k`` and ``leg<i>.head.k``.
    ports : str or sequence of str
        Groups of inputs and outputs, ``"all"`` or ``"none"``. ``"platform"``: forces Fx ... Mz at the platform's
        centre of mass and its displacements x ... rz. ``"legs"``: actuator forces ``leg1.f``, ... that push the two
        parts of a leg apart, ``leg1.elongation`` and the force in the spring ``leg1.force``. ``"base"``: base
        accelerations ax ay az and the platform's absolute accelerations ``platform.ax`` ... ``platform.arz``.

    Returns
    -------
    Model
        The platform; the default values are those of the source.

    Raises
    ------
    ModelError
        If a leg has no length, or a value is refused by the part it is for.

    Source: T. Dehaeze, stewart-simscape (github.com/tdehaeze/stewart-simscape), identification study.
    """
    one_of(foot, ("universal", "spherical"), "stewart", "foot", ModelError)
    groups = port_groups(ports, "stewart")
    low = circle(base_radius, base_height, base_angles, "stewart", "base")
    high = circle(platform_radius, platform_height, platform_angles, "stewart", "platform")
    height = check.number(payload_height, "stewart", "payload_height", "a height [m]")
    model = Model("stewart" if foot == "universal" else "stewart_isolator")
    if payload_inertia is None:
        mass = check.number(payload_mass, "stewart", "payload_mass", "a positive number [kg]")
        payload_inertia = cylinder(mass, PAYLOAD_RADIUS, PAYLOAD_THICKNESS)
    model.add_body("platform", payload_mass, payload_inertia, (0.0, 0.0, height))
    part = tuple(
        check.number(value, "stewart", field, "a positive number")
        for field, value in (("part_mass", part_mass), ("part_length", part_length), ("part_radius", part_radius))
    )
    flexure = None
    if torsion_stiffness or torsion_damping:
        flexure = ((0.0, 0.0, 0.0) + (torsion_stiffness,) * 3, (0.0, 0.0, 0.0) + (torsion_damping,) * 3)
    legs = [
        _add_leg(model, leg, a, b, part, (leg_stiffness, leg_damping), foot, flexure)
        for leg, a, b in zip(LEGS, low, high, strict=True)
    ]
    add_ports(model, groups, legs)
    return model


def stewart_isolator(
    *, leg_stiffness: float = 2e4, leg_damping: float = 60.0, payload_mass: float = 10.0,
    torsion_stiffness: float = 5.0, torsion_damping: float = 2e-3, **others: Any,
) -> Model:  # fmt: skip
    """Build the chapter's Stewart isolator: 14 bodies with the base, 12 degrees of freedom.

    A ``stewart`` with flexures at both ends of its legs: spherical joints with a spring-damper about all three axes,
    so that every leg can spin about its line. The chapter gives no data: the geometry is that of ``stewart``, the
    other values are chosen so that the platform is isolated from some 20 Hz on, within the axes of the chapter's
    figures 13 to 15 (platform modes at 9.6 to 17.2 Hz with damping ratios of 0.08 to 0.15, leg spins near 318 Hz with
    a damping ratio of 0.4).

    Parameters
    ----------
    leg_stiffness, leg_damping : float
        Of a leg, along its line [N/m, N s/m].
    payload_mass : float
        Mass of the platform with what it carries [kg].
    torsion_stiffness, torsion_damping : float
        Of a flexure, about each of its three axes [N m/rad, N m s/rad].
    **others
        As in ``stewart``.

    Returns
    -------
    Model
        The isolator.

    Raises
    ------
    ModelError
        As ``stewart`` does.

    Source: W. Jiang, X. Chen, X. Luo, "Vibration and sensitivity analysis of spatial multibody systems based on
    constraint topology transformation" (2011), section 5.2 b.
    """
    values = {"foot": "spherical", **others}
    return stewart(leg_stiffness=leg_stiffness, leg_damping=leg_damping, payload_mass=payload_mass,
                   torsion_stiffness=torsion_stiffness, torsion_damping=torsion_damping, **values)  # fmt: skip


def _add_leg(
    model: Model, leg: str, start: Vector, end: Vector, part: tuple[float, ...], spring: tuple[float, float],
    foot: str, flexure: tuple[tuple[float, ...], tuple[float, ...]] | None,
) -> tuple[str, str, Vector, Vector]:  # fmt: skip
    x, y, z = end[0] - start[0], end[1] - start[1], end[2] - start[2]
    length = sqrt(x * x + y * y + z * z)
    if length == 0.0:
        raise check.refuse(leg, "end", end, "a point other than its start: change a radius, height or angle")
    line = (x / length, y / length, z / length)
    mass, size, radius = part
    inertia, half, axes = rod(cylinder(mass, radius, size), line), 0.5 * size, check.frame_along(line)
    lower, upper = f"{leg}.lower", f"{leg}.upper"
    low = (start[0] + half * line[0], start[1] + half * line[1], start[2] + half * line[2])
    high = (end[0] - half * line[0], end[1] - half * line[1], end[2] - half * line[2])
    model.add_body(lower, mass, inertia, low)
    model.add_body(upper, mass, inertia, high)
    model.add_joint(f"{leg}.foot", foot, "ground", lower, start, axes)
    model.add_joint(f"{leg}.slide", "prismatic", lower, upper, start, axis=line)
    model.add_joint(f"{leg}.head", "spherical", upper, "platform", end)
    model.add_spring(f"{leg}.k", lower, upper, start, end, *spring)
    if flexure is not None:
        model.add_bushing(f"{leg}.foot.k", "ground", lower, start, *flexure, axes)
        model.add_bushing(f"{leg}.head.k", upper, "platform", end, *flexure, axes)
    return lower, upper, start, line


def cubic_hexapod(
    *, edge: float = 0.2, stiffness: float = 1e6, damping: float = 50.0, mass: float = 10.0,
    inertia: ArrayLike = (0.05, 0.05, 0.08), ports: str | Sequence[str] = "platform",
) -> Model:  # fmt: skip
    """Build a cubic hexapod whose payload floats with its centre of mass at the cube's centre.

    The legs are six edges of a cube that stands on one corner, the three at that corner and at the one above it left
    out, so that they are orthogonal in threes. About the cube's centre, with k the stiffness of a leg and L the edge,

        K = k diag(2, 2, 2, L^2/2, L^2/2, 2 L^2).

    Legs are line springs ``leg1`` ... without mass; nothing else holds the payload. The data are chosen.

    Parameters
    ----------
    edge : float
        Edge of the cube [m].
    stiffness, damping : float
        Of a leg, along its line [N/m, N s/m].
    mass : float
        Mass of the payload [kg].
    inertia : array-like, shape (3,), (6,) or (3, 3)
        Its inertia about the centre of mass [kg m^2], world axes.
    ports : str or sequence of str
        As in ``stewart``; the actuators of the group ``"legs"`` push the payload off the ground along a leg.

    Returns
    -------
    Model
        The hexapod, 6 degrees of freedom; body ``platform``, springs ``leg1.k`` ... ``leg6.k``.

    Raises
    ------
    ModelError
        If the edge is not positive, or a value is refused by the part it is for.

    Source: Z. Geng, L. Haynes, "Six degree-of-freedom active vibration control using the Stewart platforms" (1994).
    """
    who = "cubic_hexapod"
    size = check.number(edge, who, "edge", "a positive length [m]")
    if size <= 0.0:
        raise check.refuse(who, "edge", edge, "a positive length [m]")
    groups = port_groups(ports, who)
    # corners lie on two circles about the diagonal, L sqrt(2/3) in radius and L / sqrt(12) off the centre
    radius, height = size * sqrt(2.0 / 3.0), size / sqrt(12.0)
    model = Model(who)
    model.add_body("platform", mass, inertia)
    model.add_joint("platform.free", "free", "ground", "platform", (0.0, 0.0, 0.0))
    legs = []
    for i, leg in enumerate(LEGS):
        low, high = 2.0 * pi * ((i + 1) // 2) / 3.0, pi * (2.0 * (i // 2) + 1.0) / 3.0
        start = (radius * cos(low), radius * sin(low), -height)
        end = (radius * cos(high), radius * sin(high), height)
        spring = model.add_spring(f"{leg}.k", "ground", "platform", start, end, stiffness, damping)
        legs.append(("ground", "platform", start, spring.line))
    add_ports(model, groups, legs)
    return model


# name, mass [kg], edges [m], centre of mass [m]: chosen, of the size of a machine for 300 mm wafers
BASE = ("base", 3000.0, (2.0, 1.8, 0.4), (0.0, 0.0, 0.0))
METROLOGY = ("metrology", 900.0, (1.4, 1.4, 0.3), (0.0, 0.0, 0.9))
LONG = ("long_stroke", 60.0, (0.6, 0.5, 0.1), (0.0, 0.0, 0.3))
SHORT = ("short_stroke", 20.0, (0.4, 0.4, 0.08), (0.0, 0.0, 0.42))


def wafer_stage(
    *, floor_frequency: float = 18.0, isolator_frequency: float = 1.0, servo_frequency: float = 25.0,
    compensator_frequency: float = 0.5,
) -> Model:  # fmt: skip
    """Build a wafer stage on a base frame, with a metrology frame on soft isolators: 21 degrees of freedom.

    The base frame stands on four stiff feet. On it slides the long stroke, held by its own servo control as by springs;
    it carries the short stroke, which floats on magnets that take its weight with little stiffness. What counts is
    where the short stroke is against the metrology frame, whatever the floor does. All data are chosen.

    Parameters
    ----------
    floor_frequency : float
        Of base frame, long stroke and what they carry on the feet, along z [Hz].
    isolator_frequency : float
        Of the metrology frame on its isolators, along z [Hz].
    servo_frequency : float
        Of the long stroke and what it carries under its control, along x and y [Hz].
    compensator_frequency : float
        Of the short stroke on its magnets, in all six directions [Hz].

    Returns
    -------
    Model
        Bodies ``base``, ``metrology``, ``long_stroke`` and ``short_stroke``; bushings ``foot1`` ..., ``isolator1`` ...,
        ``servo`` and ``magnets``; inputs ``Fx`` ... ``Mz`` of the short stroke's actuators, which react on the long
        stroke, and ``floor.x``, ``floor.y`` and ``floor.z``; outputs ``x`` ... ``rz`` of the short stroke against the
        metrology frame, ``stroke.x``, ``stroke.y`` and ``stroke.z`` against the long stroke, and the acceleration
        ``metrology.az``.

    Raises
    ------
    ModelError
        If a value is refused by the part it is for.
    """
    model = Model("wafer_stage")
    for name, mass, edges, centre in (BASE, METROLOGY, LONG, SHORT):
        model.add_body(name, mass, box(mass, *edges), centre)
    frequencies = (floor_frequency, isolator_frequency, servo_frequency, compensator_frequency)
    floor, soft, stiff, light = ((2.0 * pi * f) ** 2 for f in frequencies)
    total_mass = BASE[1] + LONG[1] + SHORT[1] + METROLOGY[1]
    _add_corners(model, "foot", "ground", BASE, 0.25 * total_mass * floor, 0.05, -0.2)
    _add_corners(model, "isolator", "base", METROLOGY, 0.25 * METROLOGY[1] * soft, 0.3, 0.0)
    model.add_joint("granite", "planar", "base", "long_stroke", (0.0, 0.0, 0.25))
    sled = LONG[1] + SHORT[1]
    spring = [sled * stiff, sled * stiff, 0.0, 0.0, 0.0, 0.05 * sled * stiff]
    damper = [1.4 * sled * sqrt(stiff)] * 2 + [0.0] * 3 + [0.05 * 1.4 * sled * sqrt(stiff)]
    model.add_bushing("servo", "base", "long_stroke", LONG[3], spring, damper)
    size = (*(SHORT[1],) * 3, *box(SHORT[1], *SHORT[2]))
    model.add_bushing("magnets", "long_stroke", "short_stroke", SHORT[3], [m * light for m in size],
                      [0.02 * m * sqrt(light) for m in size])  # fmt: skip
    for force, direction in zip(LOADS, DIRECTIONS, strict=True):
        model.add_input(force, "short_stroke", direction, relative_to="long_stroke")
        model.add_output(direction, "short_stroke", direction, relative_to="metrology")
    for direction in DIRECTIONS[:3]:
        model.add_base_motion(f"floor.{direction}", direction)
        model.add_output(f"stroke.{direction}", "short_stroke", direction, relative_to="long_stroke")
    model.add_output("metrology.az", "metrology", "z", quantity="acceleration")
    return model


def _add_corners(
    model: Model, name: str, below: str, frame: tuple[str, float, Vector, Vector], stiffness: float, ratio: float,
    height: float,
) -> None:  # fmt: skip
    """Put a frame on four equal springs below its corners; sideways they are half as stiff."""
    body, mass, (long, wide, _), (_, _, z) = frame
    damping = ratio * sqrt(stiffness * mass)
    for k, (sx, sy) in enumerate(((1, 1), (-1, 1), (-1, -1), (1, -1)), start=1):
        model.add_bushing(f"{name}{k}", below, body, (0.45 * sx * long, 0.45 * sy * wide, z + height),
                          (0.5 * stiffness, 0.5 * stiffness, stiffness, 0.0, 0.0, 0.0),
                          (0.5 * damping, 0.5 * damping, damping, 0.0, 0.0, 0.0))  # fmt: skip
