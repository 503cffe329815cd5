"""What connections deform by in finite motion, as functions of components (see ``linalg.components``), and their laws.

The argument is the displacement of the second body against the first, in world axes of the pose as described, which
turn with the first body. Rows of connections are first derivatives of their deformation, geometric stiffness follows
from second ones.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from mbsvib.elements.joint_motion import normals
from mbsvib.linalg import components as c

if TYPE_CHECKING:
    from collections.abc import Callable

    from mbsvib.linalg.components import Component
    from mbsvib.linalg.displacements import Displacement


@dataclass(frozen=True, slots=True)
class Law:
    """How a connection acts on the change x of its ``deformation`` since the pose as described; names of its fields.

    V = x . k x / 2 + f . x,  R = x' . c x' / 2,  T = b x'^2 / 2

    with ``stiffness`` k, ``damping`` c, ``inertance`` b and the force f at rest: ``preload``, times -1 if it is the
    ``wrench`` on the second body, or k (x_0 - ``free``) with the described value x_0. ``series`` are the stiffness and
    the damping of a spring and a damper in series. ``rotations`` are the components of x that are rotations, which must
    stay below a limit where they have a moment. ``relaxations`` are pairs of a stiffness (d, d) and a time constant: of
    springs in series with dampers along all of the deformation.
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
    relaxations: str | None = None


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
