"""The chapter's binary tree: every body carries two, layer upon layer."""

from __future__ import annotations

from typing import TYPE_CHECKING

from mbsvib.library import _families as family

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

    from mbsvib.api.model import Model


def tree(
    layers: int = 5, joint: str = "revolute", *, axis: ArrayLike = family.Z, springs: int = 1, total: bool = True,
    mass: float = family.MASS, inertia: ArrayLike = family.INERTIA,
    stiffness: ArrayLike = family.STIFFNESS, damping: ArrayLike = family.DAMPING,
) -> Model:  # fmt: skip
    """Build the chapter's binary tree (its models T5RF1, T7RF1 and so on) of 2^layers - 1 bodies.

    Layer i holds the bodies ``body<i>.1`` ... ``body<i>.<2^(i-1)>``; the centre of mass of ``body<i>.<j>`` is at
    (j, i, 0). Bodies 2j - 1 and 2j of the next layer hang on it, joined half way between the centres of mass, and
    ``body1.1`` on ground at (1, 1/2, 0). Joints ``joint<i>.<j>`` and bushings ``spring<i>.<j>`` carry the number of
    the outer body. Force inputs (Fx, ...) and displacement outputs (x, ...) sit at the first body of the last layer;
    outputs ``last.x``, ... at the last body of that layer.

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
        The tree; one degree of freedom a body (2 cylindrical, 3 spherical).

    Raises
    ------
    ModelError
        If layers < 1, the joint is unknown, or a value is refused by the part it is for.

    Source: Jiang, Chen and Luo (2011), section 5.1 B, Table 3. The text there also turns the axes of the
    joints about z, which changes nothing where they are about or along z.
    """
    parts = family.FamilyBuilder("tree", ("layers", layers), joint, axis, springs, total=total,
                          mass=mass, inertia=inertia, stiffness=stiffness, damping=damping)  # fmt: skip
    for i in range(1, parts.size + 1):
        y = float(i)
        for j in range(1, 2 ** (i - 1) + 1):
            number, carrier = f"{i}.{j}", (j + 1) // 2
            parts.body(f"body{number}", (float(j), y, 0.0))
            parent = f"body{i - 1}.{carrier}" if i > 1 else "ground"
            point = (0.5 * (j + carrier), y - 0.5, 0.0)
            parts.join(f"joint{number}", f"spring{number}", parent, f"body{number}", point)
    first, last = f"body{parts.size}.1", f"body{parts.size}.{2 ** (parts.size - 1)}"
    # the first bodies of all layers are in line, those of the other branches spread over the plane
    shifts, turns = parts.moves(family.Y)
    family.add_inputs(parts.model, first, shifts + turns)
    family.add_outputs(parts.model, first, shifts + turns)
    if first != last:
        shifts, turns = parts.moves(family.X, family.Y)
        family.add_outputs(parts.model, last, shifts + turns, prefix="last.")
    return parts.model
