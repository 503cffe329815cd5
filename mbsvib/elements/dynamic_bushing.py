"""Bushings whose stiffness depends on frequency: rubber, foam, structural damping.

K*(s) = K + C s + (f(s) - 1) K_d,  f(s) = static + viscous s + sum of g s tau / (1 + s tau)

The bushing is one with K + (static - 1) K_d and C + viscous K_d, and beside it for each relaxation a bushing g K_d in
series with a damper g tau K_d, with a massless node between them on one of the bodies, the ground if it is one. Its
force is the sum of those of the bushings. At rest dampers carry nothing: in another pose they have yielded until the
bushings before them are relaxed.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from mbsvib.common import arguments as check
from mbsvib.common.arguments import DIRECTIONS, Matrix3, Vector
from mbsvib.common.arrays import Array
from mbsvib.elements import bushing
from mbsvib.elements import joint as _joint
from mbsvib.elements.bushing import ZERO, Bushing, Matrix6, Six, matrix6
from mbsvib.elements.deformations import Law, six
from mbsvib.elements.dynamic import Dynamic
from mbsvib.elements.maxwell import Node, as_node_joint
from mbsvib.elements.part import Part
from mbsvib.elements.pose import Pose
from mbsvib.elements.relaxing import Relaxing, factor_of
from mbsvib.elements.roles import STIFFNESS, stated
from mbsvib.elements.shared_rows import ExpandedPart
from mbsvib.errors import ModelError

GROUND = "ground"
# Eigenvalues of a matrix with ones on its diagonal that are zero, and how far below zero rounding takes them.
SINGULAR = 1e-12
_UNITS = ("N/m", "N/rad", "N m/rad")


@dataclass(frozen=True, slots=True)
class DynamicBushing(Relaxing):
    """A bushing as ``Bushing`` is one, whose stiffness ``dynamic`` lets depend on frequency.

    ``dynamic_stiffness`` [N/m, N m/rad] is the part K_d that does; None: all of it.
    """

    law = Law(six, "rest_stiffness", "rest_damping", preload="preload", wrench=True, rotations=slice(3, 6),
              relaxations="relaxations")  # fmt: skip

    roles = stated(**Bushing.roles, dynamic_stiffness=STIFFNESS)

    position: Vector
    stiffness: Six | Matrix6
    dynamic: Dynamic
    damping: Six | Matrix6 = ZERO
    orientation: Matrix3 = check.IDENTITY
    preload: Six | None = None
    dynamic_stiffness: Six | Matrix6 | None = None

    @property
    def acting(self) -> Six | Matrix6:
        """The stiffness K_d that depends on frequency."""
        return self.stiffness if self.dynamic_stiffness is None else self.dynamic_stiffness

    @property
    def rest_stiffness(self) -> Six | Matrix6:
        """Stiffness without relaxations, as it acts at rest."""
        return _sum(self.stiffness, self.acting, self.dynamic.static - 1.0)

    @property
    def rest_damping(self) -> Six | Matrix6:
        """Damping without relaxations."""
        return _sum(self.damping, self.acting, self.dynamic.viscous)

    @property
    def relaxations(self) -> tuple[tuple[Six | Matrix6, float], ...]:
        """Stiffness and time constant [s] of each relaxation."""
        return tuple([(_sum(ZERO, self.acting, g), tau) for g, tau in self.dynamic.terms])

    @property
    def at_rest(self) -> Bushing:
        """The bushing without relaxations."""
        return Bushing(self.name, self.first, self.second, self.position, self.rest_stiffness, self.rest_damping,
                       self.orientation, self.preload)  # fmt: skip

    @property
    def batched_fields(self) -> frozenset[str]:
        matrices = self.dynamic_stiffness is not None or isinstance(self.stiffness[0], tuple) or isinstance(
            self.damping[0], tuple)  # fmt: skip
        return frozenset() if matrices else frozenset(("stiffness", "damping", *self._term_names))

    @property
    def signed_fields(self) -> frozenset[str]:
        return self.batched_fields

    @property
    def cross_coupling(self) -> tuple[Array, Array] | None:
        return self.at_rest.cross_coupling

    def replacement(self, *_: Any) -> ExpandedPart:
        name, point, axes = self.name, self.position, self.orientation
        matrix = matrix6(self.acting)
        free = tuple([direction for i, direction in enumerate(DIRECTIONS) if matrix[i].any()])
        idle, on_first = _idle(matrix), self.first == GROUND
        base = self.first if on_first else self.second
        bodies, joints, dampers = {}, {}, {}
        carriers = {f"{name}.rest": replace(self.at_rest, name=f"{name}.rest")}
        for k, (stiffness, tau) in enumerate(self.relaxations, 1):
            if not self.dynamic.terms[k - 1][0]:
                continue
            stem = f"{name}.{k}"
            node = f"{stem}.node"
            bodies[node] = Node(node, 0.0, (0.0,) * 6, point)
            joints[stem] = as_node_joint(_joint.make(stem, None, base, node, point, axes, None, None, None, free))
            ends = (node, self.second) if on_first else (self.first, node)
            spring = Bushing(f"{stem}.spring", *ends, point, stiffness, ZERO, axes)
            damper = Bushing(f"{stem}.damper", base, node, point, _sum(ZERO, idle, self.dynamic.terms[k - 1][0]),
                             _sum(ZERO, stiffness, tau), axes)  # fmt: skip
            carriers[spring.name], dampers[damper.name] = spring, damper
        return ExpandedPart(bodies=bodies, joints=joints, springs=carriers | dampers, carriers=tuple(carriers))

    def in_pose(self, pose: Pose, relaxed: bool) -> Part | dict[str, Any]:
        if pose.is_unmoved(self.first) and pose.is_unmoved(self.second):
            return self
        there, acting = (part.in_pose(pose, relaxed) for part in (
            self.at_rest, replace(self.at_rest, stiffness=ZERO, damping=self.acting, preload=None)))  # fmt: skip
        assert isinstance(there, Bushing)
        assert isinstance(acting, Bushing)
        result = replace(self, position=there.position, orientation=there.orientation, preload=there.preload)
        if there.stiffness == self.rest_stiffness and acting.damping == self.acting:
            return result
        return replace(result, stiffness=_sum(there.stiffness, acting.damping, 1.0 - self.dynamic.static),
                       damping=_sum(there.damping, acting.damping, -self.dynamic.viscous),
                       dynamic_stiffness=acting.damping)  # fmt: skip


def make(
    name: str, first: str, second: str, position: Any, stiffness: Any, damping: Any = ZERO, orientation: Any = None,
    preload: Any = None, dynamic: Any = None, dynamic_stiffness: Any = None,
) -> Bushing | DynamicBushing:  # fmt: skip
    """Check the values of a bushing, whose stiffness may depend on frequency, and build it."""
    plain = bushing.make(name, first, second, position, stiffness, damping, orientation, preload)
    who = f"bushing '{name}'"
    if dynamic is None:
        if dynamic_stiffness is not None:
            raise ModelError(f"{who}: dynamic_stiffness is given without dynamic; give both, or leave it out.",
                             element=who, field="dynamic_stiffness")  # fmt: skip
        return plain
    factor = factor_of(dynamic, who)
    field = "stiffness" if dynamic_stiffness is None else "dynamic_stiffness"
    own = None if dynamic_stiffness is None else bushing.coefficients(dynamic_stiffness, who, field)
    result = DynamicBushing(name, first, second, plain.position, plain.stiffness, factor, plain.damping,
                            plain.orientation, plain.preload, own)  # fmt: skip
    matrix = matrix6(result.acting)
    scale = np.sqrt(np.abs(matrix.diagonal()))
    scaled = matrix / np.multiply.outer(*2 * [np.where(scale > 0.0, scale, 1.0)])
    if not matrix.any() or not np.array_equal(matrix, matrix.T) or np.linalg.eigvalsh(scaled)[0] < -SINGULAR:
        raise ModelError(f"{who}: {field} = {check.shown(result.acting)} with dynamic = {factor!r}; expected one that "
                         f"is symmetric, without negative eigenvalues and not zero, so that its relaxations take "
                         f"energy.", element=who, field=field)  # fmt: skip
    return result


def _idle(matrix: Array) -> Six | Matrix6:
    """A stiffness of the directions along which a singular one does nothing, so that its nodes stay there."""
    size = np.sqrt(matrix.diagonal())
    unit = np.where(size > 0.0, size, 1.0)
    values, vectors = np.linalg.eigh(matrix / np.multiply.outer(unit, unit))
    none = vectors[:, values <= SINGULAR]
    held = none @ none.T * np.multiply.outer(size, size)
    return ZERO if not held[~np.eye(6, dtype=bool)].any() else tuple(map(tuple, held.tolist()))


def _sum(base: Six | Matrix6, added: Six | Matrix6, factor: float) -> Six | Matrix6:
    """base + factor added, as six values where both are."""
    if not factor:
        return base
    if not isinstance(base[0], tuple) and not isinstance(added[0], tuple):
        return tuple([a + factor * b for a, b in zip(base, added, strict=True)])
    return tuple(map(tuple, (matrix6(base) + factor * matrix6(added)).tolist()))
