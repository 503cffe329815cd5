"""Files to documents: plain values of JSON or YAML text, and the line number of each key; every error of reading is a
ModelError.

JSON is nearly a subset of YAML 1.2, but with the standard parser a model is read ten times quicker, and its messages
are about JSON. It gives no lines; a walk over the tokens of the text that it has found valid does.

Built on the parser's events: a model of 14 bodies is read in half the time that round-trip loading takes, and a scalar
means what the core schema of YAML 1.2 says (``1e6`` is a number, ``yes`` and ``on`` are text).
"""

from __future__ import annotations

import json
import os
import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from os import PathLike
from pathlib import Path
from typing import Any

from mbsvib.common.expected import a_path
from mbsvib.common.file_content import content_of, shortened
from mbsvib.errors import ModelError, nearest

# (section, name, word): the path from the top of a document to one key
KeyPath = tuple[str, ...]


@dataclass(frozen=True, slots=True)
class Document:
    """The values of a file, as dicts, lists and scalars, and the line of each key."""

    file: str
    data: Any
    lines: Mapping[KeyPath, int]

    def error(
        self, key_path: KeyPath, message: str, *, element: str | None = None, field: str | None = None
    ) -> ModelError:
        """Build the error "FILE, line LINE, PLACE: MESSAGE"."""
        known = key_path
        while known and known not in self.lines:  # a key that is missing or is from an alias
            known = known[:-1]
        return fault(self.file, self.lines.get(known, 1), key_path, message, element=element, field=field)


def fault(
    file: str, line: int, key_path: KeyPath, message: str, *, column: int | None = None,
    element: str | None = None, field: str | None = None,
) -> ModelError:  # fmt: skip
    """Build the error "FILE, line LINE[, column COLUMN][, PLACE]: MESSAGE"."""
    location = [file, f"line {line}"]
    if column is not None:
        location.append(f"column {column}")
    if key_path:
        location.append(".".join(key_path))
    return ModelError(f"{', '.join(location)}: {message}", element=element, field=field)


def repeated(file: str, line: int, key_path: KeyPath, first: int) -> ModelError:
    """Build the error of a duplicate key."""
    return fault(file, line, key_path, f"'{key_path[-1]}' is already there on line {first}, and each key can be there "
                                       f"only once; rename or remove one.", element=key_path[-1])  # fmt: skip


_TOKEN = re.compile(r'"(?:[^"\\]|\\.)*"|[{}\[\]:\n]')


def read_json(text: str, file: str) -> Document:
    """Read a JSON text; ``file`` is its name in messages."""
    if not text.strip():
        return Document(file, None, {})
    try:
        data = json.loads(text, parse_int=_integer)
    except json.JSONDecodeError as error:
        raise fault(file, error.lineno, (), f"this is not valid JSON: {error.msg}.", column=error.colno) from error
    except RecursionError as error:
        raise fault(file, 1, (), "lists and objects are nested too deep.") from error
    return Document(file, data, _lines(text, file))


def _integer(text: str) -> Any:
    # long integers become floats too; Python refuses to convert thousands of digits
    return int(text) if len(text) < 18 else float(text)


def _lines(text: str, file: str) -> dict[KeyPath, int]:
    """Return the line of each key that is not inside a list; refuse duplicate keys anywhere."""
    lines: dict[KeyPath, int] = {}
    line = 1
    # of each object or list: its path, None inside a list, and the lines of its own keys
    stack: list[tuple[KeyPath | None, dict[str, int]]] = []
    last = ""
    value: KeyPath | None = ()
    for match in _TOKEN.finditer(text):
        token = match[0]
        if token == "\n":
            line += 1
        elif token == ":":
            parent, line_of = stack[-1]
            key = json.loads(last)
            value = None if parent is None else (*parent, key)
            if key in line_of:
                raise repeated(file, line, value or (key,), line_of[key])
            line_of[key] = line
            if value is not None:
                lines[value] = line
        elif token in "{[":
            lines.setdefault((), line)
            value = value if token == "{" else None
            stack.append((value, {}))
        elif token in "}]":
            stack.pop()
            value = None
        else:
            last = token
    return lines


_CONSTANTS: dict[str, Any] = {
    "": None, "~": None, "null": None, "Null": None, "NULL": None,
    "true": True, "True": True, "TRUE": True, "false": False, "False": False, "FALSE": False,
}  # fmt: skip
_INTEGER = re.compile(r"[-+]?[0-9]{1,17}")
_BASED = re.compile(r"0(?:o[0-7]{1,16}|x[0-9a-fA-F]{1,12})")
_FLOAT = re.compile(r"[-+]?(?:\.[0-9]+|[0-9]+(?:\.[0-9]*)?)(?:[eE][-+]?[0-9]+)?")
_SPECIAL = re.compile(r"[-+]?\.(?:inf|Inf|INF)|\.(?:nan|NaN|NAN)")
# a model needs five levels; far more could exhaust the stack
MAX_DEPTH = 40
# Values that aliases stand for: aliases of aliases multiply, and a few lines could stand for any number of values.
MOST_REPEATED = 1_000_000


def read_yaml(text: str, file: str) -> Document:
    """Read a YAML text; ``file`` is its name in messages."""
    from ruamel.yaml import YAML
    from ruamel.yaml.error import MarkedYAMLError, YAMLError

    builder = _Builder(file, YAML(typ="safe", pure=True).parse(text))
    try:
        return Document(file, builder.document(), builder.lines)
    except MarkedYAMLError as error:
        raise _syntax(error, file) from error
    except YAMLError as error:
        position = getattr(error, "position", 0)
        line, column = text.count("\n", 0, position) + 1, position - text.rfind("\n", 0, position)
        raise fault(file, line, (), f"the character {text[position : position + 1]!r} is not allowed in YAML.",
                    column=column) from error  # fmt: skip
    except ModelError:
        raise
    except Exception as error:  # numbers of characters past the last one, and what else the parser does not expect
        line = max(builder.lines.values())
        raise fault(file, line, (), f"this is no YAML from here on: {shortened(error)}.") from error


def scalar(text: str) -> Any:
    """Return the value of an unquoted scalar in the core schema of YAML 1.2."""
    if text in _CONSTANTS:
        return _CONSTANTS[text]
    if text[0] not in "+-.0123456789":
        return text
    if _INTEGER.fullmatch(text):
        return int(text)
    if _FLOAT.fullmatch(text):
        return float(text)
    if _BASED.fullmatch(text):
        return int(text[2:], 8 if text[1] == "o" else 16)
    if _SPECIAL.fullmatch(text):
        return float(text.replace(".", ""))
    return text


class _Builder:
    """Builds plain values from events, and records the line of each key."""

    def __init__(self, file: str, events: Iterator[Any]) -> None:
        self.file = file
        self.events = events
        self.lines: dict[KeyPath, int] = {(): 1}
        # value of each anchor, and the number of values in it
        self.anchors: dict[str, tuple[Any, int]] = {}
        self.values = 0
        self.repeated = 0

    def document(self) -> Any:
        from ruamel.yaml.events import DocumentStartEvent

        data, has_document = None, False
        for event in self.events:
            if isinstance(event, DocumentStartEvent):
                if has_document:
                    raise self.fault(event, (), "a second document starts here; a model file holds one.")
                first = next(self.events)
                self.lines[()] = first.start_mark.line + 1
                data, has_document = self.node(first, (), 0), True
        return data

    def node(self, event: Any, key_path: KeyPath | None, depth: int) -> Any:
        """Build the value that starts with ``event``; ``key_path`` is None inside a list."""
        from ruamel.yaml.events import AliasEvent, MappingStartEvent, ScalarEvent

        value: Any
        if isinstance(event, AliasEvent):
            if event.anchor not in self.anchors:
                raise self.fault(event, key_path, f"the alias *{event.anchor} stands for nothing; there is no "
                                               f"&{event.anchor} that is complete above it.")  # fmt: skip
            value, count = self.anchors[event.anchor]
            self.values += count
            self.repeated += count
            if self.repeated > MOST_REPEATED:
                raise self.fault(event, key_path, f"the aliases up to here stand for more than {MOST_REPEATED} values; "
                                               f"write less of them.")  # fmt: skip
            return value
        if event.tag is not None:
            raise self.fault(event, key_path, f"the tag {event.tag} has no meaning in a model file; leave it out.")
        if depth > MAX_DEPTH:
            raise self.fault(event, key_path, f"lists and mappings are nested more than {MAX_DEPTH} deep.")
        self.values += 1
        before = self.values - 1
        if isinstance(event, ScalarEvent):
            value = event.value if event.style else scalar(event.value)
        elif isinstance(event, MappingStartEvent):
            value = self.mapping(key_path, depth)
        else:
            value = self.sequence(depth)
        if event.anchor is not None:
            self.anchors[event.anchor] = value, self.values - before
        return value

    def sequence(self, depth: int) -> list[Any]:
        from ruamel.yaml.events import SequenceEndEvent

        result = []
        while not isinstance(event := next(self.events), SequenceEndEvent):
            result.append(self.node(event, None, depth + 1))
        return result

    def mapping(self, key_path: KeyPath | None, depth: int) -> dict[str, Any]:
        from ruamel.yaml.events import MappingEndEvent

        entries: dict[str, Any] = {}
        merged: dict[str, Any] = {}
        lines_of: dict[str, int] = {}
        while not isinstance(event := next(self.events), MappingEndEvent):
            line = event.start_mark.line + 1
            key = self.key(event, key_path, depth)
            path = None if key_path is None else (*key_path, key)
            if key in lines_of:
                raise repeated(self.file, line, path or (key,), lines_of[key])
            lines_of[key] = line
            if key == "<<" and not event.style:
                merged = self.merged(next(self.events), key_path, depth)
                continue
            if path is not None:
                self.lines[path] = line
            entries[key] = self.node(next(self.events), path, depth + 1)
        return merged | entries if merged else entries

    def key(self, event: Any, key_path: KeyPath | None, depth: int) -> str:
        key = self.node(event, None, depth + 1)
        if isinstance(key, str):
            return key
        if isinstance(key, (list, dict)):
            raise self.fault(event, key_path, "a list or mapping cannot be a key; expected a name.")
        kind = {bool: "a truth value", type(None): "empty"}.get(type(key), "a number")
        value = getattr(event, "value", "")
        if key_path is not None and len(key_path) > 1:  # a part has words, which are no numbers
            raise self.fault(event, key_path, f"{value} stands where a word should, such as stiffness: ...; a comma "
                                              f"ends a number: write 5000 and not 5,000.")  # fmt: skip
        raise self.fault(event, key_path, f"the key {value} is {kind} in YAML, and a name is text; "
                                          f"write it in quotes: '{value}'.")  # fmt: skip

    def merged(self, event: Any, key_path: KeyPath | None, depth: int) -> dict[str, Any]:
        """Return the entries of a merge key ``<<``; of several mappings the first one with a key has priority."""
        value = self.node(event, None, depth + 1)
        parents = value if isinstance(value, list) else [value]
        if not all(isinstance(parent, dict) for parent in parents):
            raise self.fault(event, key_path, "<< takes the alias of a mapping, or a list of such aliases.")
        result: dict[str, Any] = {}
        for parent in reversed(parents):
            result |= parent
        return result

    def fault(self, event: Any, key_path: KeyPath | None, message: str) -> ModelError:
        return fault(self.file, event.start_mark.line + 1, key_path or (), message)


def _syntax(error: Any, file: str) -> ModelError:
    mark = error.problem_mark or error.context_mark
    text = f"this is not valid YAML: {error.problem}"
    if error.context:
        text += f", {error.context}"
        if error.context_mark is not None and error.context_mark.line != mark.line:
            text += f" that starts on line {error.context_mark.line + 1}"
    if "\\t" in error.problem:
        text += "; indent with blanks, YAML takes no tabs"
    return fault(file, mark.line + 1, (), f"{text}.", column=mark.column + 1)


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
