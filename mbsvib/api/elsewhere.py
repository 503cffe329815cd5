"""Names that one class does not have and another has: asking for them tells where they are."""

from __future__ import annotations

from typing import Any, NoReturn

from mbsvib.common.display import completed_names


class Elsewhere:
    """An attribute that a class does not have; asking for it raises an AttributeError that tells which object has it.

    A ``__getattr__`` of the class would do the same, but makes access to all its attributes slower.
    """

    def __init__(self, name: str, hint: str) -> None:
        self._name, self._hint = name, hint

    def __get__(self, instance: Any, owner: type) -> NoReturn:
        text = f"'{owner.__name__}' object has no attribute '{self._name}'; {self._hint}"
        raise AttributeError(text, name=self._name, obj=instance)


def tell_where(owner: type, other: type, hint: str) -> None:
    """Let a class tell where the public names are that it does not have and another class has.

    ``hint`` is the sentence that tells it, with {name} for the name. ``dir`` does not list such names.
    """
    for name in _attributes(other) - _attributes(owner):
        if not name.startswith("_"):
            setattr(owner, name, Elsewhere(name, hint.format(name=name)))
    owner.__dir__ = _names  # type: ignore[method-assign, assignment]


def _attributes(kind: type) -> set[str]:
    return {*dir(kind), *getattr(kind, "__dataclass_fields__", ())}


def _names(value: Any) -> list[str]:
    absent = {name for kind in type(value).__mro__ for name, item in vars(kind).items() if isinstance(item, Elsewhere)}
    return [name for name in completed_names(value) if name not in absent]
