"""Models to model files: the arguments that made each part, one key a line. Files are written
completely or not at all.
"""

from __future__ import annotations

import json
import re
from collections.abc import Iterator, Mapping
from os import PathLike
from pathlib import Path
from typing import Any

from mbsvib.api.model import ADDERS, Model
from mbsvib.common.atomic_file import write_atomic
from mbsvib.common.expected import a_model
from mbsvib.elements.dynamic import Dynamic
from mbsvib.errors import ModelError
from mbsvib.files.reading import suffix_of
from mbsvib.files.words import SECTIONS, VERSION, head_words, words

HEADING = "# mbsvib model: SI units and radians; positions and axes in world coordinates"
# A plain scalar starts with a letter, so that it is not a number. It has single blanks only, so that it has no ": " and
# no " #".
_PLAIN = re.compile(r"[^\W\d][\w./-]*(?: [\w./-]+)*")
# text in YAML 1.2, but most of it has another type in YAML 1.1
_RESERVED = frozenset({"null", "true", "false", "yes", "no", "on", "off"})
# YAML takes a longer key only in its explicit form
_LONG_KEY = 1000


def yaml_text(data: Mapping[str, Any]) -> str:
    """Return the YAML text of a model's description."""
    lines = [HEADING]
    for key, value in data.items():
        if isinstance(value, Mapping):
            lines += ["", f"{key}:"]
            for name, words in value.items():
                lines.append(f"  {_key(name)}" if len(name) < _LONG_KEY else f"  ? {_word(name)}\n  :")
                lines += (f"    {line}" for word, argument in words.items() for line in _yaml_entry(word, argument))
        else:
            lines += _yaml_entry(key, value)
    return "\n".join(lines) + "\n"


def json_text(data: Mapping[str, Any]) -> str:
    """Return the JSON text of a model's description."""
    return f"{_json_value(data, '')}\n"


def number(value: float) -> str:
    """Return the shortest text that reads back as the same float, large round numbers as 2.0e+7.

    The point is always there, and an exponent has its sign: readers of YAML 1.1 take it for text otherwise.
    """
    text = repr(float(value))
    mantissa, _, exponent = text.partition("e")
    if exponent:
        return text if "." in mantissa else f"{mantissa}.0e{exponent}"
    if abs(value) >= 1e5 and text.endswith("000.0"):
        sign, digits = ("-", text[1:-2]) if text[0] == "-" else ("", text[:-2])
        significant = digits.rstrip("0")
        return f"{sign}{significant[0]}.{significant[1:] or '0'}e+{len(digits) - 1}"
    return text


def _yaml_entry(word: str, value: Any) -> Iterator[str]:
    if _is_matrix(value):
        yield _key(word)
        yield from (f"  - {_inline(row, _word)}" for row in value)
    else:
        yield f"{_key(word)} {_inline(value, _word)}"


def _json_value(value: Any, indent: str) -> str:
    deeper = indent + "  "
    if isinstance(value, Mapping):
        inner = (f"{deeper}{_quoted(key)}: {_json_value(item, deeper)}" for key, item in value.items())
        return "{\n" + ",\n".join(inner) + f"\n{indent}}}"
    if _is_matrix(value):
        return "[\n" + ",\n".join(f"{deeper}{_inline(row, _quoted)}" for row in value) + f"\n{indent}]"
    return _inline(value, _quoted)


def _inline(value: Any, text: Any) -> str:
    if isinstance(value, Mapping):
        return f"{{{', '.join(f'{text(key)}: {_inline(item, text)}' for key, item in value.items())}}}"
    if isinstance(value, tuple):
        return f"[{', '.join(_inline(item, text) for item in value)}]"
    if isinstance(value, str):
        return str(text(value))
    return json.dumps(value) if value is None or isinstance(value, int) else number(value)


def _is_matrix(value: Any) -> bool:
    return isinstance(value, tuple) and bool(value) and isinstance(value[0], tuple)


def _key(name: str) -> str:
    return f"{_word(name)}:"


def _word(text: str) -> str:
    plain = _PLAIN.fullmatch(text) and text.lower() not in _RESERVED
    return text if plain else _quoted(text)


def _quoted(text: str) -> str:
    return json.dumps(str(text), ensure_ascii=False)


def save(model: Model, path: str | PathLike[str]) -> Path:
    """Write a model file; ``load`` gives back equal parts in the same order, every float to the last bit.

    Parameters
    ----------
    model : Model
        The model.
    path : str or path-like
        Where to; its suffix .yaml, .yml or .json says how. A file that is there is replaced once the new one is
        complete.

    Returns
    -------
    Path
        The path written.

    Raises
    ------
    ModelError
        If the suffix is none of these, or the file cannot be written.
    """
    write = json_text if suffix_of(path) == ".json" else yaml_text
    text = write(described(a_model(model, "save")))
    return write_atomic(path, lambda stream: stream.write(text.encode()), ModelError)


def described(model: Model) -> dict[str, Any]:
    """Return the content of a model's file: format version, words of ``Model(...)``, and the sections."""
    data: dict[str, Any] = {"mbsvib": VERSION}
    for word, item in head_words().items():
        value = getattr(model, word, item.default)
        if word == "name" or value != item.default:
            data[word] = value
    for section, kinds in SECTIONS.items():
        entries = {}
        for name, part in getattr(model, section).items():
            kind = ADDERS[type(part)].removeprefix("add_")
            entry_words = {} if kind == kinds[0] else {"type": kind}
            for word, value in part.constructor_kwargs().items():
                if word != "name" and value != words(kind)[word].default:
                    entry_words[word] = _spoken(word, value)
            entries[name] = entry_words
        if entries:
            data[section] = entries
    return data


def _spoken(word: str, value: Any) -> Any:
    """Return the shortest form of a value that the ``add_...`` call converts to the same value."""
    if word in ("inertia", "direction") and isinstance(value, tuple) and value[3:] == (0.0, 0.0, 0.0):
        return value[:3]
    return value.words() if isinstance(value, Dynamic) else value
