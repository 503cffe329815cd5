"""Couplers where they are not supported: refused by name."""

from __future__ import annotations

from typing import TYPE_CHECKING

from mbsvib.errors import ModelError
from mbsvib.parts.coupler import Coupling

if TYPE_CHECKING:
    from collections.abc import Iterable

    from mbsvib.parts._part import Part


def refuse_coupled(parts: Iterable[Part], what: str, hint: str) -> None:
    """Refuse a mechanism that has a coupler, naming the first.

    Parameters
    ----------
    parts : iterable of Part
        Parts of the mechanism.
    what : str
        What does not support couplers.
    hint : str
        What to do instead.

    Raises
    ------
    ModelError
        If one of the parts is a coupler.
    """
    for part in parts:
        if isinstance(part, Coupling):
            kind = type(part).__name__.lower()
            raise ModelError(f"{what}: {kind} '{part.name}' couples joint coordinates, which is not supported there "
                             f"yet; {hint}.", element=part.name)  # fmt: skip
