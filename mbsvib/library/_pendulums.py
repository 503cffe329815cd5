"""Pendulums: their only stiffness is that of the forces in their joints."""

from __future__ import annotations

from math import cos, pi, sin

from mbsvib.api.model import Model
from mbsvib.common import arguments as check

FREE_FALL = 9.81  # [m/s^2]


def hinged_rod(
    *, width: float = 0.1, length: float = 1.0, density: float = 1000.0, gravity: float = FREE_FALL
) -> Model:
    """Build a square rod that hangs from a hinge at its top end: 1 degree of freedom.

    omega^2 = m g (l/2) / I with I = m (4 l^2 + a^2) / 12: 14.678304239401497 (rad/s)^2 by default. There is no spring:
    all stiffness is that of the force in the hinge.

    Parameters
    ----------
    width, length : float
        Of the rod [m]; it hangs along -z.
    density : float
        Mass per volume [kg/m^3].
    gravity : float
        Acceleration of free fall [m/s^2], along -z.

    Returns
    -------
    Model
        Body ``rod``, joint ``hinge`` at the origin about x; input ``torque``, outputs ``angle`` and the force in the
        hinge along y and z, ``hinge.fy`` and ``hinge.fz``.

    Raises
    ------
    ModelError
        If a size or the density is not positive.
    """
    a, long = (check.positive(value, "hinged_rod", field, "m") for value, field in
               ((width, "width"), (length, "length")))  # fmt: skip
    mass = check.positive(density, "hinged_rod", "density", "kg/m^3") * a * a * long
    across = mass * (a * a + long * long) / 12.0
    model = Model("hinged_rod", gravity=(0.0, 0.0, -gravity))
    model.add_body("rod", mass, (across, across, mass * a * a / 6.0), (0.0, 0.0, -0.5 * long))
    model.add_joint("hinge", "revolute", "ground", "rod", (0.0, 0.0, 0.0), axis=(1.0, 0.0, 0.0))
    model.add_input("torque", "rod", "rx")
    model.add_output("angle", "rod", "rx")
    model.add_force_output("hinge.fy", "hinge", "y")
    model.add_force_output("hinge.fz", "hinge", "z")
    return model


def pendulum_chain(n: int = 3, *, mass: float = 1.0, length: float = 1.0, gravity: float = FREE_FALL) -> Model:
    """Build n point masses, each hung from the one above: n degrees of freedom.

    omega^2 = (g/l) x_j with x_j the roots of the Laguerre polynomial L_n; for n = 3: 0.4157745568, 2.2942803603 and
    6.2899450829.

    Parameters
    ----------
    n : int
        Number of masses.
    mass : float
        Each [kg].
    length : float
        From one to the next [m].
    gravity : float
        Acceleration of free fall [m/s^2], along -z.

    Returns
    -------
    Model
        Bodies ``m1`` ... and revolute joints ``pin1`` ... about x, from the top; input ``force`` on the lowest mass
        along y, outputs ``tip`` (its displacement) and ``support``, the horizontal force in the uppermost pin.

    Raises
    ------
    ModelError
        If n < 1, or a value is refused by the part it is for.
    """
    masses = check.count(n, "pendulum_chain", "n")
    step = check.positive(length, "pendulum_chain", "length", "m")
    model = Model("pendulum_chain", gravity=(0.0, 0.0, -gravity))
    above = "ground"
    for k in range(1, masses + 1):
        model.add_body(f"m{k}", mass, (0.0, 0.0, 0.0), (0.0, 0.0, -k * step))
        model.add_joint(f"pin{k}", "revolute", above, f"m{k}", (0.0, 0.0, (1 - k) * step), axis=(1.0, 0.0, 0.0))
        above = f"m{k}"
    model.add_input("force", above, "y")
    model.add_output("tip", above, "y")
    model.add_force_output("support", "pin1", "y")
    return model


def trifilar_pendulum(
    *, mass: float = 6.0, inertia: float = 0.7, radius: float = 0.4, length: float = 1.5, gravity: float = FREE_FALL
) -> Model:
    """Build a plate on three wires, by which moments of inertia are measured: 3 degrees of freedom.

    About the vertical omega^2 = m g R^2 / (I l), sideways omega^2 = g / l; wires are rods without mass, which close two
    loops.

    Parameters
    ----------
    mass : float
        Of the plate [kg].
    inertia : float
        Its moment of inertia about the vertical [kg m^2]; those about x and y are half of it, and change nothing.
    radius : float
        Of the circle on which the wires are fixed [m].
    length : float
        Of the wires [m].
    gravity : float
        Acceleration of free fall [m/s^2], along -z.

    Returns
    -------
    Model
        Body ``plate`` at the origin and wires ``wire1`` to ``wire3``; inputs ``torque`` about and ``force`` across the
        vertical, outputs ``yaw``, ``sway`` and the tension ``wire1.force``.

    Raises
    ------
    ModelError
        If a length is not positive, or a value is refused by the part it is for.
    """
    r, long = (check.positive(value, "trifilar_pendulum", field, "m") for value, field in
               ((radius, "radius"), (length, "length")))  # fmt: skip
    moment = check.positive(inertia, "trifilar_pendulum", "inertia", "kg m^2")
    model = Model("trifilar_pendulum", gravity=(0.0, 0.0, -gravity))
    model.add_body("plate", mass, (0.5 * moment, 0.5 * moment, moment))
    for k in range(3):
        x, y = r * cos(2.0 * pi * k / 3.0), r * sin(2.0 * pi * k / 3.0)
        model.add_joint(f"wire{k + 1}", "distance", "ground", "plate", (x, y, long), end=(x, y, 0.0))
    model.add_input("torque", "plate", "rz")
    model.add_input("force", "plate", "x")
    model.add_output("yaw", "plate", "rz")
    model.add_output("sway", "plate", "x")
    model.add_force_output("wire1.force", "wire1", "z")
    return model
