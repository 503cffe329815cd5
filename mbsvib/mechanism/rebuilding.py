"""Mechanisms with all parts rebuilt, or with other arguments of some parts."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, TypeVar

from mbsvib.elements.families import rebuild_with
from mbsvib.elements.part import Part
from mbsvib.mechanism.mechanism import Mechanism

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping

M = TypeVar("M", bound=Mechanism)


def rebuilt(model: M, words: Callable[[Any], Mapping[str, Any] | Part]) -> M:
    """Return a mechanism with all parts rebuilt.

    ``words`` takes the parts in the order of ``groups()`` and returns the arguments of a part's adder, or the part that
    replaces it unchecked.
    """

    def rebuilt_part(part: Part) -> Part:
        new = words(part)
        return new if isinstance(new, Part) else rebuild_with(part, new)

    groups: Any = {
        key: {name: rebuilt_part(part) for name, part in group.items()}
        for key, group in model.groups().items() if group
    }
    return model.with_parts(**groups)


def changed(model: M, changes: Mapping[str, Mapping[str, Any]]) -> M:
    """Return a mechanism in which some parts have other arguments."""
    return rebuilt(model, lambda part: part.constructor_kwargs() | changes[part.name] if part.name in changes else part)
