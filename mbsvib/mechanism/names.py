"""Names of the parts of a mechanism: what cannot be one, and what refers to no body."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

from mbsvib.common import arguments as check
from mbsvib.common.tables import listed
from mbsvib.errors import ModelError, an, nearest

if TYPE_CHECKING:
    from mbsvib.elements.part import Part


def check_name(name: str, family: str, *groups: Mapping[str, Part]) -> None:
    """Refuse what cannot be a name or is already the name of a part."""
    if type(name) is not str or not name.isidentifier():
        check.name(name, family)
    for group in groups:
        if name in group:
            raise ModelError(
                f"{family} '{name}': the name is taken by {an(group[name].family)}; choose another.",
                element=name, field="name",
            )  # fmt: skip


def unknown_body(key: Any, where: tuple[str, str], mechanism: str, known: Sequence[str]) -> ModelError:
    """Return the error of a name that is none of the ``known`` bodies; ``where``: the part and its field."""
    who, field = where
    return ModelError(f"{who}: {field} = {key!r} is not a body of model '{mechanism}'.{nearest(str(key), known)} It "
                      f"has {listed(known)}. Add bodies before what refers to them.",
                      element=who, field=field)  # fmt: skip
