"""Bilinear forms of the derivatives, x^T (dT/dp) y, for many parameters and many pairs of motions at once."""

from __future__ import annotations

from math import prod
from typing import TYPE_CHECKING, Any

import numpy as np

from mbsvib.linalg.vectors import any_nonzero
from mbsvib.sensitivities.matrix_group import MatrixDerivativeGroup

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator

    from mbsvib.common.arrays import Index
    from mbsvib.linalg.vectors import Field
    from mbsvib.sensitivities.adjoint_fields import Fields
    from mbsvib.sensitivities.parameter_group import ParameterGroup
    from mbsvib.sensitivities.rule_terms import Terms

# Numbers that one block of forms may hold, so that it stays in the cache.
BLOCK = 80_000
# Blocks of fewer numbers are not worth a look whether they are zero.
SMALL = 2_000


def forms(
    groups: Iterable[ParameterGroup | MatrixDerivativeGroup], left: Fields, right: Fields | None = None
) -> Iterator[tuple[Index, int, Field]]:
    """Return x^T (dT/dp) y of parameters, block by block; what is zero for all parts of a large block is left out.

    Parameters
    ----------
    groups : iterable of ParameterGroup or MatrixDerivativeGroup
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
    for group in groups:
        if isinstance(group, MatrixDerivativeGroup):
            yield group.rows, group.stride, group.forms(left, right)
            continue
        count, width = group.rows.shape
        step = max(1, BLOCK // max(1, size * width))
        for start in range(0, count, step):
            number, data, rows = group.part(start, start + step)
            first = group.rule(left, number, data)
            second = None if right is None else group.rule(right, number, data)
            look = size * len(rows) > SMALL or not all(first) or not all(second or [True])
            acting = _acting(first, second) if look else None
            if acting is None:
                yield rows, group.stride, _block(first, second, len(rows))
                continue
            for i in acting:
                one = None if second is None else second[i : i + 1]
                yield rows[:, i : i + 1], group.stride, _block(first[i : i + 1], one, len(rows))


def form_table(
    groups: Iterable[ParameterGroup | MatrixDerivativeGroup], size: int, left: Fields, right: Fields | None = None
) -> Field:
    """Return x^T (dT/dp) y of the parameters of some groups, (size, ...), zero for all others."""
    kind = np.result_type(left.body_wrench, left.wrench, *(() if right is None else (right.body_wrench, right.wrench)))
    result = np.zeros((size, *_tail(left, right)), dtype=kind)
    for rows, stride, block in forms(groups, left, right):
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
    def acts(terms: Terms, other: Terms) -> bool:
        return any((any_nonzero(p) and any_nonzero(a)) or (second is not None and any_nonzero(q) and any_nonzero(b))
                   for (p, q), (b, a) in zip(terms, other, strict=True))  # fmt: skip

    pairs = zip(first, first if second is None else second, strict=True)
    acting = [i for i, (terms, other) in enumerate(pairs) if terms and other and acts(terms, other)]
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


