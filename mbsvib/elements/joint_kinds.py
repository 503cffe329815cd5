"""Kinds of ideal joints: free and locked relative displacements of two bodies.

A joint's axes Q have the kind's axis along local z (universal: first axis along x, second in the x-y plane).
In these axes the free displacements are the columns of S (6 x f) and the locked ones the rows of L (6-f x 6),
with L S = 0. Displacements are those of the second body relative to the first, at the joint's point. ``Joint`` has
diag(Q, Q) S and L diag(Q, Q)^T, in world axes.

Three kinds lock translations of a point only and leave all rotations free. In any pose, with the point p_a and the axes
x, y, z fixed in the first body and the point p_b fixed in the second body, their constraints are:

- point_on_line: x . (p_b - p_a) = 0 and y . (p_b - p_a) = 0; the line through p_a along z is fixed in the first body;
- point_on_plane: z . (p_b - p_a) = 0; the plane through p_a normal to z is fixed in the first body;
- distance: |p_b - p_a| = L, with p_a = ``position`` on the first, p_b = ``end`` on the second and L from the reference
  pose: a massless rod between two ball joints. Its z is along the rod and fixed in neither body; its free directions
  are x, y (p_b normal to the rod) and rx, ry, rz (the second body about p_b).

Free rotations by q of a kind are either the components of one rotation vector, exp(sum of q e), or two successive
rotations exp(q e) exp(q' e'), the first about an axis fixed in the first body, the second about an axis fixed in the
second. The rotation vector of the latter is q e + q' e' + 1/2 q q' e x e' to second order: it has a component along
the locked axis, which adds the term 1/2 tau . (e x e') q q' of the moment tau. The former has no such term.

A homokinetic (constant-velocity) joint has a rotation vector normal to its z: both shafts rotate at the same rate at
any angle. Displaced by a rotation vector v, it is the same joint with its z rotated by v / 2, which bisects the angle
of the shafts: the product of exp(v') and exp(v) has a rotation vector normal to z if v' is normal to exp(v / 2) z.

A new kind is a row of ``KINDS``. In finite motion it follows from the number of its free rotations: axes fixed in both
bodies (one), two successive axes or a frame that bisects the angle of both bodies (two), or a free rotation (three).
"""

from __future__ import annotations

from dataclasses import dataclass

from mbsvib.common.arguments import DIRECTIONS, UNIT6
from mbsvib.elements.joint_motion import ROD, SCREW, STRAIGHT, Motion
from mbsvib.errors import ModelError

Six = tuple[float, ...]
Named = tuple[tuple[str, Six], ...]


@dataclass(frozen=True, slots=True)
class Kind:
    """A kind of joint: its ``free`` directions, and whether its two free rotations are ``successive``.

    Otherwise they are components of one rotation vector. ``drawn`` are the numbers of the axes that pictures show;
    ``motion`` is its finite motion, one of those of which the engines have the curvature and the axes in other poses.
    """

    free: tuple[str, ...]
    successive: bool = False
    drawn: tuple[int, ...] = ()
    motion: Motion = STRAIGHT

    def __post_init__(self) -> None:
        if self.motion not in (STRAIGHT, SCREW, ROD):
            raise ModelError(f"a kind of joint that frees {', '.join(self.free)}: motion = {self.motion!r}; expected "
                             f"STRAIGHT, SCREW or ROD, as geometric stiffness and other poses of another one are not "
                             f"stated. Make it of several joints, with a body without mass between them.",
                             field="motion")  # fmt: skip


KINDS: dict[str, Kind] = {
    "revolute": Kind(("rz",), drawn=(2,)),
    "prismatic": Kind(("z",), drawn=(2,)),
    "cylindrical": Kind(("z", "rz"), drawn=(2,)),
    "screw": Kind(("rz",), drawn=(2,), motion=SCREW),
    "universal": Kind(("rx", "ry"), successive=True, drawn=(0, 1)),
    "homokinetic": Kind(("rx", "ry"), drawn=(2,)),
    "spherical": Kind(("rx", "ry", "rz")),
    "planar": Kind(("x", "y", "rz"), drawn=(2,)),
    "fixed": Kind(()),
    "free": Kind(DIRECTIONS),
    "point_on_line": Kind(("z", "rx", "ry", "rz"), drawn=(2,)),
    "point_on_plane": Kind(("x", "y", "rx", "ry", "rz")),
    "distance": Kind(("x", "y", "rx", "ry", "rz"), motion=ROD),
}
# Without a free rotation the relative displacement is the same at every point.
NEEDS_NO_POINT = frozenset(name for name, kind in KINDS.items() if not any(d[0] == "r" for d in kind.free))


def subspaces(free: tuple[str, ...]) -> tuple[Named, Named]:
    """Return the free and the locked directions of a joint that frees some of x y z rx ry rz."""
    return (
        tuple((d, UNIT6[DIRECTIONS.index(d)]) for d in free),
        tuple((d, unit) for d, unit in zip(DIRECTIONS, UNIT6, strict=True) if d not in free),
    )


# The free and the locked directions of each kind
SUBSPACES = {name: subspaces(kind.free) for name, kind in KINDS.items()}
