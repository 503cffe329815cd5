"""Models of robots in any pose: bodies, joints, stiffness of joints, torques in and angles out."""

from __future__ import annotations

import warnings
from collections.abc import Iterable, Mapping
from os import PathLike
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from mbsvib.api.model import Model
from mbsvib.common import arguments as check
from mbsvib.common.arrays import Array
from mbsvib.common.expected import names, one_of
from mbsvib.common.tables import listed
from mbsvib.elements.ports import Input
from mbsvib.errors import AccuracyWarning, LeftOutWarning, ModelError
from mbsvib.mechanism.mechanism import GROUND
from mbsvib.mechanism.unit_warnings import with_angles
from mbsvib.urdf.closing import Frames, coupled, ends
from mbsvib.urdf.extended import beside, extended
from mbsvib.urdf.extensions import in_words
from mbsvib.urdf.groups import Group
from mbsvib.urdf.loops import WITH_AXIS
from mbsvib.urdf.motion import Hinge
from mbsvib.urdf.posing import KINDS, frames_in_pose
from mbsvib.urdf.reading import Robot, read
from mbsvib.urdf.wheels import add_wheel, fresh

REPAIR = 'Correct the file, or take the nearest possible one: load_urdf(..., inertia="repair"), or --inertia repair.'
ALL = "*"  # key of a mapping by joint: all joints that it does not name
# Kinds of the model of joints with several coordinates, and the directions about which one number of stiffness acts.
OTHERS: dict[str, tuple[str, tuple[int, ...]]] = {"planar": ("planar", ()), "floating": ("free", ()),
                                                  "spherical": ("spherical", (3, 4, 5)),
                                                  "universal": ("universal", (3, 4))}  # fmt: skip


def load_urdf(
    path: str | PathLike[str], *, pose: Mapping[str, float] | None = None, stiffness: Any = 0.0, damping: Any = None,
    tip: str | Iterable[str] | None = None, floating: bool = False, gravity: ArrayLike | None = None,
    name: str | None = None, inertia: str = "as given", loops: str | PathLike[str] | None = None,
) -> Model:  # fmt: skip
    """Read a robot from a URDF file, in a pose, with springs in its joints.

    Links that fixed joints hold together are one body, with name and axes of the first of them; those that hang on the
    root are the ground, unless the robot floats. Each joint has a torque or force as an input, ``JOINT.torque`` or
    ``JOINT.force``, and its motion as an output, ``JOINT.angle`` or ``JOINT.travel``. A spring-damper in a joint is the
    bushing ``JOINT.k``, z its axis. Joints that mimic others are coupled to them; one that mimics a fixed joint is held
    at its offset. A joint that has the name of a link becomes ``NAME.joint``. Rotors and ``armature`` are inertia of a
    joint alone; a motor with a ratio N has its own torque or force as an input, ``MOTOR.torque`` or ``MOTOR.force``,
    which acts N times on its joint.

    Loops are read in three dialects: ``<constraint>`` as proposed to urdfdom, ``<loop>`` and ``<coupling>`` of URDF+,
    and the YAML file of Extended URDF, ``loops``. Each is an ideal joint of the file's name (of a YAML, of its first
    frame), a coupling is a coupler. Loops that are open are closed by Newton's method from the pose: joints that
    ``pose`` names are held, the others move as little as that takes, by the sum of squares [rad, sizes].

    Shapes are left. A ``LeftOutWarning`` names dry friction, springs of joints and other mechanics that simulators add,
    joints that move no mass, joints beyond their limits, and a robot in which nothing with a mass moves. Other elements
    that connect links beside the tree, such as bushings and tendons, are refused: add them to the model after loading.

    Parameters
    ----------
    path : str or path-like
        The file; xacro has to be expanded.
    pose : mapping of str to float, optional
        Positions of joints [rad, m]; default: 0, or that of a mimic, or what closes the loops. A joint that mimics
        another one places that one. Positions beyond the limits of the file, or against its mimics, are refused.
    stiffness : float, array-like of shape (6,), or mapping of str to these
        Of all joints, or by joint, "*" being all others: one number about or along the axis [N m/rad, N/m]; six values
        x y z rx ry rz, z along the axis, where bearings give way too: the joint is then free in all directions, held by
        the bushing. One number of a spherical or universal joint acts about all its axes.
    damping : float, array-like of shape (6,), or mapping of str to these, optional
        Likewise [N m s/rad, N s/m]; default: as in the file. A planar or floating joint takes six values of either;
        damping that the file gives it is left out with a ``LeftOutWarning``.
    tip : str or iterable of str, optional
        Links whose frames get forces ``TIP.Fx`` ... ``TIP.Mz`` as inputs and displacements ``TIP.x`` ... ``TIP.rz``;
        also links that are part of a body of another name.
    floating : bool
        Whether the root link moves freely; default: it is fixed to the ground.
    gravity : array-like, shape (3,), optional
        As for a model. The pose has to be in balance with it: see ``Model.equilibrium``, or preload the bushings.
    name : str, optional
        Name of the model; default: the robot's.
    inertia : {"as given", "repair"}
        What is done with a body whose inertia no body can have: it is refused, or replaced by the nearest possible one
        with an ``AccuracyWarning``. What rounding to six printed digits, or to printed decimals as of ``%f``, explains
        is always replaced. An ``AccuracyWarning`` names bodies of which such rounding leaves no digit of a moment.
    loops : str or path-like, optional
        A YAML file of Extended URDF with ``closed_loop``; one of the file's name beside it is warned of if not given.

    Returns
    -------
    Model
        The robot.

    Raises
    ------
    ModelError
        If the file is no URDF or is not expanded, a name or value is refused, or loops cannot be closed: which one, by
        how much it is open, and what joints of ``pose`` hold it open.
    """
    one_of(inertia, ("as given", "repair"), "load_urdf", "inertia", ModelError)
    robot = read(path)
    if loops is not None:
        robot = extended(robot, loops)
    elif (other := beside(path)) is not None:
        warnings.warn(f"{path}: {other} beside it has closed loops, which are not read; give it by loops= (--loops).",
                      LeftOutWarning, stacklevel=2)  # fmt: skip
    _known("pose", pose or {}, robot)
    frames = frames_in_pose(robot, pose or {}, path)
    angles = {f"{joint}.rz": q for joint, q in (pose or {}).items() if robot.joints[joint].kind != "prismatic"}
    model = with_angles(Model(robot.name if name is None else name, gravity), angles)
    groups = _groups(robot, frames, floating)
    moving = [group for group in dict.fromkeys(groups.values()) if group.name != GROUND]
    if repaired := [group.name for group in moving if group.add(model, path, REPAIR, inertia == "repair")]:
        warnings.warn(f"{path}: no body can have the inertia of {', '.join(map(repr, repaired))}; the nearest possible "
                      f"one is taken.", AccuracyWarning, stacklevel=2)  # fmt: skip
    if vague := [repr(group.name) for group in moving if group.mass and _is_vague(model, group)]:
        warnings.warn(f"{path}: inertia is zero, or not larger than the rounding of its printed decimals: "
                      f"{listed(vague)}. Motions that need it are inaccurate; write the moments with more digits, as "
                      f"'%.9g' does.", AccuracyWarning, stacklevel=2)  # fmt: skip
    if not any(group.mass for group in moving):
        way = "give the links <inertial> elements" if floating or model.bodies else "pass floating=True (--floating)"
        warnings.warn(f"{path}: nothing with a mass moves: {len(robot.links)} links, {len(model.bodies)} bodies. Check "
                      f"the file, or {way}.", LeftOutWarning, stacklevel=2)  # fmt: skip
    elif idle := _idle(robot, frames):
        warnings.warn(f"{path}: no mass moves with {listed(idle)}. Give the links behind <inertial> elements, or make "
                      f"these joints fixed ones.", LeftOutWarning, stacklevel=2)  # fmt: skip
    labels = {name: f"{name}.joint" if name in model.bodies else name for name in robot.joints}
    for joint in robot.joints.values():
        if joint.kind != "fixed":
            _add(model, labels[joint.name], joint, groups, frames, _of(stiffness, joint, robot, "stiffness", 0.0),
                 _of(damping, joint, robot, "damping", joint.damping if joint.kind in KINDS else 0.0))  # fmt: skip
    for joint in robot.joints.values():
        if joint.mimic is not None:
            follower, leader = labels[joint.name], labels[joint.mimic.joint]
            model.add_coupler(f"{follower}.mimic", {follower: 1.0, leader: -joint.mimic.factor})
    within = _add_loops(model, robot, groups, frames, labels)
    _add_motors(model, robot, labels, frames)
    for link in names(() if tip is None else tip, "load_urdf", "tip", ModelError):
        _add_tip(model, link, groups, frames)
    if robot.taken:
        warnings.warn(f"{path}: taken as meant: {', '.join(robot.taken)}.", LeftOutWarning, stacklevel=2)
    if robot.independent and (robot.loops or robot.couplings):  # without them all joints are
        marked = [f"{part.name}.{word}" for name in robot.independent if (part := model.joints.get(labels[name]))
                  for word, _ in part.freedom]  # fmt: skip
        warnings.warn(f"{path}: joints are marked as independent, which a model does not keep: "
                      f"linearize(independent={marked}) takes them as coordinates, linearize() chooses.",
                      LeftOutWarning, stacklevel=2)  # fmt: skip
    if left := {**robot.left, **_left_of_joints(robot, damping), **within}:
        warnings.warn(f"{path}: left out: {in_words(left)}.", LeftOutWarning, stacklevel=2)
    return model


def _add_loops(
    model: Model, robot: Robot, groups: Mapping[str, Group], frames: Frames, labels: Mapping[str, str]
) -> dict[str, list[str]]:
    """Add the joints that close loops, each at the mean of its two frames, and couplings; return loops within one body.

    ``labels`` are the names in the model of the joints of the tree.
    """
    within: dict[str, list[str]] = {}
    for loop in robot.loops:
        first, second = (groups[link].name for link in loop.links)
        if first == second:
            within.setdefault("joints within one body:", []).append(f"'{loop.name}'")
            continue
        (p1, a1), (p2, a2) = ends(loop, frames)
        axes: dict[str, Any] = {}
        if loop.kind == "universal":
            axes = {"axis": a1 @ loop.axis, "axis2": a2 @ loop.axis2}
        elif loop.kind in WITH_AXIS:
            axes = {"axis": a1 @ loop.axis + a2 @ loop.axis}
        model.add_joint(fresh(model, loop.name, "joint"), loop.kind, first, second, 0.5 * (p1 + p2), **axes)
    for part in robot.couplings:
        terms = coupled(robot, part.links, part.ratio)
        if len(terms) < 2 or any(robot.joints[name].kind not in KINDS for name in terms):
            raise ModelError(f"coupling '{part.name}' of '{part.links[0]}' and '{part.links[1]}' ties "
                             f"{', '.join(terms) or 'no joint'}; expected two or more revolute or prismatic joints.",
                             element=part.name, field="links")  # fmt: skip
        model.add_coupler(part.name, {labels[name]: ratio for name, ratio in terms.items()})
    return within


def _add_motors(model: Model, robot: Robot, labels: Mapping[str, str], frames: Frames) -> None:
    """Add reflected inertia of rotors, which moves with its joint alone, and the inputs of motors with a ratio."""
    points = np.array([frame[0] for frame in frames.values()])
    size = float(np.linalg.norm(np.ptp(points, axis=0))) or 1.0
    for name, joint in robot.joints.items():
        if joint.armature and joint.kind in KINDS:
            part = model.joints[labels[name]]
            coordinate = f"{part.name}.{'rz' if KINDS[joint.kind][1] == 5 else 'z'}"
            add_wheel(model, f"{part.name}.armature", {coordinate: 1.0}, joint.armature, frames[joint.child][0],
                      part.axes, size)  # fmt: skip
    for motor in robot.motors:
        effort = "force" if robot.joints[motor.joint].kind == "prismatic" else "torque"
        source = model.inputs.get(f"{labels[motor.joint]}.{effort}")
        own = f"{motor.name}.{effort}"
        if isinstance(source, Input) and motor.ratio != 1.0 and motor.name and own not in model.inputs:
            model.add_input(own, source.body, motor.ratio * np.array(source.direction), source.position,
                            relative_to=source.relative_to)  # fmt: skip


def _left_of_joints(robot: Robot, damping: Any) -> dict[str, list[str]]:
    """Joints with friction, and those with a damping in the file that has no direction and is not given otherwise."""
    moving = [joint for joint in robot.joints.values() if joint.kind != "fixed"]
    rubbing = [joint for joint in moving if joint.friction]
    damped = [joint for joint in moving if joint.damping and joint.kind not in KINDS
              and _of(damping, joint, robot, "damping", None) is None]  # fmt: skip
    names = {"dry friction in": rubbing, "damping in all directions of": damped}
    return {what: [repr(joint.name) for joint in joints] for what, joints in names.items() if joints}


def _idle(robot: Robot, frames: Iterable[str]) -> list[str]:
    """Joints behind which nothing has a mass or an inertia; ``frames`` are the links, parents before children."""
    joint_of = {joint.child: joint for joint in robot.joints.values()}
    heavy = {name for name, link in robot.links.items() if link.mass or link.inertia.any()}
    heavy.update(link for loop in robot.loops for link in loop.links)  # by the loop they move others
    for link in reversed(list(frames)):
        if link in heavy and link in joint_of:
            heavy.add(joint_of[link].parent)
    return [repr(joint.name) for joint in robot.joints.values() if joint.kind != "fixed" and joint.child not in heavy]


def _is_vague(model: Model, group: Group) -> bool:
    """Whether rounding leaves no digit of a principal moment of inertia, or all of them are zero."""
    xx, yy, zz, xy, xz, yz = model.bodies[group.name].inertia
    moments = np.linalg.eigvalsh(np.array(((xx, xy, xz), (xy, yy, yz), (xz, yz, zz))))
    return bool(moments[0] <= group.rounding if group.rounding else moments[2] <= group.cancelled)


def _groups(robot: Robot, frames: Frames, floating: bool) -> dict[str, Group]:
    """The group of each link, by the link's name; ``frames`` has parents before children."""
    joint_of = {joint.child: joint for joint in robot.joints.values()}
    groups: dict[str, Group] = {}
    for link in frames:
        joint = joint_of.get(link)
        if joint is None:
            groups[link] = Group(link if floating else GROUND)
        else:
            groups[link] = groups[joint.parent] if joint.kind == "fixed" else Group(link)
        groups[link].take(robot.links[link], *frames[link])
    return groups


def _add(
    model: Model, name: str, joint: Hinge, groups: dict[str, Group], frames: Frames,
    stiffness: Any, damping: Any,
) -> None:  # fmt: skip
    first, second = groups[joint.parent].name, groups[joint.child].name
    at, axes = frames[joint.child]
    z = axes @ joint.axis
    frame = np.array(check.frame_along(check.axis(tuple(z), joint.name, "axis")))
    k, c = np.ravel(stiffness).astype(float), np.ravel(damping).astype(float)
    kind, about = OTHERS.get(joint.kind) or (KINDS[joint.kind][0], KINDS[joint.kind][1:])
    for field, values in (("stiffness", k), ("damping", c)):
        if not about and len(values) == 1 and values.any():
            raise ModelError(f"joint '{joint.name}': a {joint.kind} joint takes six values of {field}, x y z rx ry rz, "
                             f"not one.", element=joint.name, field=field)  # fmt: skip
    if max(len(k), len(c)) == 6:
        kind = "free"
    if kind == "universal":
        first_axis = frames[joint.parent][1] @ joint.axes @ joint.axis
        part = model.add_joint(name, kind, first, second, at, axis=first_axis, axis2=axes @ joint.axis2)
        frame = np.array(part.axes)
    else:
        model.add_joint(name, kind, first, second, at, orientation=frame)
    if k.any() or c.any():
        model.add_bushing(f"{name}.k", first, second, at, _six(k, about), _six(c, about), frame)
    if joint.kind in KINDS:
        direction = about[0]
        along = (0.0, 0.0, 0.0, *z) if direction == 5 else (*z, 0.0, 0.0, 0.0)
        effort, motion = ("torque", "angle") if direction == 5 else ("force", "travel")
        model.add_input(f"{name}.{effort}", second, along, at, relative_to=first)
        model.add_output(f"{name}.{motion}", second, along, at, relative_to=first)


def _six(values: Array, directions: tuple[int, ...]) -> Array:
    if len(values) == 6:
        return values
    result = np.zeros(6)
    result[list(directions)] = values[0]
    return result


def _add_tip(model: Model, tip: str, groups: dict[str, Group], frames: Frames) -> None:
    check.known(tip, frames, f"tip = {tip!r} is not a link", "tip", "")
    body = groups[tip].name
    if body == GROUND:
        raise ModelError(f"tip = {tip!r} is fixed to the ground; name a link that moves.", element=tip, field="tip")
    for direction, effort in zip(check.DIRECTIONS, ("Fx", "Fy", "Fz", "Mx", "My", "Mz"), strict=True):
        model.add_input(f"{tip}.{effort}", body, direction, frames[tip][0])
        model.add_output(f"{tip}.{direction}", body, direction, frames[tip][0])


def _of(value: Any, joint: Hinge, robot: Robot, field: str, default: float | None) -> Any:
    """One number or six for a joint."""
    if isinstance(value, Mapping):
        _known(field, value, robot)
        value = value.get(joint.name, value.get(ALL))
    if value is None:
        return default
    values = check.numbers(np.ravel(value).tolist(), (1, 6), f"joint '{joint.name}'", field, "one number, or six")
    return values if len(values) == 6 else values[0]


def _known(field: str, by_joint: Mapping[str, Any], robot: Robot) -> None:
    moving = [name for name, joint in robot.joints.items() if joint.kind != "fixed"]
    for name in by_joint:
        if name not in moving and (name != ALL or field == "pose"):
            raise check.unknown(name, moving, f"{field}: {name!r} is not a joint that moves", field, "There are")
