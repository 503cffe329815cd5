"""A file compiled by MuJoCo, in a pose: MuJoCo resolves defaults, includes, frames, and inertia from shapes."""

from __future__ import annotations

import warnings
from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from os import PathLike
from typing import Any

import numpy as np

from mbsvib.common import arguments as check
from mbsvib.common.arrays import Array
from mbsvib.common.expected import names
from mbsvib.common.file_content import shortened
from mbsvib.common.patterns import matching
from mbsvib.errors import ModelError
from mbsvib.mjcf.kind import check_kind

# Numbers of a joint's position, by its type in MuJoCo: free, ball, slide, hinge.
WIDTHS = (7, 4, 1, 1)
FREE, BALL, SLIDE, HINGE = range(4)
# Features that may be left out by name, and the group of actuators that is then disabled.
LEAVABLE = ("actuator", "tendon", "equality")
OFF = 30


@dataclass(frozen=True, slots=True, eq=False)
class Compiled:
    """MuJoCo's model ``m`` and data ``d`` in the requested pose; ``api`` is its module."""

    path: str
    api: Any
    m: Any
    d: Any

    def count(self, kind: str) -> int:
        """Return the number of elements of a kind: body, joint, tendon, actuator, equality, site, key, geom."""
        m = self.m
        if kind == "actuator":
            return len(m.actuator_trntype)
        return int({"body": m.nbody, "joint": m.njnt, "tendon": m.ntendon, "equality": m.neq, "site": m.nsite,
                    "key": m.nkey, "geom": m.ngeom}[kind])  # fmt: skip

    def name(self, kind: str, i: int) -> str:
        """Return the name of an element; default: its kind and number, for a joint its body with '.joint'."""
        mujoco_name = self.api.mj_id2name(self.m, getattr(self.api.mjtObj, f"mjOBJ_{kind.upper()}"), i)
        if mujoco_name:
            return str(mujoco_name)
        if kind == "joint":
            body = int(self.m.jnt_bodyid[i])
            several = int(self.m.body_jntnum[body]) > 1
            return f"{self.name('body', body)}.joint{i - int(self.m.body_jntadr[body]) + 1 if several else ''}"
        return f"{kind}{i if kind == 'body' else i + 1}"

    def names(self, kind: str) -> list[str]:
        """Return the names of all elements of a kind."""
        return [self.name(kind, i) for i in range(self.count(kind))]

    def refuse(self, kind: str, i: int, reason: str, field: str | None = None) -> ModelError:
        """Build the error that names the file and the element."""
        name = self.name(kind, i)
        advice = f" Leave it out by leave=[{name!r}] (--leave)." if kind in LEAVABLE else ""
        return ModelError(f"{self.path}: {kind} '{name}': {reason}{advice}", element=name, field=field)

    def off(self, *flags: str) -> bool:
        """Tell whether the file's options disable a feature; names of the flags depend on the version."""
        bits = [int(getattr(self.api.mjtDisableBit, f"mjDSBL_{flag}", 0)) for flag in flags]
        return any(int(self.m.opt.disableflags) & bit for bit in bits)

    def value(self, field: str, i: int) -> Any:
        """Return entry i of a field that older versions do not have, or zero."""
        values = getattr(self.m, field, None)
        return 0.0 if values is None else values[i]

    def position(self, i: int) -> Array:
        """Return the position of a joint: one number, or a quaternion, or both point and quaternion."""
        start = int(self.m.jnt_qposadr[i])
        return np.array(self.d.qpos[start : start + WIDTHS[int(self.m.jnt_type[i])]])


def compiled(
    path: str | PathLike[str], pose: Mapping[str, Any], keyframe: str | int | None, control: Mapping[str, float],
    leave: Iterable[str],
) -> Compiled:  # fmt: skip
    """Have MuJoCo read a file and place it in a pose.

    ``pose``: positions of joints; others are the keyframe's or the file's. ``keyframe``: name or number of a keyframe.
    ``control``: controls of actuators; others are the keyframe's or 0. ``leave``: names or patterns of actuators,
    tendons and equality constraints to be left out.
    """
    try:
        import mujoco as api
    except ImportError as error:
        raise ModelError('load_mjcf needs MuJoCo; install it with:  pip install "mbsvib[mjcf]"',
                         element=str(path)) from error  # fmt: skip
    check_kind(path)
    with _warnings_passed_on(api, path):
        try:
            m = api.MjModel.from_xml_path(str(path))
        except (ValueError, api.FatalError, api.UnexpectedError, MemoryError) as error:
            raise ModelError(f"{path}: MuJoCo refuses it: {shortened(error)}", element=str(path)) from error
        compiled_model = Compiled(str(path), api, m, None)
        _leave(compiled_model, leave)
        compiled_model = Compiled(str(path), api, m, api.MjData(m))
        key = _keyframe(compiled_model, keyframe)
        if key is None:
            api.mj_resetData(m, compiled_model.d)
        else:
            api.mj_resetDataKeyframe(m, compiled_model.d, key)
        compiled_model.d.qvel[:] = 0.0
        _set_pose(compiled_model, pose)
        _command(compiled_model, control)
        api.mj_forward(m, compiled_model.d)
    return compiled_model


@contextmanager
def _warnings_passed_on(api: Any, path: str | PathLike[str]) -> Iterator[None]:
    """Convert warnings of MuJoCo, which it would otherwise write to a file in the current folder."""
    messages: list[str] = []
    before = api.get_mju_user_warning()
    api.set_mju_user_warning(messages.append)
    try:
        yield
    finally:
        api.set_mju_user_warning(before)
    for words in dict.fromkeys(messages):
        warnings.warn(f"{path}: MuJoCo warns: {' '.join(words.split())}", UserWarning, stacklevel=5)


def _leave(file: Compiled, leave: Iterable[str]) -> None:
    """Disable the features that the user leaves out, before anything is computed."""
    m = file.m
    known = [name for kind in LEAVABLE for name in file.names(kind)]
    for pattern in names(leave, "load_mjcf", "leave", ModelError):
        found = set(matching(pattern, known))
        hits = [(kind, i) for kind in LEAVABLE for i, name in enumerate(file.names(kind)) if name in found]
        if not hits:
            raise check.unknown(pattern, known, f"{file.path}: leave: {pattern!r} is not an actuator, tendon or "
                                f"equality constraint", "leave", told="")  # fmt: skip
        for kind, i in hits:
            if kind == "equality":
                m.eq_active0[i] = 0
                continue
            if kind == "actuator":
                m.actuator_group[i] = OFF
                m.opt.disableactuator |= 1 << OFF
            fields = ("stiffness", "stiffnesspoly", "damping", "armature", "frictionloss", "springyield")
            for values in (getattr(m, f"{kind}_{field}", None) for field in fields):
                if values is not None:
                    values[i] = 0.0


def _keyframe(file: Compiled, keyframe: str | int | None) -> int | None:
    known = file.names("key")
    if keyframe is None:
        return None
    if isinstance(keyframe, str) and keyframe in known:
        return known.index(keyframe)
    if isinstance(keyframe, int) and not isinstance(keyframe, bool) and 0 <= keyframe < len(known):
        return keyframe
    raise check.unknown(keyframe, known, f"{file.path}: keyframe = {keyframe!r} is none of it", "keyframe",
                        element=file.path)  # fmt: skip


def _set_pose(file: Compiled, pose: Mapping[str, Any]) -> None:
    m, d = file.m, file.d
    numbers = {name: i for i, name in enumerate(file.names("joint"))}
    for name, position in pose.items():
        i = known(name, numbers, "pose", "joint")
        start, width = int(m.jnt_qposadr[i]), WIDTHS[int(m.jnt_type[i])]
        expected = ("a number", "", "", "a quaternion (w, x, y, z)", "", "",
                    "a point and a quaternion (x, y, z, qw, qx, qy, qz)")[width - 1]  # fmt: skip
        values = [position] if width == 1 and not hasattr(position, "__len__") else position
        d.qpos[start : start + width] = check.numbers(values, (width,), f"joint '{name}'", "pose", expected)
        quaternion = d.qpos[start + width - 4 : start + width]
        if width > 1 and not quaternion.any():
            raise check.refuse(f"joint '{name}'", "pose", position, expected, "This quaternion is zero.")
    file.api.mj_normalizeQuat(m, d.qpos)


def _command(file: Compiled, control: Mapping[str, float]) -> None:
    """Set controls; for an actuator with a state, set the state, which determines its force."""
    numbers = {name: i for i, name in enumerate(file.names("actuator"))}
    for name, command in control.items():
        i = known(name, numbers, "control", "actuator")
        value = check.number(command, f"actuator '{name}'", "control")
        state = int(file.m.actuator_actadr[i])
        if state >= 0:
            file.d.act[state] = value
        else:
            file.d.ctrl[int(file.m.actuator_ctrladr[i]) if hasattr(file.m, "actuator_ctrladr") else i] = value


def known(name: str, numbers: Mapping[str, int], field: str, kind: str) -> int:
    """Return the number of an element by name."""
    check.known(name, numbers, f"{field}: {name!r} is no {kind}", field, "The file has")
    return numbers[name]
