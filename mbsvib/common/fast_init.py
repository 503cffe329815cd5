"""Constructors of frozen dataclasses that cost a quarter of what ``dataclasses`` generates.

A frozen class refuses ``self.name = name`` in its constructor too, so that ``dataclasses`` assigns every field by a
call of ``object.__setattr__``. With ten fields that takes longer than all the checks of a part of a model. Here an
object is of a subclass that is not frozen, and has the same memory layout, until all fields are assigned.
"""

from __future__ import annotations

from dataclasses import fields
from functools import update_wrapper
from typing import Any, TypeVar

T = TypeVar("T")


def fast_init(cls: type[T]) -> type[T]:
    """Return a frozen dataclass with a faster constructor, and otherwise unchanged.

    Parameters
    ----------
    cls : type
        A frozen dataclass without factories of defaults. Classes derived from it keep its usual constructor, unless
        they are decorated themselves.

    Returns
    -------
    type
        The same class.
    """
    usual: Any = cls.__init__
    unfrozen = type(cls.__name__, (cls,), {"__slots__": (), "__setattr__": object.__setattr__,
                                           "__delattr__": object.__delattr__})  # fmt: skip
    items = [item for item in fields(cls) if item.init]  # type: ignore[arg-type]
    positional = [item.name for item in items if not item.kw_only]
    by_name = [item.name for item in items if item.kw_only]
    passed = ", ".join([*positional, *[f"{name}={name}" for name in by_name]])
    source = [
        f"def __init__(self, {', '.join([*positional, *(['*'] if by_name else []), *by_name])}):",
        "    if self.__class__ is not cls:",
        f"        return usual(self, {passed})",
        "    change_class(self, '__class__', unfrozen)",
        *[f"    self.{item.name} = {item.name}" for item in items],
        "    self.__class__ = cls",
        *(["    self.__post_init__()"] if hasattr(cls, "__post_init__") else []),
    ]
    names: dict[str, Any] = {"cls": cls, "usual": usual, "unfrozen": unfrozen, "change_class": object.__setattr__}
    exec("\n".join(source), names)  # of names of fields alone, as dataclasses makes constructors
    made = names["__init__"]
    made.__defaults__, made.__kwdefaults__ = usual.__defaults__, usual.__kwdefaults__
    cls.__init__ = update_wrapper(made, usual)  # type: ignore[method-assign]
    return cls
