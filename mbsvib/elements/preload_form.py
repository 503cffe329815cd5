"""How an element between two bodies can carry a preload, from which ``equilibrium`` finds the preloads of a pose."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from mbsvib.linalg.rank import EPS

if TYPE_CHECKING:
    from collections.abc import Callable

    from mbsvib.common.arguments import Vector
    from mbsvib.common.arrays import Array


@dataclass(frozen=True, slots=True)
class PreloadForm:
    """Wrenches on the second body that an element can carry as a preload, world axes.

    ``wrenches`` (n, 6) at ``point`` [m] are orthonormal, with moments over the size of the mechanism; ``wrench`` (6,)
    [N, N m] is the one in the reference pose. ``resolution`` [N] is the force of the smallest displacement that rounded
    positions resolve. ``arguments`` returns the arguments of the element that change with a preload wrench (6,); None:
    with no preload.
    """

    point: Vector
    wrenches: Array
    wrench: Array
    resolution: float
    arguments: Callable[[Array | None], dict[str, Any]]


def along(
    part: Any, point: Vector, direction: tuple[float, ...], stiffness: float, size: float,
    arguments: Callable[[float | None], dict[str, Any]],
) -> PreloadForm | None:  # fmt: skip
    """Return the form of a preload that is an amount of one wrench (6,), a force or a moment; None without stiffness.

    ``stiffness`` [N/m, N m/rad] is that at rest along the ``direction``, ``size`` that of the mechanism [m].
    ``arguments`` returns the changed arguments for an amount [N, N m] or None.
    """
    six, unit = np.array(direction), 1.0 if any(direction[:3]) else size
    return PreloadForm(
        point, unit * six[None], np.array(part.rest_wrench), EPS * abs(stiffness) * size / unit**2,
        lambda wrench: arguments(None if wrench is None else float(wrench @ six)),
    ) if stiffness else None  # fmt: skip
