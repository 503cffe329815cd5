"""The choice between the dense and the sparse equations of motion, by the arguments and by size."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TypeVar

from numpy.typing import ArrayLike

from mbsvib.equations.assembly import is_small
from mbsvib.equations.assembly import linearized as dense_equations
from mbsvib.equations.equations import Equations
from mbsvib.equations.expansion import expanded
from mbsvib.errors import ModelError, nearest
from mbsvib.mechanism.drives import driven_coordinates
from mbsvib.mechanism.mechanism import Mechanism
from mbsvib.mechanism.topology import FLOATS, span
from mbsvib.sparse.equations import SparseEquations

E = TypeVar("E", bound=Equations)
S = TypeVar("S", bound=SparseEquations)

METHODS = ("dense", "sparse")
# Number of tree coordinates from which on the sparse equations are the default. With ten modes, they are as fast as the
# dense ones at 150 to 300 coordinates (chains, ladders). Dense equations provide more results (all modes, matrices), so
# they are used until they cost ten times as much: some tenths of a second.
MANY = 600


def wants_sparse(
    model: Mechanism, method: str | None, independent: Sequence[str] | None, cut: Sequence[str] | None,
    values: Mapping[str, ArrayLike] | None = None,
) -> bool:  # fmt: skip
    """Return whether a model is to be linearized by the sparse path, by size if ``method`` is None.

    Minimal coordinates and variants, which ``independent`` and ``values`` ask for, need dense equations.
    """
    if method not in (None, *METHODS):
        raise ModelError(f"linearize: method = {method!r}; expected 'dense', 'sparse', or None for a choice by size."
                         f"{nearest(str(method), METHODS)}", field="method")  # fmt: skip
    if method == "sparse":
        for word, value, reason in (("independent", independent, "has no minimal coordinates to choose"),
                                  ("values", values, "linearizes one variant at a time")):  # fmt: skip
            if value is not None:
                raise ModelError(f"linearize: {word} is given, yet method='sparse' {reason}; use method='dense'.",
                                 field=word)  # fmt: skip
        driven = model.derived(driven_coordinates)
        if driven:
            raise ModelError(f"linearize: method='sparse' has no minimal coordinates, and a motion input drives "
                             f"'{driven[0]}'; use method='dense'.", element=driven[0], field="method")  # fmt: skip
        return True
    if model.derived(driven_coordinates):
        return False
    if method == "dense" or independent is not None or values is not None or not model.bodies:
        return False
    topology = span(model, cut)
    return sum(6 if b.joint == FLOATS else len(topology.joints[b.joint].freedom) for b in topology.branches) > MANY


def linearized(
    model: Mechanism, independent: Sequence[str] | None = None, cut: Sequence[str] | None = None,
    method: str | None = None, dense: type[E] = Equations, sparse: type[S] = SparseEquations,  # type: ignore[assignment]
) -> E | S:  # fmt: skip
    """Return the equations of a mechanism: of the class ``dense`` or ``sparse``, by size if ``method`` is None."""
    result = expanded(model)
    if not (method is None and is_small(result)) and wants_sparse(result, method, independent, cut):
        from mbsvib.sparse.assembly import linearized as sparse_equations

        return sparse_equations(result, cut, form=sparse)
    return dense_equations(result, independent, cut, dense, model)
