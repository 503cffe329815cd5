"""Bodies and joints, with the springs, dampers and reflected inertia in joints, and sites as ports."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from mbsvib.common import arguments as check
from mbsvib.common.arrays import Array
from mbsvib.common.patterns import matching
from mbsvib.errors import ModelError
from mbsvib.mechanism.mechanism import GROUND
from mbsvib.mjcf.compiled import BALL, FREE, HINGE, SLIDE, Compiled, known
from mbsvib.mjcf.scene import Link, Scene
from mbsvib.urdf.groups import Group
from mbsvib.urdf.reading import Link as Mass
from mbsvib.urdf.robot import ALL

KINDS = {FREE: "free", BALL: "spherical", SLIDE: "prismatic", HINGE: "revolute"}
# Index of the joint's own direction among x y z rx ry rz.
OWN = {FREE: None, BALL: None, SLIDE: 2, HINGE: 5}
EFFORTS = ("Fx", "Fy", "Fz", "Mx", "My", "Mz")
# Rotations smaller than this are rounding of quaternions.
NO_TURN = 1e-12


def add_bodies(scene: Scene) -> None:
    """Add bodies and the joints between them, as they are in the pose."""
    file, m, d = scene.file, scene.file.m, scene.file.d
    groups = {0: Group(GROUND)}
    for i in range(1, m.nbody):
        moves = int(m.body_jntnum[i]) > 0
        groups[i] = Group(file.name("body", i)) if moves else groups[int(m.body_parentid[i])]
        axes = matrix_of(m.body_iquat[i], file)
        mass = Mass(groups[i].name, float(m.body_mass[i]), np.array(m.body_ipos[i]),
                    axes @ np.diag(m.body_inertia[i]) @ axes.T)  # fmt: skip
        groups[i].take(mass, np.array(d.xpos[i]), np.array(d.xmat[i]).reshape(3, 3))
    scene.bodies = {i: group.name for i, group in groups.items()}
    for group in dict.fromkeys(groups.values()):
        if group is not groups[0]:
            group.add(scene.model, file.path, 'Correct the file, or set <compiler balanceinertia="true"/>.')
    for i in range(1, m.nbody):
        if int(m.body_jntnum[i]):
            _add_joints(scene, i)
        lift = float(m.body_gravcomp[i])
        if lift and scene.model.gravity is not None and scene.bodies[i] != GROUND:
            force = -lift * float(m.body_mass[i]) * np.array(scene.model.gravity)
            name = scene.fresh(f"{file.name('body', i)}.gravcomp", "load")
            scene.model.add_load(name, scene.bodies[i], force, position=np.array(d.xipos[i]))


def matrix_of(quaternion: Array, file: Compiled) -> Array:
    """Return the rotation matrix of a quaternion (w, x, y, z)."""
    result = np.zeros(9)
    file.api.mju_quat2Mat(result, quaternion)
    return result.reshape(3, 3)


def _add_joints(scene: Scene, body: int) -> None:
    """Add the joints of a body, which act one after the other: between two of them is a body without mass."""
    file, m, d = scene.file, scene.file.m, scene.file.d
    first, start = scene.bodies[int(m.body_parentid[body])], int(m.body_jntadr[body])
    last = start + int(m.body_jntnum[body]) - 1
    for i in range(start, last + 1):
        kind, at = int(m.jnt_type[i]), np.array(d.xpos[body] if m.jnt_type[i] == FREE else d.xanchor[i])
        second = scene.bodies[body]
        if i < last:
            second = scene.fresh(f"{second}.{file.name('joint', i)}", "body")
            scene.model.add_body(second, 0.0, (0.0, 0.0, 0.0), at)
        name = scene.fresh(file.name("joint", i), "joint")
        scene.links[i] = Link(name, first, second, at, np.array(d.xaxis[i]), OWN[kind])
        first = second


def add_springs(scene: Scene, stiffness: Any, damping: Any) -> None:
    """Add joints with their springs and dampers: the file's, or those that the user gives."""
    file, m = scene.file, scene.file.m
    scalar = {file.name("joint", i): i for i in range(m.njnt) if OWN[int(m.jnt_type[i])] is not None}
    for field, argument in (("stiffness", stiffness), ("damping", damping)):
        for name in argument if isinstance(argument, Mapping) else ():
            if name not in scalar and name in file.names("joint"):
                raise ModelError(f"{field}: joint '{name}' is a ball or free joint; give hinges and slides only, and "
                                 f"model.add_bushing() afterwards.", element=name, field=field)  # fmt: skip
            if name != ALL:
                known(name, scalar, field, "hinge or slide")
    for i, link in scene.links.items():
        name = file.name("joint", i)
        k, force = _file_stiffness(scene, i)
        start = int(m.jnt_dofadr[i])
        scene.joint_forces[start : start + len(force)] += force
        c = 0.0 if file.off("DAMPER", "PASSIVE") else float(m.dof_damping[start]) + added(file, "joint", i, "damping")
        if link.direction is None:
            _add_wide(scene, i, k, c, force)
            continue
        own_k, own_c = _option(stiffness, name, "stiffness"), _option(damping, name, "damping")
        _add_scalar(scene, link, k if own_k is None else own_k, c if own_c is None else own_c,
                    float(force[0]) if own_k is None else 0.0)  # fmt: skip


def _file_stiffness(scene: Scene, i: int) -> tuple[float, Array]:
    """Stiffness of a joint's spring, and its force in the pose along MuJoCo's coordinates."""
    file, m = scene.file, scene.file.m
    kind, k = int(m.jnt_type[i]), float(m.jnt_stiffness[i])
    count = {FREE: 6, BALL: 3}.get(kind, 1)
    if k == 0.0 or file.off("SPRING", "PASSIVE"):
        return 0.0, np.zeros(count)
    at, start = file.position(i), int(m.jnt_qposadr[i])
    rest = np.array(m.qpos_spring[start : start + len(at)])
    force = np.zeros(count)
    if kind != BALL:
        straight = 3 if kind == FREE else 1
        force[:straight] = -k * (at - rest)[:straight]
    if kind in (FREE, BALL):
        turn = np.zeros(3)
        file.api.mju_subQuat(turn, at[-4:], rest[-4:])
        if np.linalg.norm(turn) > NO_TURN:
            force[-3:], name = -k * turn, file.name("joint", i)
            scene.remark("course beyond small motions from this pose of the turned spring in", f"'{name}'")
    return k, force


def _rotated_stiffness(k: float, turn: Array) -> Array:
    """Hessian (3, 3) of k/2 angle^2 of the rotation R exp(turn) relative to R, in its own axes.

    k (n n^T + (angle / 2) cot(angle / 2) (1 - n n^T)), n the axis of ``turn``.
    """
    angle = float(np.linalg.norm(turn))
    if angle <= NO_TURN:
        return k * np.eye(3)
    along = np.outer(turn, turn) / angle**2
    return np.asarray(k * (along + 0.5 * angle / np.tan(0.5 * angle) * (np.eye(3) - along)))


def _add_wide(scene: Scene, i: int, k: float, c: float, force: Array) -> None:
    """Add a ball or free joint: the ball in the axes of its body, the free joint in world axes."""
    m, d, link = scene.file.m, scene.file.d, scene.links[i]
    kind, body = int(m.jnt_type[i]), int(m.jnt_bodyid[i])
    axes = np.array(d.xmat[body]).reshape(3, 3) if kind == BALL else np.eye(3)
    scene.model.add_joint(link.name, KINDS[kind], link.first, link.second, link.at, axes)
    if not (k or c or force.any()):
        return
    moment = np.array(d.xmat[body]).reshape(3, 3) @ force[-3:]  # MuJoCo has it in the body's axes
    straight = float(kind == FREE)
    preload = np.concatenate((straight * force[:3], axes.T @ moment))
    matrix = np.zeros((6, 6))
    matrix[:3, :3] = straight * k * np.eye(3)
    matrix[3:, 3:] = _rotated_stiffness(k, preload[3:] / k if k else np.zeros(3))
    scene.model.add_bushing(scene.fresh(f"{link.name}.k", "spring"), link.first, link.second, link.at, matrix,
                            c * np.array((*[straight] * 3, 1.0, 1.0, 1.0)), axes,
                            preload if force.any() else None)  # fmt: skip


def _add_scalar(scene: Scene, link: Link, stiffness: Any, damping: Any, force: float) -> None:
    """Add a hinge or slide, with torque and angle, or force and travel."""
    assert link.direction is not None
    model, k, c = scene.model, np.ravel(stiffness), np.ravel(damping)
    axes = link.axes
    kind = "free" if max(len(k), len(c)) == 6 else "revolute" if link.direction == 5 else "prismatic"
    model.add_joint(link.name, kind, link.first, link.second, link.at, axes)
    if k.any() or c.any():
        model.add_bushing(scene.fresh(f"{link.name}.k", "spring"), link.first, link.second, link.at,
                          _six(k, link.direction), _six(c, link.direction), axes,
                          _six(np.array([force]), link.direction) if force else None)  # fmt: skip
    effort, motion = ("torque", "angle") if link.direction == 5 else ("force", "travel")
    model.add_input(f"{link.name}.{effort}", link.second, along(link), link.at, relative_to=link.first)
    model.add_output(f"{link.name}.{motion}", link.second, along(link), link.at, relative_to=link.first)


def along(link: Link, factor: float = 1.0) -> Array:
    """Return the direction of a joint's only freedom as a six-vector, times a factor."""
    zero, z = np.zeros(3), factor * link.z
    return np.concatenate((z, zero) if link.direction == 2 else (zero, z))


def _six(values: Array, direction: int) -> Array:
    result = np.zeros(6)
    result[slice(None) if len(values) == 6 else slice(direction, direction + 1)] = values
    return result


def _option(value: Any, name: str, field: str) -> Any:
    if isinstance(value, Mapping):
        value = value.get(name, value.get(ALL))
    if value is None:
        return None
    return check.numbers(np.ravel(value).tolist(), (1, 6), f"joint '{name}'", field, "one number, or six")


def added(file: Compiled, target: str, i: int, field: str) -> float:
    """Return the damping or armature that actuators add to a joint or tendon: theirs times the square of the gear."""
    m, total = file.m, 0.0
    if not hasattr(m, f"actuator_{field}"):
        return total
    requested = ("mjTRN_TENDON",) if target == "tendon" else ("mjTRN_JOINT", "mjTRN_JOINTINPARENT")
    kinds = [int(getattr(file.api.mjtTrn, kind)) for kind in requested]
    for a in range(file.count("actuator")):
        if int(m.actuator_trntype[a]) in kinds and int(m.actuator_trnid[a][0]) == i:
            gear = float(m.actuator_gear[int(m.actuator_outadr[a])][0])
            total += float(getattr(m, f"actuator_{field}")[a]) * gear**2
    return total


def add_armature(scene: Scene) -> None:
    """Add the reflected inertia of joints, which moves only with the joint."""
    m = scene.file.m
    for i, link in scene.links.items():
        inertia = float(m.dof_armature[int(m.jnt_dofadr[i])]) + added(scene.file, "joint", i, "armature")
        if inertia == 0.0:
            continue
        single = None if link.direction is None else link.coordinate
        wide = ("x", "y", "z", "rx", "ry", "rz") if m.jnt_type[i] == FREE else ("rx", "ry", "rz")
        for coordinate in (f"{link.name}.{axis}" for axis in wide) if single is None else (single,):
            name = f"{link.name}.armature" if single else f"{coordinate}.armature"
            scene.add_wheel(name, {coordinate: 1.0}, inertia, link)


def add_ports(scene: Scene, patterns: Sequence[str]) -> None:
    """Add forces on sites as inputs and their displacements as outputs."""
    file, m, model = scene.file, scene.file.m, scene.model
    names = {file.api.mj_id2name(m, file.api.mjtObj.mjOBJ_SITE, i): i for i in range(m.nsite)}
    names.pop(None, None)
    picked: set[str] = set()
    for pattern in patterns:
        found = matching(pattern, names)
        picked.update(found)
        if pattern != "*" and not found:
            raise check.unknown(pattern, names, f"sites: {pattern!r} is not a site of {file.path}", "sites", told="")
        if pattern in names and scene.bodies[int(m.site_bodyid[names[pattern]])] == GROUND:
            raise ModelError(f"sites: '{pattern}' is fixed to the ground; name a site that moves.", element=pattern,
                             field="sites")  # fmt: skip
    for name, i in names.items():
        body = scene.bodies[int(m.site_bodyid[i])]
        if body == GROUND or name not in picked:
            continue
        at = np.array(file.d.site_xpos[i])
        for direction, effort in zip(check.DIRECTIONS, EFFORTS, strict=True):
            model.add_input(f"{name}.{effort}", body, direction, at)
            model.add_output(f"{name}.{direction}", body, direction, at)
