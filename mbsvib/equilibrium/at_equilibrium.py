"""Variants of a model in equilibrium: the new equilibrium after a change of values, and its equations."""

from __future__ import annotations

from copy import copy
from dataclasses import replace
from typing import TYPE_CHECKING, TypeVar

from mbsvib.equations.equations import Equations
from mbsvib.equilibrium.displaced_balance import check_displacements
from mbsvib.equilibrium.search import equilibrium
from mbsvib.errors import EquilibriumError
from mbsvib.mechanism.mechanism import Mechanism
from mbsvib.sparse.choice import linearized
from mbsvib.sparse.equations import SparseEquations

if TYPE_CHECKING:
    from collections.abc import Sequence

M = TypeVar("M", bound=Mechanism)
E = TypeVar("E", bound=Equations)
S = TypeVar("S", bound=SparseEquations)


def at_equilibrium(
    model: M, independent: Sequence[str] | None = None, cut: Sequence[str] | None = None, method: str | None = None,
    dense: type[E] = Equations, sparse: type[S] = SparseEquations,  # type: ignore[assignment]
) -> tuple[M, E | S]:  # fmt: skip
    """Return a model in equilibrium with its equations: the model as it is if it balances.

    ``independent``, ``cut``: requested minimal coordinates and cut joints. ``method``: "dense" or "sparse"; default: by
    size. Returns the model in its pose of equilibrium; its equations.
    """
    try:
        check_displacements(model)
        return model, linearized(model, independent, cut, method, dense, sparse)
    except EquilibriumError:
        balanced = equilibrium(model).model
        equations = linearized(balanced, independent, cut, method, dense, sparse)
    if isinstance(equations, Equations):  # parameters act on the model before the motion
        provenance = replace(equations.provenance, origin=copy(model), moved_to_equilibrium=True)
        equations = replace(equations, provenance=provenance)
    return balanced, equations
