"""Errors and warnings for features that a model does not support, and comparison of forces with MuJoCo's own."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from mbsvib.errors import ModelError
from mbsvib.mjcf.compiled import HINGE, SLIDE, Compiled
from mbsvib.mjcf.scene import Scene
from mbsvib.urdf.posing import LIMIT_DIGITS

# Permitted difference of forces from MuJoCo's, relative to the largest.
SAME = 1e-9
# A joint within this distance [rad, m] of its limit touches it.
AT_LIMIT = 1e-9
LIMIT = "limit that touches in this pose of"


def refuse_unknown(file: Compiled) -> None:
    """Refuse features that a model of rigid bodies and linear springs does not support."""
    m = file.m
    if int(getattr(m, "nflex", 0)):
        raise ModelError(f"{file.path}: <flex>: deformable bodies have no place here; take them out, or add a "
                         f"superelement afterwards.", element="flex")  # fmt: skip
    for i in range(m.nbody):
        if int(m.body_plugin[i]) >= 0:
            raise file.refuse("body", i, "a plugin acts on it.")
    for kind in ("joint", "tendon"):
        prefix = "jnt" if kind == "joint" else kind
        for i in range(file.count(kind)):
            if np.any(file.value(f"{prefix}_stiffnesspoly", i)):
                raise file.refuse(kind, i, "stiffness of more than one number makes a spring that is not linear.",
                                  "stiffness")  # fmt: skip
            if np.any(file.value(f"{prefix}_springyield", i)):
                raise file.refuse(kind, i, "springyield makes a spring that yields for good.", "springyield")


def compare(scene: Scene) -> None:
    """Refuse a file if the forces of springs and actuators at rest differ from those of the model."""
    file, d = scene.file, scene.file.d
    # one of the two contains gravity compensation, which loads replace in the model
    theirs = np.array(d.qfrc_passive) + np.array(d.qfrc_actuator) - np.array(d.qfrc_gravcomp)
    ours = scene.joint_forces
    size = max(np.abs(forces).max(initial=0.0) for forces in (theirs, ours, d.qfrc_gravcomp))
    off = np.abs(theirs - ours)
    if off.size and off.max() > SAME * size:
        i = int(off.argmax())
        raise file.refuse("joint", int(file.m.dof_jntid[i]), f"MuJoCo has {theirs[i]:.9g} N or N m of springs and "
                          f"actuators on it in this pose, and what was read makes {ours[i]:.9g}: something acts "
                          f"that has no place here: magnets, wind or a limit of actuator forces.")  # fmt: skip


def look_for_left(scene: Scene) -> None:
    """Note friction, drag, and the limits and contacts that touch in the pose."""
    file, m, d, kinds = scene.file, scene.file.m, scene.file.d, scene.file.api.mjtConstraint
    if float(m.opt.viscosity):
        scene.remark("drag of the medium of", f"viscosity {float(m.opt.viscosity):g}")
    for i in range(m.njnt) if not file.off("CONSTRAINT", "LIMIT") else ():
        low, high = m.jnt_range[i]
        scalar = int(m.jnt_type[i]) in (SLIDE, HINGE) and bool(m.jnt_limited[i])
        # a joint exactly at its limit touches it in every half cycle, though MuJoCo counts it as free
        if scalar and min(file.position(i)[0] - low, high - file.position(i)[0]) <= AT_LIMIT:
            scene.remark(LIMIT, f"'{file.name('joint', i)}'")
    names: dict[int, tuple[str, str]] = {
        int(kinds.mjCNSTR_FRICTION_DOF): ("dry friction in", "dof"),
        int(kinds.mjCNSTR_FRICTION_TENDON): ("dry friction in", "tendon"),
        int(kinds.mjCNSTR_LIMIT_JOINT): (LIMIT, "joint"),
        int(kinds.mjCNSTR_LIMIT_TENDON): (LIMIT, "tendon"),
    }
    for row in range(int(d.nefc)):
        if int(d.efc_type[row]) not in names:
            continue
        remark, kind = names[int(d.efc_type[row])]
        i = int(d.efc_id[row])
        name = file.name("joint", int(m.dof_jntid[i])) if kind == "dof" else file.name(kind, i)
        if f"'{name}'" not in scene.remarks.get(remark, ()):
            scene.remark(remark, f"'{name}'")
    for contact in range(int(d.ncon)):
        bodies = [file.name("body", int(m.geom_bodyid[int(geom)])) for geom in d.contact[contact].geom]
        pair = " with ".join(f"'{body}'" for body in bodies)
        if pair not in scene.remarks.get("contact in this pose of", ()):
            scene.remark("contact in this pose of", pair)


def angles(file: Compiled, pose: Mapping[str, Any]) -> dict[str, float]:
    """Return the angles [rad] of the hinges that are named in a pose, by coordinate."""
    numbers = {name: file.names("joint").index(name) for name in pose}
    return {f"{name}.rz": float(file.position(i)[0]) for name, i in numbers.items()
            if int(file.m.jnt_type[i]) == HINGE}  # fmt: skip


def refuse_beyond(file: Compiled, pose: Mapping[str, Any]) -> None:
    """Refuse positions of hinges and slides that are named in a pose beyond their range, as degrees usually are."""
    m, names = file.m, file.names("joint")
    for i in [names.index(name) for name in pose]:
        if m.jnt_limited[i] and int(m.jnt_type[i]) in (SLIDE, HINGE):
            (low, high), q = np.array(m.jnt_range[i]), float(file.position(i)[0])
            if not low - LIMIT_DIGITS * abs(low) <= q <= high + LIMIT_DIGITS * abs(high):
                raise file.refuse("joint", i, f"pose = {q:.6g}, beyond its range {low:.6g} to {high:.6g} "
                                  f"[{'m' if m.jnt_type[i] == SLIDE else 'rad, not degrees'}].", "pose")  # fmt: skip
