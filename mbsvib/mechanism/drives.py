"""Joints whose coordinates inputs prescribe: which they are, in the tree, and held where they stand."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from mbsvib.elements.joint import Joint
from mbsvib.elements.joint import make as make_joint
from mbsvib.elements.motion_input import DrivenCoordinate, MotionInput
from mbsvib.errors import ModelError
from mbsvib.mechanism.mechanism import Mechanism
from mbsvib.mechanism.topology import cut_elsewhere


def driven_coordinates(model: Mechanism) -> tuple[str, ...]:
    """Return the names of the joint coordinates that inputs of an expanded mechanism prescribe."""
    return tuple(dict.fromkeys(part.element for part in model.inputs.values() if isinstance(part, DrivenCoordinate)))


def check_joints(model: Mechanism) -> None:
    """Refuse a model without the joint that an input drives."""
    for part in model.inputs.values():
        if isinstance(part, DrivenCoordinate):
            name, _, word = part.element.rpartition(".")
            if word not in dict(model.joints[name].freedom if name in model.joints else ()):
                raise ModelError(f"motion input '{part.source}': coordinate '{part.element}' that it drives is not in "
                                 f"model '{model.name}'; leave this input out, too.", element=part.source)  # fmt: skip


def with_drives_in_tree(model: Mechanism, cut: Sequence[str] | None) -> Sequence[str] | None:
    """Return where to cut loops so that driven joints are in the tree; ``cut`` where it is given, or none is driven."""
    driven = model.derived(driven_coordinates)
    if not driven:
        return cut
    check_joints(model)
    if cut is not None:
        return cut
    joints, loop = cut_elsewhere(model, {name.rpartition(".")[0] for name in driven})
    if loop is not None:
        raise ModelError(f"model '{model.name}': all joints of the loop that '{loop}' closes are driven; its motion "
                         f"follows from fewer. Leave out a motion input.", element=loop)  # fmt: skip
    return joints


def with_drives_held(model: Mechanism) -> dict[str, Joint]:
    """Return the joints of a mechanism, the driven ones without the coordinates that are driven."""
    joints, held = dict(model.joints), dict[str, set[str]]()
    for part in model.inputs.values():
        if isinstance(part, MotionInput) and part.element not in model.springs:
            name, _, word = part.element.rpartition(".")
            held.setdefault(name, set()).add(word)
    for name, words in held.items():
        old = joints[name]
        free = [word for word, _ in old.freedom if word not in words]
        new = make_joint(name, None if free else "fixed", old.first, old.second, old.point, old.axes, None, None, None,
                         free or None)  # fmt: skip
        if free and not np.allclose([six for _, six in new.freedom], [dict(old.freedom)[word] for word in free]):
            raise ModelError(f"joint '{name}': what it leaves free beside the driven {', '.join(sorted(words))} is not "
                             f"along its axes, so that statics does not hold it; drive a joint with one coordinate, "
                             f"or describe the model in balance.", element=name)  # fmt: skip
        joints[name] = new
    return joints
