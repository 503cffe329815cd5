"""Eigenvalues with right and left vectors, whatever solver they come from."""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import accumulate, combinations
from typing import TYPE_CHECKING, Any

import numpy as np

from mbsvib.linalg.rank import SAME_EIGENVALUE
from mbsvib.modes.damped import Damped

if TYPE_CHECKING:
    from collections.abc import Iterator

    from numpy.typing import NDArray

    from mbsvib.common.arrays import Array, Complex, Index
    from mbsvib.modes.general import General
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

    def clusters(self) -> list[Index]:
        """Return groups of eigenvalues that coincide, those at 0 left out."""
        distance = np.abs(self.lead[:, None] - self.lead)
        near = distance <= SAME_EIGENVALUE * np.abs(self.lead)
        groups, grouped = [], np.zeros(len(self.lead), dtype=bool)
        for i in np.flatnonzero((near.sum(axis=1) > 1) & (self.lead != 0.0)):
            if not grouped[i]:
                group = np.flatnonzero(near[i] & ~grouped)
                grouped[group] = True
                if len(group) > 1:
                    groups.append(group)
        return groups

    def pairs(self) -> Pairs:
        """Return the groups of eigenvalues that coincide with all pairs in them."""
        groups = self.clusters()
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
    known, right, left, _ = general.spectrum.complete()
    m = len(right)
    x, y = np.zeros((m, len(values)), dtype=complex), np.zeros((m, len(values)), dtype=complex)
    free = np.ones(len(known), dtype=bool)
    for i in np.flatnonzero(values != 0.0):
        nearest = int(np.argmin(np.where(free, np.abs(known - values[i]), np.inf)))
        free[nearest] = False
        x[:, i], y[:, i] = right[:, nearest], left[:, nearest]
    index = np.arange(len(values))
    none = np.zeros(0, dtype=np.intp)
    return Spectrum(values, x, y, index, none, none, len(values))
