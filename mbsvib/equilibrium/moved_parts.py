"""A model in another pose: points and axes that are fixed to a body move with it."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, TypeVar

from mbsvib.elements import Joint, Maxwell, Spring, spring
from mbsvib.elements.connection import Connection
from mbsvib.elements.part import Composed, Part
from mbsvib.equilibrium import flexible_parts, joints
from mbsvib.mechanism.mechanism import Mechanism
from mbsvib.mechanism.rebuilding import rebuilt

if TYPE_CHECKING:
    from mbsvib.equilibrium.pose import Pose

M = TypeVar("M", bound=Mechanism)


def model_in_pose(model: M, pose: Pose, relaxed: bool = False) -> M:
    """Return a model in another pose.

    Points and axes go with the bodies that they belong to; forces fixed in the world and the directions of inputs and
    outputs stay as they are. If ``relaxed``, springs and bushings keep the forces of the reference pose; otherwise
    these follow from the motion.

    Raises
    ------
    ModelError
        If a part cannot be described in that pose.
    """
    springs = _springs(model, pose, relaxed)
    return rebuilt(model, lambda part: springs[part.name] if isinstance(part, Connection)
                   else _part_in_pose(part, pose, relaxed))  # fmt: skip


def _springs(model: Mechanism, pose: Pose, relaxed: bool) -> dict[str, dict[str, Any] | Part]:
    """All connections in another pose, those of one kind in one call."""
    kinds: dict[type[Part], list[Any]] = {}
    for part in model.springs.values():
        kinds.setdefault(type(part), []).append(part)
    return {part.name: moved for kind, parts in kinds.items()
            for part, moved in zip(parts, kind.all_in_pose(parts, pose, relaxed), strict=True)}  # fmt: skip


def static_model(model: M) -> M:
    """Return a model for statics: without inputs, outputs and dampers in series."""
    springs = {name: static_spring(part) if isinstance(part, Maxwell) else part for name, part in model.springs.items()
               if not isinstance(part, Maxwell) or part.static_stiffness}  # fmt: skip
    return model.with_parts(springs=springs, inputs={}, outputs={})


def static_spring(part: Maxwell) -> Spring:
    """The static spring in parallel to a spring and damper in series."""
    return spring.make(part.name, part.first, part.second, part.start, part.end, part.static_stiffness, 0.0,
                       part.preload)  # fmt: skip


def _part_in_pose(part: Any, pose: Pose, relaxed: bool) -> dict[str, Any] | Part:
    if isinstance(part, Joint):
        return part if pose.is_unmoved(part.first) and pose.is_unmoved(part.second) else joints.in_pose(part, pose)
    if isinstance(part, Composed):
        return flexible_parts.part_in_pose(part, pose)  # type: ignore[arg-type]
    result: dict[str, Any] | Part = part.in_pose(pose, relaxed)
    return result
