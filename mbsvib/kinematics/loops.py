"""Loops: from joint coordinates to minimal coordinates, q = B'' z.

Each cut joint locks relative displacements: rows Phi q = 0. A rank-revealing QR of each independent group of loops
decides which rows are redundant and which joint coordinates are dependent; the others are the minimal coordinates.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field
from functools import cached_property, lru_cache, partial
from itertools import chain
from operator import sub

import numpy as np
from scipy.linalg import blas, lapack

from mbsvib.common.arrays import Array, Bools, Index
from mbsvib.common.expected import names
from mbsvib.common.fast_init import fast_init
from mbsvib.common.tables import listed
from mbsvib.elements.rows import Rows
from mbsvib.errors import ModelError, SingularPoseError, nearest
from mbsvib.kinematics.couplings import Couplings
from mbsvib.kinematics.relative_motion import Twists
from mbsvib.linalg.qr import pivoted_qr
from mbsvib.linalg.rank import EPS, NEAR_SINGULAR, RANK_FACTOR, RANK_GAP, TIE_BREAK, ZERO_PRODUCT

Arms = Callable[[Iterable[str]], float]


@fast_init
@dataclass(frozen=True, slots=True)
class Reduction:
    """Minimal coordinates: ``independent`` (m,) picks them from the joint coordinates, ``matrix`` (..., n, m) is B''.

    ``matrix`` is None where no loop exists, which stands for the identity.
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

    def apply_exactly(self, rows: Array) -> Array:
        """Return rows in minimal coordinates; rounding becomes exact 0."""
        result = self.apply(rows)
        if self.matrix is not None:
            noise = np.abs(rows) @ np.abs(self.matrix)
            result.real[np.abs(result) <= ZERO_PRODUCT * rows.shape[-1] * noise] = 0.0
        return result


@fast_init
@dataclass(frozen=True, slots=True)
class Cuts:
    """The locked rows of the cut joints: ``rows``, their ``names`` and the number of the cut ``joint`` of each.

    ``joints`` are the names of the cut joints, ``start`` the first row of each joint with locked rows; ``translates``
    is true for locked translations. The rows of ``couplings`` follow these, and each counts as one joint in ``names``,
    ``joint``, ``joints`` and ``translates``; ``rows`` and ``start`` do not contain them.
    """

    rows: Rows
    names: tuple[str, ...]
    joint: Index
    joints: tuple[str, ...]
    start: Index
    translates: Bools
    couplings: Couplings | None = None

    def spare_length(self, coordinates: Array, pitch: float, members: Index, rounding: float) -> float:
        """Return a unit of length [m] for some rows whose joints are all at one point, the same in any unit.

        It is the largest ``pitch``, the size above ``rounding`` of the mechanism with joint ``coordinates`` at points
        (3, n), or half of what couplers have per angle, so that distances stay. Without one, any length serves.
        """
        points = np.concatenate((self.rows.point, coordinates), axis=1)
        size, distance = float(np.ptp(points, axis=1).max()), float(np.abs(points).max())
        lever = 0.0 if self.couplings is None else self.couplings.lever(members - len(self.rows.first))
        return pitch or size * (size > rounding) or 0.5 * lever or distance or 1.0

    def row_scale(self, length: float | Array, members: Index | slice = slice(None)) -> Array:
        """Return factors (..., rows) that make some rows dimensionless, with ``length`` [m] as the unit of length: one
        for all, or one for each of them (..., members), or (..., 1). ``members`` may be of any shape, (groups, rows).
        """
        scale = np.where(self.translates[members], 1.0 / length, 1.0)
        if self.couplings is None:
            return scale
        number = np.arange(len(self.translates))[members]
        at = number >= len(self.rows.first)
        lengths = np.broadcast_to(length, scale.shape)[..., at]
        coupled = self.couplings.row_scale(lengths, number[at] - len(self.rows.first))
        result = np.broadcast_to(scale, (*coupled.shape[:-1], *number.shape)).copy()
        result[..., at] = coupled
        return result


def reduce(
    coordinates: Twists, cuts: Cuts | None, phi: Array, independent: Sequence[str] | None = None,
    arms: Arms | None = None,
) -> Reduction:  # fmt: skip
    """Return the minimal coordinates and B'' with Phi B'' = 0.

    ``cuts``: None where nothing is cut. ``phi`` (locked rows, n): relative displacements of these rows per unit joint
    coordinate. ``independent``: coordinates that must be among the minimal ones. ``arms``: takes names of joints and
    returns their largest distance from the centres of mass of their bodies [m], by which points of a rotated body are
    rounded; it is called only where the rank is doubtful. Raises an error if a coordinate of ``independent`` is unknown
    or cannot be independent, if the number of degrees of freedom differs in neighbouring poses, or if the rank is
    doubtful.

    Source: Jiang, Chen & Luo (2011), cut-joint constraint matrix B''.
    """
    pinned, n = None if independent is None else _pinned(coordinates, independent), len(coordinates.names)
    if cuts is None:
        return Reduction(np.arange(n), None, ())
    blocks = loop_groups(coordinates, cuts)
    scaled = _scaled(coordinates, cuts, phi, blocks)
    depends = np.zeros(n, dtype=bool)
    solved = []
    groups = []
    for i in range(len(blocks)):
        group, dependent, others, block = _solve(coordinates, cuts, phi, blocks[i], scaled, i, pinned, arms)
        depends[dependent] = True
        solved.append((dependent, others, block))
        groups.append(group)
    free = (~depends).nonzero()[0]
    position = np.empty(n, dtype=np.intp)
    position[free] = np.arange(len(free))
    matrix = np.zeros((n, len(free)))
    matrix[free, np.arange(len(free))] = 1.0
    for dependent, others, block in solved:
        matrix[dependent[:, None], position.take(others)] = block
    matrix *= np.divide.outer(scaled.columns, scaled.columns.take(free))
    return Reduction(free, matrix, tuple(groups))


def kept_rows(cuts: Cuts | None, reduction: Reduction) -> list[tuple[Index, Index]]:
    """Return the independent rows and the dependent coordinates of each group of loops."""
    if cuts is None or reduction.matrix is None:
        return []
    depends = np.ones(reduction.matrix.shape[-2], dtype=bool)
    depends[reduction.independent] = False
    result = []
    for group in reduction.groups:
        redundant = group.redundant
        rows = [row for row in group.rows.tolist() if cuts.names[row] not in redundant] if redundant else group.rows
        result.append((np.asarray(rows, dtype=np.intp), group.columns[depends[group.columns]]))
    return result


def _pinned(coordinates: Twists, independent: Sequence[str] | None) -> Bools:
    pinned = np.zeros(len(coordinates.names), dtype=bool)
    for name in () if independent is None else names(independent, "linearize", "independent", ModelError):
        if name not in coordinates.names:
            raise ModelError(
                f"independent = {name!r} is not a joint coordinate of the tree.{nearest(str(name), coordinates.names)} "
                f"Joints that are cut have none; name the cut joints with cut= to keep this one.",
                element=str(name), field="independent",
            )  # fmt: skip
        pinned[coordinates.names.index(name)] = True
    return pinned


def loop_groups(coordinates: Twists, cuts: Cuts) -> list[tuple[Index, Index]]:
    """Return rows and columns of each group of loops; loops that share a coordinate are in one group."""
    first, second = cuts.rows.first.take(cuts.start), cuts.rows.second.take(cuts.start)
    touched = coordinates.path.take(second, axis=0) != coordinates.path.take(first, axis=0)
    if cuts.couplings is not None:
        touched = np.concatenate((touched, cuts.couplings.touched))
    ends = [*cuts.start.tolist(), *range(len(cuts.rows.first), len(cuts.names) + 1)]
    return _connected(touched.tobytes(), touched.shape, tuple(ends))


@lru_cache(maxsize=32)
def _connected(touches: bytes, shape: tuple[int, int], ends: tuple[int, ...]) -> list[tuple[Index, Index]]:
    """Rows and columns of groups of loops (loops, n) that touch the same coordinates; rows of a loop start at ``ends``.

    They depend on nothing but the tree and are cached for mechanisms that are built again with other values.
    """
    touched = np.frombuffer(touches, bool).reshape(shape)
    groups: list[tuple[int, list[int]]] = []
    for loop, bits in enumerate(np.packbits(touched, axis=1)):
        # the coordinates that a loop touches as bits of one integer: an intersection is a single operation
        mask, loops, separate = int.from_bytes(bits.tobytes(), "big"), [loop], []
        for known_mask, members in groups:
            if mask & known_mask:
                mask |= known_mask
                loops = members + loops
            else:
                separate.append((known_mask, members))
        groups = [*separate, (mask, loops)]
    result = [(np.concatenate([np.arange(ends[loop], ends[loop + 1]) for loop in sorted(loops)]),
               np.asarray(touched[loops].any(axis=0)).nonzero()[0]) for _, loops in groups]  # fmt: skip
    for indices in chain.from_iterable(result):
        indices.setflags(write=False)
    return result


@dataclass(frozen=True, slots=True)
class _Scaled:
    """The locked rows in units of each group: ``matrix`` (rows, n) is Phi times ``columns`` (n,), with translations
    divided by the group's unit of ``length`` [m], so that ranks do not depend on units. ``noise`` is the rounding of an
    entry of each group.
    """

    matrix: Array
    columns: Array
    length: list[float]
    noise: list[float]


def _scaled(
    coordinates: Twists, cuts: Cuts, phi: Array, groups: list[tuple[Index, Index]], arm: float = 0.0
) -> _Scaled:
    """Scale the rows and columns of groups of loops, each by its own unit of length."""
    count, points = len(cuts.rows.first), np.concatenate((cuts.rows.point, coordinates.point), axis=1)
    row_length, column_length, preferred = np.ones(len(phi)), np.ones(phi.shape[1]), np.ones(phi.shape[1])
    lengths, noises = [], []
    for rows, columns in groups:
        cut = rows if cuts.couplings is None else rows[rows < count]
        group_points = points.take(np.concatenate((cut, columns + count)), axis=1)
        spare = partial(cuts.spare_length, coordinates.point, coordinates.pitch, rows)
        length, noise = measures(group_points, max(len(rows), len(columns)), spare, arm)
        row_length[rows], column_length[columns], preferred[columns] = length, length, preference(len(columns))
        lengths.append(length)
        noises.append(noise)
    scale = np.where(coordinates.turns, 1.0, column_length) * preferred
    return _Scaled(phi * cuts.row_scale(row_length)[:, None] * scale, scale, lengths, noises)


def _solve(
    coordinates: Twists, cuts: Cuts, phi: Array, block: tuple[Index, Index], scaled: _Scaled, number: int,
    pinned: Bools | None, arms: Arms | None,
) -> tuple[LoopGroup, Index, Index, Array]:  # fmt: skip
    """Solve one group: its rank decision, dependent and other columns, and the scaled block of B'' between them."""
    (rows, columns), length, noise = block, scaled.length[number], scaled.noise[number]
    a = scaled.matrix.take(rows, axis=0).take(columns, axis=1)
    pinned_columns = candidate = None
    if pinned is not None and pinned[columns].any():
        pinned_columns, candidate = np.nonzero(pinned[columns])[0], np.nonzero(~pinned[columns])[0]
    qr, order, tau = pivoted_qr(a if candidate is None else a[:, candidate])
    rank, retained, dropped, limit = decided(qr.diagonal().tolist(), noise)
    right, tied = qr[:rank, rank:], False
    if pinned_columns is not None:
        product = a[:, pinned_columns]
        if len(tau):
            product = lapack.dormqr("L", "T", qr[:, : len(tau)], tau, product, 64 * len(pinned_columns))[0]
        tied = bool(np.abs(product[rank:]).max(initial=0.0) > limit)
        right = np.concatenate((right, product[:rank]), axis=1)
    joints = tuple([cuts.joints[k] for k in dict.fromkeys(cuts.joint.take(rows).tolist())])
    if arms is not None and (tied or retained < NEAR_SINGULAR or limit > NEAR_SINGULAR):
        arm = arms([*joints, *(coordinates.names[k].rpartition(".")[0] for k in columns.tolist())])
        if arm:
            again = _scaled(coordinates, cuts, phi, [block], arm)
            scaled.columns[columns] = again.columns[columns]
            return _solve(coordinates, cuts, phi, block, again, 0, pinned, None)
    if pinned_columns is not None:
        if tied:
            raise _tied(coordinates, columns[pinned_columns])
        if retained**2 <= limit:
            _check_dead_centre(coordinates, columns[pinned_columns], a, noise, retained)
    group = LoopGroup(joints, rows, columns, rank, retained, dropped, length, noise,
                      partial(redundant_rows, a, rank, rows, cuts.names))  # fmt: skip
    check_gap(group)
    dependent, others = order[:rank], order[rank:]
    if candidate is not None and pinned_columns is not None:
        dependent, others = candidate[dependent], np.concatenate((candidate[others], pinned_columns))
    # dtrtrs starts a second thread even for small matrices
    solution = blas.dtrsm(-1.0, qr[:rank, :rank], right) if rank and len(others) else np.zeros((rank, len(others)))
    solution[np.abs(solution) <= noise / retained] = 0.0  # rounding here would resist free motions
    return group, columns.take(dependent), columns.take(others), solution


def _check_dead_centre(coordinates: Twists, pinned: Index, a: Array, noise: float, retained: float) -> None:
    """Refuse pinned coordinates that stand still where others would move the loops well.

    A pivot p of the pinned coordinates changes by about noise / p where a coordinate changes by the rounding ``noise``:
    below the root of it no digit is certain. ``a`` (rows, n): the scaled rows of the group.
    """
    _, best, _, limit = decided(pivoted_qr(a)[0].diagonal().tolist(), noise)
    if best**2 > limit:
        names = ", ".join(coordinates.names[k] for k in pinned)
        raise SingularPoseError(
            f"independent: {names} at a dead centre. Here the loops move others while what is pinned stands still "
            f"(smallest pivot {retained:.1e}; {best:.1e} with other coordinates), and mass and stiffness per unit of "
            f"it are infinite but for rounding. Leave out independent=, or pin a coordinate that moves."
        )


def _tied(coordinates: Twists, pinned: Index) -> ModelError:
    """The error for pinned coordinates that loops make dependent on each other."""
    names = ", ".join(coordinates.names[k] for k in pinned)
    return ModelError(
        f"independent: the loops leave no choice in which all of {names} are independent; pin fewer of them.",
        element=coordinates.names[pinned[0]], field="independent",
    )  # fmt: skip


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


def measures(points: Array, count: int, spare: Callable[[float], float], arm: float = 0.0) -> tuple[float, float]:
    """Return the unit of length of loops [m], and the rounding of the entries of rows that are scaled by it.

    The length is the size of the loops, or ``spare`` where all ``points`` (3, n) of the joints [m] coincide within
    rounding. The rounding is that of unit vectors, and of points relative to their distance from the origin, or to
    ``arm`` [m], the largest distance of the points from the centres of mass about which their bodies were turned, and
    proportional to ``count``, the larger number of rows or coordinates.
    """
    if not points.size:  # a coupler of coordinates that other joints lock
        return 1.0, EPS * count
    low, high = zip(*((min(axis), max(axis)) for axis in points.tolist()), strict=True)
    length, distance = max(map(sub, high, low)), max(*high, -min(low), arm)
    rounding = RANK_FACTOR * EPS * count * distance
    length = spare(rounding) if length <= rounding else length  # lever arms, which are shorter, are rounding
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
