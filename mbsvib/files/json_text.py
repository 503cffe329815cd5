"""JSON text to plain values with line numbers.

JSON is nearly a subset of YAML 1.2, but with the standard parser a model is read ten times quicker, and its messages
are about JSON. It gives no lines; a walk over the tokens of the text that it has found valid does.
"""

from __future__ import annotations

import json
import re
from typing import Any

from mbsvib.files.document import Document, KeyPath, fault, repeated

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
