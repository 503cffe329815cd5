"""The contact of a rolling knife-edge wheel with its plane, to first order about steady forward motion.

The point of the edge that touches the plane is at r = R d from the wheel's centre, d = -p / |p|, p = n - (n.a) a. All
is seen from axes that travel along; with the displacement T q of the centre, the rotation R_w q of axes that do not
spin, and the spin W about the axis, the velocity of that point against the plane is

g = T q' - [r]x R_w q' + W (-[r]x da + [a]x dr) R_w q,   da = -[a]x,  dr = d(r) / d(rotation).

Source: Meijaard, Papadopoulos, Ruina & Schwab, Proc. R. Soc. A 463 (2007), for knife-edge wheels without slip.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, TypeVar

import numpy as np

from mbsvib.common.arguments import Vector
from mbsvib.common.arrays import Array
from mbsvib.elements.joint import make as make_joint
from mbsvib.errors import ModelError
from mbsvib.linalg.rotations import skew
from mbsvib.mechanism.mechanism import GROUND, Mechanism

if TYPE_CHECKING:
    from mbsvib.elements.rolling import Rolling

M = TypeVar("M", bound=Mechanism)

STILL = (0.0, 0.0, 0.0)
# A wheel that slips by less than this share of the speed does so by axes that are printed with six digits.
SLIP = 1e-6


@dataclass(frozen=True, slots=True)
class Contact:
    """A wheel in steady motion: ``spin`` [rad/s] about its axis, ``arm`` (3,) [m] from its centre to the contact.

    ``turned_arm`` (3, 3) is the derivative of the arm to the rotation of the wheel, ``slip`` (3, 3) that of the
    velocity of the contact point. The rows of ``directions`` (3, 3) are the normal, the way and across.
    """

    spin: float
    arm: Array
    turned_arm: Array
    slip: Array
    directions: Array

    @property
    def rows(self) -> Array:
        """The velocity (3, 6) of the contact point by that of the centre and the angular velocity."""
        return np.concatenate((np.eye(3), -skew(self.arm)), axis=1)


def contact(wheel: Rolling, travel: Vector) -> Contact:
    """Return the contact of a wheel at a velocity [m/s]; refuse one that would slip or lift."""
    n, a, v = np.array(wheel.normal), np.array(wheel.axis), np.array(travel)
    p = n - (n @ a) * a
    size = float(np.linalg.norm(p))
    d = -p / size
    way = np.cross(d, a)
    speed = float(v @ way)
    off = v - speed * way
    if np.linalg.norm(off) > SLIP * np.linalg.norm(v):
        raise ModelError(f"rolling wheel '{wheel.name}': travel = {tuple(v.tolist())} m/s, and the wheel with axis "
                         f"{wheel.axis} on a plane with normal {wheel.normal} rolls along {tuple(way.tolist())} only. "
                         f"Turn the axis across the travel, or the travel along the plane.",
                         element=wheel.name, field="axis")  # fmt: skip
    spin = speed / wheel.radius
    turned_axis = -skew(a)
    turned_p = -np.outer(a, n @ turned_axis) - (n @ a) * turned_axis
    turned_arm = -wheel.radius / size * (np.eye(3) - np.outer(d, d)) @ turned_p
    arm = wheel.radius * d
    slip = spin * (-skew(arm) @ turned_axis + skew(a) @ turned_arm)
    return Contact(spin, arm, turned_arm, slip, np.stack((n, way, np.cross(n, way))))


def standing(model: M) -> M:
    """Return a mechanism whose wheels stand on ball joints at their contacts, which carry the same forces at rest."""
    if not model.rolling:
        return model
    feet = {}
    for name, wheel in model.rolling.items():
        point = np.array(model.bodies[wheel.body].position) + contact(wheel, model.travel or STILL).arm
        feet[name] = make_joint(name, "spherical", GROUND, wheel.body, point, None, None, None, None, None)
    return model.with_parts(rolling={}, joints=dict(model.joints) | feet)
