"""One independent group of loops: its lengths, its rank decision and the constraints that are redundant."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property, lru_cache
from operator import sub
from typing import TYPE_CHECKING

import numpy as np

from mbsvib.common.fast_init import fast_init
from mbsvib.common.tables import listed
from mbsvib.errors import SingularPoseError
from mbsvib.linalg.qr import pivoted_qr
from mbsvib.linalg.rank import EPS, RANK_FACTOR, RANK_GAP, TIE_BREAK

if TYPE_CHECKING:
    from collections.abc import Callable

    from mbsvib.common.arrays import Array, Index


@fast_init
@dataclass(frozen=True)
class LoopGroup:
    """The rank decision of one independent group of loops.

    ``joints`` are the cut joints, ``rows`` and ``columns`` the numbers of their locked rows and of the coordinates
    involved. ``retained`` is the smallest pivot kept, 1 where there is none, and ``dropped`` the largest one dropped;
    both are those of the matrix that ``length`` [m] scales to entries of about one, over its largest pivot if that
    exceeds one. ``noise`` is the rounding of its entries.
    """

    joints: tuple[str, ...]
    rows: Index
    columns: Index
    rank: int
    retained: float
    dropped: float
    length: float
    noise: float
    _names: Callable[[], tuple[str, ...]] = field(repr=False, compare=False)

    @property
    def surplus(self) -> int:
        """The number of redundant constraint rows."""
        return len(self.rows) - self.rank

    @cached_property
    def redundant(self) -> tuple[str, ...]:
        """Names of the redundant constraint rows, computed on first access."""
        return self._names() if self.surplus else ()


def measures(points: Array, count: int, pitch: float, arm: float = 0.0) -> tuple[float, float]:
    """Return the unit of length of loops [m], and the rounding of the entries of rows that are scaled by it.

    The length is the size of the loops; where all ``points`` (3, n) of the joints [m] coincide within rounding, the
    largest ``pitch`` of a screw [m], or 1 m. The rounding is that of unit vectors, and of points relative to their
    distance from the origin, or to ``arm`` [m], the largest distance of the points from the centres of mass about which
    their bodies were turned. ``count``: number of the rows or of the coordinates, whichever is larger.
    """
    if not points.size:  # a coupler of coordinates that other joints lock
        return 1.0, EPS * count
    axes = points.tolist()
    low, high = list(map(min, axes)), list(map(max, axes))
    length, distance = max(map(sub, high, low)), max(*high, -min(low), arm)
    if length <= RANK_FACTOR * EPS * count * distance:  # lever arms, which are shorter, are rounding
        length = pitch or 1.0
    return length, EPS * count * max(1.0, distance / length)


def decided(pivots: list[float], noise: float) -> tuple[int, float, float, float]:
    """Return the rank, the smallest pivot kept, the largest one dropped, and the limit up to which they are dropped.

    Pivots are those of a matrix with entries of about one, in descending order of size; ``noise`` is the rounding of an
    entry. ``retained`` and ``dropped`` are as in ``LoopGroup``, the limit is for pivots that are not divided.
    """
    sizes = list(map(abs, pivots))
    # rounding is relative to entries of about one, as the largest pivot may itself be rounding
    unit = max(1.0, sizes[0]) if sizes else 1.0
    limit = RANK_FACTOR * noise * unit
    rank = sum([size > limit for size in sizes])
    retained, dropped = sizes[rank - 1] if rank else unit, sizes[rank] if rank < len(sizes) else 0.0
    return rank, retained / unit, dropped / unit, limit


@lru_cache
def preference(n: int) -> Array:
    """Return weights (n,) by which the first of several equal pivots is taken."""
    result: Array = 1.0 - TIE_BREAK / max(1, n) * np.arange(float(n))
    result.setflags(write=False)
    return result


def redundant_members(a: Array, rank: int) -> list[int]:
    """Return the numbers of redundant rows: those that a pivoted QR of the transpose takes last."""
    return sorted(pivoted_qr((a * preference(len(a))[:, None]).T)[1][rank:].tolist())


def redundant_rows(a: Array, rank: int, rows: Index, names: tuple[str, ...]) -> tuple[str, ...]:
    """Return the names of redundant rows."""
    return tuple(names[rows[k]] for k in redundant_members(a, rank))


def check_gap(group: LoopGroup) -> None:
    """Refuse a rank decision without a gap between pivots."""
    if group.dropped * RANK_GAP > group.retained:
        raise SingularPoseError(
            f"loops closed by {listed(group.joints)}: constraint pivots {group.retained:.1e} (kept) and "
            f"{group.dropped:.1e} (dropped) are too close to tell how many constraints are independent. Move the pose "
            f"away from the singular one, or give the geometry with all its digits."
        )
