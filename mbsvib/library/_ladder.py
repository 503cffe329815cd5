"""The chapter's ladder: one closed loop a layer."""

from __future__ import annotations

from typing import TYPE_CHECKING

from mbsvib.library import _families as family

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

    from mbsvib.api.model import Model


def ladder(
    layers: int = 5, joint: str = "revolute", *, axis: ArrayLike = family.Z, springs: int = 1, total: bool = True,
    mass: float = family.MASS, inertia: ArrayLike = family.INERTIA,
    stiffness: ArrayLike = family.STIFFNESS, damping: ArrayLike = family.DAMPING,
) -> Model:  # fmt: skip
    """Build the chapter's ladder (its models L5RF1, L20RF1 and so on) of 3 bodies and one closed loop a layer.

    Layer i has the upright bodies ``left<i>`` and ``right<i>`` with centres of mass at (-+0.1, 0.2 i - 0.1, 0) and
    the body ``rung<i>`` on top, at (0, 0.2 i, 0). An upright's joints are ``left<i>.foot``, with the rung below or
    ground, and ``left<i>.head``, with its own rung; the bushing beside a joint is ``left<i>.foot.spring``. Where
    joints lock more than a plane mechanism needs (revolute about z: 3 rows a loop) the spare rows are redundant.
    Force inputs (Fx, ...) and displacement outputs (x, ...) sit at the centre of mass of the top rung.

    Parameters
    ----------
    layers : int
        Number of layers.
    joint : str
        revolute, prismatic, cylindrical or spherical, or the chapter's letter R, P, C or S.
    axis : array-like, shape (3,)
        Axis of all joints, world axes; bushings have it along their z.
    springs : int
        Number s of bushings at every joint; 0 leaves them out.
    total : bool
        Whether the bushings of a joint have ``stiffness`` and ``damping`` together, each one an s-th, as in the
        chapter's Table 3. With False each has all of it, and frequencies grow with s.
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
        The ladder; a layer adds 1 degree of freedom (revolute about z; about x 2), 3 (prismatic), 4 (cylindrical
        along z) or 6 (spherical).

    Raises
    ------
    ModelError
        If layers < 1, the joint is unknown, or a value is refused by the part it is for.

    Source: Jiang, Chen and Luo (2011), section 5.1 C, Table 3. The text there puts both joints of an upright at its
    centre of mass, where revolute joints would let no rung move; here they are at its ends.
    """
    parts = family.FamilyBuilder("ladder", ("layers", layers), joint, axis, springs, total=total,
                          mass=mass, inertia=inertia, stiffness=stiffness, damping=damping)  # fmt: skip
    below = "ground"
    for i in range(1, parts.size + 1):
        rung, foot, middle, head = f"rung{i}", (i - 1) / 5.0, (2 * i - 1) / 10.0, i / 5.0
        sides = ((f"left{i}", -0.1), (f"right{i}", 0.1))
        for side, x in sides:
            parts.body(side, (x, middle, 0.0))
        parts.body(rung, (0.0, head, 0.0))
        for side, x in sides:
            parts.join(f"{side}.foot", f"{side}.foot.spring", below, side, (x, foot, 0.0))
            parts.join(f"{side}.head", f"{side}.head.spring", side, rung, (x, head, 0.0))
        below = rung
    shifts, _ = parts.moves(family.Y)
    family.add_inputs(parts.model, below, shifts)
    family.add_outputs(parts.model, below, shifts)
    return parts.model
