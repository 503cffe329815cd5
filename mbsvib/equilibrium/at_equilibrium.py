"""Variants of a model in balance: where a value that has changed shifts the equilibrium, the pose follows."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Any

from mbsvib.equations.equations import Equations
from mbsvib.errors import EquilibriumError

if TYPE_CHECKING:
    from mbsvib.api.model import Model


def settled(model: Model, **words: Any) -> tuple[Model, Any]:
    """Return a model in equilibrium with its equations: the model as it is if it balances.

    Parameters
    ----------
    model : Model
        A model that has been in balance before its values changed.
    **words
        Of ``linearize``.

    Returns
    -------
    Model
        In its pose of equilibrium.
    System or SparseSystem
        Its equations.

    Raises
    ------
    EquilibriumError
        If no equilibrium can be reached.
    """
    try:
        return model, model.linearize(**words)
    except EquilibriumError:
        there = model.equilibrium()
        found = there.linearize(**words)
    if isinstance(found, Equations):  # what its parameters do is what they do to the model that was given
        found = replace(found, provenance=replace(found.provenance, origin=model._snapshot(), settled=True))
    return there, found
