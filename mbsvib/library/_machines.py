"""Planar machines that one crank drives: Hoeken's linkage and the carpet scraper."""

from __future__ import annotations

from typing import TYPE_CHECKING

from mbsvib.api.model import Model
from mbsvib.common import arguments as check
from mbsvib.library._families import positive
from mbsvib.library._spatial_linkages import Point, add_planar_bar, meeting, turned

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

Z = (0.0, 0.0, 1.0)


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
    a1, a0, a2, a3 = (positive(value, who, field, "m") for value, field in (
        (crank, "crank"), (ground, "ground"), (coupler, "coupler"), (rocker, "rocker")))  # fmt: skip
    per_length = positive(mass_per_length, who, "mass_per_length", "kg/m")
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
        radius, coupler_mass = positive(balance_radius, who, "balance_radius", "m"), per_length * a2
        for i, pivot, end, length in ((1, o, a, a1), (3, d, b, a3)):
            mass = 0.5 * (per_length * length + coupler_mass) * length / radius
            x, y = (p - radius * (e - p) / length for p, e in zip(pivot, end, strict=True))
            model.add_body(f"counterweight{i}", mass, (0.0, 0.0, 0.0), (x, y, 0.0))
            model.add_joint(f"weld{i}", "fixed", f"link{i}", f"counterweight{i}")
    _add_ports(model)
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
    length = positive(crank, who, "crank", "m")
    per_length = positive(mass_per_length, who, "mass_per_length", "kg/m")
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
    _add_ports(model)
    for direction in "xy":
        model.add_output(f"edge.{direction}", "link6", direction, (*e, 0.0))
    return model


def _left_of(pin: Point, reach: float, pivot: Point, rocker: float) -> Point:
    """Where coupler and rocker meet, on the side of +y while the crank points along +x."""
    return meeting(pin, reach, pivot, rocker, "hoeken", "coupler")


def _double(start: Point, middle: Point) -> Point:
    return (2.0 * middle[0] - start[0], 2.0 * middle[1] - start[1])


def _add_ports(model: Model) -> None:
    model.add_input("torque", "link1", "rz")
    model.add_output("crank.angle", "link1", "rz")
    model.add_force_output("ground.fx", "ground", "x")
    model.add_force_output("ground.fy", "ground", "y")
