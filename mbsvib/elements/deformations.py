"""What connections deform by in finite motion, as functions of components (see ``linalg.components``), and their laws.

The argument is the displacement of the second body against the first, in world axes of the pose as described, which
turn with the first body. Rows of connections are first derivatives of their deformation, geometric stiffness follows
from second ones.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from types import SimpleNamespace
from typing import Any

import numpy as np

from mbsvib.common.arrays import Array
from mbsvib.elements.joint_kinds import normals
from mbsvib.linalg import components as c
from mbsvib.linalg.components import Component
from mbsvib.linalg.displacements import Displacement, small
from mbsvib.linalg.jets import variables


@dataclass(frozen=True, slots=True)
class Law:
    """How a connection acts on the change x of its ``deformation`` since the pose as described; names of its fields.

    V = x . k x / 2 + f . x,  R = x' . c x' / 2,  T = b x'^2 / 2

    with ``stiffness`` k, ``damping`` c, ``inertance`` b and the force f at rest: ``preload``, times -1 if it is the
    ``wrench`` on the second body, or k (x_0 - ``free``) with the described value x_0. ``series`` are the stiffness and
    the damping of a spring and a damper in series. ``rotations`` are the components of x that are rotations, which must
    stay below a limit where they have a moment, and ``across`` is an angle that must always do so. ``relaxations`` are
    pairs of a stiffness (d, d) and a time constant: of springs in series with dampers along all of the deformation.

    With an ``energy`` V = energy(d, fields) [J] of the deformation d itself, from components of d and the fields of the
    part by name, the force is -dV/dd in every pose, and stiffness and force at rest have no fields. Then d in a pose is
    to follow from the fields there, as a length does and an angle since the pose as described does not.
    """

    deformation: Callable[[Displacement, Any], list[Component]]
    stiffness: str | None = None
    damping: str | None = None
    preload: str | None = None
    wrench: bool = False
    free: str | None = None
    inertance: str | None = None
    series: tuple[str, str] | None = None
    rotations: slice | None = None
    across: Callable[[Displacement, Any], Component] | None = None
    relaxations: str | None = None
    energy: Callable[[list[Component], Any], Component] | None = None

    @property
    def follows_coefficients(self) -> bool:
        """Whether the coefficients at rest determine the force in every pose, as in ``posed_scene``."""
        return self.energy is None and self.deformation in (length, six, twist)

    @property
    def has_forces_at_rest(self) -> bool:
        """Whether it has forces without a motion, in the pose as described or another one."""
        return any((self.energy, self.stiffness, self.preload, self.free, self.series))

    def is_of_fields(self, part: Any) -> bool:
        """Whether the deformation in another pose is that of the fields of a part in this pose, by trial."""
        x = Displacement(c.exponential((0.3, -0.2, 0.4)), (0.02, -0.03, 0.01))
        there, moved = fields_of(part), {"point": x.point, "rotated_vector": x.vector,
                                         "rotated_axes": partial(c.product, x.rotation)}  # fmt: skip
        for name, role in part.roles.items():
            if role.on == "second" and role.moved and getattr(part, name) is not None:
                move: Any = moved[role.moved]
                setattr(there, name, move(getattr(part, name)))
        return np.allclose(self.deformation(x, fields_of(part)), self.deformation(Displacement(), there), 1e-9, 1e-12)

    def at_pose(self, part: Any) -> tuple[Array, Array, Array]:
        """Return the first derivatives (6,) and the second ones (6, 6) of the energy, and the first ones (d, 6) of the
        deformation, to the shift and the rotation vector of the second body at the last point of a part, world axes.
        """
        values = fields_of(part)
        point = getattr(part, part.point_fields[-1]) if part.point_fields else (0.0, 0.0, 0.0)
        x, y, z, rx, ry, rz = variables(np.zeros(6))
        rotation = small((rx, ry, rz), (0.0, 0.0, 0.0), point).rotation
        deformed: list[Any] = self.deformation(Displacement(rotation, (x, y, z), point), values)
        slopes = np.array([value.gradient for value in deformed])
        if self.energy is None:
            return np.zeros(6), np.zeros((6, 6)), slopes
        energy: Any = self.energy(deformed, values)
        return energy.gradient, energy.hessian, slopes


def fields_of(part: Any) -> Any:
    """Return the fields of a part that have roles, as laws take them."""
    return SimpleNamespace(**{name: getattr(part, name) for name in part.roles})


def length(x: Displacement, j: Any) -> list[Component]:
    """Return the length of a line from ``start`` on the first to ``end`` on the second body [m]."""
    return [c.norm(c.subtract(x.point(j.end), j.start))]


def six(x: Displacement, j: Any) -> list[Component]:
    """Return the displacement of ``position`` on the second body [m] and the rotation vector [rad] of this body, in the
    axes ``orientation`` of the first.
    """
    axes = c.transpose(j.orientation)
    return [*c.apply(axes, x.moved(j.position)), *c.apply(axes, c.rotation_vector(x.rotation))]


def twist(x: Displacement, j: Any) -> list[Component]:
    """Return the angle [rad], within half a turn, by which the second body turns about ``axis`` before it swings
    across it.

    phi = 2 atan2(z, w) of the quaternion (w, x, y, z) with z along the axis
    """
    across, third = normals(j.axis)
    a, b = x.vector(across), x.vector(third)
    return [c.arctan2(c.dot(third, a) - c.dot(across, b), c.dot(across, a) + c.dot(third, b))]


def swing(x: Displacement, j: Any) -> Component:
    """Return the angle [rad] by which the second body swings across ``axis``; at half a turn its twist is undefined."""
    axis = x.vector(j.axis)
    return c.arctan2(c.norm(c.cross(j.axis, axis)), c.dot(j.axis, axis))
