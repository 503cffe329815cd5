"""Model files to models: each entry becomes an ``add_...`` call."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from os import PathLike
from pathlib import Path
from typing import Any

from mbsvib.api.model import Model
from mbsvib.common import arguments as check
from mbsvib.errors import ModelError, nearest
from mbsvib.files.reading import Document, KeyPath, read
from mbsvib.files.words import ALL_SECTIONS, VERSION, head_words, mandatory, options, unfit, words
from mbsvib.mechanism.mechanism import GROUND

# keys at the top level in addition to the sections and the arguments of Model(...)
MARK, SCHEMA = "mbsvib", "$schema"
# sections of parts that may be connected by their nodes or bodies
COMPOSED = ("models", "beams", "superelements")
# maximum number of known names in a message
MOST_NAMES = 12


def load(path: str | PathLike[str]) -> Model:
    """Read a model file: the words of ``Model(...)`` and of its ``add_...`` calls as YAML 1.2 or JSON.

    Parameters
    ----------
    path : str or path-like
        A file whose name ends in .yaml, .yml or .json; ``mbsvib.files`` describes its layout.

    Returns
    -------
    Model
        The model, its parts in the order of the file; its name is the file's where the file gives none.

    Raises
    ------
    ModelError
        If the file cannot be read, or a key or value in it is refused; the message gives file, line and key.
    """
    return _loaded(read(path), Path(path), (Path(path).resolve(),))


def _loaded(document: Document, path: Path, open_files: tuple[Path, ...], name: str | None = None) -> Model:
    """The model of a document, in which paths are relative to the folder of ``path``.

    ``open_files`` are those whose parts it is; ``name`` is its own where it gives none, else that of the file.
    """
    data = document.data
    if not isinstance(data, dict):
        problem = "the file is empty" if data is None else f"{_what(data)} stands at the top"
        raise document.error((), f"{problem}; expected the sections of a model: {', '.join(ALL_SECTIONS)}.")
    if "state_space" in data or {"A", "B"} <= data.keys():
        raise document.error((), "the file holds a state space and no model; mbsvib_export.from_json reads those of "
                             "to_json.")  # fmt: skip
    _check_version(document, data)
    head = head_words()
    for key in data:
        if key not in ALL_SECTIONS and key not in head and key not in (MARK, SCHEMA):
            hint = _outdented(key, data) or _misplaced(key) or _known(key, [*ALL_SECTIONS, *head, MARK])
            raise document.error((key,), f"there is no such section.{hint}")
    model = _model(document, {key: data[key] for key in head if key in data}, name or path.stem)
    entries = [(section, name, entry) for section in ALL_SECTIONS
               for name, entry in _entries(document, section, data.get(section))]  # fmt: skip
    for section, key, entry in _nodes_first(entries):
        _add(document, model, section, key, _with_files(document, (section, key), entry, path.parent, open_files))
    return model


def _with_files(document: Document, key_path: KeyPath, entry: Any, folder: Path, open_files: tuple[Path, ...]) -> Any:
    """The words of a part, with the model that it names or has inside, and the path of its mesh from the folder on."""
    if not isinstance(entry, dict):
        return entry
    if key_path[0] == "models" and isinstance(entry.get("other"), str | dict):
        return entry | {"other": _other(document, (*key_path, "other"), entry["other"], folder, open_files)}
    shape = entry.get("shape")
    if key_path[0] == "bodies" and isinstance(shape, dict) and isinstance(shape.get("file"), str):
        return entry | {"shape": shape | {"file": str(folder / shape["file"])}}
    return entry


def _other(document: Document, key_path: KeyPath, value: Any, folder: Path, open_files: tuple[Path, ...]) -> Model:
    """The model that is a part of another: the content of a file, or sections in place."""
    if isinstance(value, dict):
        depth = len(key_path)
        lines = {place[depth:]: line for place, line in document.lines.items() if place[:depth] == key_path}
        inside = Document(document.file, value, lines)
        return _loaded(inside, folder / Path(document.file).name, open_files, key_path[1])
    path = folder / value
    if path.resolve() in open_files:
        raise document.error(key_path, f"the file '{value}' would be a part of itself.", field="other")
    try:
        return _loaded(read(path), path, (*open_files, path.resolve()))
    except ModelError as error:
        raise document.error(key_path, str(error), element=error.element, field=error.field) from error


def _nodes_first(items: list[tuple[str, str, Any]]) -> Iterable[tuple[str, str, Any]]:
    """Entries sorted so that models, beams and superelements follow those to whose bodies they are connected."""
    waiting = [item for item in items if item[0] in COMPOSED]
    if not waiting:
        return items
    first = [item for item in items if item[0] == "bodies"]
    others = [item for item in items if item[0] not in ("bodies", *COMPOSED)]
    ordered = []
    while waiting:
        owners = {name for _, name, _ in waiting}
        ready = next((item for item in waiting if not _attached_bodies(item[2]) & (owners - {item[1]})), waiting[0])
        waiting.remove(ready)
        ordered.append(ready)
    return first + ordered + others


def _attached_bodies(entry: Any) -> set[str]:
    """Possible owners of the bodies to which a model, beam or superelement is connected."""
    if not isinstance(entry, dict):
        return set()
    attached = entry.get("bodies")
    names = [*(entry.get(word) for word in ("a", "b", "ground")),
             *(attached.values() if isinstance(attached, dict) else ())]
    return {name[:i] for name in names if isinstance(name, str) for i, sign in enumerate(name) if sign == "."}


def _check_version(document: Document, data: Mapping[str, Any]) -> None:
    version = data.get(MARK, VERSION)
    if type(version) is not int or version < 1:
        raise document.error((MARK,), f"{version!r} is not a format version; expected {VERSION}.")
    if version > VERSION:
        raise document.error((MARK,), f"the file has format version {version}, and this mbsvib reads up to "
                                      f"{VERSION}; update mbsvib.")  # fmt: skip


def _model(document: Document, head: dict[str, Any], stem: str) -> Model:
    for key, value in head.items():
        expected = unfit(head_words()[key], value)
        if expected is not None:
            raise document.error((key,), _mismatch(key, value, expected), field=key)
    try:
        return Model(**{"name": stem, **head})
    except ModelError as error:
        key_path = (error.field,) if error.field in head else ()
        raise _with_line(document, key_path, error) from error


def _entries(document: Document, section: str, entries: Any) -> Iterable[tuple[str, Any]]:
    if entries is None:
        return ()
    if not isinstance(entries, dict):
        raise document.error((section,), f"expected a name and words for each of the {section}, not "
                                         f"{_what(entries)}.")  # fmt: skip
    return entries.items()


def _add(document: Document, model: Model, section: str, name: str, entry: Any) -> None:
    path = (section, name)
    if not isinstance(entry, dict):
        raise document.error(path, f"expected the words of {_calls(section)}, not {_what(entry)}.", element=name)
    entry = dict(entry)
    kind = _kind(document, path, entry)
    known = words(kind)
    for key, value in entry.items():
        wrong = _wrong(model, section, kind, key, value)
        if wrong is not None:
            raise document.error((*path, key), wrong, element=name, field=key)
    missing = [word for word, item in known.items() if mandatory(item) and word not in entry]
    if missing:
        raise document.error(path, f"missing: {', '.join(missing)}; add_{kind} takes {', '.join(known)}.",
                             element=name, field=missing[0])  # fmt: skip
    # an argument that may be None is optional here, even if Python requires it
    absent = {word: None for word, item in known.items() if item.default is item.empty and word not in entry}
    try:
        getattr(model, f"add_{kind}")(name, **absent, **entry)
    except ModelError as error:
        field = error.field
        raise _with_line(document, (*path, field) if field in known and field is not None else path, error) from error


def _wrong(model: Model, section: str, kind: str, key: str, value: Any) -> str | None:
    """Return the error of an argument that the ``add_...`` call would not report, or less clearly."""
    known = words(kind)
    if key not in known:
        return f"add_{kind} has no such word.{_kinds_with_word(section, kind, key) or _known(key, known)}"
    expected = unfit(known[key], value)
    if expected is not None:
        return _mismatch(key, value, expected)
    # the call would advise to add bodies first, but in a file the order does not matter
    if "Body" in options(known[key]) and "Joint" not in options(known[key]) and not _is_body(model, value):
        return f"there is no body '{value}'.{_known(value, [*model.bodies, *model.nodes, GROUND])}"
    return None


def _is_body(model: Model, value: Any) -> bool:
    return value is None or value in model.bodies or value == GROUND or value in model.nodes


def _kind(document: Document, key_path: KeyPath, entry: dict[str, Any]) -> str:
    kinds = ALL_SECTIONS[key_path[0]]
    if len(kinds) == 1 or "type" not in entry:
        return kinds[0]
    kind = entry.pop("type")
    if kind not in kinds:
        expected = f"{', '.join(kinds[:-1])} or {kinds[-1]}"
        raise document.error((*key_path, "type"), f"{kind!r} is not a type of {key_path[0]}; expected {expected}."
                             f"{nearest(str(kind), kinds)}", element=key_path[1], field="type")  # fmt: skip
    return str(kind)


def _with_line(document: Document, key_path: KeyPath, error: ModelError) -> ModelError:
    message = str(error).removeprefix(f"{error.element}: ")
    return document.error(key_path, message, element=error.element, field=error.field)


def _calls(section: str) -> str:
    return " or ".join(f"add_{kind} ({', '.join(words(kind))})" for kind in ALL_SECTIONS[section])


def _outdented(key: str, data: Mapping[str, Any]) -> str:
    """Return a hint for an entry of the section above that begins where sections begin."""
    above = next((other for other in reversed(list(data)[: list(data).index(key)]) if other in ALL_SECTIONS), None)
    entry = data[key]
    fits = above is not None and isinstance(entry, dict) and entry and any(
        entry.keys() <= {*words(kind), "type"} for kind in ALL_SECTIONS[above])
    return f" It reads as one of the {above} above: indent it as these." if fits else ""


def _misplaced(key: str) -> str:
    """Return a hint for names of sections that do not exist, such as those of single types."""
    for section, kinds in ALL_SECTIONS.items():
        for kind in kinds:
            if key in (kind, f"{kind}s"):
                condition = "" if kind == kinds[0] else f", each with 'type: {kind}'"
                return f" These go under '{section}'{condition}."
    return ""


def _kinds_with_word(section: str, kind: str, key: str) -> str:
    others = [candidate for candidate in ALL_SECTIONS[section] if candidate != kind and key in words(candidate)]
    return f" It is a word of add_{others[0]}: add 'type: {others[0]}' if that is meant." if others else ""


def _known(key: str, known: Iterable[str]) -> str:
    names = list(known)
    more = ", ..." if len(names) > MOST_NAMES else "."
    return nearest(key, names) or f" Known: {', '.join(names[:MOST_NAMES])}{more}"


def _mismatch(key: str, value: Any, expected: str) -> str:
    hint = ""
    if expected == "true or false" and isinstance(value, str):
        hint = " In YAML 1.2 yes, no, on and off are text."
    elif expected == "a text" and isinstance(value, (bool, int, float)):
        hint = " Write it in quotes if it is a name."
    return f"{key} = {check.shown(value)}; expected {expected}.{hint}"


def _what(value: Any) -> str:
    if value is None:
        return "nothing"
    if isinstance(value, list):
        return "a list"
    return check.shown(value)
