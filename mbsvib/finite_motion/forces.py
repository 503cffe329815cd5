"""Loads and inputs in finite motion: the power of a force is linear in the rates, and so gives generalized forces.

Angular momentum of bodies about their centres of mass, that of their rotors among it.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import TYPE_CHECKING

import casadi as ca
import numpy as np

from mbsvib.finite_motion.frames import REST, Expression

if TYPE_CHECKING:
    from mbsvib.elements import Body, Load
    from mbsvib.elements.motion_input import MotionForce
    from mbsvib.elements.ports import BaseMotion, Input, Output
    from mbsvib.elements.rotor import Rotor
    from mbsvib.finite_motion.connections import Connected
    from mbsvib.finite_motion.kinematics import Kinematics
    from mbsvib.mechanism.mechanism import Mechanism


def velocity(motion: Kinematics, body: str, point: Expression) -> tuple[Expression, Expression]:
    """Return the velocity (3,) of the point of a body that was at ``point`` as described, and its angular velocity,
    both in world axes [m/s, rad/s].
    """
    frame = motion.frames[body]
    if frame is REST:
        return ca.SX.zeros(3), ca.SX.zeros(3)
    return motion.rate(frame.point(point)), frame.rotation @ motion.angular_velocity(body)


def generalized(motion: Kinematics, power: Expression) -> Expression:
    """Return generalized forces (n,) of a power that is linear in the rates."""
    return ca.gradient(power, motion.qd)


def load_power(part: Load, model: Mechanism, motion: Kinematics) -> Expression:
    """Return the power [W] of a load: force times velocity and torque times angular velocity."""
    numbers = motion.numbers
    point = numbers.vector(model.bodies[part.body], "position") if part.position is None else \
        numbers.vector(part, "position")  # fmt: skip
    v, w = velocity(motion, part.body, point)
    force, torque = numbers.vector(part, "force"), numbers.vector(part, "torque")
    if part.follower:
        force, torque = (motion.frames[part.body].vector(value) for value in (force, torque))
    return ca.dot(force, v) + ca.dot(torque, w)


def input_power(part: Input, model: Mechanism, motion: Kinematics) -> Expression:
    """Return the power [W] of a force input of 1 N or 1 N m; its reaction acts at the same point."""
    point = model.bodies[part.body].position if part.position is None else part.position
    _, speed, spin = relative_motion(part, ca.SX(np.array(point)), motion)
    return ca.dot(part.wrench[:3], speed) + ca.dot(part.wrench[3:], spin)


def relative_motion(part: Input | Output, point: Expression, motion: Kinematics) -> tuple[Expression, ...]:
    """Return how far a point of a port's ``body`` has gone from that of ``relative_to`` [m], the velocity of this [m/s]
    and the angular velocity [rad/s], in the axes of ``relative_to``, as described those of the world.

    d = R^T (p - p0),  d' = R^T (v - v0 - w0 x (p - p0)),  R^T (w - w0)
    """
    frame = motion.frames[part.relative_to]
    (v, w), (v0, w0) = velocity(motion, part.body, point), velocity(motion, part.relative_to, point)
    away, back = motion.frames[part.body].point(point) - frame.point(point), frame.rotation.T
    return back @ away, back @ (v - v0 - ca.cross(w0, away)), back @ (w - w0)


def moved_end_force(part: MotionForce, element: Connected) -> Expression:
    """Return the force (d,) along the deformation of an element whose end on ground moves by 1 m or with 1 m/s.

    The element is shorter by the displacement of this end along its line, or along its axis as it is then.
    """
    along = ca.SX(np.array(part.wrench if element.deformation.shape[0] == 6 else part.wrench[2:3]))
    return element.coefficients[part.order] @ along


def base_power(part: BaseMotion, bodies: Iterable[Body], bent: Expression, motion: Kinematics) -> Expression:
    """Return the power [W] of the inertia forces on parts whose ground accelerates by 1 m/s^2 along a direction.

    P = -d . (sum m v + p), with velocities v of the centres relative to the ground

    ``bent`` (3,): momentum p of beams and superelements relative to the ground.
    """
    numbers = motion.numbers
    momentum = sum((numbers.scalar(body, "mass") * velocity(motion, body.name, numbers.vector(body, "position"))[0]
                    for body in bodies), bent)  # fmt: skip
    return -ca.dot(ca.SX(np.array(part.wrench[:3])), momentum)


def momentum_of(body: Body, motion: Kinematics) -> Expression:
    """Return I w (3,) of a body [N m s], in axes that turn with it, which as described are those of the world."""
    axes, entries = ca.SX(np.array(body.orientation)), motion.numbers.vector(body, "inertia")
    xx, yy, zz, xy, xz, yz = (entries[i] for i in range(6))
    tensor = ca.vertcat(ca.horzcat(xx, xy, xz), ca.horzcat(xy, yy, yz), ca.horzcat(xz, yz, zz))
    return axes @ (tensor @ (axes.T @ motion.angular_velocity(body.name)))


def rotor_momentum(rotor: Rotor, motion: Kinematics) -> Expression:
    """Return the constant angular momentum (3,) of a rotor [N m s], in axes that turn with its body."""
    return motion.numbers.scalar(rotor, "inertia") * motion.numbers.scalar(rotor, "speed") * ca.SX(np.array(rotor.axis))


def angular_momentum(body: Body, rotors: Mapping[str, Rotor], motion: Kinematics) -> Expression:
    """Return the angular momentum (3,) of a body and its rotors about its centre of mass [N m s], world axes."""
    own = [rotor_momentum(rotor, motion) for rotor in rotors.values() if rotor.body == body.name]
    return motion.frames[body.name].vector(sum(own, momentum_of(body, motion)))
