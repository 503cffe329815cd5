"""The cubic hexapod: six springs along edges of a cube, decoupled in all six directions."""

from __future__ import annotations

from math import cos, pi, sin, sqrt
from typing import TYPE_CHECKING

from mbsvib.api.model import Model
from mbsvib.common import arguments as check
from mbsvib.library import _platform as shape

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import ArrayLike


def cubic_hexapod(
    *, edge: float = 0.2, stiffness: float = 1e6, damping: float = 50.0, mass: float = 10.0,
    inertia: ArrayLike = (0.05, 0.05, 0.08), ports: str | Sequence[str] = "platform",
) -> Model:  # fmt: skip
    """Build a cubic hexapod whose payload floats with its centre of mass at the cube's centre.

    The legs are six edges of a cube that stands on one corner, the three at that corner and at the one above it left
    out, so that they are orthogonal in threes. About the cube's centre, with k the stiffness of a leg and L the edge,

        K = k diag(2, 2, 2, L^2/2, L^2/2, 2 L^2).

    Legs are line springs ``leg1`` ... without mass; nothing else holds the payload. The data are chosen.

    Parameters
    ----------
    edge : float
        Edge of the cube [m].
    stiffness, damping : float
        Of a leg, along its line [N/m, N s/m].
    mass : float
        Mass of the payload [kg].
    inertia : array-like, shape (3,), (6,) or (3, 3)
        Its inertia about the centre of mass [kg m^2], world axes.
    ports : str or sequence of str
        As in ``stewart``; the actuators of the group ``"legs"`` push the payload off the ground along a leg.

    Returns
    -------
    Model
        The hexapod, 6 degrees of freedom; body ``platform``, springs ``leg1.k`` ... ``leg6.k``.

    Raises
    ------
    ModelError
        If the edge is not positive, or a value is refused by the part it is for.

    Source: Z. Geng, L. Haynes, "Six degree-of-freedom active vibration control using the Stewart platforms" (1994).
    """
    who = "cubic_hexapod"
    size = check.number(edge, who, "edge", "a positive length [m]")
    if size <= 0.0:
        raise check.refuse(who, "edge", edge, "a positive length [m]")
    groups = shape.port_groups(ports, who)
    # corners lie on two circles about the diagonal, L sqrt(2/3) in radius and L / sqrt(12) off the centre
    radius, height = size * sqrt(2.0 / 3.0), size / sqrt(12.0)
    model = Model(who)
    model.add_body("platform", mass, inertia)
    model.add_joint("platform.free", "free", "ground", "platform", (0.0, 0.0, 0.0))
    legs = []
    for i, leg in enumerate(shape.LEGS):
        low, high = 2.0 * pi * ((i + 1) // 2) / 3.0, pi * (2.0 * (i // 2) + 1.0) / 3.0
        start = (radius * cos(low), radius * sin(low), -height)
        end = (radius * cos(high), radius * sin(high), height)
        spring = model.add_spring(f"{leg}.k", "ground", "platform", start, end, stiffness, damping)
        legs.append(("ground", "platform", start, spring.line))
    shape.add_ports(model, groups, legs)
    return model
