"""YAML 1.2 text to plain values with line numbers.

Built on the parser's events: a model of 14 bodies is read in half the time that round-trip loading takes, and a scalar
means what the core schema of YAML 1.2 says (``1e6`` is a number, ``yes`` and ``on`` are text).
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from typing import Any

from mbsvib.common.file_content import shortened
from mbsvib.errors import ModelError
from mbsvib.files.document import Document, KeyPath, fault, repeated

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
