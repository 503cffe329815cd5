"""A model in another pose: points and axes that are fixed to a body move with it.

Parts are rebuilt with other arguments. Couplers that are no linear relations of the joint coordinates of that pose are
refused.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from typing import Any, TypeVar

import numpy as np

from mbsvib.common.arrays import Array
from mbsvib.elements import Body, Joint
from mbsvib.elements.coupler import refuse_curved
from mbsvib.elements.families import EXPANSIONS, rebuild_with
from mbsvib.elements.part import Part
from mbsvib.elements.pose import Pose
from mbsvib.equations.expansion import expanded
from mbsvib.errors import ModelError
from mbsvib.linalg.rotations import logarithm
from mbsvib.mechanism.drives import with_drives_held
from mbsvib.mechanism.mechanism import Mechanism

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


# Rotation vectors shorter than this [rad] are rounding of a pose from Newton's method.
TURNED = 1e-9


def check_couplers(model: Mechanism, moved: Mechanism) -> None:
    """Refuse a pose in which couplers are no longer linear relations of joint coordinates.

    ``moved`` is the model in the new pose. The components of a rotation vector w from the reference pose change by
    e . J(w) omega, with J of ``rotations.inverse_jacobian``: they are coordinates of the joint in the new pose too
    where w is along e. Translations are where the axes of the joint have stayed those of its first body, other than
    those of two successive rotations and of rods. Couplers with curvature are known at the reference pose only, and
    those of rates hold in each.
    """
    if not model.couplers:
        return
    before, after = (expanded(mechanism).bodies for mechanism in (model, moved))
    for part in model.couplers.values():
        for name, _ in part.terms if not part.of_rates else ():
            owner, _, direction = name.rpartition(".")
            joint = model.joints[owner]
            frame, turn, shift = _displacement(joint, before, after)
            angle = float(np.linalg.norm(turn))
            if part.curvatures is not None:
                if angle > TURNED or shift:
                    moved_by = f"{angle:.3g} rad" if angle > TURNED else f"{shift:.3g} m"
                    refuse_curved([part], f"and joint '{owner}' has moved by {moved_by}. Describe the model in the "
                                  f"other pose anew, as load_mjcf(..., pose=...) does.")  # fmt: skip
                continue
            along, there = (np.array(dict(each.freedom)[direction]) for each in (joint, moved.joints[owner]))
            if direction[0] != "r":
                lost, why = frame @ along[:3] - there[:3], "is along an axis that has turned with"
            else:
                lost = np.cross(along[3:], turn) if joint.turns_by_vector else np.zeros(3)
                why = "is a component of the rotation vector of"
            if np.linalg.norm(lost) > TURNED:
                raise ModelError(
                    f"coupler '{part.name}': '{name}' {why} the {joint.kind} joint '{owner}', which has turned by "
                    f"{angle:.3g} rad; the coupler is not a linear relation of its coordinates in another pose. Couple "
                    f"joints with one free rotation, or rotations of universal ones.",
                    element=part.name,
                )  # fmt: skip


def _displacement(joint: Joint, before: Mapping[str, Body], after: Mapping[str, Body]) -> tuple[Array, Array, float]:
    """Turn (3, 3) of a joint's first body, rotation vector (3,) [rad] of the second relative to it, along axes as
    described, and shift [m]; 0 for a shift that is rounding.
    """
    turns, ends, size = [], [], 0.0
    for body in (joint.first, joint.second):
        at = np.array(joint.point or before[joint.first if joint.second == "ground" else joint.second].position)
        if body == "ground":
            turns.append(np.eye(3))
            ends.append(at)
            continue
        start, end = np.array(before[body].position), np.array(after[body].position)
        turns.append(np.array(after[body].orientation) @ np.array(before[body].orientation).T)
        ends.append(end + turns[-1] @ (at - start))
        size = max(size, float(np.abs((at, start, end)).max()))
    shift = float(np.linalg.norm(ends[1] - ends[0]))
    return turns[0], logarithm(turns[0].T @ turns[1]), shift if shift > TURNED * size else 0.0


def rebuilt(model: M, words: Callable[[Any], Mapping[str, Any] | Part]) -> M:
    """Return a mechanism with all parts rebuilt.

    ``words`` takes the parts in the order of ``groups()`` and returns the arguments of a part's adder, or the part that
    replaces it unchecked.
    """
    def rebuilt_part(part: Part) -> Part:
        new = words(part)
        return new if isinstance(new, Part) else rebuild_with(part, new)

    groups: Any = {
        key: {name: rebuilt_part(part) for name, part in group.items()}
        for key, group in model.groups().items() if group
    }
    return model.with_parts(**groups)


def changed(model: M, changes: Mapping[str, Mapping[str, Any]]) -> M:
    """Return a mechanism in which some parts have other arguments."""
    return rebuilt(model, lambda part: part.constructor_kwargs() | changes[part.name] if part.name in changes else part)
