"""The chapter's chain: n bodies in line, each joined to the one before and the first to ground."""

from __future__ import annotations

from typing import TYPE_CHECKING

from mbsvib.common import arguments as check
from mbsvib.library import _families as family

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

    from mbsvib.api.model import Model


def chain(
    n: int = 10, joint: str = "revolute", *, axis: ArrayLike = family.Z, line: ArrayLike = family.Z, springs: int = 1,
    total: bool = True, spacing: float = 0.2, mass: float = family.MASS, inertia: ArrayLike = family.INERTIA,
    stiffness: ArrayLike = family.STIFFNESS, damping: ArrayLike = family.DAMPING,
) -> Model:  # fmt: skip
    """Build the chapter's chain (its models C10RF1, C50RF1 and so on).

    Body i is joined to body i - 1, body 1 to ground; joint i lies (i - 1) spacing from the origin along the line and
    the centre of mass of body i half a spacing farther on. The chapter's chain runs along z, the axis of its joints:
    a revolute one only twists. With ``line=(0, 1, 0)`` it bends. Bodies are ``body1``, joints ``joint1``, bushings
    ``spring1`` (``spring1.1``, ``spring1.2`` where there are several) and so on. Force inputs (Fx, ...) and
    displacement outputs (x, ...) sit at the centre of mass of the last body, in the directions in which it can move.

    Parameters
    ----------
    n : int
        Number of bodies.
    joint : str
        revolute, prismatic, cylindrical or spherical, or the chapter's letter R, P, C or S.
    axis : array-like, shape (3,)
        Axis of all joints, world axes; bushings have it along their z.
    line : array-like, shape (3,)
        Direction of the chain, world axes; z as in the chapter.
    springs : int
        Number s of bushings at every joint; 0 leaves them out.
    total : bool
        Whether the bushings of a joint have ``stiffness`` and ``damping`` together, each one an s-th, as in the
        chapter's Table 3. With False each has all of it, and frequencies grow with s.
    spacing : float
        Distance between joints [m].
    mass : float
        Mass of every body [kg].
    inertia : array-like, shape (3,), (6,) or (3, 3)
        Inertia of every body about its centre of mass [kg m^2], world axes.
    stiffness, damping : array-like, shape (6,) or (6, 6)
        Of the bushings of a joint, in their axes: N/m and N m/rad; N s/m and N m s/rad. The default is the chapter's
        Table 3.

    Returns
    -------
    Model
        The chain; n degrees of freedom (2 n cylindrical, 3 n spherical).

    Raises
    ------
    ModelError
        If n < 1, the joint is unknown, or a value is refused by the part it is for.

    Source: Jiang, Chen and Luo (2011), section 5.1 A, Table 3.
    """
    parts = family.FamilyBuilder("chain", ("n", n), joint, axis, springs, total=total,
                          mass=mass, inertia=inertia, stiffness=stiffness, damping=damping)  # fmt: skip
    along = check.axis(line, "chain", "line")
    distance = check.number(spacing, "chain", "spacing", "the distance between joints [m]")
    x, y, z = (distance * e for e in along)
    before = "ground"
    for i in range(1, parts.size + 1):
        body, s = f"body{i}", i - 0.5
        parts.body(body, (s * x, s * y, s * z))
        s = i - 1.0
        parts.join(f"joint{i}", f"spring{i}", before, body, (s * x, s * y, s * z))
        before = body
    shifts, turns = parts.moves(along)
    family.add_inputs(parts.model, before, shifts + turns)
    family.add_outputs(parts.model, before, shifts + turns)
    return parts.model
