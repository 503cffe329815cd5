"""Masses and springs on an inclined rail, both ends fixed."""

from __future__ import annotations

from typing import TYPE_CHECKING

from mbsvib.api.model import Model
from mbsvib.common import arguments as check
from mbsvib.library._families import count

if TYPE_CHECKING:
    from numpy.typing import ArrayLike


def inclined_chain(
    n: int = 8, *, mass: float = 10.0, stiffness: float = 1e5, damping: float = 0.0,
    line: ArrayLike = (4.0, 3.0, 0.0), spacing: float = 1.0,
) -> Model:  # fmt: skip
    """Build n equal masses on an inclined rail, n + 1 equal springs between them and to the ground at both ends.

    The eigenfrequencies do not know about the inclination:

        f_i = (1/pi) sqrt(k/m) sin(i pi / (2 (n + 1))),   i = 1 ... n.

    Bodies ``mass1`` ..., prismatic joints ``rail1`` ..., springs ``spring0`` ... ``spring<n>``. Input ``f``: force
    along the rail on the first mass; outputs ``mass1.d`` ...: displacements along the rail.

    Parameters
    ----------
    n : int
        Number of masses.
    mass : float
        Of each [kg].
    stiffness, damping : float
        Of each spring [N/m, N s/m].
    line : array-like, shape (3,)
        Direction of the rail, world axes.
    spacing : float
        Distance between neighbours [m]; chosen, it changes nothing.

    Returns
    -------
    Model
        The chain, n degrees of freedom.

    Raises
    ------
    ModelError
        If n < 1, or a value is refused by the part it is for.

    Source: Commission VPCS, "Guide de validation des progiciels de calcul de structures" (AFNOR, 1990), SDLD02.
    """
    number = count(n, "inclined_chain", "n")
    x, y, z = along = check.axis(line, "inclined_chain", "line")
    distance = check.number(spacing, "inclined_chain", "spacing", "the distance between neighbours [m]")
    points = [(s * x, s * y, s * z) for s in (distance * i for i in range(number + 2))]
    model = Model("inclined_chain")
    for i in range(1, number + 1):
        # bodies do not rotate: the moment of inertia is arbitrary
        model.add_body(f"mass{i}", mass, (1.0, 1.0, 1.0), points[i])
        model.add_joint(f"rail{i}", "prismatic", "ground", f"mass{i}", points[i], axis=along)
    names = ["ground", *model.bodies, "ground"]
    for i in range(number + 1):
        # with a single mass both springs have the same two ends; the second then runs against the rail
        model.add_spring(f"spring{i}", names[i], names[i + 1], points[i], points[i + 1], stiffness, damping)
    model.add_input("f", "mass1", along)
    for name in names[1:-1]:
        model.add_output(f"{name}.d", name, along)
    return model
