"""Models made again of all their parts, some of which have other words."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from mbsvib.elements import Body

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping

    from mbsvib.api.model import Model


def remade(model: Model, words: Callable[[Any], dict[str, Any] | Body]) -> Model:
    """Return a model made of all parts of another in its order.

    Parameters
    ----------
    model : Model
        The model.
    words : callable
        The words of each part's ``add_...`` call; of bodies also the body that takes its place, unchecked.

    Returns
    -------
    Model
        The model with these parts.

    Raises
    ------
    ModelError
        If a word is refused.
    """
    from mbsvib.api.model import ADDERS

    result = type(model)(model.name, model.gravity)
    for adder, group in model._groups():
        for part in group.values():
            found = words(part)
            if isinstance(found, Body):
                result._bodies[found.name] = found
            else:
                getattr(result, adder or ADDERS[type(part)])(**found)
    return result


def rebuilt(model: Model, changes: Mapping[str, Mapping[str, Any]]) -> Model:
    """Return a model in which some parts have other words.

    Parameters
    ----------
    model : Model
        The model.
    changes : mapping
        New words of parts by name.

    Returns
    -------
    Model
        The changed model.

    Raises
    ------
    ModelError
        If a word is refused.
    """
    return remade(model, lambda part: part.words() | changes.get(part.name, {}))
