"""Batches whose variants are linearized one after the other: under loads, with beams, or with forces in joints.

Rows that one variant has and another has not, such as those of geometric stiffness, are zero rows there.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, TypeVar

import numpy as np

from mbsvib.equations.assembly import linearized
from mbsvib.equations.batch_equations import FACTORS, BatchEquations
from mbsvib.equations.equations import MATRICES
from mbsvib.errors import MbsvibError, ModelError

if TYPE_CHECKING:
    from collections.abc import Sequence

    from mbsvib.equations.batch_values import Values
    from mbsvib.equations.equations import Equations
    from mbsvib.mechanism.mechanism import Mechanism

B = TypeVar("B", bound=BatchEquations)

ROWS = ("elastic_rows", "stiffness", "damping")


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
        If a load makes the stiffness unsymmetric, or the equations of a variant are refused, by its index.
    """
    systems = []
    for i in range(variants.count):
        try:
            variant = model.with_values({name: float(values[i]) for name, values in variants.by_name.items()})
            found: Equations = linearized(variant, nominal.coordinates, cut)
        except MbsvibError as error:
            error.args = (f"variant {i}: {error}", *error.args[1:])
            raise
        if found.circulatory is not None:
            load = next(load.name for load in model.loads.values() if load.follower or any(load.torque))
            raise ModelError(f"values: load '{load}' follows its body or is a torque, whose stiffness is not "
                             f"symmetric, which batches do not support yet; linearize the variants one by one, with "
                             f"model.with_values.", element=load, field="values")  # fmt: skip
        systems.append(found)
    arrays: dict[str, Any] = {key: np.array([getattr(each, key) for each in systems])
                              for key in (*MATRICES, *FACTORS) if key not in ROWS}  # fmt: skip
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
    return batch(nominal, variants, None, elastic_rows=rows, stiffness=values, damping=damping,
                 row_owner=np.repeat(np.arange(width), most), own=tuple(each.provenance for each in systems),
                 **arrays)  # fmt: skip
