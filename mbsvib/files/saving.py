"""Models to model files: the arguments that made each part; files are written completely or not at all."""

from __future__ import annotations

from os import PathLike
from pathlib import Path
from typing import Any

from mbsvib.api.model import ADDERS, Model
from mbsvib.common.atomic_file import write_atomic
from mbsvib.common.expected import a_model
from mbsvib.elements.dynamic import Dynamic
from mbsvib.errors import ModelError
from mbsvib.files.reading import suffix_of
from mbsvib.files.text import json_text, yaml_text
from mbsvib.files.words import SECTIONS, VERSION, head_words, words


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
