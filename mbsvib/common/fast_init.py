"""Constructors of frozen dataclasses that cost a quarter of what ``dataclasses`` generates.

A frozen class refuses ``self.name = name`` in its constructor too, so that ``dataclasses`` assigns every field by a
call of ``object.__setattr__``. With ten fields that takes longer than all the checks of a part of a model. Here all
fields are assigned at once where they are in a dictionary. Where they are in slots, an object is of a subclass that is
not frozen, and has the same memory layout, until they are assigned.
"""

from __future__ import annotations

from dataclasses import MISSING, fields
from functools import update_wrapper
from typing import Any, TypeVar

T = TypeVar("T")


def fast_init(cls: type[T]) -> type[T]:
    """Return a frozen dataclass with a faster constructor, and otherwise unchanged.

    ``cls``: all its fields are arguments, and no default is made by a factory. Classes derived from it keep its usual
    constructor, unless they are decorated themselves.
    """
    usual: Any = cls.__init__
    plain = {"__slots__": (), "__setattr__": object.__setattr__, "__delattr__": object.__delattr__}
    unfrozen = None if cls.__dictoffset__ else type(cls.__name__, (cls,), plain)
    items = fields(cls)  # type: ignore[arg-type]
    assert all(item.init and item.default_factory is MISSING for item in items)
    positional = [item.name for item in items if not item.kw_only]
    by_name = [item.name for item in items if item.kw_only]
    passed = ", ".join([*positional, *[f"{name}={name}" for name in by_name]])
    source = [
        f"def __init__(self, {', '.join([*positional, *(['*'] if by_name else []), *by_name])}):",
        "    if self.__class__ is not cls:",
        f"        return usual(self, {passed})",
        *(_to_slots if unfrozen else _to_dictionary)([item.name for item in items]),
        *(["    self.__post_init__()"] if hasattr(cls, "__post_init__") else []),
    ]
    names = {"cls": cls, "unfrozen": unfrozen, "usual": usual, "assign": object.__setattr__}
    exec("\n".join(source), names)  # of names of fields alone, as dataclasses makes constructors
    made: Any = names["__init__"]
    made.__defaults__, made.__kwdefaults__ = usual.__defaults__, usual.__kwdefaults__
    cls.__init__ = update_wrapper(made, usual)  # type: ignore[method-assign]
    return cls


def changed(item: T, **changes: Any) -> T:
    """Return a frozen dataclass, all of whose fields are positional arguments, with other values of some fields."""
    names: tuple[str, ...] = type(item).__match_args__  # type: ignore[attr-defined]
    return type(item)(*[changes[name] if name in changes else getattr(item, name) for name in names])


def _to_dictionary(names: list[str]) -> list[str]:
    return [f"    assign(self, '__dict__', {{{', '.join(f'{name!r}: {name}' for name in names)}}})"]


def _to_slots(names: list[str]) -> list[str]:
    return ["    assign(self, '__class__', unfrozen)", *[f"    self.{name} = {name}" for name in names],
            "    self.__class__ = cls"]  # fmt: skip
