"""Angular momentum of bodies about their centres of mass, that of their rotors among it."""

from __future__ import annotations

from typing import TYPE_CHECKING

import casadi as ca
import numpy as np

if TYPE_CHECKING:
    from collections.abc import Mapping

    from mbsvib.elements import Body
    from mbsvib.elements.rotor import Rotor
    from mbsvib.finite_motion.kinematics import Kinematics
    from mbsvib.finite_motion.rotations import Expression


def of_body(body: Body, motion: Kinematics) -> Expression:
    """Return I w (3,) of a body [N m s], in axes that turn with it, which as described are those of the world."""
    axes, entries = ca.SX(np.array(body.orientation)), motion.numbers.vector(body, "inertia")
    xx, yy, zz, xy, xz, yz = (entries[i] for i in range(6))
    tensor = ca.vertcat(ca.horzcat(xx, xy, xz), ca.horzcat(xy, yy, yz), ca.horzcat(xz, yz, zz))
    return axes @ (tensor @ (axes.T @ motion.angular_velocity(body.name)))


def of_rotor(rotor: Rotor, motion: Kinematics) -> Expression:
    """Return the constant angular momentum (3,) of a rotor [N m s], in axes that turn with its body."""
    return motion.numbers.scalar(rotor, "inertia") * motion.numbers.scalar(rotor, "speed") * ca.SX(np.array(rotor.axis))


def angular_momentum(body: Body, rotors: Mapping[str, Rotor], motion: Kinematics) -> Expression:
    """Return the angular momentum (3,) of a body and its rotors about its centre of mass [N m s], world axes."""
    rotor_momentum = sum((of_rotor(rotor, motion) for rotor in rotors.values() if rotor.body == body.name),
              of_body(body, motion))  # fmt: skip
    return motion.frames[body.name].vector(rotor_momentum)
