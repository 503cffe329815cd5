"""Robot arms and a gripper from Denavit-Hartenberg rows, open chains and a tree without springs."""

from __future__ import annotations

from math import pi
from typing import TYPE_CHECKING, Any

from mbsvib.common import arguments as check
from mbsvib.library._dh import from_dh
from mbsvib.library._families import positive

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

    from mbsvib.api.model import Model

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
    a = positive(length, who, "length", "m")
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
    long, heavy = positive(length, who, "length", "m"), positive(mass, who, "mass", "kg")
    across = heavy * long**2 / 12.0
    return {"a": long, "theta": angle, "mass": heavy, "cm": (-0.5 * long, 0.0, 0.0),
            "inertia": (SLENDER**2 * across, across, across)}  # fmt: skip
