"""Mechanisms on leaf springs: a parallel guide and a cross hinge."""

from __future__ import annotations

from math import pi

from mbsvib.api.model import Model
from mbsvib.common import arguments as check
from mbsvib.errors import ModelError
from mbsvib.library._families import positive

STEEL = {"E": 2.1e11, "nu": 0.3, "rho": 7800.0}


def parallel_guide(
    *, length: float = 0.05, width: float = 0.02, thickness: float = 5e-4, distance: float = 0.06, mass: float = 0.5,
    beta: float = 0.0,
) -> Model:  # fmt: skip
    """Build a stage on two parallel leaf springs of steel, which it moves across: 6 degrees of freedom.

    Its lowest mode is the motion along x, omega^2 = 24 E I / (L^3 (m + 26/35 m_leaf)) but for the tilt that the stretch
    of the leaves lets happen. The next ones are far above.

    Parameters
    ----------
    length, width, thickness : float
        Of the leaves [m], along z, y and x.
    distance : float
        Between the leaves [m], along x.
    mass : float
        Of the stage [kg], a cuboid of this ``distance``, the ``width`` and a third of the ``distance``, which the
        leaves hold at its mid-height, where forces bend them without tilting it.
    beta : float
        Damping of the leaves proportional to their stiffness [s].

    Returns
    -------
    Model
        Body ``stage``, flexures ``left`` and ``right``; input ``F`` along x at half the length of the leaves, outputs
        ``x``, ``z`` and ``tilt`` (about y).

    Raises
    ------
    ModelError
        If a value is not positive, or the thickness is above the width.

    Source: Smith, Flexures: Elements of Elastic Mechanisms (2000), chapter 4.
    """
    who = "parallel_guide"
    span, side = positive(distance, who, "distance", "m"), positive(width, who, "width", "m")
    height, half = span / 3.0, 0.5 * positive(length, who, "length", "m")
    m = positive(mass, who, "mass", "kg")
    model = Model(who)
    model.add_body("stage", m, [m / 12.0 * (a * a + b * b) for a, b in ((side, height), (span, height), (span, side))],
                   (0.0, 0.0, half))  # fmt: skip
    shape = {"type": "leaf", "length": length, "width": width, "thickness": thickness}
    for name, x in (("left", -0.5 * span), ("right", 0.5 * span)):
        model.add_flexure(name, "ground", "stage", shape, STEEL, (x, 0.0, 0.0), beta=beta)
    model.add_input("F", "stage", "x", (0.0, 0.0, 0.0))
    for name, direction in (("x", "x"), ("z", "z"), ("tilt", "ry")):
        model.add_output(name, "stage", direction)
    return model


def cross_hinge(
    *, length: float = 0.04, width: float = 0.01, thickness: float = 3e-4, angle: float = 0.25 * pi, gap: float = 0.002,
    mass: float = 0.2, radius: float = 0.03, beta: float = 0.0,
) -> Model:  # fmt: skip
    """Build a disk on two crossed leaf springs of steel, which turns about the line where they cross: 6 degrees of
    freedom.

    The leaves lie side by side and cross at their middles, so that k = 2 E I / L about y, whatever their angle.

    Parameters
    ----------
    length, width, thickness : float
        Of the leaves [m].
    angle : float
        Between either leaf and z [rad], below pi/2.
    gap : float
        Between the leaves [m], along y.
    mass : float
        Of the disk [kg], with its centre in the hinge.
    radius : float
        Of the disk [m], which is thin.
    beta : float
        Damping of the leaves proportional to their stiffness [s].

    Returns
    -------
    Model
        Body ``disk``, flexures ``one`` and ``other``; input ``torque`` about y, outputs ``angle``, ``x`` and ``z``.

    Raises
    ------
    ModelError
        If a value is not positive, the thickness is above the width, or the angle is not between 0 and pi/2.

    Source: Wittrick, The theory of symmetrical crossed flexure pivots, Aust. J. Sci. Res. A 1 (1948), 121-134.
    """
    who = "cross_hinge"
    side, apart, m, r = (positive(value, who, field, unit) for value, field, unit in (
        (width, "width", "m"), (gap, "gap", "m"), (mass, "mass", "kg"), (radius, "radius", "m")))  # fmt: skip
    lean = check.number(angle, who, "angle", "an angle [rad]")
    if not 0.0 < lean < 0.5 * pi:
        raise ModelError(f"{who}: angle = {lean:g}; expected an angle between 0 and pi/2, as leaves that are parallel "
                         f"are a guide.", element=who, field="angle")  # fmt: skip
    model = Model(who)
    model.add_body("disk", m, (0.25 * m * r * r, 0.5 * m * r * r, 0.25 * m * r * r))
    shape = {"type": "leaf", "length": length, "width": width, "thickness": thickness}
    for name, sign in (("one", 1.0), ("other", -1.0)):
        model.add_flexure(name, "ground", "disk", shape, STEEL, (0.0, sign * 0.5 * (side + apart), 0.0),
                          (0.0, sign * lean, 0.0), beta=beta)  # fmt: skip
    model.add_input("torque", "disk", "ry")
    for name, direction in (("angle", "ry"), ("x", "x"), ("z", "z")):
        model.add_output(name, "disk", direction)
    return model
