"""The operator whose largest eigenvalues are the modes nearest to a shift: T = W (K - sigma M)^-1 W^T, M = W^T W.

T is symmetric, acts on h = W x, and has the eigenvalues 1 / (omega^2 - sigma). One application is one solve with the
factored tableau. At sigma = 0 rigid-body modes are constrained: each coordinate without stiffness is locked by an
additional spring, which a self-equilibrated load does not deform, and the modes are deflated on both sides.
The structure of the springs, and no tolerance, determines these coordinates.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from mbsvib.common.arrays import AnyArray, Array, Bools, Index
from mbsvib.linalg.groups import by_label, connected_parts
from mbsvib.linalg.qr import pivoted_qr
from mbsvib.linalg.rank import DEPENDENT_ROWS, SAME_ENERGY
from mbsvib.sparse.assembly import with_stiffness
from mbsvib.sparse.equations import SparseEquations
from mbsvib.sparse.quadratic import Quadratic
from mbsvib.sparse.tableau import Factor

# Shifts, relative to the square of the highest frequency, at which modes are counted if the springs do not determine
# which coordinates are free. Below the last one rounding of the stiffness dominates.
SHIFTS = 10.0 ** -np.arange(2.0, 13.5, 0.5)
# Dampers may couple all rigid-body modes, so that the slowest ones are combinations of all. Up to this number all are
# computed, even if fewer modes are wanted.
COUPLED_RIGID = 200
# In larger parts of coordinates that springs and loops couple, all coordinates are assumed to have stiffness.
PART = 600


@dataclass(frozen=True)
class Operator:
    """T at ``sigma``, with ``rigid`` modes (size, r) of the equations and the ``deflated`` vectors (h, r).

    ``total`` is the number of all rigid-body modes, None if it is not known beforehand; at a shift they are not
    deflated but computed like all others.
    """

    quadratic: Quadratic
    sigma: float
    factor: Factor
    rigid: Array
    deflated: Array
    total: int | None

    @property
    def system(self) -> SparseEquations:
        """The equations of motion."""
        return self.quadratic.system

    @property
    def w(self) -> Any:
        """The nonzero rows of W."""
        return self.quadratic.w

    @property
    def wt(self) -> Any:
        """W^T by rows."""
        return self.quadratic.wt

    def right(self, force: AnyArray) -> AnyArray:
        """Return right sides of the tableau for generalised forces (size, n) on displacements and coordinates."""
        return self.quadratic.right(force)

    def solve(self, h: AnyArray) -> AnyArray:
        """Return displacements and coordinates (size, n) under the loads W^T h, h (rows, n) or (rows,)."""
        return self.factor.solve(self.right(self.wt @ self.without_rigid(h)), 0)

    def apply(self, h: AnyArray) -> AnyArray:
        """Return T h."""
        return self.without_rigid(self.w @ self.solve(h))

    def without_rigid(self, h: AnyArray) -> AnyArray:
        """Return vectors (h, n) without their components along the deflated rigid-body modes."""
        return h - self.deflated @ (self.deflated.T @ h) if self.deflated.shape[1] else h

    def flexible(self, z: AnyArray) -> AnyArray:
        """Return motions (size, n) without their components along the rigid-body modes."""
        return z - self.rigid @ (self.quadratic.inertia(self.rigid).T @ z) if self.rigid.shape[1] else z

    def diverging(self) -> int:
        """Return the number of modes that diverge by negative stiffness; all modes if they cannot be counted."""
        if (self.system.row_stiffness >= 0.0).all():
            return 0
        try:
            count = count_below(self.system, -SAME_ENERGY * abs(self.sigma))
        except np.linalg.LinAlgError:
            count = None
        return self.system.dof if count is None else count

    def deflating(self, motions: Array) -> Operator:
        """Return the operator with more vectors (h, n) deflated."""
        return replace(self, deflated=np.linalg.qr(np.concatenate((self.deflated, motions), axis=1))[0])


def operator(system: SparseEquations, sigma: float | None, requested: int) -> Operator:
    """Return T at a shift ``sigma`` [rad^2/s^2], or near zero for the lowest modes.

    ``requested``: number of wanted modes, which limits that of rigid-body modes.
    """
    quadratic = Quadratic(system)
    first = Operator(quadratic, sigma or 0.0, _factor(system, sigma or 0.0), np.zeros((system.layout.size, 0)),
                     np.zeros((quadratic.w.shape[0], 0)), None)  # fmt: skip
    if sigma is not None:
        return first
    if first.factor is not None and _all_motions_resisted(first):
        return replace(first, total=0)
    lock = coordinates_without_stiffness(system)
    if len(lock):
        try:
            return _locked(first, lock, requested)
        except np.linalg.LinAlgError:  # stiffness of loads cancels in some motion
            pass
    return _shifted(first)


def _locked(first: Operator, lock: Index, requested: int) -> Operator:
    """T at zero with the free motions locked and deflated; with a shift if the locks do not cover all of them."""
    system, far, modes = first.system, far_rows(first.system), None
    if far.any():
        short_only = with_stiffness(system, system.row_stiffness * ~far)
        locked = replace(first, factor=short_only.tableau.factor(lock=system.layout.coordinate[lock]))
        lock, modes = without_far(system, lock, _locked_motions(locked, lock))
    locked = replace(first, factor=system.tableau.factor(lock=system.layout.coordinate[lock]), total=len(lock))
    if not _all_motions_resisted(locked, lock):
        return _shifted(first)
    if system.row_damping.any() and len(lock) <= COUPLED_RIGID:
        requested = len(lock)
    rigid = _locked_motions(locked, lock[:requested]) if modes is None else modes[:, :requested]
    return _with_rigid_modes(locked, rigid)


def _factor(system: SparseEquations, sigma: float) -> Any:
    try:
        return system.tableau.factor(square=sigma)
    except np.linalg.LinAlgError:
        if sigma:
            raise
        return None


def _all_motions_resisted(locked: Operator, lock: Index | None = None) -> bool:
    """Whether springs (and locks) resist all motions, so that work and strain energy of a random load are equal."""
    system = locked.system
    h = np.random.default_rng(0).standard_normal(locked.w.shape[0])
    z = locked.factor.solve(locked.right(locked.wt @ h), 0)
    work = float(h @ (locked.w @ z))
    e = system.elastic_rows @ z
    strain = float(system.row_stiffness @ (e * e))
    if lock is not None:
        index = system.layout.coordinate[lock]
        scale = locked.factor.column_scale[index] * locked.factor.row_scale[index]
        strain += float(np.sum(z[index] ** 2 / scale))
    # a motion that only cancelling stiffness resists has an energy that is rounding of its terms
    return bool(np.isfinite(work)) and abs(work - strain) <= SAME_ENERGY * abs(work)


def _locked_motions(locked: Operator, lock: Index) -> Array:
    """Free motions: responses of the locked stiffness to a unit load on each lock, which deform this lock only."""
    index = locked.system.layout.coordinate[lock]
    right = np.zeros((locked.system.layout.size, len(index)))
    right[index, np.arange(len(index))] = 1.0 / locked.factor.row_scale[index]
    return np.asarray(locked.factor.solve(right))


def _with_rigid_modes(locked: Operator, modes: Array) -> Operator:
    """The operator with deflated rigid-body modes, which are M-orthonormalized."""
    h = locked.w @ modes
    for _ in range(2):  # the second pass removes the rounding of the first
        root = np.linalg.qr(h)[1]
        modes = np.linalg.solve(root.T, modes.T).T
        h = locked.w @ modes
    return replace(locked, rigid=modes, deflated=h)


def _shifted(first: Operator) -> Operator:
    """A shift below zero, of the size of the lowest flexible mode, from counts of modes."""
    system = first.system
    highest = first.quadratic.speed**2
    counts = [count_below(system, shift * highest) for shift in SHIFTS]
    last, diverging = counts[-1], count_below(system, -SHIFTS[-1] * highest)
    larger = [shift for shift, count in zip(SHIFTS, counts, strict=True) if count is not None and count != last]
    sigma = -highest * float(min(larger, default=SHIFTS[0])) if last is not None else -1e-6 * highest
    total = None if last is None or diverging is None else last - diverging
    return replace(first, sigma=sigma, factor=system.tableau.factor(square=sigma), total=total)


def count_below(system: SparseEquations, square: float) -> int | None:
    """Return the number of modes with squared angular frequencies below one; None if they cannot be counted."""
    return system.tableau.factor(square=square, pivot=0.0).negative(system.layout)


def far_rows(system: SparseEquations) -> Bools:
    """Return the mask of rows with stiffness that act on displacements, since the path between their ends is long."""
    is_displacement = np.zeros(system.layout.size, dtype=bool)
    is_displacement[system.layout.displacement[system.layout.displacement >= 0]] = True
    entries = system.elastic_rows.tocoo()
    result = np.zeros(entries.shape[0], dtype=bool)
    result[entries.row[is_displacement[entries.col]]] = True
    return np.asarray(result & (system.row_stiffness != 0.0))


def coordinates_without_stiffness(system: SparseEquations) -> Index:
    """Return the coordinates that must be locked so that every motion deforms a spring along a short path.

    Springs and loops couple coordinates into parts; within each part a pivoted QR of all its rows determines the free
    coordinates. A coordinate that is the only entry of some row is not free. Parts that are too large are assumed to
    have no free coordinates.
    """
    m = len(system.joint_coordinates)
    row, column, value = _entries(system)
    resisted = np.zeros(m, dtype=bool)
    while True:
        single_entry = np.bincount(row, minlength=1)[row] == 1
        if not single_entry.any():
            break
        resisted[column[single_entry]] = True
        others = ~resisted[column]
        row, column, value = row[others], column[others], value[others]
    has_entry = np.zeros(m, dtype=bool)
    has_entry[column] = True
    free = np.flatnonzero(~resisted & ~has_entry).tolist()
    for rows, columns, values in _parts(row, column, value):
        coordinates, local_column = np.unique(columns, return_inverse=True)
        if len(coordinates) > PART:
            continue
        part_rows, local_row = np.unique(rows, return_inverse=True)
        block = np.zeros((len(part_rows), len(coordinates)))
        block[local_row, local_column] = values
        # unit rows and columns: the rank depends neither on the size of a stiffness nor on the unit of a coordinate
        block /= np.linalg.norm(block, axis=1)[:, None]
        block /= np.linalg.norm(block, axis=0)
        qr, order, _ = pivoted_qr(block)
        pivots = np.abs(qr.diagonal())
        free += coordinates[order[int(np.count_nonzero(pivots > DEPENDENT_ROWS * pivots[0])) :]].tolist()
    return np.array(sorted(free), dtype=np.intp)


def _entries(system: SparseEquations) -> tuple[Index, Index, Array]:
    """Entries of springs along short paths and of all loops over the joint coordinates."""
    near = system.elastic_rows[(system.row_stiffness != 0.0) & ~far_rows(system)].tocoo()
    coordinate_number = np.full(system.layout.size, -1)
    coordinate_number[system.layout.coordinate] = np.arange(len(system.joint_coordinates))
    row, column, value = system.constraints.independent_entries(system.structure)
    used = value != 0.0
    return (np.concatenate((near.row, near.shape[0] + row[used])),
            np.concatenate((coordinate_number[near.col], column[used])),
            np.concatenate((near.data, value[used])))  # fmt: skip


def _parts(row: Index, column: Index, value: Array) -> list[tuple[Index, Index, Array]]:
    """Entries by independent parts."""
    if not len(row):
        return []
    shape = int(row.max()) + 1, int(column.max()) + 1
    return [(row[part], column[part], value[part]) for part in by_label(connected_parts(row, column, shape)[0][row])]


def without_far(system: SparseEquations, lock: Index, modes: Array) -> tuple[Index, Array]:
    """Return the remaining locks and free motions, after springs along long paths are taken into account.

    ``lock`` (n,): coordinates that the other springs leave free. ``modes`` (size, n): the free motions: each moves its
    own lock by one, and no other.
    """
    rows = system.elastic_rows[far_rows(system)]
    block = np.asarray(rows @ modes)
    block /= np.maximum(np.asarray(abs(rows) @ np.abs(modes)).max(axis=1, initial=0.0), 1e-300)[:, None]
    qr, order, _ = pivoted_qr(block)
    pivots = np.abs(qr.diagonal())
    rank = int(np.count_nonzero(pivots > DEPENDENT_ROWS))
    null = np.zeros((len(lock), len(lock) - rank))
    null[order[rank:], np.arange(len(lock) - rank)] = 1.0
    if 0 < rank < len(lock):
        null[order[:rank]] = -np.linalg.solve(np.triu(qr[:rank, :rank]), qr[:rank, rank:])
    return lock[order[rank:]], modes @ null
