"""Eigenvalues with their right and left vectors, and the branches of those that coincide.

The derivatives of branches are the eigenvalues of -(Y^T (2 lambda M + C) X)^-1 Y^T dT X in the common subspace.
Variables come last, so that entries of the matrices of all variables are one contiguous vector.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from itertools import accumulate, combinations
from typing import Any

import numpy as np
from numpy.typing import NDArray

from mbsvib.common.arrays import Array, Complex, Index
from mbsvib.linalg.groups import linked_items
from mbsvib.linalg.rank import EPS, ONE_BRANCH, SAME_EIGENVALUE
from mbsvib.modes.damped import Damped
from mbsvib.modes.general import General
from mbsvib.modes.pairs import of_all
from mbsvib.modes.result import Modes

Field = NDArray[Any]


@dataclass(frozen=True, slots=True)
class Pairs:
    """Groups of eigenvalues that coincide, and all pairs ``first``, ``second`` (n,) in them, group after group."""

    groups: list[Index]
    first: Index
    second: Index

    def by_size(self) -> Iterator[tuple[int, Index, Index]]:
        """Yield each size k of groups, with the groups of that size (n, k) and the numbers of their pairs (n, -1)."""
        sizes = [len(group) for group in self.groups]
        starts = list(accumulate((k * (k - 1) // 2 for k in sizes), initial=0))
        for k in sorted(set(sizes)):
            indices = [i for i, size in enumerate(sizes) if size == k]
            numbers = np.array([range(starts[i], starts[i + 1]) for i in indices])
            yield k, np.array([self.groups[i] for i in indices]), numbers


@dataclass(frozen=True, slots=True)
class Spectrum:
    """Eigenvalues ``lead`` (h,) of which conjugates are left out, with ``right`` and ``left`` vectors (m, h), left None
    where they are the same. ``index`` (h,) are their places among all, and the eigenvalues at ``mirror`` are conjugate
    to the lead ones ``mirrored``.
    """

    lead: Complex
    right: Field
    left: Field | None
    index: Index
    mirror: Index
    mirrored: Index
    count: int

    @property
    def alternates(self) -> bool:
        """Whether each lead eigenvalue is followed by its conjugate, and there are no others."""
        pairs = len(self.lead)
        return 2 * pairs == self.count and len(self.mirror) == pairs and \
            bool((self.index == np.arange(0, self.count, 2)).all())  # fmt: skip

    def pairs(self) -> Pairs:
        """Return the groups of eigenvalues that coincide with all pairs in them, those at 0 left out."""
        groups = [group for group in coinciding(self.lead) if self.lead[group[0]] != 0.0]
        members = [pair for group in groups for pair in combinations(group.tolist(), 2)]
        first, second = np.array(members, dtype=np.intp).reshape(-1, 2).T
        return Pairs(groups, first, second)

    def with_sums(self, pairs: Pairs) -> Spectrum:
        """Return the spectrum with the sum of the vectors of each pair behind its own."""
        if not pairs.groups:
            return self
        sums = self.right[:, pairs.first] + self.right[:, pairs.second]
        return replace(self, lead=np.concatenate((self.lead, self.lead[pairs.first])),
                       right=np.concatenate((self.right, sums), axis=1))  # fmt: skip


def coinciding(values: Complex) -> list[Index]:
    """Return the groups of two or more eigenvalues (n,) that coincide; those at 0 are one of them."""
    return linked_items(np.abs(values[:, None] - values) <= SAME_EIGENVALUE * np.abs(values))


def spectrum(modes: Modes) -> Spectrum:
    """Return the eigenvalues of a system with their vectors."""
    damped = modes.damped
    if isinstance(damped, Damped):
        return _symmetric(damped)
    return _general(modes.eigenvalues, damped)


def put(result: Complex, spectrum: Spectrum, which: Index, form: Complex | Array) -> None:
    """Set, in place, the columns of some of the lead eigenvalues, and of their conjugates."""
    result[:, spectrum.index[which]] = form
    mirror = np.full(len(spectrum.lead), -1)
    mirror[spectrum.mirrored] = spectrum.mirror
    paired = mirror[which] >= 0
    result[:, mirror[which][paired]] = form[:, paired].conj()


def _symmetric(damped: Damped) -> Spectrum:
    values = damped.pairs.reshape(-1)
    second_alike = damped.pairs[:, 0].imag != 0.0
    if damped.vectors is None:  # both eigenvalues 0 of a rigid-body motion have its shape
        second_alike |= ~damped.pairs.any(axis=1)
    retained = np.ones(damped.pairs.shape, dtype=bool)
    retained[second_alike, 1] = False
    index = np.flatnonzero(retained)
    mirror = np.flatnonzero(~retained)
    position = np.cumsum(retained) - 1
    right: Field
    if damped.vectors is None:
        right = damped.shapes[:, index // 2]
    else:
        right = damped.shapes @ damped.vectors.reshape(len(damped.pairs), -1)[:, index]
    return Spectrum(values[index], right, None, index, mirror, position[mirror - 1], len(values))


def _general(values: Complex, general: General) -> Spectrum:
    _, right, left, _ = general.spectrum.complete()
    numbers = of_all(general.numbers, general.single)
    # the eigenvalue 0 is the last one, and its vectors are none
    x, y = (np.pad(part, ((0, 0), (0, 1)))[:, numbers] for part in (right, left))
    index, none = np.arange(len(values)), np.zeros(0, dtype=np.intp)
    return Spectrum(values, x, y, index, none, none, len(values))


# Cardano's formula is as accurate as the matrix where the root in it exceeds this share of its sum.
DISTINCT = 0.1
_THIRD_ROOTS = np.exp(2j * np.pi / 3.0 * np.arange(3))[:, None]


def branches(
    pairs: Pairs, diagonal: Complex, cross: Complex, norm: tuple[Complex, Complex]
) -> Iterator[tuple[Index, Complex]]:  # fmt: skip
    """Yield the numbers (n,) of eigenvalues that coincide, and the derivatives (n, variables) of their branches, groups
    of one size together.

    ``diagonal`` (eigenvalues, variables): derivatives of single eigenvalues, forms of those that coincide; ``cross``
    (pairs, variables) or (2 pairs, variables): the forms of pairs, first with second, then second with first unless
    these are the same; ``norm`` (eigenvalues,) and (pairs,) or (2 pairs,): y^T (2 lambda M + C) x of single eigenvalues
    and of pairs. Branches of a group are in ascending order of their derivatives.
    """
    forms, norms = np.concatenate((diagonal, cross)), np.concatenate((norm[0][: len(diagonal)], norm[1]))
    single = np.ones(len(diagonal), dtype=bool)
    single[np.concatenate(pairs.groups)] = False
    derivatives, mirrored = [diagonal[single]], len(cross) - len(pairs.first)
    for k, groups, numbers in pairs.by_size():
        n, count = len(groups), forms.shape[1]
        rows = np.empty((n, k, k), dtype=np.intp)
        upper, lower = np.array(list(combinations(range(k), 2))).T
        rows[:, range(k), range(k)] = groups
        rows[:, upper, lower], rows[:, lower, upper] = len(diagonal) + numbers, len(diagonal) + numbers + mirrored
        pair = norms[rows]
        with np.errstate(all="ignore"):
            inverse = _inverse(pair)
            product = np.asarray(-inverse @ forms[rows].reshape(n, k, k * count), dtype=complex)
            matrix: Complex = np.moveaxis(product.reshape(n, k, k, count), 0, 2)
            if k == 2:
                values = _of_pairs(matrix)
            else:
                sizes = np.abs(np.concatenate(derivatives))
                rounding = ONE_BRANCH * sizes.max(axis=0, initial=0.0, where=np.isfinite(sizes))
                values = _ascending(_eigenvalues(matrix.reshape(k, k, n * count), np.tile(rounding, n)))
            values = np.moveaxis(values.reshape(k, n, count), 0, 1)
            condition = np.abs(inverse).max(axis=(1, 2)) * np.abs(pair).max(axis=(1, 2))
            values[~(condition * EPS < 1.0)] = np.inf  # a defective group parts with a root
        derivatives.append(values.reshape(n * k, count))
        yield groups.reshape(-1), derivatives[-1]


def _inverse(pair: Complex) -> Complex:
    """Inverses of matrices (n, k, k), of singular ones those that solve as well as can be."""
    try:
        return np.asarray(np.linalg.inv(pair), dtype=complex)
    except np.linalg.LinAlgError:
        return np.asarray(np.linalg.pinv(np.where(np.isfinite(pair), pair, 0.0), rcond=EPS))


def _of_pairs(matrices: Complex) -> Complex:
    """Eigenvalues (2, ...) of 2x2 matrices (2, 2, ...), in ascending order."""
    (a, b), (c, d) = matrices
    half, mean = 0.5 * (a - d), 0.5 * (a + d)
    root = np.sqrt(half * half + b * c)
    turns = np.abs(mean.imag) + np.abs(root.imag) > np.abs(mean.real) + np.abs(root.real)
    root[np.where(turns, root.imag, root.real) < 0.0] *= -1.0
    return np.array([mean - root, mean + root])


def _ascending(values: Complex) -> Complex:
    """Values (k, n) in ascending order of their imaginary parts where these are larger, else of their real parts."""
    turns = np.abs(values.imag).max(axis=0) > np.abs(values.real).max(axis=0)
    order = np.where(turns, values.imag, values.real).argsort(axis=0)
    return np.take_along_axis(values, order, axis=0)


def _eigenvalues(matrices: Complex, rounding: Array) -> Complex:
    """Eigenvalues (k, n) of matrices (k, k, n): their diagonals where no entry exceeds the ``rounding`` (n,), not a
    number where these are not.
    """
    k, _, n = matrices.shape
    size = np.abs(matrices.reshape(k * k, n)).max(axis=0)
    result: Complex = matrices.reshape(k * k, n)[:: k + 1].copy()
    others = np.flatnonzero(~(size <= rounding))
    if k == 3:
        values, known = _of_triples(matrices[..., others], size[others])
        result[:, others[known]] = values[:, known]
        others = others[~known]
    finite = np.isfinite(size[others])
    result[:, others[~finite]] = np.nan
    others = others[finite]
    result[:, others] = np.linalg.eigvals(np.moveaxis(matrices[..., others], 2, 0)).T
    return result


def _of_triples(matrices: Complex, size: Array) -> tuple[Complex, NDArray[np.bool_]]:
    """Eigenvalues (3, n) of 3x3 matrices (3, 3, n) with entries up to a ``size`` (n,), and whether they are known.

    The change of one part often has rank one: all minors vanish, and the trace is the only eigenvalue that does not.
    Where the three are distinct Cardano's formula gives them: with A = B + 1 tr A / 3, p = tr B^2 / 6 and q = det B / 2
    they are tr A / 3 + u + p / u for u^3 = q + (q^2 - p^3)^1/2.
    """
    (a, b, c), (d, e, f), (g, h, i) = matrices
    trace = a + e + i
    minors = np.abs((e * i - f * h, d * i - f * g, d * h - e * g, b * i - c * h, a * i - c * g, a * h - b * g,
                     b * f - c * e, a * f - c * d, a * e - b * d)).max(axis=0)  # fmt: skip
    single = (minors <= ONE_BRANCH * size * size) & (np.abs(trace) >= 0.5 * size)
    centre = trace / 3.0
    a, e, i = a - centre, e - centre, i - centre
    p = (a * a + e * e + i * i + 2.0 * (b * d + c * g + f * h)) / 6.0
    q = 0.5 * (a * (e * i - f * h) - b * (d * i - f * g) + c * (d * h - e * g))
    root = np.sqrt(q * q - p * p * p)
    root[(root * q.conj()).real < 0.0] *= -1.0
    u = (q + root) ** (1.0 / 3.0) * _THIRD_ROOTS
    values: Complex = centre + u + p / u
    values[:, single] = 0.0
    values[0, single] = trace[single]
    return values, single | (np.abs(root) > DISTINCT * np.abs(q + root))
