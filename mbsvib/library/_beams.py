"""A cantilever with a mass at its tip, a clamped beam with two arms that swing through their singular pose, and
mechanisms on leaf springs: a parallel guide and a cross hinge.
"""

from __future__ import annotations

from math import acos, cos, pi, sin

import numpy as np

from mbsvib.api.model import Model
from mbsvib.common import arguments as check
from mbsvib.elements.beam_expansion import elastic_part
from mbsvib.errors import ModelError


def cantilever(
    *, length: float = 10.0, radius: float = 0.175, wall: float = 0.015, tip_mass: float = 1000.0, elements: int = 20,
    shear: bool = False, damping_ratio: float = 0.0,
) -> Model:  # fmt: skip
    """Build a steel tube that is clamped at one end and carries a mass at the other: 6 degrees of freedom an element.

    By default the lowest frequencies are 1.655433398 Hz, twice, 16.071161667 Hz, twice, and 50.023996028 Hz, twice;
    76.472717539 Hz along the tube and 80.468757907 Hz of torsion (consistent mass, 20 elements).

    Parameters
    ----------
    length : float
        Of the tube [m], along x.
    radius, wall : float
        Outer radius and thickness [m].
    tip_mass : float
        Mass at the tip [kg], a point.
    elements : int
        How many elements.
    shear : bool
        True: Timoshenko's beam, False: Euler's and Bernoulli's.
    damping_ratio : float
        Damping ratio of the tube's elastic modes.

    Returns
    -------
    Model
        Beam ``tube`` and body ``tip``; inputs ``Fy`` and ``Fz`` at the tip, outputs ``y`` and ``z`` there and
        ``root.shear``, the shear force along z in the first element.

    Raises
    ------
    ModelError
        If the length is not positive, or a value is refused by the part it is for.

    Source: Societe francaise des mecaniciens, "Guide de validation des progiciels de calcul de structures", case
    SDLL 15 without eccentricity, for the data.
    """
    end = (check.positive(length, "cantilever", "length", "m"), 0.0, 0.0)
    model = Model("cantilever")
    model.add_body("tip", tip_mass, (0.0, 0.0, 0.0), end)
    model.add_beam("tube", "ground", "tip", {"type": "tube", "radius": radius, "wall": wall},
                   {"E": 2.1e11, "nu": 0.3, "rho": 7800.0}, (0.0, 0.0, 0.0), end, elements=elements, shear=shear,
                   damping_ratio=damping_ratio)  # fmt: skip
    for direction in ("y", "z"):
        model.add_input(f"F{direction}", "tip", direction)
        model.add_output(direction, "tip", direction)
    model.add_force_output("root.shear", "tube.e1", "z")
    return model


LENGTH, WIDTH, THICKNESS = 1.0, 0.020, 0.004  # of the beam [m]
STEEL = {"E": 2.1e11, "nu": 0.3, "rho": 7800.0}
LOAD = 30.0  # that bends the beam until it is dropped [N]
Y, Z = (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)


def singular_beam(
    arm_mass: float = 0.05, gap: float = 1e-3, damping: float = 0.0, *, arm: float = 0.1, elements: int = 8
) -> Model:
    """Build a beam that two arms hang from, bent by a load that may be dropped.

    The beam (1 m of steel, 20 x 4 mm) is clamped at both ends and bends over its thickness in the x-z plane. Two
    slender arms are pinned to its middle, to each other and to a base 2 ``arm`` + ``gap`` below. The pose as described
    is the one at rest under the load ``drop`` of 30 N at the middle, w0 = -6.975446 mm, where the arms stand at the
    angle theta0 = acos(1 + (w0 + gap) / (2 arm)) from the vertical: ``model.simulate(t, without="drop")`` follows the
    drop. Then theta = theta0 + ``base.rz``, and the middle of the beam is at w = w0 + output ``w`` = 2 arm (cos(theta)
    - 1) - gap. Where theta = 0 both arms are in line: the middle passes at a rate of 0 whatever that of theta, and a
    mechanism on rigid ground would be singular there.

    The arms guide the middle along z only, so that the beam bends and does not stretch. By itself the straight beam has
    21.33625854, 58.84641055 and 115.56285039 Hz, and 4300.8 N/m at its middle. It is a linear beam, as in the source
    (``second_order=False``): ``simulate`` bends it only, 16.44 Hz in small motion about the pose as described.
    ``linearize`` sees the arch that the sag makes of it, whose clamped ends are held apart, so that it also stretches:
    35.43 Hz; without axial stiffness it has 16.44 Hz, too.

    Parameters
    ----------
    arm_mass : float
        Mass of each arm [kg].
    gap : float
        How far the base is below the point where the arms just stretch to the straight beam [m]; below 0 they never do.
    damping : float
        beta [s] of the beam's damping C = beta K.
    arm : float
        Length of each arm [m].
    elements : int
        Elements of the beam, an even number.

    Returns
    -------
    Model
        Bodies ``lower``, ``upper`` and ``guide``, joints ``base``, ``elbow``, ``pin``, ``rail`` and ``contact``, beam
        ``beam``, load ``drop``; input ``F`` at the middle of the beam, outputs ``w`` there and ``theta`` of the lower
        arm.

    Raises
    ------
    ModelError
        If a value is refused, or the gap is so large that the arms do not reach the bent beam.
    """
    who = "singular_beam"
    mass, long = check.positive(arm_mass, who, "arm_mass", "kg"), check.positive(arm, who, "arm", "m")
    distance = check.number(gap, who, "gap", "a distance [m]")
    if check.count(elements, who, "elements", 2) % 2:
        raise check.refuse(who, "elements", elements, "an even number, as the arms hang from the middle")
    middle = f"beam.{elements // 2}"
    model = Model(who)
    straight = model.add_beam("beam", "ground", "ground", {"type": "rectangle", "width": WIDTH, "height": THICKNESS},
                              STEEL, (-0.5 * LENGTH, 0.0, 0.0), (0.5 * LENGTH, 0.0, 0.0), elements=elements, y_axis=Y,
                              beta=damping, second_order=False)  # fmt: skip
    displacements = np.zeros((elements + 1, 6))
    elastic = elastic_part(straight)
    force = np.zeros(elastic.rows.shape[1])
    force[6 * (elements // 2 - 1) + 2] = -LOAD
    stiffness = elastic.rows.T @ (elastic.values[:, None] * elastic.rows)
    displacements[1:-1] = np.linalg.solve(stiffness, force).reshape(-1, 6)
    w0 = float(displacements[elements // 2, 2])
    cosine = 1.0 + (w0 + distance) / (2.0 * long)
    if not -1.0 < cosine < 1.0:
        raise check.refuse(who, "gap", gap, f"less than the sag of the beam, {-w0:.6g} m, and more than "
                           f"{-4.0 * long - w0:.6g} m")  # fmt: skip
    bent = straight.through(np.array(straight.points) + displacements[:, :3], np.tile(Y, (elements, 1)), displacements)
    model = Model(who)
    model.add_beam(**bent.constructor_kwargs())
    theta = acos(cosine)
    base = (0.0, 0.0, -2.0 * long - distance)
    elbow = (long * sin(theta), 0.0, base[2] + long * cos(theta))
    top = (0.0, 0.0, w0)
    moment = mass * long**2 / 12.0
    for name, start, end, angle in (("lower", base, elbow, theta), ("upper", elbow, top, -theta)):
        centre = tuple(0.5 * (a + b) for a, b in zip(start, end, strict=True))
        model.add_body(name, mass, (moment, moment, 0.01 * moment), centre, (0.0, angle, 0.0))
    model.add_body("guide", 0.0, (0.0, 0.0, 0.0), top)
    model.add_joint("base", "revolute", "ground", "lower", base, axis=Y)
    model.add_joint("elbow", "revolute", "lower", "upper", elbow, axis=Y)
    model.add_joint("pin", "revolute", "upper", "guide", top, axis=Y)
    model.add_joint("rail", "prismatic", "ground", "guide", axis=Z)
    model.add_joint("contact", "point_on_plane", "guide", middle, top, axis=Z)
    model.add_load("drop", middle, (0.0, 0.0, -LOAD))
    model.add_input("F", middle, "z")
    model.add_output("w", middle, "z")
    model.add_output("theta", "lower", "ry")
    return model


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
    span, side = check.positive(distance, who, "distance", "m"), check.positive(width, who, "width", "m")
    height, half = span / 3.0, 0.5 * check.positive(length, who, "length", "m")
    m = check.positive(mass, who, "mass", "kg")
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
    side, apart, m, r = (check.positive(value, who, field, unit) for value, field, unit in (
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
