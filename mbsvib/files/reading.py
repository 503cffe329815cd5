"""Files to documents: the suffix determines the format; every error of reading is a ModelError."""

from __future__ import annotations

import os
from os import PathLike
from pathlib import Path

from mbsvib.common.expected import a_path
from mbsvib.common.file_content import content_of
from mbsvib.errors import ModelError, nearest
from mbsvib.files.document import Document, fault
from mbsvib.files.json_text import read_json
from mbsvib.files.yaml_text import read_yaml

READERS = {".yaml": read_yaml, ".yml": read_yaml, ".json": read_json}
HINTS = {
    ".xacro": " Expand macros to a URDF first, xacro file.urdf.xacro > file.urdf, which load_urdf and commands read.",
    ".sdf": " SDF is not read; write the robot as a URDF or MJCF file, which load_urdf, load_mjcf and commands read.",
}  # fmt: skip
ROBOTS = {".urdf": "load_urdf", ".xml": "load_mjcf"}


def suffix_of(path: str | PathLike[str]) -> str:
    """Return the suffix of a model file in lower case; refuse unknown ones."""
    suffix = a_path(path, "file", ModelError).suffix
    if suffix.lower() not in READERS:
        robot = f" Robots are read by mbsvib.{ROBOTS[suffix.lower()]}." if suffix.lower() in ROBOTS else \
            HINTS.get(suffix.lower(), "")  # fmt: skip
        raise ModelError(f"{path}: the suffix is {suffix!r}; expected .yaml, .yml or .json, which says how a model "
                         f"is written.{robot}")  # fmt: skip
    return suffix.lower()


def read(path: str | PathLike[str]) -> Document:
    """Read a file whose suffix is .yaml, .yml or .json."""
    parse = READERS[suffix_of(path)]
    file = Path(path)
    if not os.path.lexists(path):
        raise ModelError(f"{path}: there is no such file.{_neighbour(file)}")
    content = content_of(path, ModelError, "a model file")
    try:
        text = content.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        line = content.count(b"\n", 0, error.start) + 1
        raise fault(str(path), line, (), f"the byte 0x{content[error.start]:02x} is not UTF-8; save the file "
                                         f"with this encoding.") from error  # fmt: skip
    return parse(text, str(path))


def _neighbour(file: Path) -> str:
    folder = file.parent
    if not folder.is_dir():
        return f" There is no folder '{folder}' either."
    try:
        return nearest(file.name, [entry.name for entry in folder.iterdir()])
    except OSError:
        return ""
