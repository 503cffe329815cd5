"""Bilinear forms of the derivatives, x^T (dT/dp) y, for many parameters and many pairs of motions at once.

Parameters that no rule of one part tells have whole matrices as derivatives.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import prod
from typing import TYPE_CHECKING, Any

import numpy as np

from mbsvib.errors import ModelError
from mbsvib.linalg.rank import ZERO_MATRIX_SLOPE
from mbsvib.linalg.vectors import any_nonzero

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping

    from mbsvib.common.arrays import Array, Index
    from mbsvib.linalg.vectors import Field
    from mbsvib.sensitivities.adjoint_fields import Fields
    from mbsvib.sensitivities.families.terms import Terms
    from mbsvib.sensitivities.parameter_group import ParameterGroup


_POWERS = {"K": "stiff", "C": "rate", "M": "square"}


@dataclass(frozen=True, slots=True)
class MatrixDerivativeGroup:
    """The derivatives ``slopes`` of all matrices to the parameters ``rows`` (k,)."""

    rows: Index
    slopes: Mapping[str, Array]

    def forms(self, left: Fields, right: Fields | None = None) -> Field:
        """Return x^T (dK + s dC + s^2 dM) y, (k, ...); right None: y = x, and half of each form is returned.
        """
        other = left if right is None else right
        result: Any = 0.0
        for key, power in _POWERS.items():
            change = self.slopes[key]
            if not change.any():
                continue
            weight = getattr(left, power) if right is None else getattr(left, power) + getattr(right, power)
            shape = other.vectors.shape
            pushed = change @ other.vectors.reshape(len(other.vectors), prod(shape[1:]))
            works = (left.vectors * pushed.reshape(len(change), *shape)).sum(axis=1)
            result = result + 0.5 * weight * works
        if isinstance(result, float):
            tail = np.broadcast_shapes(left.vectors.shape[1:], other.vectors.shape[1:], np.shape(left.stiff))
            result = np.zeros((len(self.rows), *tail), dtype=left.vectors.dtype)
        return np.asarray(result)

    @property
    def symmetric(self) -> bool:
        """Whether all derivatives of K are symmetric."""
        change = np.nan_to_num(self.slopes["K"])
        asymmetry = np.abs(change - change.swapaxes(1, 2)).max(initial=0.0)
        return bool(asymmetry <= ZERO_MATRIX_SLOPE * np.abs(change).max(initial=0.0))

    def with_ports(
        self, result: Field, ports: tuple[list[int], list[int]], powers: tuple[Field, Field, Field],
        vectors: tuple[Field, Field], excluded: tuple[int, ...] = (),
    ) -> None:  # fmt: skip
        """Add dD + L^T dB + (dCq + s dCv + s^2 dCa) R to the derivatives of responses, in place.

        ``result`` (parameters, outputs, inputs, n): derivatives to all parameters; ``powers`` (n,): 1, s and s^2;
        ``vectors`` (m, 1, inputs, n) and (m, outputs, 1, n): R and L; ``excluded``: outputs whose D and H are counted
        elsewhere.
        """
        (i, o), (right, left) = ports, vectors
        counts = np.array([k not in excluded for k in range(len(o))])[:, None, None]
        for k, row in enumerate(self.rows.tolist()):
            result[row] += counts * self.slopes["D"][k][np.ix_(o, i)][:, :, None]
            result[row] += np.einsum("mi,mon->oin", self.slopes["B"][k][:, i], left[:, :, 0])
            for key, power in zip(("Cq", "Cv", "Ca"), powers, strict=True):
                result[row] += counts * power * np.einsum("om,min->oin", self.slopes[key][k][o], right[:, 0])

    def factors(self, row: int, matrix: str, name: str) -> tuple[Array, Array]:
        """Return P and Q (rank, m) with P^T Q + Q^T P the derivative of a matrix to one parameter.

        ``row``: the parameter; ``matrix``: "M", "C" or "K"; ``name``: what the derivative is to, for the message.
        Raises an error if the derivative is not symmetric, or not a number.
        """
        return factored(self.slopes[matrix][self.rows.tolist().index(row)], matrix, name, ZERO_MATRIX_SLOPE)


def factored(change: Array, matrix: str, name: str, rounding: float) -> tuple[Array, Array]:
    """Return P and Q (rank, m) with P^T Q + Q^T P a symmetric matrix.

    ``change`` (m, m): the derivative of a matrix; ``matrix``, ``name``: which, and to what, for the message;
    ``rounding``: what is zero, against the largest entry. Raises an error if the derivative is not symmetric, or not a
    number.
    """
    size = np.abs(change).max(initial=0.0)
    if not np.abs(change - change.T).max(initial=0.0) <= rounding * size:
        raise ModelError(f"factors: the derivative of {matrix} to '{name}' is not symmetric, or not a number, and has "
                         f"no such factors; take the matrix itself.", element=name)  # fmt: skip
    sizes, vectors = np.linalg.eigh(0.5 * (change + change.T))
    acts = np.abs(sizes) > rounding * size
    return 0.5 * sizes[acts, None] * vectors.T[acts], vectors.T[acts]


# Numbers that one block of forms may hold, so that it stays in the cache.
BLOCK = 80_000
# Blocks of fewer numbers are not worth a look whether they are zero.
SMALL = 2_000


def form_table(
    groups: Iterable[ParameterGroup], size: int, left: Fields, right: Fields | None = None
) -> Field:  # fmt: skip
    """Return x^T (dT/dp) y (size, ...) of the parameters of some groups, zero for all others.

    ``left``, ``right``: the motions x and y; right None: y = x, and half of each form is returned. Forms are computed
    block by block; what is zero for all parts of a large block is left out.
    """
    kind = np.result_type(left.body_wrench, left.wrench, *(() if right is None else (right.body_wrench, right.wrench)))
    tail = _tail(left, right)
    result, numbers = np.zeros((size, *tail), dtype=kind), prod(tail)
    for group in groups:
        count, width = group.rows.shape
        step = max(1, BLOCK // max(1, numbers * width))
        for start in range(0, count, step):
            number, data, rows = group.part(start, start + step)
            first = group.rule(left, number, data)
            second = None if right is None else group.rule(right, number, data)
            look = numbers * len(rows) > SMALL or not all(first) or not all(second or [True])
            coupled = _acting(first, second) if look else None
            if coupled is None:
                _put(result, rows, group.stride, _block(first, second, len(rows)))
                continue
            for i in coupled:
                of_one = None if second is None else second[i : i + 1]
                _put(result, rows[:, i : i + 1], group.stride, _block(first[i : i + 1], of_one, len(rows)))
    return result


def _put(result: Field, rows: Index, stride: int, block: Field) -> None:
    """Set the forms (parts, entries, ...) of the parameters ``rows``, -1 for none; ``stride`` leads from part to part
    where entries follow each other, and is 0 elsewhere.
    """
    if not stride:
        requested = rows >= 0
        result[rows[requested]] = block[requested]
        return
    first, (count, width) = int(rows[0, 0]), rows.shape
    if first + count * stride <= len(result):
        result[first : first + count * stride].reshape(count, stride, *block.shape[2:])[:, :width] = block
        return
    step, *inner = result.strides
    shape = (count, width, *block.shape[2:])
    np.lib.stride_tricks.as_strided(result[first:], shape, (stride * step, step, *inner))[:] = block


def _tail(left: Fields, right: Fields | None) -> tuple[int, ...]:
    pair = (left,) if right is None else (left, right)
    return np.broadcast_shapes(*(array.shape[2:] for side in pair for array in (side.body, side.body_wrench)))


def _acting(first: list[Terms], second: list[Terms] | None) -> list[int] | None:
    """Entries that are not zero for all parts, as planar mechanisms have many; None where all act."""
    def acts(terms: Terms, other: Terms) -> bool:
        return any((any_nonzero(p) and any_nonzero(a)) or (second is not None and any_nonzero(q) and any_nonzero(b))
                   for (p, q), (b, a) in zip(terms, other, strict=True))  # fmt: skip

    pairs = zip(first, first if second is None else second, strict=True)
    coupled = [i for i, (terms, other) in enumerate(pairs) if terms and other and acts(terms, other)]
    return None if len(coupled) == len(first) else coupled


def _block(first: list[Terms], second: list[Terms] | None, parts: int) -> Field:
    p, q = first[0][0]
    factors = (p, q) if second is None else (p, second[0][0][1], q, second[0][0][0])
    shape = np.broadcast_shapes(*(factor.shape[1:] for factor in factors))
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
