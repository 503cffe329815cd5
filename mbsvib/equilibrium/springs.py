"""Spring-dampers in finite motion: the words of a spring or bushing in another pose.

A line spring keeps the law F + k (L - L0). A bushing has the potential s . k s / 2 - preload . s with s = (d, rho):
d = A^T (p_b - p_a) in axes A that turn with the first body, rho = log(A^T B). In another pose the same law is expanded
to second order about that pose, which is all that its preload and its stiffness there can say.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

import numpy as np

from mbsvib.elements import Maxwell, Spring
from mbsvib.equilibrium.joints import NoWordsError
from mbsvib.errors import ModelError
from mbsvib.linalg.rotations import inverse_jacobian, logarithm, second_order

if TYPE_CHECKING:
    from mbsvib.common.arrays import Array
    from mbsvib.elements import Bushing
    from mbsvib.equilibrium.pose import Pose

# A force below this share of stiffness times length is rounding of the length.
ROUNDING = 1e-15
# Bushings that carry moments are followed up to this angle [rad] between their bodies.
FARTHEST = 3.0


def words_at(part: Spring | Bushing | Maxwell, pose: Pose, relaxed: bool = False) -> dict[str, Any]:
    """Return the words of a spring-damper in another pose.

    Parameters
    ----------
    part : Spring, Bushing or Maxwell
        The spring-damper as described.
    pose : Pose
        The pose.
    relaxed : bool
        Whether its force stays as it is described; otherwise it follows from the motion.

    Returns
    -------
    dict
        Words for ``add_spring``, ``add_bushing`` or ``add_maxwell``.

    Raises
    ------
    ModelError
        If a Maxwell element would have to carry a force.
    """
    words = part.words()
    if isinstance(part, Maxwell):
        return _maxwell(part, pose, words, relaxed)
    return _spring(part, pose, words, relaxed) if isinstance(part, Spring) else _bushing(part, pose, words, relaxed)


def _spring(spring: Spring, pose: Pose, words: dict[str, Any], relaxed: bool) -> dict[str, Any]:
    start, end = pose.point(spring.first, spring.start), pose.point(spring.second, spring.end)
    words |= {"start": start, "end": end}
    if relaxed:
        if spring.free_length is not None:
            words["preload"] = spring.tension
            del words["free_length"]
    elif spring.free_length is None:
        change = spring.stiffness * (math.dist(start, end) - spring.length)
        tension = spring.tension + change
        if abs(tension) < ROUNDING * abs(spring.stiffness) * spring.length:
            tension = 0.0
        if tension or spring.preload is not None:
            words["preload"] = tension
    return words


def _maxwell(part: Maxwell, pose: Pose, words: dict[str, Any], relaxed: bool) -> dict[str, Any]:
    """Its damper gives way until the spring in series carries nothing; the spring beside them would carry a force."""
    start, end = pose.point(part.first, part.start), pose.point(part.second, part.end)
    before, after = math.dist(part.start, part.end), math.dist(start, end)
    if not relaxed and part.static_stiffness and abs(after - before) > 16 * ROUNDING * before:
        who = f"maxwell '{part.name}'"
        raise NoWordsError(
            f"{who}: static_stiffness = {part.static_stiffness:g} would carry a force in another pose, "
            f"which a Maxwell element cannot say; make it an add_spring of its own.",
            element=who, field="static_stiffness",
        )  # fmt: skip
    return words | {"start": start, "end": end}


def deflection(bushing: Bushing, pose: Pose) -> tuple[Array, Array]:
    """Return d [m] and rho [rad] of a bushing since the pose in which it is described, in its axes."""
    first, second = (pose.turned(body, bushing.orientation) for body in (bushing.first, bushing.second))
    gap = np.subtract(pose.point(bushing.second, bushing.position), pose.point(bushing.first, bushing.position))
    return first.T @ gap, logarithm(first.T @ second)


def _check_turn(bushing: Bushing, rho: Array) -> None:
    """Next to half a turn the rotation vector may as well point the other way, and so may the moment."""
    angle = float(np.linalg.norm(rho))
    if angle > FARTHEST:
        who = f"bushing '{bushing.name}'"
        raise ModelError(f"{who}: is turned by {np.degrees(angle):.0f} degrees, where its moment is no longer defined "
                         f"(limit {np.degrees(FARTHEST):.0f}). Describe the model in a pose nearer by.",
                         element=who, field="stiffness")  # fmt: skip


def _bushing(bushing: Bushing, pose: Pose, words: dict[str, Any], relaxed: bool) -> dict[str, Any]:
    words |= {"position": pose.point(bushing.second, bushing.position),
              "orientation": pose.axes(bushing.first, bushing.orientation)}  # fmt: skip
    if relaxed:
        return words
    d, rho = deflection(bushing, pose)
    stiffness, damping = (np.array(value) for value in (bushing.stiffness, bushing.damping))
    full = np.diag(stiffness) if stiffness.ndim == 1 else stiffness
    wrench = np.array(bushing.preload or np.zeros(6)) - full @ np.concatenate((d, rho))
    if rho.any():
        map_ = np.eye(6)
        map_[3:, 3:] = inverse_jacobian(rho)
        if wrench[3:].any() or full[3:].any():
            _check_turn(bushing, rho)
            tangent = map_.T @ full @ map_
            tangent[3:, 3:] -= second_order(rho, wrench[3:])
            words["stiffness"] = 0.5 * (tangent + tangent.T)
        if damping[3:].any():
            words["damping"] = map_.T @ (np.diag(damping) if damping.ndim == 1 else damping) @ map_
        wrench = map_.T @ wrench
    if wrench.any() or bushing.preload is not None:
        words["preload"] = wrench
    return words
