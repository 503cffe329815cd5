"""Refusal of beams and reduced models where nothing is known of them."""

from __future__ import annotations

from typing import TYPE_CHECKING

from mbsvib.elements.part import Composed
from mbsvib.errors import ModelError

if TYPE_CHECKING:
    from collections.abc import Iterable

    from mbsvib.elements.part import Part


def refuse_composed(parts: Iterable[Part], what: str, hint: str) -> None:
    """Refuse what is not made for beams and superelements, naming the first of them.

    Parameters
    ----------
    parts : iterable of Part
        The parts of a model.
    what : str
        What does not support them.
    hint : str
        What to do instead.

    Raises
    ------
    ModelError
        If there is one.
    """
    for part in parts:
        if isinstance(part, Composed):
            kind = type(part).__name__.lower()
            raise ModelError(f"{kind} '{part.name}': {what} does not support a {kind} yet; {hint}.", element=part.name)
