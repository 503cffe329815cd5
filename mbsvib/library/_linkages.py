"""Planar linkages that a spring holds: loops, redundant constraints and forces in pins, and a toggle that is nearly
stretched; planar machines that one crank drives: Hoeken's linkage and the carpet scraper.
"""

from __future__ import annotations

from math import asin, atan2, cos, hypot, radians, sin

from numpy.typing import ArrayLike

from mbsvib.api.model import Model
from mbsvib.common import arguments as check
from mbsvib.common.arguments import Vector
from mbsvib.library._pendulums import FREE_FALL
from mbsvib.library._spatial_linkages import Point, add_planar_bar, meeting, turned

X, Y, Z = (1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)


def four_bar(
    *, pins: ArrayLike = ((0.0, 0.0), (0.2, 0.25), (1.05, 0.65), (1.2, 0.0)), mass_per_length: float = 2.0,
    anchor: ArrayLike = (0.4, 1.1), spring_stiffness: float = 400.0, spring_damping: float = 0.5,
    gravity: float = FREE_FALL,
) -> Model:  # fmt: skip
    """Build a four-bar linkage whose coupler hangs on a spring: 1 degree of freedom.

    All moves in the x-z plane, on pins along y: in space three constraints of the loop are redundant. The tension of
    the spring is the one that holds the linkage as it is drawn. With q the angle of the crank and V(q) the potential
    of weights and spring, omega^2 = V''(q) / M(q).

    Parameters
    ----------
    pins : array-like, shape (4, 2)
        Pins A (ground and crank), B (crank and coupler), C (coupler and rocker) and D (rocker and ground), x and z [m].
    mass_per_length : float
        Of the three slender bars [kg/m].
    anchor : array-like, shape (2,)
        Where the spring is fixed to the ground, x and z [m]; it pulls at the middle of the coupler.
    spring_stiffness, spring_damping : float
        Of the spring [N/m, N s/m].
    gravity : float
        Acceleration of free fall [m/s^2], along -z.

    Returns
    -------
    Model
        Bodies ``crank``, ``coupler`` and ``rocker``, joints ``A`` to ``D``, spring ``spring``; input ``torque`` on the
        crank, outputs ``crank`` (its angle), ``spring.force`` and the shaking forces ``ground.fx`` and ``ground.fz``.

    Raises
    ------
    ModelError
        If a value is refused by the part it is for.
    EquilibriumError
        If the spring pulls where the linkage does not move, so that it cannot hold it.
    """
    per_length = check.positive(mass_per_length, "four_bar", "mass_per_length", "kg/m")
    four = check.listed(pins, "four_bar", "pins", "four points, x and z [m]")
    if len(four) != 4:
        raise check.refuse("four_bar", "pins", pins, "four points, x and z [m]")
    points = [check.numbers(pin, (2,), "four_bar", "pins", "four points, x and z [m]") for pin in four]
    points.append(check.numbers(anchor, (2,), "four_bar", "anchor", "a point, x and z [m]"))
    a, b, c, d, hook = ((x, 0.0, z) for x, z in points)
    model = Model("four_bar", gravity=(0.0, 0.0, -gravity))
    for name, start, end in (("crank", a, b), ("coupler", b, c), ("rocker", c, d)):
        _add_bar(model, name, start, end, per_length)
    chain = ("ground", "crank", "coupler", "rocker", "ground")
    for pin, point, first, second in zip("ABCD", (a, b, c, d), chain, chain[1:], strict=False):
        model.add_joint(pin, "revolute", first, second, point, axis=Y)
    model.add_spring("spring", "ground", "coupler", hook, model.bodies["coupler"].position, spring_stiffness,
                     spring_damping)  # fmt: skip
    _add_ports(model)
    model.add_force_output("spring.force", "spring")
    return model.equilibrium(preload="spring")


def slider_crank(
    *, crank: float = 0.1, rod: float = 0.3, angle: float = radians(60.0), crank_mass: float = 1.0,
    rod_mass: float = 1.5, slider_mass: float = 2.0, spring_stiffness: float = 5e3, spring_damping: float = 5.0,
    gravity: float = FREE_FALL,
) -> Model:  # fmt: skip
    """Build a slider-crank whose slider leans on a spring: 1 degree of freedom.

    The crank turns about y at the origin, the slider moves along x; crank and rod are slender, their centres of mass in
    the middle. The spring runs along x from the slider outwards, and its preload is the one that holds the crank at the
    given angle against the weights.

    Parameters
    ----------
    crank, rod : float
        Lengths [m]; the rod is the longer one.
    angle : float
        Of the crank [rad], from x towards z.
    crank_mass, rod_mass, slider_mass : float
        Masses [kg].
    spring_stiffness, spring_damping : float
        Of the spring [N/m, N s/m].
    gravity : float
        Acceleration of free fall [m/s^2], along -z.

    Returns
    -------
    Model
        Bodies ``crank``, ``rod`` and ``slider``, joints ``A``, ``B``, ``C`` and ``rail``, spring ``spring``; input
        ``torque`` on the crank, outputs ``crank`` (its angle), ``slider`` (its displacement) and the shaking forces
        ``ground.fx`` and ``ground.fz``.

    Raises
    ------
    ModelError
        If a length is not positive, the rod too short, or a value is refused by the part it is for.
    EquilibriumError
        If the slider is at a dead centre, where no spring at it holds the crank.
    """
    r = check.positive(crank, "slider_crank", "crank", "m")
    long = check.positive(rod, "slider_crank", "rod", "m")
    crank_angle = check.number(angle, "slider_crank", "angle", "an angle [rad]")
    if r >= long:
        raise check.refuse("slider_crank", "rod", rod, f"more than the crank, {r:g} m")
    down = asin(r * sin(crank_angle) / long)
    a, b = (0.0, 0.0, 0.0), (r * cos(crank_angle), 0.0, r * sin(crank_angle))
    c = (b[0] + long * cos(down), 0.0, 0.0)
    model = Model("slider_crank", gravity=(0.0, 0.0, -gravity))
    _add_bar(model, "crank", a, b, crank_mass / r)
    _add_bar(model, "rod", b, c, rod_mass / long)
    model.add_body("slider", slider_mass, (1e-3 * slider_mass,) * 3, c)  # it never turns
    model.add_joint("A", "revolute", "ground", "crank", a, axis=Y)
    model.add_joint("B", "revolute", "crank", "rod", b, axis=Y)
    model.add_joint("C", "revolute", "rod", "slider", c, axis=Y)
    model.add_joint("rail", "prismatic", "ground", "slider", axis=X)
    model.add_spring("spring", "slider", "ground", c, (c[0] + long, 0.0, 0.0), spring_stiffness, spring_damping)
    _add_ports(model)
    model.add_output("slider", "slider", "x")
    return model.equilibrium(preload="spring")


def toggle(
    *, angle: float = 0.284, arm: float = 0.1, arm_mass: float = 0.05, slider_mass: float = 1.0,
    spring_stiffness: float = 1e4, spring_damping: float = 1.0, gravity: ArrayLike | None = None,
) -> Model:  # fmt: skip
    """Build a toggle: two equal arms between a pivot and a slider on a spring, 1 degree of freedom.

    ``arm1`` turns on ``base`` at the origin, ``elbow`` joins it to ``arm2``, ``tip`` joins that to ``slider``, which
    moves along x on ``rail``. With theta the angle of either arm to x, the slider is at s = 2 l cos(theta):

    M = m l^2 (2/3 + 2 sin^2 theta) + m_s (2 l sin theta)^2,  K = k (2 l sin theta)^2

    about the pose as described, in which the spring from the slider outwards is relaxed. Near the stretched pose
    theta = 0 the second-order part of s, l cos(theta) dtheta^2, soon exceeds the first, 2 l sin(theta) dtheta.

    Parameters
    ----------
    angle : float
        theta [rad], more than 0 and less than pi / 2.
    arm : float
        Length l [m].
    arm_mass : float
        Mass m of each arm, a slender bar [kg].
    slider_mass : float
        m_s [kg].
    spring_stiffness, spring_damping : float
        Of the spring [N/m, N s/m].
    gravity : array-like, shape (3,), optional
        As for a model.

    Returns
    -------
    Model
        The toggle; input ``force`` on the slider along x, outputs ``s``, its displacement, and ``angle``, that of
        the first arm.

    Raises
    ------
    ModelError
        If a value is not positive, or the angle out of its range.
    """
    who = "toggle"
    length = check.positive(arm, who, "arm", "m")
    mass = check.positive(arm_mass, who, "arm_mass", "kg")
    theta = check.number(angle, who, "angle", "an angle [rad]")
    if not 0.0 < theta < 1.57:
        raise check.refuse(who, "angle", angle, "more than 0 (the stretched pose) and less than pi / 2 rad")
    elbow, end = (length * cos(theta), length * sin(theta)), 2.0 * length * cos(theta)
    model = Model(who, gravity)
    add_planar_bar(model, "arm1", (0.0, 0.0), elbow, mass / length)
    add_planar_bar(model, "arm2", elbow, (end, 0.0), mass / length)
    model.add_body("slider", slider_mass, (1e-3 * slider_mass,) * 3, (end, 0.0, 0.0))  # it never turns
    model.add_joint("base", "revolute", "ground", "arm1", (0.0, 0.0, 0.0), axis=Z)
    model.add_joint("elbow", "revolute", "arm1", "arm2", (*elbow, 0.0), axis=Z)
    model.add_joint("tip", "revolute", "arm2", "slider", (end, 0.0, 0.0), axis=Z)
    model.add_joint("rail", "prismatic", "ground", "slider", axis=X)
    model.add_spring("spring", "slider", "ground", (end, 0.0, 0.0), (end + 2.0 * length, 0.0, 0.0), spring_stiffness,
                     spring_damping)  # fmt: skip
    model.add_input("force", "slider", "x")
    model.add_output("s", "slider", "x")
    model.add_output("angle", "arm1", "rz")
    return model


def _add_bar(model: Model, name: str, start: Vector, end: Vector, per_length: float) -> None:
    """Add a slender bar; its moment of inertia about its own line is a hundredth of the others, and has no effect."""
    length = hypot(end[0] - start[0], end[2] - start[2])
    moment = per_length * length**3 / 12.0
    model.add_body(name, per_length * length, (0.01 * moment, moment, moment),
                   tuple(0.5 * (s + e) for s, e in zip(start, end, strict=True)),
                   (0.0, atan2(start[2] - end[2], end[0] - start[0]), 0.0))  # fmt: skip


def _add_ports(model: Model) -> None:
    model.add_input("torque", "crank", "ry")
    model.add_output("crank", "crank", "ry")
    model.add_force_output("ground.fx", "ground", "x")
    model.add_force_output("ground.fz", "ground", "z")


def hoeken(
    *, crank: float = 0.1, ground: float = 0.2, coupler: float = 0.25, rocker: float = 0.25,
    mass_per_length: float = 2.0, angle: float = 0.0, balance_radius: float | None = None,
    gravity: ArrayLike | None = None,
) -> Model:  # fmt: skip
    """Build Hoeken's four-bar linkage, whose crank turns fully: 3 bodies, 1 degree of freedom.

    All moves in the x-y plane: the crank ``link1`` turns on the joint ``crank`` at the origin, the rocker ``link3`` on
    ``rocker`` at (ground, 0); the coupler ``link2`` joins them by ``pin12`` and ``pin23``, which is on the side of +y.
    All bars are slender. In space three constraints of the loop are redundant.

    With ``balance_radius`` the linkage is balanced after Berkof and Lowen: bodies ``counterweight1`` and
    ``counterweight3``, points of mass, are fixed to crank and rocker opposite to their bars,

    m_c r_c = m_1 a_1 / 2 + m_2 a_1 / 2 on the crank,  m_c r_c = m_3 a_3 / 2 + m_2 a_3 / 2 on the rocker,

    so that the centre of mass stays where it is and no shaking force is left.

    Parameters
    ----------
    crank, ground, coupler, rocker : float
        Lengths a_1, distance of the ground's pivots, a_2 and a_3 [m].
    mass_per_length : float
        Of the bars [kg/m].
    angle : float
        Of the crank [rad], from x towards y.
    balance_radius : float, optional
        Distance r_c of the counterweights from the ground's pivots [m]; default: no counterweights.
    gravity : array-like, shape (3,), optional
        As for a model; nothing holds the crank against it.

    Returns
    -------
    Model
        The linkage; input ``torque`` on the crank, output ``crank.angle``, shaking forces ``ground.fx``, ``ground.fy``.

    Raises
    ------
    ModelError
        If a value is not positive, or the linkage cannot be closed.

    Source: H. Chaudhary, S. K. Saha, "Dynamics and Balancing of Multibody Systems" (2009), chapter 6; R. S. Berkof,
    G. G. Lowen, "A new method for completely force balancing simple linkages", J. Eng. Ind. 91 (1969), 21-26.
    """
    who = "hoeken"
    a1, a0, a2, a3 = (check.positive(value, who, field, "m") for value, field in (
        (crank, "crank"), (ground, "ground"), (coupler, "coupler"), (rocker, "rocker")))  # fmt: skip
    per_length = check.positive(mass_per_length, who, "mass_per_length", "kg/m")
    turn = check.number(angle, who, "angle", "an angle [rad]")
    o, d, a = (0.0, 0.0), (a0, 0.0), turned(a1, turn)
    b = _left_of(a, a2, d, a3)
    model = Model(who, gravity)
    for name, start, end in (("link1", o, a), ("link2", a, b), ("link3", d, b)):
        add_planar_bar(model, name, start, end, per_length)
    for name, first, second, at in (("crank", "ground", "link1", o), ("pin12", "link1", "link2", a),
                                    ("pin23", "link2", "link3", b), ("rocker", "ground", "link3", d)):  # fmt: skip
        model.add_joint(name, "revolute", first, second, (*at, 0.0), axis=Z)
    if balance_radius is not None:
        radius, coupler_mass = check.positive(balance_radius, who, "balance_radius", "m"), per_length * a2
        for i, pivot, end, length in ((1, o, a, a1), (3, d, b, a3)):
            mass = 0.5 * (per_length * length + coupler_mass) * length / radius
            x, y = (p - radius * (e - p) / length for p, e in zip(pivot, end, strict=True))
            model.add_body(f"counterweight{i}", mass, (0.0, 0.0, 0.0), (x, y, 0.0))
            model.add_joint(f"weld{i}", "fixed", f"link{i}", f"counterweight{i}")
    _add_crank_ports(model)
    return model


def carpet_scraper(
    *, crank: float = 0.1, mass_per_length: float = 2.0, angle: float = 0.0, gravity: ArrayLike | None = None
) -> Model:
    """Build the carpet scraper: a Hoeken linkage whose tip a pantograph enlarges, 7 bodies, 1 degree of freedom.

    With the crank's length a: ``link1`` is the crank on ``crank`` at the origin, ``link2`` the coupler of 5 a, the
    rocker ``link3`` (2.5 a) on ``pin03`` at (2 a, 0) holds its middle, C is its tip. ``link4`` (8 a) turns on ``pin04``
    at P = (2 a, 8 a); A is its middle, Q its end. ``link5`` (4.5 a) joins A and C, ``link6`` (9 a) goes from Q to the
    scraper's edge E = P + 2 (C - P), ``link7`` (4 a) joins C to its middle D. Joints are named by their links. All bars
    are slender and move in the x-y plane; in space nine constraints of the three loops are redundant.

    Parameters
    ----------
    crank : float
        Length a [m].
    mass_per_length : float
        Of the bars [kg/m].
    angle : float
        Of the crank [rad], from x towards y.
    gravity : array-like, shape (3,), optional
        As for a model; nothing holds the crank against it.

    Returns
    -------
    Model
        The machine; input ``torque`` on the crank, outputs ``crank.angle``, the edge's ``edge.x`` and ``edge.y``, and
        the shaking forces ``ground.fx``, ``ground.fy``.

    Raises
    ------
    ModelError
        If a value is not positive.

    Source: H. Chaudhary, S. K. Saha, "Dynamics and Balancing of Multibody Systems" (2009), section 4.5 and figure B.2.
    """
    who = "carpet_scraper"
    length = check.positive(crank, who, "crank", "m")
    per_length = check.positive(mass_per_length, who, "mass_per_length", "kg/m")
    turn = check.number(angle, who, "angle", "an angle [rad]")
    o, r, p, pin = (0.0, 0.0), (2.0 * length, 0.0), (2.0 * length, 8.0 * length), turned(length, turn)
    middle = _left_of(pin, 2.5 * length, r, 2.5 * length)
    c = _double(pin, middle)
    a = meeting(p, 4.0 * length, c, 4.5 * length, who, "crank")
    q, e = _double(p, a), _double(p, c)
    d = (c[0] + q[0] - a[0], c[1] + q[1] - a[1])
    model = Model(who, gravity)
    for i, (start, end) in enumerate(((o, pin), (pin, c), (r, middle), (p, q), (a, c), (q, e), (c, d)), 1):
        add_planar_bar(model, f"link{i}", start, end, per_length)
    # among equal paths the joint that comes first stays in the tree: the source cuts 1-2, 2-5 and 2-7
    for first, second, at in ((0, 1, o), (0, 3, r), (0, 4, p), (2, 3, middle), (4, 5, a), (4, 6, q), (6, 7, d),
                              (1, 2, pin), (2, 5, c), (2, 7, c)):  # fmt: skip
        name = "crank" if second == 1 else f"pin{first}{second}"
        model.add_joint(name, "revolute", f"link{first}" if first else "ground", f"link{second}", (*at, 0.0), axis=Z)
    _add_crank_ports(model)
    for direction in "xy":
        model.add_output(f"edge.{direction}", "link6", direction, (*e, 0.0))
    return model


def _left_of(pin: Point, reach: float, pivot: Point, rocker: float) -> Point:
    """Where coupler and rocker meet, on the side of +y while the crank points along +x."""
    return meeting(pin, reach, pivot, rocker, "hoeken", "coupler")


def _double(start: Point, middle: Point) -> Point:
    return (2.0 * middle[0] - start[0], 2.0 * middle[1] - start[1])


def _add_crank_ports(model: Model) -> None:
    model.add_input("torque", "link1", "rz")
    model.add_output("crank.angle", "link1", "rz")
    model.add_force_output("ground.fx", "ground", "x")
    model.add_force_output("ground.fy", "ground", "y")
