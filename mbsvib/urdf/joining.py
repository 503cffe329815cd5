"""What a file has beside its tree, added to the model: joints that close loops, couplings, rotors and motors."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from mbsvib.elements.ports import Input
from mbsvib.errors import ModelError
from mbsvib.urdf.closing import coupled, ends
from mbsvib.urdf.loops import WITH_AXIS
from mbsvib.urdf.posing import KINDS
from mbsvib.urdf.wheels import add_wheel, fresh

if TYPE_CHECKING:
    from collections.abc import Mapping

    from mbsvib.api.model import Model
    from mbsvib.urdf.closing import Frames
    from mbsvib.urdf.groups import Group
    from mbsvib.urdf.reading import Robot


def add_loops(
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


def add_motors(model: Model, robot: Robot, labels: Mapping[str, str], frames: Frames) -> None:
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
