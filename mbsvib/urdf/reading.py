"""Contents of a URDF file as plain numbers: links with inertia, joints with origin, axis and damping."""

from __future__ import annotations

from dataclasses import dataclass
from math import cos, sin
from typing import TYPE_CHECKING

import numpy as np

from mbsvib.common.file_content import ContentError, content_of
from mbsvib.common.number_text import real
from mbsvib.common.xml_file import read_xml
from mbsvib.errors import ModelError, nearest

if TYPE_CHECKING:
    from os import PathLike
    from xml.etree import ElementTree

    from mbsvib.common.arrays import Array


KINDS = ("revolute", "continuous", "prismatic", "fixed", "floating", "planar")
AXIS = np.array((1.0, 0.0, 0.0))  # default axis of a joint in the format
# Elements by which extensions of the format close loops; a simulator's own joints have a child.
LOOPS = ("loop", "loop_joint", "constraint", "gazebo/joint[child]")


@dataclass(frozen=True, slots=True, eq=False)
class Link:
    """A link: ``mass`` [kg], ``centre`` (3,) [m] and ``inertia`` (3, 3) [kg m^2] about it, in the link's axes."""

    name: str
    mass: float
    centre: Array
    inertia: Array


@dataclass(frozen=True, slots=True, eq=False)
class Mimic:
    """A joint that follows another one: q = factor q_joint + offset."""

    joint: str
    factor: float
    offset: float


@dataclass(frozen=True, slots=True, eq=False)
class Hinge:
    """A joint of any kind: ``origin`` (3,) [m], ``axes`` (3, 3) of its frame in the parent's, ``axis`` in its own."""

    name: str
    kind: str
    parent: str
    child: str
    origin: Array
    axes: Array
    axis: Array
    damping: float
    friction: float
    mimic: Mimic | None


@dataclass(frozen=True, slots=True, eq=False)
class Robot:
    """All links and joints by name; ``root`` is the link that is not the child of a joint."""

    name: str
    links: dict[str, Link]
    joints: dict[str, Hinge]
    root: str


def read(path: str | PathLike[str]) -> Robot:
    """Return masses and joints of a URDF file; shapes, colours and limits are ignored."""
    try:
        top = read_xml(content_of(path, ModelError, "a URDF file"))
    except ContentError as error:
        raise ModelError(f"{path}: no XML that is read: {error} Expand xacro files first: "
                         f"xacro a.xacro > a.urdf") from error  # fmt: skip
    if top.tag != "robot":
        raise ModelError(f"{path}: the file's element is <{top.tag}>; expected <robot>, as URDF has it.")
    _complete(top, path)
    links = {name: _link(element, name) for name, element in _named(top, "link", path).items()}
    joints = {name: _joint(element, name, links) for name, element in _named(top, "joint", path).items()}
    for joint in joints.values():
        if joint.mimic is not None and joint.mimic.joint not in joints:
            raise ModelError(f"joint '{joint.name}': mimics '{joint.mimic.joint}', which is no joint."
                             f"{nearest(joint.mimic.joint, joints)}", element=joint.name, field="mimic")  # fmt: skip
    return Robot(top.get("name") or "robot", links, joints, _root(links, joints, path))


def _complete(top: ElementTree.Element, path: str | PathLike[str]) -> None:
    """Refuse what would be lost in silence: macros that are not expanded, and loops beside the tree."""
    for element in top.iter():
        tag = str(element.tag)
        if tag.startswith("xacro:"):
            raise ModelError(f"{path}: <{tag}> is not expanded. Expand the file first: xacro a.xacro > a.urdf",
                             element=tag)  # fmt: skip
    for element in (found for kind in LOOPS for found in top.findall(kind)):
        name = element.get("name", "")
        raise ModelError(f"{path}: <{element.tag}> {name!r} closes a loop; a URDF is read as a tree. Remove the "
                         f"element from a copy of the file, load the copy, and close the loop by model.add_joint().",
                         element=name)  # fmt: skip


def _named(top: ElementTree.Element, kind: str, path: str | PathLike[str]) -> dict[str, ElementTree.Element]:
    result: dict[str, ElementTree.Element] = {}
    for element in top.findall(kind):
        name = element.get("name")
        if not name or name in result:
            raise ModelError(f"{path}: a {kind} {'has no name' if not name else f'{name!r} is there twice'}.",
                             element=name, field="name")  # fmt: skip
        result[name] = element
    return result


def _root(links: dict[str, Link], joints: dict[str, Hinge], path: str | PathLike[str]) -> str:
    parents: dict[str, str] = {}
    for joint in joints.values():
        if joint.child in parents:
            raise ModelError(f"link '{joint.child}': joints '{parents[joint.child]}' and '{joint.name}' both carry it; "
                             f"a URDF is a tree. Close the loop by model.add_joint() afterwards.",
                             element=joint.child)  # fmt: skip
        parents[joint.child] = joint.name
    roots = [name for name in links if name not in parents]
    if len(roots) != 1:
        listed = ", ".join(roots) if roots else "none"
        raise ModelError(f"{path}: expected one link that no joint carries, the root of the tree; found {listed}.")
    children: dict[str, list[str]] = {}
    for child, carrier in parents.items():
        children.setdefault(joints[carrier].parent, []).append(child)
    reached = [roots[0]]
    for link in reached:
        reached.extend(children.get(link, []))
    known = set(reached)
    if rest := [name for name in links if name not in known]:
        raise ModelError(f"{path}: link '{rest[0]}' hangs in a ring of joints that does not reach the root "
                         f"'{roots[0]}'; a URDF is a tree.", element=rest[0])  # fmt: skip
    return roots[0]


def _link(element: ElementTree.Element, name: str) -> Link:
    inertial = element.find("inertial")
    if inertial is None:
        return Link(name, 0.0, np.zeros(3), np.zeros((3, 3)))
    centre, axes = _frame(inertial.find("origin"), f"link '{name}'")
    mass = _numbers(inertial.find("mass"), "value", None, 1, f"link '{name}'")[0]
    entries = inertial.find("inertia")
    xx, xy, xz, yy, yz, zz = (_numbers(entries, key, "0", 1, f"link '{name}'")[0]
                              for key in ("ixx", "ixy", "ixz", "iyy", "iyz", "izz"))  # fmt: skip
    tensor = np.array(((xx, xy, xz), (xy, yy, yz), (xz, yz, zz)))
    return Link(name, float(mass), centre, axes @ tensor @ axes.T)


def _joint(element: ElementTree.Element, name: str, links: dict[str, Link]) -> Hinge:
    who, kind = f"joint '{name}'", element.get("type", "")
    if kind not in KINDS:
        raise ModelError(f"{who}: type = {kind!r}; expected {', '.join(KINDS)}.", element=name, field="type")
    ends = []
    for role in ("parent", "child"):
        end = element.find(role)
        link = "" if end is None else end.get("link", "")
        if link not in links:
            raise ModelError(f"{who}: {role} = {link!r} is no link.{nearest(link, links)}", element=name, field=role)
        ends.append(link)
    origin, axes = _frame(element.find("origin"), who)
    axis_element = element.find("axis")
    axis = AXIS if axis_element is None else _numbers(axis_element, "xyz", "1 0 0", 3, who)
    if not np.any(axis) and kind in ("revolute", "continuous", "prismatic", "planar"):
        raise ModelError(f"{who}: axis = (0, 0, 0) is no direction.", element=name, field="axis")
    damping, friction = (float(_numbers(element.find("dynamics"), key, "0", 1, who)[0])
                         for key in ("damping", "friction"))  # fmt: skip
    follows, mimic = element.find("mimic"), None
    if follows is not None and kind != "fixed":  # a fixed joint has no coordinate that could follow
        factor, offset = (_numbers(follows, key, value, 1, who)[0]
                          for key, value in (("multiplier", "1"), ("offset", "0")))  # fmt: skip
        mimic = Mimic(follows.get("joint", ""), float(factor), float(offset))
    length = np.linalg.norm(axis) or 1.0
    return Hinge(name, kind, ends[0], ends[1], origin, axes, axis / length, damping, friction, mimic)


def _frame(element: ElementTree.Element | None, who: str) -> tuple[Array, Array]:
    """Position and axes of an origin: fixed-axis angles roll, pitch and yaw, R = Rz(yaw) Ry(pitch) Rx(roll)."""
    at = _numbers(element, "xyz", "0 0 0", 3, who)
    roll, pitch, yaw = _numbers(element, "rpy", "0 0 0", 3, who)
    cr, sr, cp, sp, cy, sy = cos(roll), sin(roll), cos(pitch), sin(pitch), cos(yaw), sin(yaw)
    axes = np.array(((cy * cp, cy * sp * sr - sy * cr, cy * sp * cr + sy * sr),
                     (sy * cp, sy * sp * sr + cy * cr, sy * sp * cr - cy * sr),
                     (-sp, cp * sr, cp * cr)))  # fmt: skip
    return at, axes


def _numbers(element: ElementTree.Element | None, key: str, default: str | None, count: int, who: str) -> Array:
    text = default if element is None else element.get(key, default)
    try:
        values = np.array([real(word) for word in (text or "").split()])
    except ValueError:
        values = np.zeros(0)
    if len(values) != count:
        raise ModelError(f"{who}: {key} = {text!r}; expected {count} finite number{'s' if count > 1 else ''}.",
                         element=who, field=key)  # fmt: skip
    return values
