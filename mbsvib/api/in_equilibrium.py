"""Models in equilibrium with their systems, in the public classes."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from mbsvib.api.batch import Batch
from mbsvib.api.model import Model
from mbsvib.api.sparse_system import SparseSystem
from mbsvib.api.system import System
from mbsvib.equilibrium.balanced_variants import balanced_batch
from mbsvib.equilibrium.search import at_equilibrium
from mbsvib.errors import EquilibriumError


def in_equilibrium(
    model: Model, independent: Sequence[str] | None = None, cut: Sequence[str] | None = None
) -> tuple[Model, System | SparseSystem]:
    """Return a model in equilibrium with its system; a model that is in equilibrium is returned as it is.

    ``model``: a model that was in equilibrium before its values changed. ``independent``, ``cut``: requested minimal
    coordinates and cut joints.
    """
    if model.rolling:  # forces at the contacts hold it, or linearize refuses it
        return model, model.linearize(independent)
    return at_equilibrium(model, independent, cut, dense=System, sparse=SparseSystem)


def batch_in_equilibrium(model: Model, values: Mapping[str, Any]) -> Batch:
    """Return the variants of a model in equilibrium, with ``values`` (n,) of parameters, at once: as they are described
    where they balance, else in the equilibrium of each.
    """
    try:
        return model.linearize(values=values)
    except EquilibriumError:
        return balanced_batch(model, values, System, Batch)
