"""The benchmark bicycle: two knife-edge wheels, a frame with a rigid rider, and a fork that steers."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from mbsvib.api.model import Model
from mbsvib.common import arguments as check

ACROSS, UP = (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)


def bicycle(
    *, speed: float = 5.0, wheel_base: float = 1.02, trail: float = 0.08, tilt: float = np.pi / 10.0,
    rear_radius: float = 0.3, front_radius: float = 0.35, gravity: ArrayLike = (0.0, 0.0, -9.81),
) -> Model:  # fmt: skip
    """Build the benchmark bicycle, which rolls upright along x: 7 coordinates and 3 independent speeds.

    Body ``frame`` is the rear frame with a rider who does not move; ``fork`` turns against it about the joint
    ``steer``, whose axis leans back by ``tilt``; ``rear_wheel`` and ``front_wheel`` turn on ``rear_axle`` and
    ``front_axle``, and roll as ``rear`` and ``front``. Positive lean is to the right, positive steering to the left.
    Inputs: ``steer.torque`` on the fork against the frame, ``lean.torque`` on the frame about x, ``side.force`` on the
    frame along y. Outputs: ``lean`` and ``lean.rate`` of the frame, ``steer.angle`` and ``steer.rate``.

    ``linearize()`` returns a ``RollingSystem``. With the default values it weaves below 4.292 m/s and capsizes slowly
    above 6.024 m/s; in between it balances itself.

    Parameters
    ----------
    speed : float
        Forward speed [m/s]; 0: it stands.
    wheel_base, trail : float
        Distance of the wheels' contacts [m]; distance of the front one behind the steering axis, on the ground [m].
    tilt : float
        Angle of the steering axis from the vertical [rad].
    rear_radius, front_radius : float
        Of the wheels [m].
    gravity : array-like, shape (3,)
        As for a model.

    Returns
    -------
    Model
        The bicycle.

    Raises
    ------
    ModelError
        If a value is refused.

    Source: J. P. Meijaard, J. M. Papadopoulos, A. Ruina, A. L. Schwab, "Linearized dynamics equations for the balance
    and steer of a bicycle", Proc. R. Soc. A 463 (2007) 1955-1982, table 1; its z points down and its y to the right.
    """
    who = "bicycle"
    w, r, f = (check.positive(value, who, field, "m") for value, field in
               ((wheel_base, "wheel_base"), (rear_radius, "rear_radius"), (front_radius, "front_radius")))  # fmt: skip
    c = check.number(trail, who, "trail", "a length [m]")
    angle = check.number(tilt, who, "tilt", "an angle [rad]")
    axis = (-np.sin(angle), 0.0, np.cos(angle))
    model = Model(who, gravity, travel=(check.number(speed, who, "speed", "a speed [m/s]"), 0.0, 0.0))
    model.add_body("frame", 85.0, (9.2, 11.0, 2.8, 0.0, -2.4, 0.0), (0.3, 0.0, 0.9))
    model.add_body("fork", 4.0, (0.05892, 0.06, 0.00708, 0.0, 0.00756, 0.0), (0.9, 0.0, 0.7))
    model.add_body("rear_wheel", 2.0, (0.0603, 0.12, 0.0603), (0.0, 0.0, r))
    model.add_body("front_wheel", 3.0, (0.1405, 0.28, 0.1405), (w, 0.0, f))
    model.add_joint("steer", "revolute", "frame", "fork", (w + c, 0.0, 0.0), axis=axis)
    model.add_joint("rear_axle", "revolute", "frame", "rear_wheel", (0.0, 0.0, r), axis=ACROSS)
    model.add_joint("front_axle", "revolute", "fork", "front_wheel", (w, 0.0, f), axis=ACROSS)
    model.add_rolling("rear", "rear_wheel", r, ACROSS, UP)
    model.add_rolling("front", "front_wheel", f, ACROSS, UP)
    model.add_input("steer.torque", "fork", (0.0, 0.0, 0.0, *axis), relative_to="frame")
    model.add_input("lean.torque", "frame", "rx")
    model.add_input("side.force", "frame", "y")
    for name, quantity in (("lean", "displacement"), ("lean.rate", "velocity")):
        model.add_output(name, "frame", "rx", quantity=quantity)
    for name, quantity in (("steer.angle", "displacement"), ("steer.rate", "velocity")):
        model.add_output(name, "fork", (0.0, 0.0, 0.0, *axis), relative_to="frame", quantity=quantity)
    return model
