"""Actuators: motors are inputs, servos are spring-dampers whose set point is an input.

force = (g0 + g1 l + g2 l') u + b0 + b1 l + b2 l' along the length l, u being the control, or the actuator's own state.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from mbsvib.common.arrays import Array
from mbsvib.mechanism.mechanism import GROUND
from mbsvib.mjcf.bodies import matrix_of
from mbsvib.mjcf.compiled import BALL, FREE
from mbsvib.mjcf.scene import Scene
from mbsvib.mjcf.tendons import Path, attach, drive, joint_path

# MuJoCo's own force may differ from the formula by rounding only.
SAME = 1e-9
FORMULAS = ("mjGAIN_FIXED", "mjGAIN_AFFINE"), ("mjBIAS_NONE", "mjBIAS_AFFINE")
STATES = ("mjDYN_NONE", "mjDYN_INTEGRATOR", "mjDYN_FILTER", "mjDYN_FILTEREXACT")


def add_actuators(scene: Scene, tendons: Mapping[int, Path | None]) -> None:
    """Add all actuators that are not switched off."""
    file, m = scene.file, scene.file.m
    if file.off("ACTUATION"):
        return
    for i in range(file.count("actuator")):
        if 0 <= int(m.actuator_group[i]) <= 30 and int(m.opt.disableactuator) >> int(m.actuator_group[i]) & 1:
            continue
        gain, k, c, force = _linear(scene, i)
        name, gear = file.name("actuator", i), _gear(scene, i)
        path = _path(scene, i, tendons)
        if path is not None:
            attach(scene, scene.fresh(f"{name}.servo", "spring"), path, gear[0], k, c, force)
            if gain * gear[0] and _moves(scene, path):
                drive(scene, _free_input(scene, name), path, gain * gear[0])
        elif k or c or force:
            raise file.refuse("actuator", i, "acts on a site, or a ball or free joint, and not by a motor alone, which "
                              "has no place in a model.")  # fmt: skip
        elif gain:
            _drive_six(scene, i, gain * gear)


def _linear(scene: Scene, i: int) -> tuple[float, float, float, float]:
    """Gain, stiffness, damping and force of an actuator in the pose, along its length."""
    file, m, d = scene.file, scene.file.m, scene.file.d
    _refuse_kinds(scene, i)
    a = int(m.actuator_actadr[i])
    column = int(m.actuator_ctrladr[i]) if hasattr(m, "actuator_ctrladr") else i
    u = float(d.ctrl[column] if a < 0 else d.act[a])
    if a < 0 and m.actuator_ctrllimited[column] and not file.off("CLAMPCTRL"):
        u = float(np.clip(u, *m.actuator_ctrlrange[column]))
    row = _row(scene, i)
    length = float(d.actuator_length[row])
    g, b = np.array(m.actuator_gainprm[i][:3]), np.array(m.actuator_biasprm[i][:3])
    if m.actuator_gaintype[i] == file.api.mjtGain.mjGAIN_FIXED:
        g[1:] = 0.0
    if m.actuator_biastype[i] == file.api.mjtBias.mjBIAS_NONE:
        b[:] = 0.0
    gain = float(g[0] + g[1] * length)
    force, actual = gain * u + float(b[0] + b[1] * length), float(d.actuator_force[row])
    if abs(force - actual) > SAME * max(abs(gain * u), abs(b[0]), abs(b[1] * length)):
        raise file.refuse("actuator", i, f"its force in this pose is {actual:.6g} in MuJoCo and {force:.6g} by its "
                          f"gains: it is limited, or set by a turn more or less. Give a pose and a control where it "
                          f"is free.", "control")  # fmt: skip
    if a >= 0:
        scene.remark("dynamics of what drives the input", f"'{file.name('actuator', i)}'")
    if file.value("actuator_delay", i):
        scene.remark("delay of the control of", f"'{file.name('actuator', i)}'")
    return gain, -float(b[1] + g[1] * u), -float(b[2] + g[2] * u), force


def _refuse_kinds(scene: Scene, i: int) -> None:
    file, m, api = scene.file, scene.file.m, scene.file.api
    for value, allowed, enum, field in ((m.actuator_gaintype[i], FORMULAS[0], api.mjtGain, "gain"),
                                       (m.actuator_biastype[i], FORMULAS[1], api.mjtBias, "bias"),
                                       (m.actuator_dyntype[i], STATES, api.mjtDyn, "dynamics")):  # fmt: skip
        if int(value) not in [int(getattr(enum, constant)) for constant in allowed]:
            kind = str(enum(int(value))).rpartition("_")[2].lower()
            raise file.refuse("actuator", i, f"{field} of kind {kind}; motors, servos and dampers (fixed and affine "
                              f"gain and bias, no state, integrator or filter) are known here.")  # fmt: skip
    if int(m.actuator_plugin[i]) >= 0:
        raise file.refuse("actuator", i, "is computed by a plugin.")


def _row(scene: Scene, i: int) -> int:
    """Index of the actuator's force and length among those of all."""
    m = scene.file.m
    return int(m.actuator_outadr[i]) if hasattr(m, "actuator_outadr") else i


def _gear(scene: Scene, i: int) -> Array:
    return np.array(scene.file.m.actuator_gear[_row(scene, i)], dtype=float)


def _path(scene: Scene, i: int, tendons: Mapping[int, Path | None]) -> Path | None:
    """The path that the actuator extends; None if it acts on a site, or on a ball or free joint."""
    file, m, api = scene.file, scene.file.m, scene.file.api.mjtTrn
    kind, target = int(m.actuator_trntype[i]), int(m.actuator_trnid[i][0])
    if kind == api.mjTRN_TENDON:
        path = tendons[target]
        if path is None:
            raise file.refuse("actuator", i, f"its tendon '{file.name('tendon', target)}' goes by more than two sites, "
                              f"around a shape or by pulleys.")  # fmt: skip
        return path
    if kind in (api.mjTRN_JOINT, api.mjTRN_JOINTINPARENT):
        return None if m.jnt_type[target] in (BALL, FREE) else joint_path(scene, target)
    if kind == api.mjTRN_SITE and int(m.actuator_trnid[i][1]) < 0:
        return None
    transmission = "a site against another one" if kind == api.mjTRN_SITE else \
        str(api(kind)).rpartition("_")[2].lower()  # fmt: skip
    raise file.refuse("actuator", i, f"acts on {transmission}; joints, tendons and single sites are known here.")


def _moves(scene: Scene, path: Path) -> bool:
    return not path.ends or scene.bodies[path.ends[0][0]] != scene.bodies[path.ends[1][0]]


def _drive_six(scene: Scene, i: int, gear: Array) -> None:
    """A force and torque: in a site's axes; on a free joint the force in the world's, the torque in the body's."""
    file, m, d = scene.file, scene.file.m, scene.file.d
    target, name = int(m.actuator_trnid[i][0]), _free_input(scene, file.name("actuator", i))
    if m.actuator_trntype[i] == file.api.mjtTrn.mjTRN_SITE:
        axes, body = np.array(d.site_xmat[target]).reshape(3, 3), scene.bodies[int(m.site_bodyid[target])]
        six = np.concatenate((axes @ gear[:3], axes @ gear[3:]))
        if body != GROUND:
            scene.model.add_input(name, body, six, np.array(d.site_xpos[target]))
        return
    link, free = scene.links[target], m.jnt_type[target] == FREE
    axes = np.array(d.xmat[int(m.jnt_bodyid[target])]).reshape(3, 3)
    if m.actuator_trntype[i] != file.api.mjtTrn.mjTRN_JOINT:  # in the axes that the body has before the joint turns it
        axes = axes @ matrix_of(file.position(target)[-4:], file).T
    force, torque = (gear[:3], gear[3:]) if free else (np.zeros(3), gear[:3])
    scene.model.add_input(name, link.second, np.concatenate((force, axes @ torque)), link.at, relative_to=link.first)


def _free_input(scene: Scene, name: str) -> str:
    while name in scene.model.inputs:
        name = f"{name}.control"
    return name
