"""Loops: from joint coordinates to minimal coordinates, q = B'' z.

Each cut joint locks relative displacements: rows Phi q = 0. A rank-revealing QR per independent group of loops tells
which rows are redundant and which joint coordinates depend on the others; the others are the minimal coordinates.
"""

from __future__ import annotations

import warnings
from dataclasses import dataclass, field
from functools import cached_property, lru_cache, partial
from operator import sub
from typing import TYPE_CHECKING

import numpy as np
from scipy.linalg import blas, lapack

from mbsvib.common.expected import names
from mbsvib.elements.rows import Rows
from mbsvib.errors import ModelError, NearSingularWarning, SingularPoseError, nearest
from mbsvib.kinematics.relative_motion import Twists
from mbsvib.linalg.qr import pivoted_qr
from mbsvib.linalg.rank import EPS, NEAR_SINGULAR, RANK_FACTOR, RANK_GAP, TIE_BREAK, ZERO_PRODUCT

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Sequence

    from numpy.typing import NDArray

    from mbsvib.common.arrays import Array, Index
    from mbsvib.kinematics.couplings import Couplings

    Mask = NDArray[np.bool_]
    Arms = Callable[[Iterable[str]], float]



@dataclass(frozen=True)
class LoopGroup:
    """What the rank decision of one independent group of loops was.

    ``joints`` are the cut joints, ``rows`` and ``columns`` the numbers of their locked rows and of the coordinates
    involved; ``kept`` is the smallest pivot kept, 1 where there is none, and ``dropped`` the largest one dropped, both
    of rows and columns that ``length`` [m] scales to the size of one (over the largest pivot where that is more);
    ``noise`` is the rounding of their entries, ``surplus`` the number of redundant constraint rows.
    """

    joints: tuple[str, ...]
    rows: Index
    columns: Index
    rank: int
    kept: float
    dropped: float
    length: float
    noise: float
    _names: Callable[[], tuple[str, ...]] = field(repr=False, compare=False)

    @property
    def surplus(self) -> int:
        """How many constraint rows the others imply."""
        return len(self.rows) - self.rank

    @cached_property
    def redundant(self) -> tuple[str, ...]:
        """Names of the constraint rows that the others imply: found out when they are first asked for."""
        return self._names() if self.surplus else ()


@dataclass(frozen=True, slots=True)
class Reduction:
    """Minimal coordinates: ``independent`` (m,) picks them from the joint coordinates, ``matrix`` (..., n, m) is B''.

    ``matrix`` is None where no loop exists, B'' being the identity that nothing is multiplied by.
    """

    independent: Index
    matrix: Array | None
    groups: tuple[LoopGroup, ...]

    def apply(self, rows: Array) -> Array:
        """Return rows (..., rows, n) in minimal coordinates (..., rows, m)."""
        return rows if self.matrix is None else rows @ self.matrix

    def apply_to_bodies(self, motion: Array) -> Array:
        """Return body motions (..., bodies, 6, n) in minimal coordinates (..., bodies, 6, m)."""
        if self.matrix is None:
            return motion
        *lead, bodies, _, n = motion.shape
        result = motion.reshape(*lead, 6 * bodies, n) @ self.matrix
        return result.reshape(*result.shape[:-2], bodies, 6, result.shape[-1])

    def apply_exactly(self, rows: Array, count: int | None = None) -> Array:
        """Return rows in minimal coordinates, the first ``count`` of them (default: all) with exact zeros where loops
        take a motion away but for rounding.
        """
        result = self.apply(rows)
        if self.matrix is not None:
            exact = result[..., :count, :]
            noise = np.abs(rows[..., :count, :]) @ np.abs(self.matrix)
            exact[np.abs(exact) <= ZERO_PRODUCT * rows.shape[-1] * noise] = 0.0
        return result


@dataclass(frozen=True, slots=True)
class Cuts:
    """The locked rows of the cut joints: ``rows``, their ``names`` and the number of the cut ``joint`` of each.

    ``joints`` are the cut joints' names, ``start`` the first row of each joint that locks anything; ``translates``
    tells locked translations from rotations. The rows of ``couplings`` come behind these, each a joint of its own in
    ``names``, ``joint``, ``joints`` and ``translates``; ``rows`` and ``start`` have none of them.
    """

    rows: Rows
    names: tuple[str, ...]
    joint: Index
    joints: tuple[str, ...]
    start: Index
    translates: Mask
    couplings: Couplings | None = None

    def row_scale(self, length: float) -> Array:
        """Return the factors (..., rows) by which the rows know no units, lengths being measured in ``length`` [m]."""
        if self.couplings is None:
            return np.where(self.translates, 1.0 / length, 1.0)
        own, coupled = self.translates[: len(self.rows.first)], self.couplings.row_scale(length)
        scale = np.broadcast_to(np.where(own, 1.0 / length, 1.0), (*coupled.shape[:-1], len(own)))
        return np.concatenate((scale, coupled), axis=-1)


def reduce(
    coordinates: Twists, cuts: Cuts | None, phi: Array, independent: Sequence[str] | None = None,
    arms: Arms | None = None,
) -> Reduction:  # fmt: skip
    """Return the minimal coordinates and B'' with Phi B'' = 0.

    Parameters
    ----------
    coordinates : Twists
        The joint coordinates of the tree.
    cuts : Cuts or None
        The locked rows of the cut joints; None where nothing is cut.
    phi : array, shape (locked rows, n)
        Relative displacements of these rows per unit joint coordinate.
    independent : sequence of str, optional
        Coordinates that must be among the minimal ones.
    arms : callable, optional
        How far joints, by name, are from the centres of mass of their bodies [m]: a body that has been turned has its
        points rounded by that. Asked where the rank is in doubt.

    Returns
    -------
    Reduction
        The choice of coordinates, B'' and the rank decisions.

    Raises
    ------
    ModelError
        If a pinned coordinate is unknown or cannot be independent.
    SingularPoseError
        If the number of degrees of freedom is another one in every pose nearby, or the rank is in doubt.

    Source: Jiang, Chen & Luo (2011), cut-joint constraint matrix B''.
    """
    pinned = None if independent is None else _pinned(coordinates, independent)
    n = len(coordinates.names)
    if cuts is None:
        return Reduction(np.arange(n), None, ())
    depends = np.zeros(n, dtype=bool)
    solved = []
    groups = []
    for rows, columns in _groups(coordinates, cuts):
        group, dependent, others, block = _solve(coordinates, cuts, phi, rows, columns, pinned, arms)
        depends[dependent] = True
        solved.append((dependent, others, block))
        groups.append(group)
    free = (~depends).nonzero()[0]
    place = np.empty(n, dtype=np.intp)
    place[free] = np.arange(len(free))
    matrix = np.zeros((n, len(free)))
    matrix[free, np.arange(len(free))] = 1.0
    for dependent, others, block in solved:
        matrix[dependent[:, None], place[others]] = block
    return Reduction(free, matrix, tuple(groups))


def _pinned(coordinates: Twists, independent: Sequence[str] | None) -> Mask:
    pinned = np.zeros(len(coordinates.names), dtype=bool)
    for name in () if independent is None else names(independent, "linearize", "independent", ModelError):
        if name not in coordinates.names:
            raise ModelError(
                f"independent = {name!r} is no joint coordinate of the tree.{nearest(str(name), coordinates.names)} "
                f"Joints that are cut have none; name the cut joints with cut= to keep this one.",
                element=str(name), field="independent",
            )  # fmt: skip
        pinned[coordinates.names.index(name)] = True
    return pinned


def _groups(coordinates: Twists, cuts: Cuts) -> list[tuple[Index, Index]]:
    """Loops that share a coordinate form a group: (rows, columns) of each."""
    first, second = cuts.rows.first.take(cuts.start), cuts.rows.second.take(cuts.start)
    touched = coordinates.path.take(second, axis=0) != coordinates.path.take(first, axis=0)
    if cuts.couplings is not None:
        touched = np.concatenate((touched, cuts.couplings.touched))
    groups: list[tuple[int, list[int]]] = []
    for loop, bits in enumerate(np.packbits(touched, axis=1)):
        # the coordinates that a loop touches as bits of one integer: an intersection is a single operation
        mask, loops, apart = int.from_bytes(bits.tobytes(), "big"), [loop], []
        for other, members in groups:
            if mask & other:
                mask |= other
                loops = members + loops
            else:
                apart.append((other, members))
        groups = [*apart, (mask, loops)]
    row = np.arange(len(cuts.names))
    if len(groups) == 1:
        return [(row, touched.any(axis=0).nonzero()[0])]
    ends = [*cuts.start.tolist(), *range(len(cuts.rows.first), len(row) + 1)]
    return [
        (row[ends[loops[0]] : ends[loops[0] + 1]], touched[loops[0]].nonzero()[0]) if len(loops) == 1 else
        (np.concatenate([row[ends[loop] : ends[loop + 1]] for loop in loops]), touched[loops].any(axis=0).nonzero()[0])
        for _, loops in groups
    ]  # fmt: skip


def _solve(
    coordinates: Twists, cuts: Cuts, phi: Array, rows: Index, columns: Index, pinned: Mask | None, arms: Arms | None,
    arm: float = 0.0,
) -> tuple[LoopGroup, Index, Index, Array]:  # fmt: skip
    """Solve one group: its rank decision, dependent and other columns, and the block of B'' between them."""
    cut = rows if cuts.couplings is None else rows[rows < len(cuts.rows.first)]
    points = np.concatenate((cuts.rows.point.take(cut, axis=1), coordinates.point.take(columns, axis=1)), axis=1)
    length, noise = measures(points, max(len(rows), len(columns)), coordinates.pitch, arm)
    scale = np.where(coordinates.turns.take(columns), 1.0, length)
    scale *= _preference(len(columns))
    a = scaled(phi.take(rows, axis=0).take(columns, axis=1), cuts, rows, scale, length)
    held = candidate = None
    if pinned is not None and pinned[columns].any():
        held, candidate = np.nonzero(pinned[columns])[0], np.nonzero(~pinned[columns])[0]
    qr, order, tau = pivoted_qr(a if candidate is None else a[:, candidate])
    rank, kept, dropped, limit = decided(qr.diagonal().tolist(), noise)
    right, tied = qr[:rank, rank:], False
    if held is not None:
        product = a[:, held]
        if len(tau):
            product = lapack.dormqr("L", "T", qr[:, : len(tau)], tau, product, 64 * len(held))[0]
        tied = bool(np.abs(product[rank:]).max(initial=0.0) > limit)
        right = np.concatenate((right, product[:rank]), axis=1)
    joints = tuple([cuts.joints[k] for k in dict.fromkeys(cuts.joint.take(rows).tolist())])
    doubtful = tied or kept < NEAR_SINGULAR or limit > NEAR_SINGULAR
    if doubtful and arms is not None and not arm:
        arm = arms([*joints, *(coordinates.names[k].rpartition(".")[0] for k in columns.tolist())])
        if arm:
            return _solve(coordinates, cuts, phi, rows, columns, pinned, arms, arm)
    if tied and held is not None:
        raise _tied(coordinates, columns[held])
    group = LoopGroup(joints, rows, columns, rank, kept, dropped, length, noise,
                      partial(_redundant, a, rank, rows, cuts.names))  # fmt: skip
    _check_gap(group)
    dependent, others = order[:rank], order[rank:]
    if candidate is not None and held is not None:
        dependent, others = candidate[dependent], np.concatenate((candidate[others], held))
    # dtrtrs would wait for a second thread, however small the loop
    block = blas.dtrsm(-1.0, qr[:rank, :rank], right) if rank and len(others) else np.zeros((rank, len(others)))
    block[np.abs(block) <= noise / kept] = 0.0  # what joints do not move by but for rounding would hold free motions
    block *= np.divide.outer(scale.take(dependent), scale.take(others))
    return group, columns.take(dependent), columns.take(others), block


def measures(points: Array, count: int, pitch: float, arm: float = 0.0) -> tuple[float, float]:
    """Return what lengths in loops are measured in, and the rounding of rows that are scaled by it.

    Parameters
    ----------
    points : array, shape (3, n)
        Points of the joints [m].
    count : int
        Number of the rows or of the coordinates, whichever is larger.
    pitch : float
        Largest pitch of a screw [m].
    arm : float
        How far the points are from the centres of mass of their bodies [m].

    Returns
    -------
    length : float
        The size of the loops [m]; where all points are one but for rounding, the pitch, or 1 m.
    noise : float
        Rounding of an entry: that of unit vectors, and of points relative to their distance from the origin, or from
        the centre of mass about which their body was turned.
    """
    if not points.size:  # a coupler of coordinates that other joints hold still
        return 1.0, EPS * count
    axes = points.tolist()
    low, high = list(map(min, axes)), list(map(max, axes))
    length, distance = max(map(sub, high, low)), max(*high, -min(low), arm)
    if length <= RANK_FACTOR * EPS * count * distance:  # lever arms, which are shorter, are rounding
        length = pitch or 1.0
    return length, EPS * count * max(1.0, distance / length)


def decided(pivots: list[float], noise: float) -> tuple[int, float, float, float]:
    """Return the rank, the smallest pivot kept and the largest one dropped, and up to what size pivots are dropped.

    Parameters
    ----------
    pivots : list of float
        Pivots of rows and columns of the size of one, in descending order of size.
    noise : float
        Rounding of an entry.

    Returns
    -------
    tuple of int, float, float and float
        Rank, ``kept`` and ``dropped`` as ``LoopGroup`` has them, and the limit, of pivots as they are.
    """
    sizes = list(map(abs, pivots))
    # rounding is measured by entries of the size of one: the largest pivot may be rounding itself
    unit = max(1.0, sizes[0]) if sizes else 1.0
    limit = RANK_FACTOR * noise * unit
    rank = sum([size > limit for size in sizes])
    kept, dropped = sizes[rank - 1] if rank else unit, sizes[rank] if rank < len(sizes) else 0.0
    return rank, kept / unit, dropped / unit, limit


@lru_cache
def _preference(n: int) -> Array:
    """Weights by which the first of n equals is taken."""
    result: Array = 1.0 - TIE_BREAK / max(1, n) * np.arange(float(n))
    result.setflags(write=False)
    return result


def scaled(phi: Array, cuts: Cuts, rows: Index, column_scale: Array, length: float) -> Array:
    """Return Phi with translations over ``length`` and rotations as they are, so that rank knows no units."""
    return phi * cuts.row_scale(length).take(rows)[:, None] * column_scale


def _redundant(a: Array, rank: int, rows: Index, names: tuple[str, ...]) -> tuple[str, ...]:
    """Name the rows that the others imply: those that a pivoted QR of the transpose takes last."""
    _, order, _ = pivoted_qr((a * _preference(len(rows))[:, None]).T)
    return tuple(names[rows[k]] for k in sorted(order[rank:].tolist()))


def _tied(coordinates: Twists, held: Index) -> ModelError:
    """Refuse pinned coordinates that the loops tie to each other (their columns reach outside the others' range)."""
    names = ", ".join(coordinates.names[k] for k in held)
    return ModelError(
        f"independent: the loops leave no choice in which all of {names} are independent; pin fewer of them.",
        element=coordinates.names[held[0]], field="independent",
    )  # fmt: skip


def _check_gap(group: LoopGroup) -> None:
    if group.dropped * RANK_GAP <= group.kept and group.kept >= NEAR_SINGULAR:
        return
    names = ", ".join(group.joints)
    if group.dropped * RANK_GAP > group.kept:
        raise SingularPoseError(
            f"loops closed by {names}: constraint pivots {group.kept:.1e} (kept) and {group.dropped:.1e} (dropped) are "
            f"too close to tell how many constraints are independent. Move the pose away from the singular one, or "
            f"give the geometry with all its digits."
        )
    warnings.warn(
        f"loops closed by {names}: nearly singular pose (smallest pivot {group.kept:.1e}); the minimal coordinates "
        f"lose as many digits. Pin other coordinates with independent=, move the pose, or give joints that are meant "
        f"to be in line all their digits.", NearSingularWarning, stacklevel=6,
    )  # fmt: skip
