"""A model in another pose: points and axes that are fixed to a body move with it."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, TypeVar

from mbsvib.elements.families import EXPANSIONS
from mbsvib.elements.part import Part
from mbsvib.errors import ModelError
from mbsvib.mechanism.drives import with_drives_held
from mbsvib.mechanism.mechanism import Mechanism
from mbsvib.mechanism.rebuilding import rebuilt

if TYPE_CHECKING:
    from collections.abc import Iterable

    from mbsvib.kinematics.pose import Pose

M = TypeVar("M", bound=Mechanism)


def model_in_pose(model: M, pose: Pose, relaxed: bool = False) -> M:
    """Return a model in another pose.

    Points and axes go with the bodies that they belong to; forces fixed in the world stay as they are. If ``relaxed``,
    springs and bushings keep the forces of the reference pose; otherwise these follow from the motion.
    """
    families: dict[type[Part], list[Part]] = {}
    for group in model.groups().values():
        for part in group.values():
            families.setdefault(type(part), []).append(part)
    refuse_unstated([part for part in model.springs.values()
                     if not (pose.is_unmoved(part.first) and pose.is_unmoved(part.second))], relaxed)  # fmt: skip
    # parts of a family are rebuilt in the order in which they are listed here
    moved = {family: iter(family.all_in_pose(parts, pose, relaxed)) for family, parts in families.items()}
    return rebuilt(model, lambda part: next(moved[type(part)]))


def refuse_unstated(parts: Iterable[Any], relaxed: bool = False) -> None:
    """Refuse connections that do not state which forces they have in another pose."""
    reasons: dict[type[Any], str] = {}
    for part in parts:
        family = type(part)
        if family not in reasons:
            reasons[family] = _unstated(part, relaxed)
        if reasons[family] and not (relaxed and part.law is None and not _has_force(part)):
            raise ModelError(f"{part.family} '{part.name}': {reasons[family]}.", element=part.name)


def _unstated(part: Any, relaxed: bool) -> str:
    """Why the force of the family of a part in another pose is not known; empty if it is."""
    family, law = type(part), part.law
    if family.in_pose is not Part.in_pose or family.all_in_pose is not Part.all_in_pose:
        return ""
    if law is None:
        return "it states no law of finite motion, so that its force in another pose is not known; give it a law"
    if law.energy is None:
        return "its force in another pose is not stated; give its law an energy, or its family an in_pose" \
            if law.has_forces_at_rest and not relaxed else ""  # fmt: skip
    if not law.is_of_fields(part):
        return "its deformation in another pose does not follow from its fields there; give its family an in_pose"
    return ("its force follows from its geometry, so that it cannot keep the one of the reference pose; leave out "
            "relaxed=True") if relaxed else ""  # fmt: skip


def _has_force(part: Any) -> bool:
    expand = EXPANSIONS.get(type(part))
    return part.loaded or (expand is not None and any(spring.loaded for spring in expand(part, {}).springs.values()))


def static_model(model: M) -> M:
    """Return a model for statics: without inputs, outputs and dampers in series, its driven joints held."""
    springs = {name: rest for name, part in model.springs.items() if (rest := part.at_rest) is not None}
    return model.with_parts(joints=with_drives_held(model), springs=springs, inputs={}, outputs={})
