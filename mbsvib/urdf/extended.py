"""Extended URDF: loops, joints with several freedoms and motors in a YAML file beside a URDF.

Frames are links, or joints whose child they mean. Of a loop "6d" frames coincide, "3d" their points. A joint of the
tree is made SPHERICAL, FIXED, or UJOINT_XY with two letters for its axes, the first of which is fixed in the parent.

Source: arXiv 2504.04767; files of Gepetto/example-parallel-robots.
"""

from __future__ import annotations

from dataclasses import replace
from itertools import permutations
from os import PathLike
from pathlib import Path
from typing import Any

import numpy as np

from mbsvib.common import arguments as check
from mbsvib.common.file_content import content_of
from mbsvib.errors import ModelError
from mbsvib.files.reading import read_yaml
from mbsvib.urdf.loops import Loop
from mbsvib.urdf.reading import Robot

TYPES = {"6d": "fixed", "3d": "spherical"}
LETTERS = dict(zip("XYZ", np.eye(3), strict=True))
UJOINTS = tuple(f"UJOINT_{first}{second}" for first, second in permutations("XYZ", 2))
# Lists of the file, and the one whose entries theirs go with.
LISTS = {"closed_loop": None, "type": "closed_loop", "name_mot": None, "joint_name": None, "joint_type": "joint_name",
         "armature": "name_mot", "rotor_inertia": "name_mot", "gear_ratio": "name_mot"}  # fmt: skip
NUMBERS = ("armature", "rotor_inertia", "gear_ratio")


def beside(path: str | PathLike[str]) -> Path | None:
    """Return the YAML file of the same name beside a URDF, if it is there and has loops."""
    for suffix in (".yaml", ".yml"):
        other = Path(path).with_suffix(suffix)
        if other.is_file() and b"closed_loop" in content_of(other, ModelError, "a YAML file"):
            return other
    return None


def extended(robot: Robot, path: str | PathLike[str]) -> Robot:
    """Return a robot with the loops, joints and motors of a YAML file."""
    lists = _lists(path)
    joints, ratio = dict(robot.joints), lists.get("gear_ratio")
    for name, kind in zip(lists["joint_name"], lists["joint_type"], strict=True):
        joint = _known(name, joints, path, "joint_name")
        if kind == "SPHERICAL":
            joints[name] = replace(joint, kind="spherical", mimic=None)
        elif kind == "FIXED":
            joints[name] = replace(joint, kind="fixed", mimic=None)
        elif kind in UJOINTS:
            joints[name] = replace(joint, kind="universal", axis=LETTERS[kind[-2]], axis2=LETTERS[kind[-1]], mimic=None)
        else:
            raise ModelError(f"{path}: joint_type of '{name}' = {kind!r}; expected SPHERICAL, FIXED or one of "
                             f"{', '.join(UJOINTS)}.", element=name, field="joint_type")  # fmt: skip
    for i, motor in enumerate(lists["name_mot"]):
        gear = 1.0 if ratio is None else ratio[i]
        inertia = sum(lists[word][i] * factor for word, factor in (("armature", 1.0), ("rotor_inertia", gear**2))
                      if word in lists)  # fmt: skip
        # a name may be a part of the names of several joints
        for name in [motor] if motor in joints else [name for name in joints if str(motor) in name] or [motor]:
            joint = _known(name, joints, path, "name_mot")
            joints[name] = replace(joint, armature=joint.armature + inertia)
    loops = [_loop(robot, pair, kind, path) for pair, kind in zip(lists["closed_loop"], lists["type"], strict=True)]
    names = [loop.name for loop in (*robot.loops, *loops)]
    loops = [replace(loop, name="+".join(loop.links)) if names.count(loop.name) > 1 else loop for loop in loops]
    left = robot.left
    if "" in lists:
        left = {**left, "of the YAML": [f"'{key}'" for key in lists[""]]}
    return replace(robot, joints=joints, loops=(*robot.loops, *loops), left=left)


def _loop(robot: Robot, pair: Any, kind: Any, path: str | PathLike[str]) -> Loop:
    if not isinstance(pair, list) or len(pair) != 2:
        raise ModelError(f"{path}: closed_loop: {pair!r}; expected two names of frames.", field="closed_loop")
    links = []
    for frame in map(str, pair):
        if frame not in robot.links and frame not in robot.joints:
            raise check.unknown(frame, robot.links, f"{path}: closed_loop: '{frame}' is not a link", "closed_loop", "")
        links.append(frame if frame in robot.links else robot.joints[frame].child)
    if str(kind).lower() not in TYPES:
        raise ModelError(f"{path}: type of {links} = {kind!r}; expected 6d or 3d.", element=links[0], field="type")
    place, axis = (np.zeros(3), np.eye(3)), np.array((1.0, 0.0, 0.0))
    return Loop(links[0], TYPES[str(kind).lower()], (links[0], links[1]), (place, place), axis, axis)


def _known(name: Any, joints: dict[str, Any], path: str | PathLike[str], key: str) -> Any:
    check.known(name, joints, f"{path}: {key}: {name!r} is not a joint", key, "")
    return joints[name]


def _lists(path: str | PathLike[str]) -> dict[str, list[Any]]:
    """The lists of the file; those that are left out are empty, types are then 6d. Other keys are listed by ''."""
    text = content_of(path, ModelError, "a YAML file of Extended URDF").decode("utf-8", "replace")
    data = read_yaml(text, str(path)).data
    if not isinstance(data, dict) or "closed_loop" not in data:
        raise ModelError(f"{path}: has no list closed_loop; expected a YAML file of Extended URDF.",
                         field="closed_loop")  # fmt: skip
    lists: dict[str, list[Any]] = {}
    for key, owner in LISTS.items():
        default = ["6d"] * len(lists["closed_loop"]) if key == "type" else []
        value = data.get(key)
        if value is None:
            if key not in NUMBERS:
                lists[key] = default
            continue
        value = [value] if key == "name_mot" and isinstance(value, str) else value
        if not isinstance(value, list) or (owner is not None and len(value) != len(lists[owner])):
            raise ModelError(f"{path}: {key} = {value!r}; expected a list" +
                             (f" with an entry for each of {owner}." if owner else "."), field=key)  # fmt: skip
        for entry in value if key in NUMBERS else ():
            if isinstance(entry, bool) or not isinstance(entry, int | float) or not np.isfinite(entry) or entry < 0:
                raise ModelError(f"{path}: {key}: {entry!r}; expected a number that is not negative.", field=key)
        lists[key] = value
    if others := [str(key) for key in data if key not in LISTS]:
        lists[""] = others
    return lists
