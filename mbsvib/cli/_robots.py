"""Options of all commands that take a model, for files that state less than a model: URDF and MJCF.

Each option is an argument of the same name of the files' readers, ``load_urdf`` and ``load_mjcf``.
"""

from __future__ import annotations

from argparse import ArgumentTypeError
from importlib import import_module
from inspect import signature
from typing import TYPE_CHECKING, Any

from mbsvib.cli._arguments import flag, number, option
from mbsvib.cli._shell import UsageProblem

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping

    from mbsvib.api.model import Model

# The reader of a file by what it is: module and function, and the format's name.
READERS = {".urdf": ("mbsvib.urdf", "load_urdf", "URDF"), ".xml": ("mbsvib.mjcf", "load_mjcf", "MJCF")}
ALL = "*"  # of a mapping by joint: all that are not named

Pair = tuple[str, float | list[float]]


def _values(text: str) -> float | list[float]:
    values = [number(word) for word in text.split(",")]
    return values if len(values) > 1 else values[0]


def _named(text: str) -> Pair:
    """NAME=VALUES."""
    name, _, values = text.rpartition("=")
    if not name:
        raise ArgumentTypeError(f"expected NAME=VALUE, such as elbow=0.5, and not '{text[:40]}'")
    return name, _values(values)


def _by_joint(text: str) -> Pair:
    """JOINT=VALUES, or VALUES of all joints."""
    try:
        return _named(text) if "=" in text else (ALL, _values(text))
    except ArgumentTypeError:
        raise ArgumentTypeError(f"expected a number, or six with commas between, of all joints or as JOINT=NUMBER, and "
                                f"not '{text[:40]}'") from None  # fmt: skip


def _vector(text: str) -> list[float]:
    values = _values(text)
    if not isinstance(values, list) or len(values) != 3:
        raise ArgumentTypeError(f"expected X,Y,Z without blanks, such as 0,0,-9.81, and not '{text[:40]}'")
    return values


ROBOTS = (
    option("--stiffness", to="stiffness", metavar="[JOINT=]K", action="append", type=_by_joint, completes="joint",
           words="Of all joints, or of one [N m/rad, N/m]: one number, or six, x,y,z,rx,ry,rz with z along the axis. "
                 "May be given several times; a URDF states none."),
    option("--damping", to="damping", metavar="[JOINT=]C", action="append", type=_by_joint, completes="joint",
           words="Likewise [N m s/rad, N s/m]. Default: the file's."),
    option("--pose", to="pose", metavar="JOINT=Q", action="append", type=_named, completes="joint",
           words="Position of a joint [rad, m]; may be given several times. Default: 0 (MJCF: the keyframe's)."),
    option("--gravity", to="gravity", metavar="X,Y,Z", type=_vector,
           words="Gravity [m/s^2], such as 0,0,-9.81; where X is negative, as --gravity=X,Y,Z. Default: none (MJCF: "
                 "the file's)."),
    flag("--floating", "floating", "URDF: the root link moves freely."),
    option("--tip", to="tip", metavar="LINK", action="append",
           words="URDF: a link with forces and displacements as inputs and outputs; may be given several times."),
    option("--loops", to="loops", metavar="FILE", completes="file",
           words="URDF: a YAML file of Extended URDF with closed loops; those in the URDF itself are always read."),
    option("--inertia", to="inertia", metavar="repair", choices=("repair",),
           words="URDF: replace an inertia that no body can have by the nearest possible one."),
    option("--keyframe", to="keyframe", metavar="NAME", words="MJCF: the keyframe with positions and controls."),
    option("--control", to="control", metavar="ACTUATOR=U", action="append", type=_named,
           words="MJCF: control of an actuator; may be given several times."),
    option("--leave", to="leave", metavar="NAME", action="append",
           words="MJCF: actuator, tendon or equality constraint that is left out; may be given several times."),
)  # fmt: skip
NAMES = {argument.settings["dest"]: argument.names[0] for argument in ROBOTS}
MAPPINGS = ("stiffness", "damping", "pose", "control")


def given(values: dict[str, Any]) -> dict[str, Any]:
    """Take the options of this file out of the values of a command line; return those that were given."""
    options = {name: values.pop(name) for name in NAMES}
    return {name: dict(value) if name in MAPPINGS else value for name, value in options.items()
            if value is not None and value is not False}  # fmt: skip


def read(path: str, kind: str, options: Mapping[str, Any]) -> Model:
    """Read a file by its reader in ``READERS`` with the options that it takes; others are refused."""
    reader = _reader(kind)
    refuse_others(path, READERS[kind][2], options, list(signature(reader).parameters))
    return reader(path, **options)


def refuse_others(path: str, kind: str, options: Mapping[str, Any], known: list[str]) -> None:
    """Refuse options that a kind of files does not take; ``known`` are those that it takes."""
    for name in options:
        if name not in known:
            takers = " and ".join(f"{title} ({suffix})" for suffix, (*_, title) in READERS.items()
                                  if name in signature(_reader(suffix)).parameters)  # fmt: skip
            raise UsageProblem(f"{NAMES[name]}: '{path}' is {kind}, which does not take it; it is for files of "
                               f"{takers}.")  # fmt: skip


def _reader(kind: str) -> Callable[..., Model]:
    module, function, _ = READERS[kind]
    reader: Callable[..., Model] = getattr(import_module(module), function)
    return reader
