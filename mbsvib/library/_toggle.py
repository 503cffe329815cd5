"""The toggle: two bars near their stretched pose, which turn a small angle into a much smaller displacement."""

from __future__ import annotations

from math import cos, sin
from typing import TYPE_CHECKING

from mbsvib.api.model import Model
from mbsvib.common import arguments as check
from mbsvib.library._families import positive
from mbsvib.library._spatial_linkages import add_planar_bar

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

X, Z = (1.0, 0.0, 0.0), (0.0, 0.0, 1.0)


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
    length = positive(arm, who, "arm", "m")
    mass = positive(arm_mass, who, "arm_mass", "kg")
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
