"""What a model has no place for is refused or said, and the forces in the pose are compared with MuJoCo's own."""

from __future__ import annotations

import numpy as np

from mbsvib.errors import ModelError
from mbsvib.mjcf.compiled import Compiled
from mbsvib.mjcf.scene import Scene

# Forces that are to agree with MuJoCo's, beside the largest of them.
SAME = 1e-9


def refuse_unknown(file: Compiled) -> None:
    """Refuse what has no place in a model of rigid bodies and linear springs.

    Parameters
    ----------
    file : Compiled
        The file.

    Raises
    ------
    ModelError
        If there is such an element, by its name.
    """
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
    """Refuse a file whose forces of springs and actuators at rest are not what was read.

    Parameters
    ----------
    scene : Scene
        The model, complete.

    Raises
    ------
    ModelError
        If they differ, by the joint.
    """
    file, d = scene.file, scene.file.d
    found = np.array(d.qfrc_spring) + np.array(d.qfrc_fluid) + np.array(d.qfrc_actuator)
    ours = file.d.qfrc_gravcomp * _by_actuators(file) + scene.felt
    size = max(np.abs(found).max(initial=0.0), np.abs(scene.felt).max(initial=0.0))
    off = np.abs(found - ours)
    if off.size and off.max() > SAME * size:
        i = int(off.argmax())
        raise file.refuse("joint", int(file.m.dof_jntid[i]), f"MuJoCo has {found[i]:.9g} N or N m of springs and "
                          f"actuators on it in this pose, and what was read makes {ours[i]:.9g}: something acts "
                          f"that has no place here, a limit of the forces of all actuators or wind.")  # fmt: skip


def _by_actuators(file: Compiled) -> np.ndarray:
    """One where weight is lifted by actuators, in whose sum it is then."""
    m = file.m
    return np.array([float(m.jnt_actgravcomp[j]) for j in m.dof_jntid])


def look_for_left(scene: Scene) -> None:
    """Note friction, drag, and the limits and contacts that touch in the pose.

    Parameters
    ----------
    scene : Scene
        The model; its remarks grow.
    """
    file, m, d, kinds = scene.file, scene.file.m, scene.file.d, scene.file.api.mjtConstraint
    if float(m.opt.viscosity):
        scene.remark("drag of the medium of", f"viscosity {float(m.opt.viscosity):g}")
    names: dict[int, tuple[str, str]] = {
        int(kinds.mjCNSTR_FRICTION_DOF): ("dry friction in", "dof"),
        int(kinds.mjCNSTR_FRICTION_TENDON): ("dry friction in", "tendon"),
        int(kinds.mjCNSTR_LIMIT_JOINT): ("limit that touches in this pose of", "joint"),
        int(kinds.mjCNSTR_LIMIT_TENDON): ("limit that touches in this pose of", "tendon"),
    }
    for row in range(int(d.nefc)):
        if int(d.efc_type[row]) not in names:
            continue
        what, kind = names[int(d.efc_type[row])]
        i = int(d.efc_id[row])
        name = file.name("joint", int(m.dof_jntid[i])) if kind == "dof" else file.name(kind, i)
        if f"'{name}'" not in scene.remarks.get(what, ()):
            scene.remark(what, f"'{name}'")
    for contact in range(int(d.ncon)):
        bodies = [file.name("body", int(m.geom_bodyid[int(geom)])) for geom in d.contact[contact].geom]
        pair = " with ".join(f"'{body}'" for body in bodies)
        if pair not in scene.remarks.get("contact in this pose of", ()):
            scene.remark("contact in this pose of", pair)
