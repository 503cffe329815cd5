"""Robots: arms and a gripper from Denavit-Hartenberg rows, without springs, and a quadruped on elastic feet."""

from __future__ import annotations

from math import pi, sqrt
from typing import Any

from numpy.typing import ArrayLike

from mbsvib.api.model import Model
from mbsvib.common import arguments as check
from mbsvib.common.arguments import DIRECTIONS, Vector
from mbsvib.library._dh import from_dh
from mbsvib.library._stewart import LOADS, box, cylinder

# Thickness of slender links as a share of their length, for the moment of inertia about their own line.
SLENDER = 0.1
# Lengths and twists of a PUMA 560, masses and inertia about the links' centres of mass as commonly measured
PUMA = (
    {"alpha": pi / 2, "theta": 0.3, "mass": 13.0, "cm": (0, 0.01, -0.05), "inertia": (0.30, 0.35, 0.25)},
    {"a": 0.4318, "theta": -0.7, "mass": 17.4, "cm": (-0.3638, 0.006, 0.2275), "inertia": (0.13, 0.524, 0.539)},
    {"a": 0.0203, "b": 0.15005, "alpha": -pi / 2, "theta": 1.1, "mass": 4.8, "cm": (-0.0203, -0.0141, 0.070),
     "inertia": (0.066, 0.086, 0.0525)},
    {"b": 0.4318, "alpha": pi / 2, "theta": 0.4, "mass": 0.82, "cm": (0, 0.019, 0),
     "inertia": (1.8e-3, 1.3e-3, 1.8e-3)},
    {"alpha": -pi / 2, "theta": -0.9, "mass": 0.34, "inertia": (3e-4, 4e-4, 3e-4)},
    {"theta": 2.0, "mass": 0.09, "cm": (0, 0, 0.032), "inertia": (1.5e-4, 1.5e-4, 4e-5)},
)  # fmt: skip
# Masses, centres and moments about the frames' axes after Bejczy and Paul; the slide is half out
STANFORD = (
    {"b": 0.412, "alpha": -pi / 2, "mass": 9.29, "cm": (0, 0.0175, -0.1105), "inertia": (0.276, 0.255, 0.071)},
    {"b": 0.154, "alpha": pi / 2, "theta": 0.5, "mass": 5.01, "cm": (0, -0.1054, 0), "inertia": (0.108, 0.018, 0.1)},
    {"joint": "prismatic", "b": 0.6, "theta": -pi / 2, "mass": 4.25, "cm": (0, 0, -0.6447),
     "inertia": (2.51, 2.51, 0.006)},
    {"alpha": -pi / 2, "theta": 0.3, "mass": 1.08, "cm": (0, 0.0092, -0.0054), "inertia": (0.002, 0.001, 0.001)},
    {"alpha": pi / 2, "theta": 0.6, "mass": 0.63, "cm": (0, 0.0, 0.0566), "inertia": (0.003, 0.003, 0.0004)},
    {"mass": 0.51, "cm": (0, 0, 0.1554), "inertia": (0.013, 0.013, 0.0003)},
)  # fmt: skip


def two_link(
    *, lengths: ArrayLike = (1.0, 1.0), masses: ArrayLike = (1.0, 1.0), angles: ArrayLike = (0.4, 0.8),
    gravity: ArrayLike | None = None,
) -> Model:  # fmt: skip
    """Build an arm of two slender links in the x-y plane: 2 degrees of freedom, without springs.

    M_11 = (m_1 + 3 m_2) l_1^2 / 3 + m_2 l_2^2 / 3 + m_2 l_1 l_2 cos q,  M_12 = m_2 (l_2^2 / 3 + l_1 l_2 cos(q) / 2),
    M_22 = m_2 l_2^2 / 3

    with q the second angle.

    Parameters
    ----------
    lengths, masses, angles : array-like, shape (2,)
        Of the links [m, kg], and from x to the first, from the first to the second [rad].
    gravity : array-like, shape (3,), optional
        As for a model; nothing holds the arm against it.

    Returns
    -------
    Model
        Bodies, joints and ports as those of ``from_dh``.

    Raises
    ------
    ModelError
        If a value is refused by the part it is for.

    Source: H. Chaudhary, S. K. Saha, "Dynamics and Balancing of Multibody Systems" (2009), section 3.5.
    """
    who = "two_link"
    long, heavy, turns = (check.numbers(value, (2,), who, field, "two numbers") for value, field in (
        (lengths, "lengths"), (masses, "masses"), (angles, "angles")))  # fmt: skip
    rows = [_slender(*link, who) for link in zip(long, heavy, turns, strict=True)]
    return from_dh(rows, name=who, gravity=gravity)


def gripper(
    *, lengths: ArrayLike = (0.3, 0.1, 0.1, 0.1), masses: ArrayLike = (1.0, 0.3, 0.3, 0.3),
    angles: ArrayLike = (0.4, 0.9, -0.9, 1.2), width: float = 0.08, gravity: ArrayLike | None = None,
) -> Model:  # fmt: skip
    """Build a gripper of four slender links in the x-y plane: a tree, 4 degrees of freedom, without springs.

    ``palm`` turns on the ground. ``finger`` is on its end, half a width to the left of it; ``knuckle`` half a width to
    the right, with ``tip`` on the end of that.

    Parameters
    ----------
    lengths, masses, angles : array-like, shape (4,)
        Of palm, finger, knuckle and tip: lengths [m], masses [kg], and the angle from the link before [rad].
    width : float
        Distance between the joints of finger and knuckle [m].
    gravity : array-like, shape (3,), optional
        As for a model; nothing holds the gripper against it.

    Returns
    -------
    Model
        Joints and ports as those of ``from_dh``.

    Raises
    ------
    ModelError
        If a value is refused by the part it is for.

    Source: H. Chaudhary, S. K. Saha, "Dynamics and Balancing of Multibody Systems" (2009), section 3.5: the topology;
    the values are chosen.
    """
    who = "gripper"
    expected = "four numbers: palm, finger, knuckle, tip"
    long, heavy, turns = (check.numbers(value, (4,), who, field, expected) for value, field in (
        (lengths, "lengths"), (masses, "masses"), (angles, "angles")))  # fmt: skip
    half = 0.5 * check.number(width, who, "width", "a width [m]")
    rows = [_slender(*link, who) for link in zip(long, heavy, turns, strict=True)]
    rows[0] |= {"name": "palm"}
    rows[1] |= {"name": "finger", "parent": "palm", "offset": (0.0, half, 0.0)}
    rows[2] |= {"name": "knuckle", "parent": "palm", "offset": (0.0, -half, 0.0)}
    rows[3] |= {"name": "tip", "parent": "knuckle"}
    return from_dh(rows, name=who, gravity=gravity)


def six_link(
    *, joints: str = "RRRRRR", length: float = 0.3, mass: float = 2.0, gravity: ArrayLike | None = None
) -> Model:
    """Build an arm of six equal slender links whose joint axes are at right angles: 6 degrees of freedom, no springs.

    Every row of Denavit and Hartenberg has a = ``length``, b = a / 3 and alpha = 90 and -90 degrees in turn, so that
    every link moves in space.

    Parameters
    ----------
    joints : str
        Six letters, R (revolute) or P (prismatic), from the base on.
    length, mass : float
        Of a link [m, kg].
    gravity : array-like, shape (3,), optional
        As for a model; nothing holds the arm against it.

    Returns
    -------
    Model
        Bodies, joints and ports as those of ``from_dh``.

    Raises
    ------
    ModelError
        If a value is refused.

    Source: H. Chaudhary, S. K. Saha, "Dynamics and Balancing of Multibody Systems" (2009), section 3.5: the topology;
    the values are chosen.
    """
    who = "six_link"
    if not isinstance(joints, str) or len(joints) != 6 or set(joints) - set("RP"):
        raise check.refuse(who, "joints", joints, "six letters R or P, such as 'RRPRRR'")
    a = check.positive(length, who, "length", "m")
    rows = [_slender(a, mass, 0.3, who) | {"b": a / 3.0, "alpha": 0.5 * pi * (-1) ** i, "joint": letter}
            for i, letter in enumerate(joints)]  # fmt: skip
    return from_dh(rows, name=who, gravity=gravity)


def puma(*, gravity: ArrayLike | None = None) -> Model:
    """Build a PUMA 560 arm: 6 revolute joints, 6 degrees of freedom, without springs.

    Parameters
    ----------
    gravity : array-like, shape (3,), optional
        As for a model; nothing holds the arm against it.

    Returns
    -------
    Model
        Bodies, joints and ports as those of ``from_dh``.

    Source: H. Chaudhary, S. K. Saha, "Dynamics and Balancing of Multibody Systems" (2009), section 3.5; B. Armstrong,
    O. Khatib, J. Burdick, "The explicit dynamic model and inertial parameters of the PUMA 560 arm" (1986), rounded.
    """
    return from_dh(PUMA, name="puma", gravity=gravity)


def stanford(*, gravity: ArrayLike | None = None) -> Model:
    """Build a Stanford arm: a slide after two revolute joints, then a wrist; 6 degrees of freedom, without springs.

    Parameters
    ----------
    gravity : array-like, shape (3,), optional
        As for a model; nothing holds the arm against it.

    Returns
    -------
    Model
        Bodies, joints and ports as those of ``from_dh``.

    Source: H. Chaudhary, S. K. Saha, "Dynamics and Balancing of Multibody Systems" (2009), section 3.5; R. P. Paul,
    "Robot manipulators: mathematics, programming, and control" (1981), chapter 6; his moments are taken about the
    origins of the frames that the links carry.
    """
    return from_dh([row | {"about": "origin"} for row in STANFORD], name="stanford", gravity=gravity)


def _slender(length: Any, mass: Any, angle: Any, who: str) -> dict[str, Any]:
    """The row of a slender link along the x axis of the frame that it carries."""
    long, heavy = check.positive(length, who, "length", "m"), check.positive(mass, who, "mass", "kg")
    across = heavy * long**2 / 12.0
    return {"a": long, "theta": angle, "mass": heavy, "cm": (-0.5 * long, 0.0, 0.0),
            "inertia": (SLENDER**2 * across, across, across)}  # fmt: skip


# A leg in its own plane: sideways and upward from the ground under the trunk's edge [m], hip to foot.
HIP, FIRST_GEAR, SECOND_GEAR, FOOT = (0.12, 0.30), (0.20, 0.30), (0.32, 0.24), (0.30, 0.0)
LENGTHWISE = 0.25
PARTS = (("hip", HIP, FIRST_GEAR, 0.6), ("thigh", FIRST_GEAR, SECOND_GEAR, 0.8), ("shank", SECOND_GEAR, FOOT, 0.5))
RADIUS = 0.02
# A worm with its motor's rotor: mass [kg], radius and length [m] of a cylinder across the leg's plane's normal.
WORM = (0.08, 0.012, 0.04)


def quadruped(
    *, trunk_mass: float = 12.0, yaw_stiffness: float = 4e6, yaw_damping: float = 60.0, gear_stiffness: float = 2e6,
    gear_damping: float = 60.0, foot_stiffness: ArrayLike = (4e7, 4e7, 8e7),
    foot_damping: ArrayLike = (1200.0, 1200.0, 2400.0), worm_ratio: float | None = None,
) -> Model:  # fmt: skip
    """Build the chapter's quadruped robot: 13 bodies, 18 degrees of freedom.

    The trunk floats. At each corner (``fl``, ``fr``, ``rl``, ``rr``: front and rear, left and right) a leg of three
    bodies ``fl.hip``, ``fl.thigh``, ``fl.shank`` hangs on it: ``fl.yaw`` is a revolute joint about z, ``fl.gear1``
    and ``fl.gear2`` are worm gears, revolute joints about x; each has a torsion spring-damper, ``fl.yaw.k`` and so
    on. The foot ``fl.foot`` is a spring-damper in three directions between shank and ground. Forces Fx ... Mz act at
    the trunk's centre of mass, displacements x ... rz are measured there.

    With ``worm_ratio`` the worms are bodies of their own (21 bodies, still 18 degrees of freedom): ``fl.worm1`` and
    ``fl.worm2`` turn about y on ``fl.worm1.shaft`` ... in the part before, and drive the gear by ``fl.worm1.mesh`` ...

    The chapter gives the topology only; masses, geometry, stiffness and damping are chosen, the latter two so that
    natural frequencies and damping ratios are in the range of the chapter's figure 10: 247 to 5452 Hz, 0.02 to 0.5.

    Parameters
    ----------
    trunk_mass : float
        Mass of the trunk, a box of 0.6 x 0.24 x 0.1 m [kg].
    yaw_stiffness, yaw_damping : float
        About z, between trunk and leg [N m/rad, N m s/rad].
    gear_stiffness, gear_damping : float
        Of a worm gear, about x [N m/rad, N m s/rad].
    foot_stiffness, foot_damping : array-like, shape (3,)
        Of a foot along x, y, z [N/m, N s/m].
    worm_ratio : float, optional
        Turns of a leg's part per turn of its worm [rad/rad], such as 1/40; default: worms without inertia.

    Returns
    -------
    Model
        The robot.

    Raises
    ------
    ModelError
        If a value is refused by the part it is for.

    Source: W. Jiang, X. Chen, X. Luo, "Vibration and sensitivity analysis of spatial multibody systems based on
    constraint topology transformation" (2011), section 5.2 a.
    """
    who = "quadruped"
    trunk = check.number(trunk_mass, who, "trunk_mass", "a positive number [kg]")
    zeros = (0.0, 0.0, 0.0)
    foot = tuple(
        check.vector(value, who, field, "three finite numbers (x, y, z)") + zeros
        for field, value in (("foot_stiffness", foot_stiffness), ("foot_damping", foot_damping))
    )
    yaw = ((*zeros, 0.0, 0.0, yaw_stiffness), (*zeros, 0.0, 0.0, yaw_damping))
    gear = ((*zeros, gear_stiffness, 0.0, 0.0), (*zeros, gear_damping, 0.0, 0.0))
    model = Model(who)
    centre = (0.0, 0.0, HIP[1])
    model.add_body("trunk", trunk, box(trunk, 0.6, 0.24, 0.1), centre)
    model.add_joint("trunk.free", "free", "ground", "trunk", centre)
    for corner, x, side in (("fl", 1.0, 1.0), ("fr", 1.0, -1.0), ("rl", -1.0, 1.0), ("rr", -1.0, -1.0)):
        points = [(LENGTHWISE * x, side * sideways, up) for sideways, up in (HIP, FIRST_GEAR, SECOND_GEAR, FOOT)]
        before = "trunk"
        for (part, _, _, mass), start, end in zip(PARTS, points[:-1], points[1:], strict=True):
            _add_rod(model, f"{corner}.{part}", mass, start, end)
        for joint, part, axis, spring, point in (
            ("yaw", "hip", (0.0, 0.0, 1.0), yaw, points[0]),
            ("gear1", "thigh", (1.0, 0.0, 0.0), gear, points[1]),
            ("gear2", "shank", (1.0, 0.0, 0.0), gear, points[2]),
        ):
            body, name = f"{corner}.{part}", f"{corner}.{joint}"
            model.add_joint(name, "revolute", before, body, point, axis=axis)
            model.add_bushing(f"{name}.k", before, body, point, *spring)
            if worm_ratio is not None and joint != "yaw":
                _add_worm(model, f"{corner}.worm{joint[-1]}", before, name, point, worm_ratio)
            before = body
        model.add_bushing(f"{corner}.foot", "ground", before, points[3], *foot)
    for load, direction in zip(LOADS, DIRECTIONS, strict=True):
        model.add_input(load, "trunk", direction)
        model.add_output(direction, "trunk", direction)
    return model


def _add_rod(model: Model, name: str, mass: float, start: Vector, end: Vector) -> None:
    line = (end[0] - start[0], end[1] - start[1], end[2] - start[2])
    length = sqrt(line[0] ** 2 + line[1] ** 2 + line[2] ** 2)
    middle = (0.5 * (start[0] + end[0]), 0.5 * (start[1] + end[1]), 0.5 * (start[2] + end[2]))
    axes = check.frame_along((line[0] / length, line[1] / length, line[2] / length))
    model.add_body(name, mass, cylinder(mass, RADIUS, length), middle, axes)


def _add_worm(model: Model, name: str, carrier: str, gear: str, point: Vector, ratio: float) -> None:
    mass, radius, length = WORM
    across = (0.0, 1.0, 0.0)
    model.add_body(name, mass, cylinder(mass, radius, length), point, check.frame_along(across))
    model.add_joint(f"{name}.shaft", "revolute", carrier, name, point, axis=across)
    model.add_worm(f"{name}.mesh", f"{name}.shaft", gear, ratio)
