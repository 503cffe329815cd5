"""Bilinear forms of the derivatives, x^T (dT/dp) y, for many parameters and many pairs of motions at once."""

from __future__ import annotations

from dataclasses import replace
from math import prod
from typing import TYPE_CHECKING, Any

import numpy as np

from mbsvib.sensitivities.adjoint_fields import acts, fields, in_joints, motions
from mbsvib.sensitivities.matrix_derivatives import Whole

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator

    from numpy.typing import NDArray

    from mbsvib.common.arrays import Index
    from mbsvib.sensitivities.adjoint_fields import Field, Fields
    from mbsvib.sensitivities.factors import Terms
    from mbsvib.sensitivities.parameter_groups import Family, Plan

# Numbers that one block of forms may hold, so that it stays in the cache.
BLOCK = 80_000
# Blocks of fewer numbers are not worth a look whether they are zero.
SMALL = 2_000
# Work of a state of self-stress is rounding below this share of the largest force times the largest motion anywhere.
WORKS = 1e-9


def forms(
    families: Iterable[Family | Whole], left: Fields, right: Fields | None = None
) -> Iterator[tuple[Index, int, Field]]:
    """Return x^T (dT/dp) y of parameters, block by block; what is zero for all parts of a large block is left out.

    Parameters
    ----------
    families : iterable of Family
        What changes.
    left, right : Fields
        The motions x and y; right None: y = x, and half of each form is returned.

    Returns
    -------
    iterator of tuple of array, shape (parts, entries), int and array, shape (parts, entries, ...)
        The parameters, -1 where none is asked for; the stride from part to part where entries follow each other, else
        0; and their forms.
    """
    size = prod(_tail(left, right))
    for family in families:
        if isinstance(family, Whole):
            yield family.rows, family.stride, family.forms(left, right)
            continue
        count, width = family.rows.shape
        step = max(1, BLOCK // max(1, size * width))
        for start in range(0, count, step):
            number, data, rows = family.part(start, start + step)
            first = family.rule(left, number, data)
            second = None if right is None else family.rule(right, number, data)
            look = size * len(rows) > SMALL or not all(first) or not all(second or [True])
            acting = _acting(first, second) if look else None
            if acting is None:
                yield rows, family.stride, _block(first, second, len(rows))
                continue
            for i in acting:
                one = None if second is None else second[i : i + 1]
                yield rows[:, i : i + 1], family.stride, _block(first[i : i + 1], one, len(rows))


def table(
    plan: Plan, left: Fields, right: Fields | None = None, families: Iterable[Family | Whole] | None = None
) -> Field:
    """Return x^T (dT/dp) y of all parameters, (size, ...); arguments and halves as of ``forms``. Those of some families
    only leave out what the forces at the pose do.
    """
    result = ruled(plan.families if families is None else families, plan.size, left, right)
    if families is None and plan.balanced is not None:
        plan.balanced.add(result, left, right)
    return result


def ruled(families: Iterable[Family | Whole], size: int, left: Fields, right: Fields | None = None) -> Field:
    """Return x^T (dT/dp) y by the rules of families, (size, ...), zero for what these do not hold."""
    kind = np.result_type(left.body_wrench, left.wrench, *(() if right is None else (right.body_wrench, right.wrench)))
    result = np.zeros((size, *_tail(left, right)), dtype=kind)
    for rows, stride, block in forms(families, left, right):
        into = picked(result, rows, stride)
        if into is None:
            asked = rows >= 0
            result[rows[asked]] = block[asked]
        else:
            into[:] = block
    return result


def picked(array: Any, rows: Index, stride: int) -> Any:
    """Return the view (parts, entries, ...) of an array (parameters, ...) whose rows follow each other, else None."""
    if not stride:
        return None
    first, count = int(rows[0, 0]), len(rows)
    if first + count * stride <= len(array):
        return array[first : first + count * stride].reshape(count, stride, *array.shape[1:])[:, : rows.shape[1]]
    step, *inner = array.strides
    start = array[first:]
    return np.lib.stride_tricks.as_strided(start, (*rows.shape, *array.shape[1:]), (stride * step, step, *inner))


def _tail(left: Fields, right: Fields | None) -> tuple[int, ...]:
    pair = (left,) if right is None else (left, right)
    return np.broadcast_shapes(*(each.shape[2:] for found in pair for each in (found.body, found.body_wrench)))


def _acting(first: list[Terms], second: list[Terms] | None) -> list[int] | None:
    """Entries that are not zero for all parts, as planar mechanisms have many; None where all act."""
    other = first if second is None else second
    acting = [i for i, terms in enumerate(first)
              if terms and other[i] and any((acts(p) and acts(a)) or (second is not None and acts(q) and acts(b))
                     for (p, q), (b, a) in zip(terms, other[i], strict=True))]  # fmt: skip
    return None if len(acting) == len(first) else acting


def _block(first: list[Terms], second: list[Terms] | None, parts: int) -> Field:
    p, q = first[0][0]
    factors = (p, q) if second is None else (p, second[0][0][1], q, second[0][0][0])
    shape = np.broadcast_shapes(*(each.shape[1:] for each in factors))
    result: Field = np.empty((parts, len(first), *shape), dtype=np.result_type(*factors))
    for i, terms in enumerate(first):
        out = result[:, i]
        if second is None:
            np.multiply(*terms[0], out=out)
            for p, q in terms[1:]:
                out += p * q
            continue
        for t, ((p, q), (b, a)) in enumerate(zip(terms, second[i], strict=True)):
            if t:
                out += p * a
            else:
                np.multiply(p, a, out=out)
            out += q * b
    return result


def breaking(plan: Plan) -> NDArray[np.bool_]:
    """Return which parameters, changed alone, take degrees of freedom away: redundant constraints then contradict.

    A change does so where a state of self-stress, forces in the locked rows that load no coordinate, works on it.

    Parameters
    ----------
    plan : Plan
        What changes.

    Returns
    -------
    array, shape (parameters,)
        True where the mechanism has fewer degrees of freedom nearby.
    """
    result = np.zeros(plan.size, dtype=bool)
    network = plan.network
    ties, dof = network.constraints, network.displacements.shape[1]
    if ties is None or not ties.stress.shape[1] or not dof:
        return result
    joints = len(network.joints)
    one = np.ones(dof)
    motion = fields(network, motions(network, np.eye(dof)), one, one, one)
    none = np.zeros((len(network.bodies), 6, ties.stress.shape[1]))
    wrench = np.concatenate((in_joints(network, none, ties.stress), np.zeros((len(network.springs), *none.shape[1:]))))
    length = float(np.ptp(network.point, axis=0).max()) or 1.0
    per_length = np.repeat([1.0, length], 3)[:, None]
    moves = float(np.abs(motion.relative * per_length).max(initial=0.0)) / length
    loads = float(np.abs(wrench[:joints] / per_length).max(initial=0.0))
    stress = replace(motion, wrench=wrench[..., None], tied=ties.stress[..., None],
                     relative=motion.relative[..., None, :])  # fmt: skip
    for family in (*plan.only("joint"), *plan.only("coupler")):
        number, data, rows = family.part(0, len(family.number))
        work = _work(family.rule(stress, number, data))
        broken = work > WORKS * moves * (length if family.field == "orientation" else 1.0) * loads
        asked = rows >= 0
        result[rows[asked]] = broken[asked]
    return result


def _work(terms: list[Terms]) -> Any:
    """Largest product of a force and a change, (parts, entries)."""
    return np.stack([np.abs(sum(p * q for p, q in entry)).reshape(len(entry[0][0]), -1).max(axis=1)
                     for entry in terms], axis=1)  # fmt: skip
