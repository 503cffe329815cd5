"""Batches whose variants are linearized one after the other: the form that takes every element.

Rows that one variant has and another has not, such as those of geometric stiffness, are zero rows there; so are the
gyroscopic and circulatory parts of matrices where a variant has none.
"""

from __future__ import annotations

import warnings
from typing import TYPE_CHECKING, Any, TypeVar

import numpy as np

from mbsvib.equations.assembly import linearized
from mbsvib.equations.batch_equations import FACTORS, BatchEquations
from mbsvib.equations.batch_loops import HELP, check_freedom
from mbsvib.equations.terms import MATRICES, OPTIONAL
from mbsvib.errors import MbsvibError, ModelError, NearSingularWarning, SingularPoseError

if TYPE_CHECKING:
    from collections.abc import Sequence

    from mbsvib.common.arrays import Array
    from mbsvib.equations.batch_values import Values
    from mbsvib.equations.equations import Equations
    from mbsvib.mechanism.mechanism import Mechanism

B = TypeVar("B", bound=BatchEquations)

ROWS = ("elastic_rows", "row_stiffness", "row_damping")


def one_by_one(
    model: Mechanism, nominal: Equations, variants: Values, cut: Sequence[str] | None, batch: type[B]
) -> B:
    """Return a batch of any model, whose variants are linearized one after the other.

    Parameters
    ----------
    model : Mechanism
        The mechanism.
    nominal : Equations
        Its equations in the pose as given.
    variants : Values
        What varies.
    cut : sequence of str or None
        Joints at which loops are to be cut.
    batch : type
        The class of the batch.

    Returns
    -------
    BatchEquations
        All variants, in the minimal coordinates of the pose as given.

    Raises
    ------
    ModelError
        If other motions than in the model as given move no mass, or a variant is refused by itself, by its index.
    SingularPoseError
        If a variant has another number of degrees of freedom, by its index.
    """
    systems = [_linearized(model, nominal, variants, cut, i) for i in range(variants.count)]
    arrays: dict[str, Any] = {key: np.array([getattr(each, key) for each in systems])
                              for key in (*MATRICES, *FACTORS) if key not in ROWS}  # fmt: skip
    arrays |= {key: _stacked([getattr(each, key) for each in systems]) for key in OPTIONAL}
    counts = [np.bincount(each.row_owner, minlength=1) for each in systems]
    width = max(map(len, counts))
    most = np.max([np.pad(count, (0, width - len(count))) for count in counts], axis=0)
    start = np.concatenate(([0], np.cumsum(most)))
    rows, values, damping = (np.zeros((len(systems), start[-1], *tail)) for tail in ((nominal.dof,), (), ()))
    for i, each in enumerate(systems):
        order = np.argsort(each.row_owner, kind="stable")
        owner = each.row_owner[order]
        place = start[owner] + np.arange(len(owner)) - np.searchsorted(owner, owner)
        rows[i, place], values[i, place], damping[i, place] = (getattr(each, key)[order] for key in ROWS)
    return batch(
        nominal=nominal, values=variants, closure=None, elastic_rows=rows, row_stiffness=values, row_damping=damping,
        row_owner=np.repeat(np.arange(width), most), massless=nominal.massless,
        own=tuple(each.provenance for each in systems), **arrays,
    )  # fmt: skip


def _linearized(
    model: Mechanism, nominal: Equations, variants: Values, cut: Sequence[str] | None, i: int
) -> Equations:
    """Equations of variant ``i`` in the coordinates of the pose as given."""
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always", NearSingularWarning)
        try:
            variant = model.with_values({name: float(values[i]) for name, values in variants.by_name.items()})
            system = _in_coordinates(variant, nominal, cut)
            _check_massless(system, nominal)
            check_freedom(system.dof, nominal.dof)
        except MbsvibError as error:
            error.args = (f"variant {i}: {error}", *error.args[1:])
            raise
    for warning in caught:
        warnings.warn(f"variant {i}: {warning.message}", warning.category, stacklevel=5)
    return system


def _in_coordinates(variant: Mechanism, nominal: Equations, cut: Sequence[str] | None) -> Equations:
    """Equations of a variant in the coordinates of the pose as given."""
    try:
        result: Equations = linearized(variant, nominal.coordinates, cut)
    except ModelError as error:
        if error.field != "independent":
            raise
        _check_massless(linearized(variant, None, cut), nominal)  # more motions without mass, fewer coordinates
        raise SingularPoseError(f"its loops tie the coordinates {', '.join(nominal.coordinates)} of the pose as given "
                                f"to each other. {HELP}") from error  # fmt: skip
    return result


def _check_massless(system: Equations, nominal: Equations) -> None:
    """Refuse a variant in which other motions move no mass than in the model as given, by name."""
    own, expected = _without_mass(system), _without_mass(nominal)
    if sorted(own.values()) == sorted(expected.values()):
        return  # of motions that move no mass together, either coordinate may stand for them
    name = next(name for name in (*own, *expected) if own.get(name) != expected.get(name))
    moves = "moves mass"
    raise ModelError(
        f"coordinate '{name}' {own.get(name, moves)}, in the model as given it {expected.get(name, moves)}. All "
        f"variants of a batch have the same motions without mass; linearize this one by itself (model.with_values).",
        element=name, field="values",
    )  # fmt: skip


def _without_mass(system: Equations) -> dict[str, str]:
    """What motions without mass do, by coordinate."""
    separation = system.provenance.separation
    if separation is None:
        return {}
    return (dict.fromkeys(separation.condensed, "moves no mass and follows from statics")
            | dict.fromkeys(separation.first_order, "moves no mass but dampers"))  # fmt: skip


def _stacked(parts: list[Array | None]) -> Array | None:
    """Matrices that some variants have and others lack, which are zero there; None where all lack them."""
    shape = next((part.shape for part in parts if part is not None), None)
    if shape is None:
        return None
    return np.array([np.zeros(shape) if part is None else part for part in parts])
