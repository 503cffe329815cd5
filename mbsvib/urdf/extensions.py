"""What a URDF file says beside its tree of links and joints: refused where it connects links, else noted or harmless.

Elements are known by their names without the prefix of a namespace: ``drake:ball_constraint`` is a ball_constraint.
"""

from __future__ import annotations

import re
from collections.abc import Collection, Iterator
from os import PathLike
from xml.etree.ElementTree import Element

from mbsvib.common.number_text import real
from mbsvib.errors import ModelError
from mbsvib.urdf.loops import TAGS

Remarks = dict[str, list[str]]  # what was left out, and of which elements


# Parts of the names of elements that connect links, and the calls that add the same to a model.
CONNECTIONS = {
    "tendon": "add_coupler()", "coupling": "add_coupler()", "equality": "add_joint() or add_coupler()",
    "bushing": "add_bushing()",
    "spring": "add_spring() or add_bushing()", "damper": "add_spring() or add_bushing()", "loop": "add_joint()",
    "clos": "add_joint()", "constraint": "add_joint()", "weld": "add_joint()", "joint": "add_joint()",
}  # fmt: skip
# Elements that add links.
ADDED = ("link", "model", "include", "body")
# Elements of robots that do not change their mechanics.
HARMLESS = (
    "material", "transmission", "gazebo", "mujoco", "sensor", "ros2_control", "frame", "fixed_frame", "plugin",
    "collision_filter_group", "disable_collisions", "group", "group_state", "end_effector", "visual", "collision",
    "gripper", "author", "license", "version", "safety_controller", "actuator", "camera", "color", "texture",
)  # fmt: skip
# What a simulator's elements, or an element of a transmission, do to a link or joint, by names in small letters.
NOTED = {
    "springstiffness": "spring in", "spring_stiffness": "spring in", "dampingfactor": "velocity decay of",
    "turngravityoff": "no gravity on", "rotor_inertia": "rotor inertia in", "rotorinertia": "rotor inertia in",
    "motorinertia": "rotor inertia in", "motor_inertia": "rotor inertia in",
}  # fmt: skip
# Parts of the names of elements in joints, and of attributes of <dynamics>, that act on the motion.
IN_JOINTS = ("stiff", "spring", "inertia", "armature", "bushing")
MOST_NAMES = 8  # names of each kind in a warning
MACRO = re.compile(r"\$[{(]")


def refuse_macros(top: Element, path: str | PathLike[str]) -> None:
    """Refuse a file with macros of xacro that are not expanded, in elements or in the attributes that are read."""
    way = "Expand the file first: xacro file.urdf.xacro > file.urdf"
    for element in top.iter():
        if element.tag.startswith("xacro:"):
            raise ModelError(f"{path}: <{element.tag}> is not expanded. {way}", element=element.tag)
    for element in _read_elements(top):
        for key, text in element.items():
            if MACRO.search(text):
                raise ModelError(f"{path}: <{element.tag} {key}={text!r}> has a macro of xacro that is not expanded. "
                                 f"{way}", element=element.get("name", element.tag), field=key)  # fmt: skip


def _read_elements(top: Element) -> Iterator[Element]:
    yield top
    for kind in ("link", "joint", *TAGS):
        for element in top.findall(kind):
            yield element
            for part in element.findall("inertial") if kind == "link" else element:
                yield from part.iter()


def left_out(top: Element, path: str | PathLike[str], rotors: Collection[int]) -> Remarks:
    """Refuse what connects or adds links beside the tree and is not read; return what else is left out.

    A simulator's fixed joint may hold the root link to the world, as the reader does. ``rotors``: identities of the
    actuators that are read.
    """
    children = [child.get("link") for child in top.findall("joint/child")]
    roots = [str(link.get("name")) for link in top.findall("link") if link.get("name") not in children]
    notes = [note for element in top.iter() if id(element) not in rotors for note in _noted(element)]
    for element in top:
        tag = _name(element)
        if tag == "gazebo":
            for part in element:
                if not _holds_root(part, roots) and not element.get("reference"):
                    _refuse_connection(part, path)
        elif tag == "mujoco":
            for part in element:
                _refuse_connection(part, path)
        elif element.tag == "link":
            if len(element.findall("inertial")) > 1:
                notes.append(("all but the first <inertial> of", f"'{element.get('name')}'"))
        elif element.tag == "joint":
            notes += _in_joint(element)
        elif element.tag in TAGS:
            continue
        elif tag not in HARMLESS:
            for part in element.iter():
                if part is element or _name(part) not in (*ADDED, "joint"):  # within others these are mere names
                    _refuse_connection(part, path)
            notes.append((f"<{element.tag}>", repr(element.get("name", ""))))
    remarks: Remarks = {}
    for what, name in notes:
        remarks.setdefault(what, []).append(name)
    return remarks


def in_words(remarks: Remarks) -> str:
    """Return what was left out as words of a warning, with a few names of each kind."""
    return "; ".join(f"{what} {', '.join(names[:MOST_NAMES])}" +
                     (f" and {len(names) - MOST_NAMES} more" if len(names) > MOST_NAMES else "")
                     for what, names in remarks.items())  # fmt: skip


def _name(element: Element) -> str:
    return element.tag.rpartition(":")[2].lower()


def _refuse_connection(element: Element, path: str | PathLike[str]) -> None:
    tag, name = _name(element), element.get("name", "")
    if tag in ADDED:
        raise ModelError(f"{path}: <{element.tag}> {name!r} adds links in a way that is not read. Write them as <link> "
                         f"and <joint> of <robot>.", element=name)  # fmt: skip
    call = next((call for part, call in CONNECTIONS.items() if part in tag), None)
    if call is None:
        return
    closing = f"<{element.tag}> {name!r} connects links beside the tree of joints, and is not read."
    way = "Remove the element from a copy of the file, load the copy"
    if element.tag.endswith(":joint"):
        way = 'Write a <joint type="floating"> in its place in a copy of the file, load the copy'
    raise ModelError(f"{path}: {closing} {way}, and add what it does by model.{call}.", element=name)


def _holds_root(element: Element, roots: list[str]) -> bool:
    """Whether a simulator's joint fixes the only root link to the world."""
    ends = [(element.findtext(role) or "").strip() for role in ("parent", "child")]
    return _name(element) == "joint" and element.get("type") == "fixed" and ends == ["world", *roots]


def _noted(element: Element) -> Iterator[tuple[str, str]]:
    """What a simulator adds to the mechanics of a link or joint."""
    for part in element:
        effect, value = NOTED.get(_name(part)), (part.get("value") or part.text or "").strip()
        weightless = _name(part) == "gravity" and element.tag == "gazebo" and _zero(value)
        if weightless or (effect is not None and not _zero(value)):
            name = element.get("reference") or element.get("name") or ""
            yield "no gravity on" if weightless else str(effect), f"'{name}' (<{part.tag}> {value})"


def _in_joint(joint: Element) -> list[tuple[str, str]]:
    """Elements and attributes that act on a joint and are not of the format."""
    name, dynamics = f"'{joint.get('name')}'", joint.find("dynamics")
    notes = [(f"<{part.tag}> of", name) for part in joint if any(word in _name(part) for word in IN_JOINTS)]
    return notes + [(f"{key} of", f"{name} ({value})") for key, value in (() if dynamics is None else dynamics.items())
                    if key != "armature" and any(word in key.lower() for word in IN_JOINTS)
                    and not _zero(value)]  # fmt: skip


def _zero(text: str) -> bool:
    if text.lower() in ("", "false"):
        return True
    try:
        return real(text) == 0.0
    except ValueError:
        return False
