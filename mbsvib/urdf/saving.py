"""Models to URDF files: a tree of joints, loops as constraints, what URDF cannot say refused by name."""

from __future__ import annotations

import warnings
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from math import atan2
from os import PathLike
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np

from mbsvib.api.model import Model
from mbsvib.common.arrays import Array
from mbsvib.common.atomic_file import write_atomic
from mbsvib.common.expected import a_model, names
from mbsvib.common.patterns import matching
from mbsvib.common.tables import listed
from mbsvib.elements import Joint
from mbsvib.elements.bushing import Bushing
from mbsvib.elements.coupler import Coupling
from mbsvib.errors import LeftOutWarning, ModelError
from mbsvib.linalg.rank import ALIGNED
from mbsvib.linalg.rotations import exponential
from mbsvib.mechanism.mechanism import GROUND

# Words of URDF for joints of the tree, by kinds of the model; of constraints, and of the loop that has none.
TREE = {"revolute": "continuous", "prismatic": "prismatic", "planar": "planar", "fixed": "fixed", "free": "floating"}
CLOSING = {"revolute": "revolute_joint", "prismatic": "prismatic_joint", "universal": "universal_joint",
           "spherical": "spherical_joint", "fixed": "link", "planar": "planar"}  # fmt: skip
# Groups of parts that are written, or warned of.
WRITTEN = ("bodies", "joints", "inputs", "outputs")
# Index of the coordinate of a joint among x y z rx ry rz, and its ports when it is read again.
OWN = {"revolute": (5, "rz", "torque", "angle"), "prismatic": (2, "z", "force", "travel")}
# Other readers require limits of prismatic joints: beyond any robot.
UNLIMITED = {"lower": "-1e6", "upper": "1e6", "effort": "1e6", "velocity": "1e6"}


def save_urdf(model: Model, path: str | PathLike[str], *, leave: Sequence[str] = ()) -> Path:
    """Write a model as a URDF file in the pose in which it is described; ``load_urdf`` gives back the same equations.

    The ground is the link ``world``; bodies that hang on it by no joint float. Joints that close loops are
    ``<constraint>``, planar ones ``<loop>`` of URDF+. Dampers in revolute and prismatic joints become ``<dynamics>``,
    couplers of two of these ``<mimic>``. Links have the axes of the bodies. Numbers have all digits. Positions of all
    joints are zero in the pose of the model. Gravity, and inputs and outputs other than those of joints, have no place
    in a URDF and are named by a ``LeftOutWarning``.

    Parameters
    ----------
    model : Model
        The model.
    path : str or path-like
        Where to; a file that is there is replaced once the new one is complete.
    leave : sequence of str
        Names or patterns of springs, loads, couplers, rotors, beams and superelements to leave out. A URDF has no
        stiffness: ``leave=["*.k"]``, and ``load_urdf(..., stiffness=...)``.

    Returns
    -------
    Path
        The path written.

    Raises
    ------
    ModelError
        If a part has no place in a URDF and is not left out, or the file cannot be written.
    """
    a_model(model, "save_urdf")
    patterns = names(leave, "save_urdf", "leave", ModelError)
    text = ElementTree.tostring(_robot(model, patterns), encoding="utf-8", xml_declaration=True)
    return write_atomic(path, lambda stream: stream.write(text), ModelError)


@dataclass(slots=True, eq=False)
class _Tree:
    """Frames (origin, axes) of links by body; joints of the tree by the body that they carry."""

    frames: dict[str, tuple[Array, Array]]
    parent_joint: dict[str, Joint] = field(default_factory=dict)


def _robot(model: Model, leave: Sequence[str]) -> ElementTree.Element:
    tree = _tree(model)
    in_tree = {joint.name for joint in tree.parent_joint.values()}
    damping, mimics = _refused_or_said(model, leave, in_tree)
    root = "world"
    while root in model.bodies:
        root += ".ground"
    links = {GROUND: root} | {name: name for name in model.bodies}
    top = ElementTree.Element("robot", name=model.name)
    ElementTree.SubElement(top, "link", name=root)
    for name, body in model.bodies.items():
        origin, axes = tree.frames[name]
        inertial = ElementTree.SubElement(ElementTree.SubElement(top, "link", name=name), "inertial")
        ElementTree.SubElement(inertial, "origin", xyz=_text(axes.T @ (np.array(body.position) - origin)))
        ElementTree.SubElement(inertial, "mass", value=repr(float(body.mass)))
        entries = dict(zip(("ixx", "iyy", "izz", "ixy", "ixz", "iyz"), body.inertia, strict=True))
        ElementTree.SubElement(inertial, "inertia", {key: repr(float(value)) for key, value in entries.items()})
    by_joint = {joint.name: (name, joint) for name, joint in tree.parent_joint.items()}
    moving: list[tuple[str, Joint | None]] = [by_joint[name] for name in model.joints if name in by_joint]
    moving += [(name, None) for name in model.bodies if name not in tree.parent_joint]
    for name, joint in moving:
        parent = GROUND if joint is None else joint.first if joint.second == name else joint.second
        label = f"{name}.floating" if joint is None else joint.name
        kind = "floating" if joint is None else TREE[joint.kind]
        element = ElementTree.SubElement(top, "joint", name=label, type=kind)
        ElementTree.SubElement(element, "parent", link=links[parent])
        ElementTree.SubElement(element, "child", link=name)
        _origin(element, "origin", tree.frames[parent], tree.frames[name])
        if joint is not None and kind != "fixed":
            sign = 1.0 if joint.second == name else -1.0
            z = sign * tree.frames[name][1].T @ np.array(joint.axes)[:, 2]
            ElementTree.SubElement(element, "axis", xyz=_text(z))
        if label in damping:
            ElementTree.SubElement(element, "dynamics", damping=repr(damping[label]))
        if kind == "prismatic":
            ElementTree.SubElement(element, "limit", UNLIMITED)
        if label in mimics:
            leader, factor = mimics[label]
            ElementTree.SubElement(element, "mimic", joint=leader, multiplier=repr(factor), offset="0")
    for joint in model.joints.values():
        if joint.name not in in_tree:
            _add_closing(top, joint, tree.frames, links)
    ElementTree.indent(top)
    return top


def _tree(model: Model) -> _Tree:
    """The joints that URDF has, from the ground outwards, in the order of the model; bodies left over float."""
    tree = _Tree({GROUND: (np.zeros(3), np.eye(3))})
    usable = [joint for joint in model.joints.values() if joint.free is None and joint.kind in TREE]
    start = [GROUND]
    for body in (None, *model.bodies):
        if body is not None:
            if body in tree.frames:
                continue
            part = model.bodies[body]
            tree.frames[body] = np.array(part.position), np.array(part.orientation)
            start = [body]
        for reached in start:  # grows
            for joint in usable:
                for one, other in ((joint.first, joint.second), (joint.second, joint.first)):
                    if one == reached and other not in tree.frames:
                        part = model.bodies[other]
                        at = part.position if joint.position is None else joint.position
                        tree.frames[other] = np.array(at), np.array(part.orientation)
                        tree.parent_joint[other] = joint
                        start.append(other)
    return tree


def _add_closing(
    top: ElementTree.Element, joint: Joint, frames: Mapping[str, tuple[Array, Array]], links: Mapping[str, str]
) -> None:
    loop = joint.kind == "planar"
    ends = joint.first, joint.second
    at = np.array(joint.position if joint.position is not None else frames[ends[1]][0])
    element = ElementTree.SubElement(top, "loop" if loop else "constraint", name=joint.name, type=CLOSING[joint.kind])
    for role, new, body in zip(("parent", "child"), ("predecessor", "successor"), ends, strict=True):
        part = ElementTree.SubElement(element, new if loop else role, link=links[body])
        # both frames are in the world's axes, where they coincide
        _origin(part if loop else element, "origin" if loop else f"{role}_origin", frames[body], (at, np.eye(3)))
    if joint.kind == "universal":
        for role, axis in zip(("parent", "child"), joint.rotation_axes, strict=True):
            ElementTree.SubElement(element, f"{role}_axis", xyz=_text(axis))
    elif joint.kind in ("revolute", "prismatic", "planar"):
        ElementTree.SubElement(element, "axis" if loop else "parent_axis", xyz=_text(np.array(joint.axes)[:, 2]))


def _refused_or_said(
    model: Model, leave: Sequence[str], in_tree: set[str]
) -> tuple[dict[str, float], dict[str, tuple[str, float]]]:
    """Damping and mimics by joint; parts without a place in URDF are refused, ports without one are warned of."""
    damping: dict[str, float] = {}
    mimics: dict[str, tuple[str, float]] = {}
    homeless = [f"hub '{name}'" for name in model.hubs]
    homeless += [f"joint '{joint.name}' ({joint.kind})" for joint in model.joints.values() if joint.name not in in_tree
                 and (joint.free is not None or joint.kind not in CLOSING)]  # fmt: skip
    known = [name for group in model.groups().values() for name in group]
    left_out = {name for pattern in leave for name in matching(pattern, known)}
    for key, group in model.groups().items():
        for name, part in {} if key in WRITTEN else group.items():
            if name not in left_out and not _said(part, model, in_tree, damping, mimics):
                homeless.append(f"{type(part).__name__.lower()} '{name}'")
    if homeless:
        raise ModelError(f"save_urdf: a URDF has no place for {listed(homeless)}. Leave out what is not a joint by "
                         f"leave=, with names or patterns.", element=model.name, field="leave")  # fmt: skip
    ports = {f"{name}.{word}" for name in in_tree if model.joints[name].kind in OWN
             for word in OWN[model.joints[name].kind][2:]}  # fmt: skip
    lost = [repr(name) for name in (*model.inputs, *model.outputs) if name not in ports]
    if model.gravity is not None:
        lost.insert(0, "gravity")
    if lost:
        warnings.warn(f"save_urdf: a URDF has no place for {listed(lost)}. Give them when it is read, by gravity= and "
                      f"tip=.", LeftOutWarning, stacklevel=4)  # fmt: skip
    return damping, mimics


def _said(
    part: Any, model: Model, in_tree: set[str], damping: dict[str, float], mimics: dict[str, tuple[str, float]]
) -> bool:
    """Whether a damper or coupler is said by a joint of the tree; it is then added to ``damping`` or ``mimics``."""
    if isinstance(part, Bushing):
        k, c = np.ravel(part.stiffness), np.ravel(part.damping)
        if k.any() or len(c) != 6 or (part.preload is not None and any(part.preload)):
            return False
        for name in in_tree - set(damping):
            joint = model.joints[name]
            if joint.kind in OWN and {joint.first, joint.second} == {part.first, part.second}:
                index = OWN[joint.kind][0]
                off = np.linalg.norm(np.cross(np.array(part.orientation)[:, 2], np.array(joint.axes)[:, 2]))
                if off <= ALIGNED and not np.delete(c, index).any():
                    damping[name] = float(c[index])
                    return True
        return False
    if not isinstance(part, Coupling) or len(part.terms) != 2 or part.curvatures is not None:
        return False
    terms = part.terms
    for (follower, own), (leader, other) in (terms, terms[::-1]):
        (one, direction), (two, along) = (coordinate.rsplit(".", 1) for coordinate in (follower, leader))
        chain = two
        while chain in mimics:
            chain = mimics[chain][0]
        if one not in mimics and chain != one and all(
                name in in_tree and OWN.get(model.joints[name].kind, ("", ""))[1] == word
                for name, word in ((one, direction), (two, along))):  # fmt: skip
            mimics[one] = (two, -other / own)
            return True
    return False


def _origin(element: ElementTree.Element, tag: str, inner: tuple[Array, Array], outer: tuple[Array, Array]) -> None:
    """Write the frame ``outer`` in the frame ``inner``: position, and roll, pitch, yaw with R = Rz Ry Rx."""
    turn = inner[1].T @ outer[1]
    yaw = atan2(turn[1, 0], turn[0, 0])
    rest = exponential(np.array((0.0, 0.0, -yaw))) @ turn
    pitch, roll = atan2(-rest[2, 0], rest[0, 0]), atan2(-rest[1, 2], rest[1, 1])
    ElementTree.SubElement(element, tag, xyz=_text(inner[1].T @ (outer[0] - inner[0])), rpy=_text((roll, pitch, yaw)))


def _text(values: Any) -> str:
    return " ".join(repr(float(value) + 0.0) for value in values)
