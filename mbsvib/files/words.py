"""The words a model file may use: those of the ``add_...`` calls, read from their signatures."""

from __future__ import annotations

from collections.abc import Mapping
from functools import cache
from inspect import Parameter, signature
from typing import Any

from mbsvib.api.model import Model
from mbsvib.elements.families import FAMILIES

VERSION = 1

# Each section is a property of the model with its parts in the order in which they were added. If several calls fill
# one section, ``type`` names the call; the first one is the default.
SECTIONS: dict[str, tuple[str, ...]] = {
    section: tuple(dict.fromkeys([family.word for family in FAMILIES if family.section == section]))
    for section in dict.fromkeys(family.section for family in FAMILIES)
}
# Calls that add several parts: files may have them, and hold these parts once they are saved again.
COMPOUND: dict[str, tuple[str, ...]] = {
    "models": ("model",), "drives": ("ball_screw", "belt", "gear_pair", "voice_coil", "piezo_stack"),
}  # fmt: skip


def _all_sections() -> dict[str, tuple[str, ...]]:
    """All sections in the order in which they are read: models with bodies, drives with joints."""
    result = {}
    for section, kinds in SECTIONS.items():
        result[section] = kinds
        result |= {"bodies": {"models": COMPOUND["models"]}, "joints": {"drives": COMPOUND["drives"]}}.get(section, {})
    return result


ALL_SECTIONS = _all_sections()


@cache
def words(kind: str) -> Mapping[str, Parameter]:
    """Return the arguments of ``add_KIND`` by name, without the name of the part."""
    parameters = signature(getattr(Model, f"add_{kind}")).parameters
    return {word: item for word, item in parameters.items() if word not in ("self", "name")}


@cache
def head_words() -> Mapping[str, Parameter]:
    """Return the arguments of ``Model(...)`` by name: they are at the top level of a file."""
    return {word: item for word, item in signature(Model.__init__).parameters.items() if word != "self"}


def options(item: Parameter) -> frozenset[str]:
    """Return the types that an argument admits, as its annotation names them."""
    return frozenset(str(item.annotation).split(" | "))


def mandatory(item: Parameter) -> bool:
    """Return whether an argument is required; one that may be None is optional."""
    return item.default is Parameter.empty and "None" not in options(item)


def unfit(item: Parameter, value: Any) -> str | None:
    """Return the expected value if an ``add_...`` call would misinterpret ``value``, else None.

    Numbers are left to the call, which knows the unit and the range. What is caught here is what Python would let
    through in silence (``"no"`` is true, ``["1", 2, 3]`` converts to numbers) or fail on without a clear word.
    """
    allowed = options(item)
    if (value is None and "None" in allowed) or (isinstance(value, str) and "str" in allowed):
        return None
    if "ArrayLike" in allowed:
        return None if _numeric(value) else "a list of numbers"
    if "Sequence[str]" in allowed:
        listed = value if isinstance(value, list) else [value]
        return None if all(isinstance(entry, str) for entry in listed) else "a list of texts"
    if "Mapping[str, float]" in allowed:
        numeric = isinstance(value, dict) and all(_numeric([entry]) for entry in value.values())
        return None if numeric else "a number for each of several names"
    if any(kind.startswith("Mapping[") for kind in allowed):
        return None if isinstance(value, dict) else "a mapping of words"
    if "bool" in allowed:
        return None if isinstance(value, bool) else "true or false"
    return "a text" if "str" in allowed else None


def _numeric(value: Any) -> bool:
    if isinstance(value, list):
        return all(_numeric(entry) and not isinstance(entry, (str, bool)) and entry is not None for entry in value)
    return not isinstance(value, dict)
