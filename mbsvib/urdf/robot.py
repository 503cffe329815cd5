"""Models of robots in any pose: bodies, joints, stiffness of joints, torques in and angles out."""

from __future__ import annotations

import warnings
from collections.abc import Iterable, Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from mbsvib.api.model import Model
from mbsvib.common import arguments as check
from mbsvib.common.tables import listed
from mbsvib.errors import AccuracyWarning, LeftOutWarning, ModelError, nearest
from mbsvib.mechanism.mechanism import GROUND
from mbsvib.urdf.extensions import in_words
from mbsvib.urdf.groups import Group
from mbsvib.urdf.reading import Hinge, Robot, moved, read

if TYPE_CHECKING:
    from os import PathLike

    from numpy.typing import ArrayLike

    from mbsvib.common.arrays import Array


REPAIR = 'Correct the file, or take the nearest possible one: load_urdf(..., inertia="repair"), or --inertia repair.'
ALL = "*"  # key of a mapping by joint: all joints that it does not name
# Joint of the model, and the direction along or about which its spring acts, by the joint of the file.
KINDS = {"revolute": ("revolute", 5), "continuous": ("revolute", 5), "prismatic": ("prismatic", 2)}


def load_urdf(
    path: str | PathLike[str], *, pose: Mapping[str, float] | None = None, stiffness: Any = 0.0, damping: Any = None,
    tip: str | None = None, floating: bool = False, gravity: ArrayLike | None = None, name: str | None = None,
    inertia: str = "as given",
) -> Model:  # fmt: skip
    """Read a robot from a URDF file, in a pose, with springs in its joints.

    Links that fixed joints hold together are one body, with name and axes of the first of them; those that hang on the
    root are the ground, unless the robot floats. Each joint has a torque or force as an input, ``JOINT.torque`` or
    ``JOINT.force``, and its motion as an output, ``JOINT.angle`` or ``JOINT.travel``. A spring-damper in a joint is the
    bushing ``JOINT.k``, z its axis. Joints that mimic others are coupled to them; one that mimics a fixed joint is held
    at its offset. A joint that has the name of a link becomes ``NAME.joint``.

    Shapes and limits are left. A ``LeftOutWarning`` names dry friction, springs of joints and other mechanics that
    simulators add, joints that move no mass, and a robot in which nothing with a mass moves. Elements that connect
    links beside the tree, such as loops, bushings and tendons, are refused: add them to the model after loading.

    Parameters
    ----------
    path : str or path-like
        The file; xacro has to be expanded.
    pose : mapping of str to float, optional
        Positions of joints [rad, m]; default: 0, or that of a mimic.
    stiffness : float, array-like of shape (6,), or mapping of str to these
        Of all joints, or by joint, "*" being all others: one number about or along the axis [N m/rad, N/m]; six values
        x y z rx ry rz, z along the axis, where bearings give way too: the joint is then free in all directions, held by
        the bushing.
    damping : float, array-like of shape (6,), or mapping of str to these, optional
        Likewise [N m s/rad, N s/m]; default: as in the file. A planar or floating joint takes six values of either;
        damping that the file gives it is left out with a ``LeftOutWarning``.
    tip : str, optional
        A link whose frame gets forces ``TIP.Fx`` ... ``TIP.Mz`` as inputs and displacements ``TIP.x`` ... ``TIP.rz``.
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

    Returns
    -------
    Model
        The robot.

    Raises
    ------
    ModelError
        If the file is no URDF, is not expanded or has loops, or a name or value is refused.
    """
    if inertia not in ("as given", "repair"):
        raise ModelError(f'inertia = {inertia!r}; expected "as given" or "repair".', field="inertia")
    robot = read(path)
    _known("pose", pose or {}, robot)
    frames = _link_frames(robot, _positions(robot, pose or {}))
    model = Model(robot.name if name is None else name, gravity)
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
    if tip is not None:
        _add_tip(model, tip, groups, frames)
    if left := {**robot.left, **_left_of_joints(robot, damping)}:
        warnings.warn(f"{path}: left out: {in_words(left)}.", LeftOutWarning, stacklevel=2)
    return model


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
    for link in reversed(list(frames)):
        if link in heavy and link in joint_of:
            heavy.add(joint_of[link].parent)
    return [repr(joint.name) for joint in robot.joints.values() if joint.kind != "fixed" and joint.child not in heavy]


def _is_vague(model: Model, group: Group) -> bool:
    """Whether rounding leaves no digit of a principal moment of inertia, or all of them are zero."""
    xx, yy, zz, xy, xz, yz = model.bodies[group.name].inertia
    moments = np.linalg.eigvalsh(np.array(((xx, xy, xz), (xy, yy, yz), (xz, yz, zz))))
    return bool(moments[0] <= group.rounding if group.rounding else moments[2] <= group.cancelled)


def _groups(robot: Robot, frames: dict[str, tuple[Array, Array]], floating: bool) -> dict[str, Group]:
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


def _positions(robot: Robot, pose: Mapping[str, float]) -> dict[str, float]:
    """Positions of all joints; a joint that mimics another one follows it."""
    result: dict[str, float] = {}
    for name in robot.joints:
        factor, offset, leader = 1.0, 0.0, name
        while leader not in pose and (mimic := robot.joints[leader].mimic) is not None:
            factor, offset, leader = factor * mimic.factor, offset + factor * mimic.offset, mimic.joint
        result[name] = offset + factor * check.number(pose.get(leader, 0.0), f"joint '{leader}'", "pose")
    return result


def _link_frames(robot: Robot, positions: dict[str, float]) -> dict[str, tuple[Array, Array]]:
    """World position and axes of each link's frame, parents before children."""
    children: dict[str, list[Hinge]] = {}
    for joint in robot.joints.values():
        children.setdefault(joint.parent, []).append(joint)
    frames = {robot.root: (np.zeros(3), np.eye(3))}
    stack = [robot.root]
    while stack:
        link = stack.pop()
        origin, axes = frames[link]
        for joint in reversed(children.get(link, [])):
            q = positions[joint.name]
            if q and joint.kind not in KINDS:
                raise ModelError(f"joint '{joint.name}': pose = {q:g}, but a {joint.kind} joint has no position of its "
                                 f"own.", element=joint.name, field="pose")  # fmt: skip
            at, joint_axes = moved(joint, q)
            frames[joint.child] = (origin + axes @ at, axes @ joint_axes)
            stack.append(joint.child)
    return frames


def _add(
    model: Model, name: str, joint: Hinge, groups: dict[str, Group], frames: dict[str, tuple[Array, Array]],
    stiffness: Any, damping: Any,
) -> None:  # fmt: skip
    first, second = groups[joint.parent].name, groups[joint.child].name
    at, axes = frames[joint.child]
    z = axes @ joint.axis
    frame = np.array(check.frame_along(check.axis(tuple(z), joint.name, "axis")))
    k, c = np.ravel(stiffness).astype(float), np.ravel(damping).astype(float)
    kind, direction = KINDS.get(joint.kind, ("planar" if joint.kind == "planar" else "free", None))
    for field, values in (("stiffness", k), ("damping", c)):
        if direction is None and len(values) == 1 and values.any():
            raise ModelError(f"joint '{joint.name}': a {joint.kind} joint takes six values of {field}, x y z rx ry rz, "
                             f"not one.", element=joint.name, field=field)  # fmt: skip
    if max(len(k), len(c)) == 6:
        kind = "free"
    model.add_joint(name, kind, first, second, at, orientation=frame)
    if k.any() or c.any():
        model.add_bushing(f"{name}.k", first, second, at, _six(k, direction), _six(c, direction), frame)
    if direction is not None:
        along = (0.0, 0.0, 0.0, *z) if direction == 5 else (*z, 0.0, 0.0, 0.0)
        effort, motion = ("torque", "angle") if direction == 5 else ("force", "travel")
        model.add_input(f"{name}.{effort}", second, along, at, relative_to=first)
        model.add_output(f"{name}.{motion}", second, along, at, relative_to=first)


def _six(values: Array, direction: int | None) -> Array:
    if len(values) == 6:
        return values
    result = np.zeros(6)
    if direction is not None:
        result[direction] = values[0]
    return result


def _add_tip(model: Model, tip: str, groups: dict[str, Group], frames: dict[str, tuple[Array, Array]]) -> None:
    if tip not in frames:
        raise ModelError(f"tip = {tip!r} is no link.{nearest(tip, frames)}", element=tip, field="tip")
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
            raise ModelError(f"{field}: {name!r} is no joint that moves.{nearest(str(name), moving)} There are "
                             f"{', '.join(moving)}.", element=str(name), field=field)  # fmt: skip
