"""Parts that state a law of finite motion alone: what they are in the equations about a pose follows by jets.

An element with the energy V acts about a pose to second order as a bushing with the second derivatives of V as its
stiffness, and minus the first ones as its preload, because the potential of a bushing is quadratic in the shift and the
rotation vector at its point. Along a line it is a spring with k = d2V/dL2 and the tension dV/dL.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from mbsvib.common.arguments import IDENTITY
from mbsvib.common.arrays import Array
from mbsvib.elements import ports
from mbsvib.elements.bushing import Bushing
from mbsvib.elements.connection import line_between
from mbsvib.elements.deformations import fields_of, length
from mbsvib.elements.shared_rows import ExpandedPart
from mbsvib.elements.spring import Spring
from mbsvib.elements.torsion_spring import NOWHERE
from mbsvib.errors import ModelError
from mbsvib.linalg.jets import variables


def expand(part: Any, *_: Any) -> ExpandedPart:
    """Return the spring or bushing that an element is about the pose, or the row that an output is."""
    if isinstance(part, ports.Signal):
        return ExpandedPart(outputs={part.name: _row(part)})
    damping = 0.0 if part.law.damping is None else getattr(part, part.law.damping)
    if part.law.deformation is length:
        return ExpandedPart(springs={part.name: _spring(part, damping)})
    gradient, hessian, slopes = part.law.at_pose(part)
    _check(part, gradient, hessian)
    rates = slopes.T @ (np.broadcast_to(damping, len(slopes))[:, None] * slopes)
    stiffness, damped = (tuple(map(tuple, (0.5 * (array + array.T)).tolist())) for array in (hessian, rates))
    point = part.points[-1] if part.points else NOWHERE
    return ExpandedPart(springs={part.name: Bushing(
        part.name, part.first, part.second, point, stiffness, damped, IDENTITY, tuple((-gradient).tolist()))})


def _spring(part: Any, damping: float) -> Spring:
    start, end, line, distance = line_between(part.name, part.start, part.end, "It has no line to act along.")
    energy = part.law.energy(variables(np.array([distance])), fields_of(part))
    _check(part, energy.gradient, energy.hessian)
    tension = float(energy.gradient[0])
    return Spring(part.name, part.first, part.second, start, end, float(energy.hessian[0, 0]), damping, tension, None,
                  line, distance, tension)  # fmt: skip


def _row(part: Any) -> ports.Output:
    """The output along the first derivatives of its deformation."""
    slopes = part.law.at_pose(part)[2]
    point = [getattr(part, key) for key in part.point_fields][-1:] or [NOWHERE]
    return ports.make_output(part.name, part.second, slopes[0], point[0], part.first, "displacement", None, part.unit)


def _check(part: Any, *derivatives: Array) -> None:
    if not all(np.isfinite(array).all() for array in derivatives):
        raise ModelError(f"{part.family} '{part.name}': its energy has no finite derivatives in this pose; change the "
                         f"pose or its values.", element=part.name)  # fmt: skip
