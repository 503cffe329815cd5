"""Contents of a URDF file as plain numbers: links with inertia, joints with origin, axis, limits and damping, loops;
and motors, which are transmissions of one actuator to one joint.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from math import atan2, cos, sin
from os import PathLike
from xml.etree import ElementTree

import numpy as np

from mbsvib.common import arguments as check
from mbsvib.common.arrays import Array
from mbsvib.common.file_content import ContentError, content_of, read_xml
from mbsvib.common.number_text import real
from mbsvib.errors import ModelError
from mbsvib.urdf.extensions import Remarks, left_out, refuse_macros
from mbsvib.urdf.loops import Coupling, Loop, Reader
from mbsvib.urdf.motion import Hinge, Mimic, moved

KINDS = ("revolute", "continuous", "prismatic", "fixed", "floating", "planar")
AXIS = np.array((1.0, 0.0, 0.0))  # default axis of a joint in the format
# Decimals from which on a number without exponent was printed with a fixed count of them, as "%f" does: its last digit
# is rounded, however few digits that leaves of a small number.
DECIMALS = 6
RATIO, ROTOR = "mechanicalreduction", "rotor_inertia"
# Names of elements for these, in small letters.
WORDS = {RATIO: RATIO, "gear_ratio": RATIO} | dict.fromkeys(
    (ROTOR, "rotorinertia", "motor_inertia", "motorinertia"), ROTOR)


@dataclass(frozen=True, slots=True)
class Motor:
    """A motor that turns ``ratio`` times as fast as its ``joint``, with a rotor of ``inertia`` [kg m^2, kg]."""

    name: str
    joint: str
    ratio: float
    inertia: float


@dataclass(frozen=True, slots=True, eq=False)
class Link:
    """A link: ``mass`` [kg], ``centre`` (3,) [m] and ``inertia`` (3, 3) [kg m^2] about it, in the link's axes.

    ``rounding`` [kg m^2]: by how much rounding to the printed decimals can falsify a second moment of mass.
    """

    name: str
    mass: float
    centre: Array
    inertia: Array
    rounding: float = 0.0


@dataclass(frozen=True, slots=True, eq=False)
class Robot:
    """All links and joints by name; ``root`` is the link that is not the child of a joint; ``left`` names what was left
    out, ``taken`` what was taken as meant, ``independent`` the joints that are marked so.
    """

    name: str
    links: dict[str, Link]
    joints: dict[str, Hinge]
    root: str
    left: Remarks
    loops: tuple[Loop, ...] = ()
    couplings: tuple[Coupling, ...] = ()
    motors: tuple[Motor, ...] = ()
    taken: tuple[str, ...] = ()
    independent: tuple[str, ...] = ()


def read(path: str | PathLike[str]) -> Robot:
    """Return masses, joints, loops and motors of a URDF file; shapes and colours are ignored."""
    try:
        top = read_xml(content_of(path, ModelError, "a URDF file"))
    except ContentError as error:
        raise ModelError(f"{path}: no XML that is read: {error} Expand xacro files first: "
                         f"xacro a.xacro > a.urdf") from error  # fmt: skip
    if top.tag != "robot":
        raise ModelError(f"{path}: the file's element is <{top.tag}>; expected <robot>, as URDF has it.")
    refuse_macros(top, path)
    motors, rotors = _motors(top, path)
    left = left_out(top, path, rotors)
    links = {name: _link(element, name, path) for name, element in _named(top, "link", path).items()}
    elements = _named(top, "joint", path)
    joints = {name: _joint(element, name, links, path) for name, element in elements.items()}
    independent = [name for name, element in elements.items() if element.get("independent") in ("true", "1")]
    for motor in motors:
        check.known(motor.joint, joints, f"{path}: transmission of '{motor.name}': {motor.joint!r} is not a joint",
                    "joint", "", element=motor.name)  # fmt: skip
        joint = joints[motor.joint]
        joints[motor.joint] = replace(joint, armature=joint.armature + motor.inertia * motor.ratio**2)
    joints = {name: _held(joint, joints, path) for name, joint in joints.items()}
    reader = Reader(path, links, _numbers, _frame, [])
    loops, couplings = reader.all_of(top)
    return Robot(top.get("name") or "robot", links, joints, _root(links, joints, path), left, loops, couplings, motors,
                 tuple(reader.taken), tuple(independent))  # fmt: skip


def _motors(top: ElementTree.Element, path: str | PathLike[str]) -> tuple[tuple[Motor, ...], set[int]]:
    """The motors of one joint each, and the identities of the actuators whose rotors are taken by them.

    Transmissions between several joints or actuators have no single ratio.
    """
    motors, taken = [], set()
    for element in top.findall("transmission"):
        joints, actuators = element.findall("joint"), element.findall("actuator")
        if len(joints) != 1 or len(actuators) != 1:
            continue
        name, joint = actuators[0].get("name", ""), joints[0].get("name", "")
        who, values = f"{path}: transmission of '{name}'", {RATIO: 1.0, ROTOR: 0.0}
        for part in (*joints[0], *actuators[0], *element):
            tag = part.tag.rpartition(":")[2].lower()
            if tag in WORDS:
                key = WORDS[tag]
                if part.get("value") is not None:
                    values[key] = float(_numbers(part, "value", None, 1, who, name)[0])
                else:
                    try:
                        values[key] = real(part.text or "")
                    except ValueError as error:
                        raise ModelError(f"{who}: <{part.tag}> {part.text!r}; expected a number.", element=name,
                                         field=part.tag) from error  # fmt: skip
        if values[RATIO] == 0.0 or values[ROTOR] < 0.0:
            raise ModelError(f"{who}: ratio {values[RATIO]:g}, rotor {values[ROTOR]:g} kg m^2; expected a ratio other "
                             f"than 0 and an inertia that is not negative.", element=name)  # fmt: skip
        taken.add(id(actuators[0]))
        motors.append(Motor(name, joint, values[RATIO], values[ROTOR]))
    return tuple(motors), taken


def _held(joint: Hinge, joints: dict[str, Hinge], path: str | PathLike[str]) -> Hinge:
    """The joint itself, or a fixed one where what it mimics, directly or not, is constant.

    A fixed joint has the position 0, so that q = offset; so has a joint that mimics with the factor 0.
    """
    factor, offset, leader, chain = 1.0, 0.0, joint, [joint.name]
    while leader.mimic is not None and factor != 0.0:
        factor, offset = factor * leader.mimic.factor, offset + factor * leader.mimic.offset
        target = leader.mimic.joint
        check.known(target, joints, f"{path}: joint '{leader.name}': mimics '{target}', which is not a joint", "mimic",
                    "", element=leader.name)  # fmt: skip
        if target in chain:
            raise ModelError(f"{path}: joint '{joint.name}': mimics itself in the end.",
                             element=joint.name, field="mimic")  # fmt: skip
        chain.append(target)
        leader = joints[target]
    for name in chain if len(chain) > 1 else ():
        if joints[name].kind in ("floating", "planar"):
            raise ModelError(f"{path}: joint '{joint.name}': mimics '{chain[1]}', but a {joints[name].kind} joint "
                             f"('{name}') has no single position. Leave out the <mimic> in a copy of the file, and add "
                             f"a coupler by model.add_coupler().", element=joint.name, field="mimic")  # fmt: skip
    if joint.mimic is None or (factor != 0.0 and leader.kind != "fixed"):
        return joint
    at, axes = moved(joint, np.array((offset,)))
    return replace(joint, kind="fixed", origin=at, axes=axes, mimic=None)


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
    if not links:
        raise ModelError(f"{path}: <robot> has no <link>. If xacro wrote the file, it calls no macro that makes some.",
                         element=str(path))  # fmt: skip
    parents: dict[str, str] = {}
    for joint in joints.values():
        if joint.child in parents:
            raise ModelError(f"{path}: link '{joint.child}': joints '{parents[joint.child]}' and '{joint.name}' both "
                             f"carry it; a URDF is a tree. Write the joint that closes the loop as a <constraint>.",
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


def _link(element: ElementTree.Element, name: str, path: str | PathLike[str]) -> Link:
    inertial, who = element.find("inertial"), f"{path}: link '{name}'"
    if inertial is None:
        return Link(name, 0.0, np.zeros(3), np.zeros((3, 3)))
    centre, axes = _frame(inertial.find("origin"), who, name)
    mass = _numbers(inertial.find("mass"), "value", None, 1, who, name)[0]
    entries = inertial.find("inertia")
    tensor, rounding = np.zeros((3, 3)), np.zeros((3, 3))
    for key in ("ixx", "iyy", "izz", "ixy", "ixz", "iyz"):
        i, j = ("xyz".index(letter) for letter in key[1:])
        default = None if i == j and entries is not None else "0"
        tensor[i, j] = tensor[j, i] = _numbers(entries, key, default, 1, who, name)[0]
        rounding[i, j] = rounding[j, i] = _last_digit("0" if entries is None else entries.get(key, "0"))
    off = 0.5 * np.trace(rounding) + rounding.sum(axis=1).max()  # of tr(J) / 2 - J
    return Link(name, float(mass), centre, axes @ tensor @ axes.T, float(off))


def _last_digit(text: str) -> float:
    """Half a unit of the last decimal of a number printed with a fixed count of decimals; otherwise 0."""
    decimals = text.strip().rpartition(".")[2]
    fixed = "." in text and decimals.isdigit() and len(decimals) >= DECIMALS
    return float(0.5 * 10.0 ** -len(decimals)) if fixed else 0.0


def _joint(element: ElementTree.Element, name: str, links: dict[str, Link], path: str | PathLike[str]) -> Hinge:
    who, kind = f"{path}: joint '{name}'", element.get("type", "")
    if kind not in KINDS:
        raise ModelError(f"{who}: type = {kind!r}; expected {', '.join(KINDS)}.", element=name, field="type")
    ends = []
    for role in ("parent", "child"):
        end = element.find(role)
        link = "" if end is None else end.get("link", "")
        check.known(link, links, f"{who}: {role} = {link!r} is not a link", role, "", element=name)
        ends.append(link)
    origin, axes = _frame(element.find("origin"), who, name)
    axis_element = element.find("axis")
    axis = AXIS if axis_element is None else _numbers(axis_element, "xyz", "1 0 0", 3, who, name)
    if not np.any(axis):
        if kind in ("revolute", "continuous", "prismatic", "planar"):
            raise ModelError(f"{who}: axis = (0, 0, 0) is not a direction.", element=name, field="axis")
        axis = AXIS  # of a kind that has none
    damping, friction = (float(_numbers(element.find("dynamics"), key, "0", 1, who, name)[0])
                         for key in ("damping", "friction"))  # fmt: skip
    follows, mimic = element.find("mimic"), None
    if follows is not None and kind != "fixed":  # a fixed joint has no coordinate that could follow
        factor, offset = (_numbers(follows, key, value, 1, who, name)[0]
                          for key, value in (("multiplier", "1"), ("offset", "0")))  # fmt: skip
        mimic = Mimic(follows.get("joint", ""), float(factor), float(offset))
    armature = float(_numbers(element.find("dynamics"), "armature", "0", 1, who, name)[0])
    if armature < 0.0:
        raise ModelError(f"{who}: armature = {armature:g}; it cannot be negative.", element=name, field="armature")
    direction = axis / np.linalg.norm(axis)
    return Hinge(name, kind, ends[0], ends[1], origin, axes, direction, damping, friction, mimic,
                 _limits(element, kind, who, name), armature)  # fmt: skip


def _limits(element: ElementTree.Element, kind: str, who: str, name: str) -> tuple[float, float] | None:
    """Limits of a revolute or prismatic joint; None where none are stated, as of two that are equal."""
    limit = element.find("limit")
    if limit is None or kind not in ("revolute", "prismatic"):
        return None
    ends = []
    for key, infinite in (("lower", -np.inf), ("upper", np.inf)):
        unlimited = limit.get(key, "").strip().lower().lstrip("+-") in ("inf", "infinity")
        ends.append(infinite if unlimited else float(_numbers(limit, key, "0", 1, who, name)[0]))
    if ends[0] > ends[1]:
        raise ModelError(f"{who}: limits from {ends[0]:g} to {ends[1]:g} leave no position; expected lower <= upper.",
                         element=name, field="limit")  # fmt: skip
    return (ends[0], ends[1]) if ends[0] < ends[1] else None


def _frame(element: ElementTree.Element | None, who: str, name: str) -> tuple[Array, Array]:
    """Position and axes of an origin: a quaternion, or fixed-axis angles roll, pitch and yaw, R = Rz(yaw) Ry(pitch)
    Rx(roll).
    """
    at = _numbers(element, "xyz", "0 0 0", 3, who, name)
    if element is not None and element.get("quat_xyzw") is not None:
        if element.get("rpy") is not None:
            raise ModelError(f"{who}: origin has both rpy and quat_xyzw; expected one of them.",
                             element=name, field="origin")  # fmt: skip
        quaternion = _numbers(element, "quat_xyzw", None, 4, who, name)
        length = float(np.linalg.norm(quaternion[:3]))
        if not quaternion.any():
            raise ModelError(f"{who}: quat_xyzw = (0, 0, 0, 0) is not a rotation.", element=name, field="quat_xyzw")
        turn = 2.0 * atan2(length, quaternion[3]) / (length or 1.0) * quaternion[:3]
        return at, np.array(check.exponential(tuple(turn)))
    roll, pitch, yaw = _numbers(element, "rpy", "0 0 0", 3, who, name)
    cr, sr, cp, sp, cy, sy = cos(roll), sin(roll), cos(pitch), sin(pitch), cos(yaw), sin(yaw)
    axes = np.array(((cy * cp, cy * sp * sr - sy * cr, cy * sp * cr + sy * sr),
                     (sy * cp, sy * sp * sr + cy * cr, sy * sp * cr - cy * sr),
                     (-sp, cp * sr, cp * cr)))  # fmt: skip
    return at, axes


def _numbers(
    element: ElementTree.Element | None, key: str, default: str | None, count: int, who: str, name: str,
) -> Array:  # fmt: skip
    text = default if element is None else element.get(key, default)
    try:
        values = np.array([real(word) for word in (text or "").split()])
    except ValueError:
        values = np.zeros(0)
    if len(values) != count:
        raise ModelError(f"{who}: {key} = {text!r}; expected {count} finite number{'s' if count > 1 else ''}.",
                         element=name, field=key)  # fmt: skip
    return values
