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

from mbsvib._given import names
from mbsvib.errors import ModelError, NearSingularWarning, SingularPoseError, nearest
from mbsvib.kinematics import Rows, Twists

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from numpy.typing import NDArray

    from mbsvib.couplers.rows import Couplings
    from mbsvib.kinematics import Array, Index

    Mask = NDArray[np.bool_]

EPS = float(np.finfo(float).eps)
# Entries of the scaled Phi carry a rounding error of a few eps times (distance from the origin / loop size); pivots
# below this many times that error count as zero.
RANK_FACTOR = 50.0
# A pivot that small means that coordinates lose as many digits: eigenvalues good to 1e-12 are no longer certain.
NEAR_SINGULAR = 1e-4
# Sums of n products that cancel to less than this times n of their size are zero but for rounding.
ZERO_ENTRY = 4.0 * EPS
# Kept and dropped pivots closer than this leave the rank itself in doubt.
RANK_GAP = 1e3
# Points closer than this share of their distance from the origin are one point, told apart by rounding.
SAME_POINT = 16.0 * EPS
# Equal column norms would leave the choice of coordinates to rounding; this prefers to keep what comes later.
TIE_BREAK = 1e-6


@dataclass(frozen=True)
class LoopGroup:
    """What the rank decision of one independent group of loops was.

    ``joints`` are the cut joints, ``rows`` and ``columns`` the numbers of their locked rows and of the coordinates
    involved; ``kept`` is the smallest pivot kept and ``dropped`` the largest one dropped (relative to the largest
    pivot; rotations scaled by ``length`` [m]), ``surplus`` the number of redundant constraint rows.
    """

    joints: tuple[str, ...]
    rows: Index
    columns: Index
    rank: int
    kept: float
    dropped: float
    length: float
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
            exact[np.abs(exact) <= ZERO_ENTRY * rows.shape[-1] * noise] = 0.0
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
    coordinates: Twists, cuts: Cuts | None, phi: Array, independent: Sequence[str] | None = None
) -> Reduction:
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
        group, dependent, others, block = _solve(coordinates, cuts, phi, rows, columns, pinned)
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
    coordinates: Twists, cuts: Cuts, phi: Array, rows: Index, columns: Index, pinned: Mask | None
) -> tuple[LoopGroup, Index, Index, Array]:
    """Solve one group: its rank decision, dependent and other columns, and the block of B'' between them."""
    cut = rows if cuts.couplings is None else rows[rows < len(cuts.rows.first)]
    points = np.concatenate((cuts.rows.point.take(cut, axis=1), coordinates.point.take(columns, axis=1)), axis=1)
    if not points.size:  # a coupler of coordinates that other joints hold still
        points = np.zeros((3, 1))
    low, high = np.minimum.reduce(points, axis=1).tolist(), np.maximum.reduce(points, axis=1).tolist()
    length, distance = max(map(sub, high, low)), max(*high, -min(low))
    if length <= SAME_POINT * distance or length == 0.0:  # no size: joints about one point, but for rounding
        length = 1.0
    scale = np.where(coordinates.turns.take(columns), 1.0, length)
    scale *= _preference(len(columns))
    a = scaled(phi.take(rows, axis=0).take(columns, axis=1), cuts, rows, scale, length)
    held = candidate = None
    if pinned is not None and pinned[columns].any():
        held, candidate = np.nonzero(pinned[columns])[0], np.nonzero(~pinned[columns])[0]
    qr, order, tau = pivoted_qr(a if candidate is None else a[:, candidate])
    pivots = list(map(abs, qr.diagonal().tolist()))
    # positions are rounded relative to the origin, entries of Phi therefore relative to origin distance / loop size
    noise = EPS * max(a.shape) * max(1.0, distance / length)
    largest = pivots[0] if pivots and pivots[0] > 0.0 else 1.0
    limit = RANK_FACTOR * noise * max(1.0, largest)
    rank = sum([pivot > limit for pivot in pivots])
    right = qr[:rank, rank:]
    if held is not None:
        product = a[:, held]
        if len(tau):
            product = lapack.dormqr("L", "T", qr[:, : len(tau)], tau, product, 64 * len(held))[0]
        _check_pins(coordinates, columns[held], product[rank:], RANK_FACTOR * noise)
        right = np.concatenate((right, product[:rank]), axis=1)
    group = LoopGroup(
        tuple([cuts.joints[k] for k in dict.fromkeys(cuts.joint.take(rows).tolist())]), rows, columns, rank,
        pivots[rank - 1] / largest if rank else 1.0, pivots[rank] / largest if rank < len(pivots) else 0.0, length,
        partial(_redundant, a, rank, rows, cuts.names),
    )  # fmt: skip
    _check_gap(group)
    dependent, others = order[:rank], order[rank:]
    if candidate is not None and held is not None:
        dependent, others = candidate[dependent], np.concatenate((candidate[others], held))
    # dtrtrs would wait for a second thread, however small the loop
    block = blas.dtrsm(1.0, qr[:rank, :rank], right) if rank and len(others) else np.zeros((rank, len(others)))
    block *= -scale.take(dependent)[:, None] / scale.take(others)
    return group, columns.take(dependent), columns.take(others), block


@lru_cache
def _preference(n: int) -> Array:
    """Weights by which the first of n equals is taken."""
    result: Array = 1.0 - TIE_BREAK / max(1, n) * np.arange(float(n))
    result.setflags(write=False)
    return result


def scaled(phi: Array, cuts: Cuts, rows: Index, column_scale: Array, length: float) -> Array:
    """Return Phi with translations over ``length`` and rotations as they are, so that rank knows no units."""
    return phi * cuts.row_scale(length).take(rows)[:, None] * column_scale


def pivoted_qr(a: Array) -> tuple[Array, Index, Array]:
    """Return LAPACK's packed column-pivoted QR of ``a``, the order of columns and the reflectors' factors."""
    if 0 in a.shape:
        return np.zeros(a.shape), np.arange(a.shape[1]), np.zeros(0)
    qr, order, tau, _, _ = lapack.dgeqp3(a)
    return qr, order - 1, tau


def _redundant(a: Array, rank: int, rows: Index, names: tuple[str, ...]) -> tuple[str, ...]:
    """Name the rows that the others imply: those that a pivoted QR of the transpose takes last."""
    _, order, _ = pivoted_qr((a * _preference(len(rows))[:, None]).T)
    return tuple(names[rows[k]] for k in sorted(order[rank:].tolist()))


def _check_pins(coordinates: Twists, held: Index, rest: Array, limit: float) -> None:
    """Refuse pinned coordinates that the loops tie to each other (their columns reach outside the others' range)."""
    if rest.size and float(np.abs(rest).max()) > limit:
        names = ", ".join(coordinates.names[k] for k in held)
        raise ModelError(
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
        f"lose as many digits. Pin other coordinates with independent=, or move the pose.",
        NearSingularWarning, stacklevel=6,
    )  # fmt: skip
