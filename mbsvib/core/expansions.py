"""Second derivatives of what parts state in finite motion, as constants in the axes of the part.

A part states its deformation, its openings or its displacement once (``elements.deformations``,
``elements.joint_kinds``). Second-order jets of these functions at the pose are the same for all parts of a form, and
are computed once in a process. A length, as that of a line or of a rod, is the unit: each derivative to a translation
divides by it. Exponential coordinates (theta, v) of a displacement come in this order.
"""

from __future__ import annotations

from functools import lru_cache
from types import SimpleNamespace
from typing import Any, NamedTuple

import numpy as np

from mbsvib.common.arguments import DIRECTIONS, IDENTITY
from mbsvib.common.arrays import Array
from mbsvib.elements import Joint, deformations
from mbsvib.elements.joint_kinds import ROD, SCREW, Columns, Motion, subspaces
from mbsvib.linalg import components as c
from mbsvib.linalg.displacements import small
from mbsvib.linalg.jets import Jet, variables

ORIGIN = (0.0, 0.0, 0.0)
# Where a line or rod of unit length along z begins that ends at the origin.
BELOW = (0.0, 0.0, -1.0)
# Number of translations among the exponential coordinates (theta, v).
_TRANSLATES = np.repeat((0, 1), 3)
# A universal joint whose axes have a smaller cosine is one with normal axes.
NORMAL = 1e-15


class Form(NamedTuple):
    """Joints with the same expansions: their ``motion``, ``free`` directions, whether two turns are ``successive``, and
    the ``cosine`` of the axes of these.
    """

    motion: Motion
    free: tuple[str, ...]
    successive: bool
    cosine: float

    @property
    def locked(self) -> tuple[str, ...]:
        """Names of the locked directions."""
        return tuple([direction for direction in DIRECTIONS if direction not in self.free])

    @property
    def columns(self) -> Columns:
        """The numbers of such a joint in its own axes at the origin, with a rod or a pitch of length one."""
        free, locked = subspaces(self.free)
        if self.motion is SCREW:
            free = (("rz", (0.0, 0.0, 1.0, 0.0, 0.0, 1.0)),)
        elif self.cosine:
            second = (0.0, 0.0, 0.0, self.cosine, np.sqrt((1.0 - self.cosine) * (1.0 + self.cosine)), 0.0)
            free = (free[0], (free[1][0], second))
        return Columns(free, locked, ORIGIN, BELOW if self.motion is ROD else ORIGIN, self.successive)


def form_of(joint: Joint) -> Form:
    """Return the form of a joint."""
    cosine = 0.0
    if joint.successive:
        first, second = joint.rotation_axes
        cosine = float(np.dot(first, second))
    return Form(joint.motion, tuple([name for name, _ in joint.freedom]), joint.successive,
                cosine if abs(cosine) > NORMAL else 0.0)  # fmt: skip


def length_of(joint: Joint) -> float:
    """Return the length [m] that is the unit of a joint: that of its rod, or 1; no second derivative has a pitch."""
    if joint.end is None or joint.position is None:
        return 1.0
    return float(np.linalg.norm(np.subtract(joint.end, joint.position)))


@lru_cache
def of_line() -> Array:
    """Second derivatives (6, 6) of the length of a line of unit length along z to the displacement of its end."""
    return np.asarray(_hessians(lambda x: deformations.length(x, SimpleNamespace(start=BELOW, end=ORIGIN)))[0])


@lru_cache
def of_six() -> Array:
    """Second derivatives (6, 6, 6) of the shift and the rotation vector in the axes of the first body."""
    return _hessians(lambda x: deformations.six(x, SimpleNamespace(position=ORIGIN, orientation=IDENTITY)))


@lru_cache
def of_place() -> Array:
    """Second derivatives (3, 6, 6) of the shift of a point."""
    return _hessians(lambda x: list(x.moved(ORIGIN)))


@lru_cache
def of_openings(form: Form) -> Array:
    """Second derivatives (locked, 6, 6) of the openings of a cut joint, in its axes."""
    if not form.locked:
        return np.zeros((0, 6, 6))
    return _hessians(lambda x: form.motion.openings(x, form.columns))


@lru_cache
def of_displacement(form: Form) -> Array:
    """Second derivatives (6, f, f) of the exponential coordinates of a joint's displacement to its own coordinates."""
    columns = form.columns
    moved = form.motion.displacement(variables(np.zeros(len(form.free))), columns)
    theta = c.axial(moved.rotation)
    shift = c.subtract(moved.shift, c.scale(0.5, c.cross(theta, moved.shift)))
    return np.array([_hessian(entry, len(form.free)) for entry in (*theta, *shift)])


def opening_units(form: Form) -> Array:
    """Exponents (locked, 6, 6) of the length by which second derivatives of openings are multiplied."""
    translates = np.array([name[0] != "r" for name in form.locked], dtype=int).reshape(-1, 1, 1)
    return np.asarray(translates - _TRANSLATES[:, None] - _TRANSLATES)


def displacement_units(form: Form) -> Array:
    """Exponents (6, f, f) of the length by which second derivatives of a displacement are multiplied."""
    translates = np.array([name[0] != "r" for name in form.free], dtype=int)
    return np.asarray(_TRANSLATES[:, None, None] - translates[:, None] - translates)


def line_units() -> Array:
    """Exponents (6, 6) of the length by which second derivatives of a length are multiplied."""
    return np.asarray(1 - _TRANSLATES[:, None] - _TRANSLATES)


def with_length(constants: Array, units: Array, length: Any) -> Array:
    """Return second derivatives (..., *shape) of parts of some ``length`` (...), from those of unit length."""
    size = np.asarray(length).reshape(*np.shape(length), *[1] * constants.ndim)
    return np.asarray(np.where(constants != 0.0, constants * np.where(constants != 0.0, size, 1.0) ** units, 0.0))


def turned(axes: Array, hessians: Array) -> Array:
    """Return second derivatives (..., 6, 6) to displacements in ``axes`` (..., 3, 3; columns, world axes) as those to
    displacements in world axes.
    """
    blocks = hessians.reshape(*hessians.shape[:-2], 2, 3, 2, 3).swapaxes(-3, -2)
    wide = axes[..., None, None, :, :]
    result = (wide @ blocks @ wide.swapaxes(-1, -2)).swapaxes(-3, -2)
    return result.reshape(*result.shape[:-4], 6, 6)


def _hessians(function: Any) -> Array:
    rx, ry, rz, x, y, z = variables(np.zeros(6))
    return np.array([_hessian(value, 6) for value in function(small((rx, ry, rz), (x, y, z), ORIGIN))])


def _hessian(value: Any, count: int) -> Array:
    return value.hessian if isinstance(value, Jet) else np.zeros((count, count))
