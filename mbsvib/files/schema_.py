"""The JSON schema of model files, made of the signatures and docstrings of the ``add_...`` calls.

Each argument has its shape and limits where its docstring names its type: ``float, at least 0``, ``array-like, shape
(3,) or (6,), optional``. What is stated here is what these do not say: choices, words within words, and which arguments
go together.
"""

from __future__ import annotations

import re
from inspect import Parameter, getdoc
from typing import Any

from mbsvib.api.model import Model
from mbsvib.common.arguments import DIRECTIONS
from mbsvib.elements import flexure, sections, shapes, strain_output
from mbsvib.elements.joint_kinds import KINDS
from mbsvib.elements.ports import QUANTITIES
from mbsvib.files.words import ALL_SECTIONS, COMPOUND, VERSION, head_words, mandatory, options, words
from mbsvib.mechanism.copies import PLANES

NUMBER, TEXT = {"type": "number"}, {"type": "string"}
POSITIVE = {**NUMBER, "exclusiveMinimum": 0}
NOT_NEGATIVE = {**NUMBER, "minimum": 0}


def _array(items: dict[str, Any], size: str) -> dict[str, Any]:
    exact = {"minItems": int(size), "maxItems": int(size)} if size.isdigit() else {"minItems": 1}
    return {"type": "array", "items": items, **exact}


def _ref(name: str) -> dict[str, Any]:
    return {"$ref": f"#/$defs/{name}"}


def _needs(*groups: tuple[str, ...]) -> list[dict[str, Any]]:
    return [{"required": list(group)} for group in groups]


def _typed(kinds: Any, **words_of: Any) -> dict[str, Any]:
    """A shape with its type and dimensions."""
    return {"type": "object", "properties": {"type": {"enum": [*kinds], "description": "The shape."}}, **words_of}


MATERIAL = {"type": "object", "required": ["E", "rho"], "oneOf": _needs(("nu",), ("G",)),
            "propertyNames": {"enum": ["E", "rho", "nu", "G"]}, "additionalProperties": NUMBER}  # fmt: skip
NUMBERS = {"type": "array", "items": NUMBER, "minItems": 6}  # a superelement has one node at least
SQUARE = {"type": "array", "items": NUMBERS, "minItems": 6}
LINKED = _needs(("stiffness",), ("damping",), ("preload",))
# Shapes that several arguments have.
SHARED: dict[str, Any] = {
    "name": {**TEXT, "pattern": r"^\S(.*\S)?$"}, "new_name": {**_ref("name"), "not": {"const": "ground"}},
    "vector": _array(NUMBER, "3"), "six": _array(NUMBER, "6"), "matrix": _array(_ref("vector"), "3"),
    "six_by_six": _array(_ref("six"), "6"),
    "direction": {"anyOf": [{"enum": [*DIRECTIONS]}, _ref("vector"), _ref("six")]},
    "dynamic": {
        "type": ["object", "null"], "additionalProperties": False, "required": ["weights", "times"], "properties": {
            "static": {**NOT_NEGATIVE, "default": 1.0, "description": "The factor at rest."},
            "viscous": {**NOT_NEGATIVE, "default": 0.0, "description": "Of a damper [s]."},
            "weights": {"type": "array", "items": NOT_NEGATIVE, "description": "Of the relaxations."},
            "times": {"type": "array", "items": POSITIVE, "description": "Their time constants [s]."},
        },
    },
}  # fmt: skip
# What arguments admit beyond their types, by name or by the call's name and theirs.
ADMITTED: dict[str, Any] = {
    "M": SQUARE, "C": SQUARE, "K": SQUARE, "superelement.displacements": NUMBERS,
    "beam.nodes": {"type": "array", "items": _ref("vector"), "minItems": 2},
    "direction": _ref("direction"), "dynamic": _ref("dynamic"), "material": MATERIAL,
    "section": _typed(sections.SHAPES, additionalProperties=POSITIVE),
    "body.shape": _typed(shapes.SHAPES, required=["type"]),
    "flexure.shape": _typed(flexure.SHAPES, required=["type"], additionalProperties=POSITIVE),
    "other": {"anyOf": [TEXT, {"$ref": "#"}]}, "kind": {"enum": [*KINDS, "custom", None]},
    "free": {"anyOf": [{"enum": [*DIRECTIONS]}, {"type": "array", "items": {"enum": [*DIRECTIONS]},
                                                 "uniqueItems": True}]},
    "quantity": {"enum": [*QUANTITIES]}, "mirror": {"enum": [*PLANES]}, "drive": {"enum": ["voltage", "charge"]},
    "at": {"enum": [*strain_output.POSITIONS]}, "side": {"enum": [*strain_output.SIDES]},
    "coefficients": {"type": "object", "minProperties": 2, "additionalProperties": NUMBER},
}  # fmt: skip
# Which arguments of a call go together.
TOGETHER: dict[str, Any] = {
    "body": {"oneOf": _needs(("mass", "inertia"), ("shape", "density"))},
    "beam": {"anyOf": _needs(("start", "end"), ("start", "axis", "length"), ("nodes",))},
    "joint": {"anyOf": _needs(("kind",), ("free",)), "then": {"required": ["pitch"]},
              "if": {"properties": {"kind": {"const": "screw"}}, "required": ["kind"]}},
    "spring": {"anyOf": [*LINKED, *_needs(("free_length",))]}, "bushing": {"anyOf": LINKED},
    "load": {"anyOf": _needs(("force",), ("torque",))},
}  # fmt: skip
ENTRY = re.compile(r"^(\w[\w, ]*) : (.*)\n((?:    .*\n?|\n(?=    ))+)", re.MULTILINE)


def schema() -> dict[str, Any]:
    """Return the JSON schema (draft 2020-12) of model files, for editors that complete and check as one types.

    Write it next to a model as ``model.schema.json``; the line ``# yaml-language-server: $schema=model.schema.json``
    at the top of a YAML file, or the key ``"$schema": "model.schema.json"`` in a JSON file, ties the two together.

    Returns
    -------
    dict
        The schema; words and mandatory words are those of the ``add_...`` calls.
    """
    head = _entries(Model)
    properties = {
        "$schema": {**TEXT, "description": "Where an editor finds this schema."},
        "mbsvib": {"type": "integer", "const": VERSION, "description": "Version of the file format."},
        **{word: _argument("model", word, item, head) for word, item in head_words().items()},
        **{section: _section(section, kinds) for section, kinds in ALL_SECTIONS.items()},
    }
    properties["name"] = {**_ref("name"), "description": "Name of the model; the file's name if left out."}
    return {
        "$schema": "https://json-schema.org/draft/2020-12/schema", "$id": f"urn:mbsvib:model:{VERSION}",
        "title": "mbsvib model", "description": "A multibody model for vibration analysis. SI units and radians; "
                                                "positions and axes in world coordinates.",
        "type": "object", "additionalProperties": False, "properties": properties,
        "$defs": SHARED | {kind: _call(kind, kinds) for kinds in ALL_SECTIONS.values() for kind in kinds},
    }  # fmt: skip


def _section(section: str, kinds: tuple[str, ...]) -> dict[str, Any]:
    """The schema of a section: parts by name, of the first kind unless their type is another."""
    part = _ref(kinds[0])
    for kind in reversed(kinds[1:]):
        test = {"type": "object", "properties": {"type": {"const": kind}}, "required": ["type"]}
        part = {"if": test, "then": _ref(kind), "else": part}
    text = "; ".join([f"What add_{kinds[0]} adds, by name", *[f"with 'type: {kind}' what add_{kind} adds"
                                                              for kind in kinds[1:]]])  # fmt: skip
    if section in COMPOUND:
        text += ". Once saved again, a file holds the parts of which they are made"
    names = "name" if section in ("inputs", "outputs") else "new_name"
    return {"type": ["object", "null"], "description": f"{text}.", "propertyNames": _ref(names),
            "additionalProperties": part}  # fmt: skip


def _call(kind: str, kinds: tuple[str, ...]) -> dict[str, Any]:
    """The schema of the arguments of ``add_KIND``, one of the kinds of a section."""
    call = getattr(Model, f"add_{kind}")
    entries, known = _entries(call), words(kind)
    properties = {word: _argument(kind, word, item, entries) for word, item in known.items()}
    needed = [word for word, item in known.items() if mandatory(item)]
    if kind != kinds[0]:
        properties, needed = {"type": {"const": kind}} | properties, ["type", *needed]
    elif len(kinds) > 1:
        properties = {"type": {"enum": [*kinds]}} | properties
        if kind not in COMPOUND.get("drives", ()):
            properties["type"] |= {"default": kind, "description": "What it is."}
    said = _plain((getdoc(call) or "").split("\n\n")[0]).removeprefix("Add ").rstrip(".")
    return {"type": "object", "description": f"{said[:1].upper()}{said[1:]} (add_{kind}).",
            "additionalProperties": False, "required": needed, **TOGETHER.get(kind, {}),
            "properties": properties}  # fmt: skip


def _argument(kind: str, word: str, item: Parameter, entries: dict[str, tuple[str, str]]) -> dict[str, Any]:
    """The schema of an argument: its type, default and description."""
    stated, text = entries.get(word, ("", ""))
    result = dict(ADMITTED.get(f"{kind}.{word}") or ADMITTED.get(word) or _typed_as(stated, options(item)))
    if "None" in options(item) and result != _ref("dynamic"):
        if "enum" in result:
            result["enum"] = [*dict.fromkeys([*result["enum"], None])]
        elif isinstance(result.get("type"), str):
            result["type"] = [result["type"], "null"]
        else:
            result = {"anyOf": [*result.get("anyOf", [result]), {"type": "null"}]}
    if item.default is not Parameter.empty:
        result["default"] = list(item.default) if isinstance(item.default, tuple) else item.default
    return result | {"description": text}


def _typed_as(stated: str, allowed: frozenset[str]) -> dict[str, Any]:
    """The schema of a type as a docstring states it, of an argument with the types ``allowed``."""
    arrays = [_of_shape(shape.split(", ")) for shape in re.findall(r"\(([^()]*)\)", stated)]
    shape = {"anyOf": arrays} if len(arrays) > 1 else dict(*arrays)
    mapping = next((kind for kind in allowed if kind.startswith("Mapping[str, ")), None)
    if mapping is not None:
        items = {"float": NUMBER, "str": TEXT, "ArrayLike": shape}[mapping[13:-1]]
        return {"type": "object", "minProperties": 1, "additionalProperties": items} if items is not TEXT else \
            {"type": "object", "additionalProperties": items}  # fmt: skip
    if "ArrayLike" in allowed:
        return shape
    limit = re.search(r"(above|at least) (\d+)", stated)
    bound = {{"above": "exclusiveMinimum", "at least": "minimum"}[limit[1]]: int(limit[2])} if limit else {}
    names = {"str": "string", "bool": "boolean", "int": "integer", "float": "number"}
    return {"type": next(name for kind, name in names.items() if kind in allowed), **bound}


def _of_shape(sizes: list[str]) -> dict[str, Any]:
    """An array whose sizes are numbers or words, the last of one axis followed by a comma."""
    sizes = [size.strip(" ,") for size in sizes]
    named = {("3",): "vector", ("6",): "six", ("3", "3"): "matrix", ("6", "6"): "six_by_six"}
    if tuple(sizes) in named:
        return _ref(named[tuple(sizes)])
    return _array(_of_shape(sizes[1:]) if len(sizes) > 1 else NUMBER, sizes[0])


def _entries(call: Any) -> dict[str, tuple[str, str]]:
    """Type and description of each argument, as the docstring of a call has them."""
    return {word: (stated, _plain(text)) for names, stated, text in ENTRY.findall(f"{getdoc(call)}\n")
            for word in names.split(", ")}  # fmt: skip


def _plain(text: str) -> str:
    """The words of a docstring for files, on one line."""
    return re.sub(r"\s+", " ", text.replace("``", "'").replace('\'"', "'").replace("\"'", "'")
                  .replace("True", "true").replace("False", "false").replace("None", "null")).strip()  # fmt: skip
