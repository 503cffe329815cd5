"""A model in another pose: points and axes that are fixed to a body move with it."""

from __future__ import annotations

from typing import TYPE_CHECKING, TypeVar

from mbsvib.mechanism.drives import with_drives_held
from mbsvib.mechanism.mechanism import Mechanism
from mbsvib.mechanism.rebuilding import rebuilt

if TYPE_CHECKING:
    from mbsvib.elements.part import Part
    from mbsvib.kinematics.pose import Pose

M = TypeVar("M", bound=Mechanism)


def model_in_pose(model: M, pose: Pose, relaxed: bool = False) -> M:
    """Return a model in another pose.

    Points and axes go with the bodies that they belong to; forces fixed in the world and the directions of inputs and
    outputs stay as they are. If ``relaxed``, springs and bushings keep the forces of the reference pose; otherwise
    these follow from the motion.
    """
    families: dict[type[Part], list[Part]] = {}
    for group in model.groups().values():
        for part in group.values():
            families.setdefault(type(part), []).append(part)
    # parts of a family are rebuilt in the order in which they are listed here
    moved = {family: iter(family.all_in_pose(parts, pose, relaxed)) for family, parts in families.items()}
    return rebuilt(model, lambda part: next(moved[type(part)]))


def static_model(model: M) -> M:
    """Return a model for statics: without inputs, outputs and dampers in series, its driven joints held."""
    springs = {name: rest for name, part in model.springs.items() if (rest := part.at_rest) is not None}
    return model.with_parts(joints=with_drives_held(model), springs=springs, inputs={}, outputs={})
