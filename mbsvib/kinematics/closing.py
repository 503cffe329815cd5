"""Poses of mechanisms with loops: Newton's method on the coordinates that depend on others, for many poses at once.

q_d <- q_d - A^-1 e,  A = Phi J in the independent rows and the dependent columns

with the exact openings e of cut joints and couplers, Phi per unit rate of the joint coordinates in the pose, and J the
rates of these per unit rate of the values q, which is one but for rotation vectors and rods. The values of all other
coordinates are held, so that they are exact.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from mbsvib.kinematics.couplers import locked
from mbsvib.kinematics.couplings import coupler_travel
from mbsvib.linalg.dead_points import NEARBY, no_dead_point
from mbsvib.linalg.rank import CLOSED_EXACTLY, NEAR_SINGULAR

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from mbsvib.common.arrays import Array, Index
    from mbsvib.elements.coupler import Coupling
    from mbsvib.kinematics.pose import Pose
    from mbsvib.kinematics.pose_kinematics import PoseKinematics

    Mask = NDArray[np.bool_]

CORRECTIONS = 25
# Loops count as closed when they are open by no more than this share of their size and steps do not reduce it.
CLOSED = 1e-13
# The longest step [rad, mechanism sizes] in which loops are kept closed, and the shortest that is still tried.
LONGEST, SHORTEST = 0.2, 1e-5
# Loops count as closed in the end when they are open by less than this share of the mechanism's size, or by rounding.
TOLERANCE = 1e-12
# Where loops are open by less than this, the Jacobian of the step before is as good, unless it left more than this
# share, as at a dead point.
RENEWED, SLOW = 1e-6, 1e-2
# Loops need be closed no better on the way to a pose.
WAY = 1e-8


@dataclass(frozen=True, slots=True)
class Reached:
    """Some poses (v): the values ``q`` (v, n) of the coordinates and the ``pose``.

    ``opening`` (v,) is what loops are open and ``rounding`` (v,) what of it is rounding, in units of 1 rad and the size
    of the mechanism; ``closure`` (v, rows, n) is Phi J in the same units, ``error`` (v, rows) the openings, ``travel``
    (v, terms) the displacements of the coordinates in couplers. ``doubtful`` (v,) may be next to a dead point.
    """

    q: Array
    pose: Pose
    opening: Array
    rounding: Array
    closure: Array
    error: Array
    travel: Array
    doubtful: Mask

    def __getitem__(self, which: Index | Mask) -> Reached:
        """Return some of them."""
        return Reached(self.q[which], self.pose[which], self.opening[which], self.rounding[which], self.closure[which],
                       self.error[which], self.travel[which], self.doubtful[which])  # fmt: skip

    def update(self, which: Index | Mask, others: Reached) -> None:
        """Replace some of them, in place."""
        for name in ("q", "opening", "rounding", "closure", "error", "travel", "doubtful"):
            getattr(self, name)[which] = getattr(others, name)
        self.pose.centre[which], self.pose.rotations[which] = others.pose.centre, others.pose.rotations


@dataclass(frozen=True)
class Closing:
    """A mechanism whose loops are closed by the coordinates that depend on others.

    ``blocks``: independent rows and dependent coordinates of each group of loops.
    """

    kinematics: PoseKinematics
    couplers: tuple[Coupling, ...]
    blocks: tuple[tuple[Index, Index], ...]

    @cached_property
    def depends(self) -> Mask:
        """Which coordinates (n,) depend on others."""
        result = np.zeros(len(self.kinematics.coordinates.names), dtype=bool)
        for _, dependent in self.blocks:
            result[dependent] = True
        return result

    def poses(self, target: Array) -> tuple[Reached, Mask, Array]:
        """Return the poses for values (v, n) of the coordinates that do not depend on others.

        Steps from the reference pose are halved where loops do not stay closed or might jump. Returns the poses as far
        as they were reached, a mask (v,) of those that were not, and the share (v,) of the way to each.
        """
        kinematics, count = self.kinematics, len(target)
        longest = np.abs(target / kinematics.scale).max(axis=1, initial=0.0)
        full = LONGEST / np.maximum(longest, LONGEST)
        done, step, lost, open_by = np.zeros(count), full.copy(), np.zeros(count, dtype=bool), np.zeros(count)
        if kinematics.cuts is None:
            return self._open(target, None), lost, done
        first = self.described
        reached, active, before = None, np.arange(count), first
        while len(active):
            share = np.minimum(step[active], 1.0 - done[active])
            ends = share >= 1.0 - done[active]
            values = np.where(ends, 1.0, done[active] + share)[:, None] * target[active]
            attempt, small = self._attempt(before, share[:, None] * target[active], values,
                                           CLOSED_EXACTLY if ends.any() else WAY)  # fmt: skip
            limit = np.where(ends, np.maximum(TOLERANCE, attempt.rounding), RENEWED)
            good = small & (attempt.opening <= limit) & self._near(before, attempt)
            good, near = self._same_branch(before, attempt, good)
            attempt.doubtful[:] = ~near | before.doubtful
            if reached is None and good.all():
                reached = attempt
            else:
                reached = reached or first[np.zeros(count, dtype=np.intp)]
                reached.update(active[good], attempt[good])
            which, bad = active[good], active[~good]
            done[which] = np.where(ends, 1.0, done[active] + share)[good]
            step[which] = np.minimum(2.0 * step[which], full[which])
            step[bad], open_by[bad] = 0.5 * share[~good], np.where(small, attempt.opening, np.inf)[~good]
            lost[bad] = step[bad] * longest[bad] < SHORTEST
            active = active[(done[active] < 1.0) & ~lost[active]]
            before = reached[active] if len(active) else first
        assert reached is not None
        reached.opening[lost] = open_by[lost]
        # the poses were changed in place: what they had cached goes
        return replace(reached, pose=replace(reached.pose)), lost, done

    @cached_property
    def described(self) -> Reached:
        """The reference pose, with the loops closed that its rounded numbers leave open."""
        kinematics = self.kinematics
        described, scale = kinematics.described, kinematics.row_scale
        count = len(scale) - len(kinematics.described_openings)
        error = np.append(kinematics.described_openings, np.zeros(count)) * scale
        closure = kinematics.closure * scale[:, None] * kinematics.scale
        pose = replace(described, centre=described.centre.copy())[None]
        travel = np.zeros((1, sum(len(part.terms) for part in self.couplers)))
        at = Reached(np.zeros((1, closure.shape[1])), pose, np.array([np.abs(error).max(initial=0.0)]),
                     kinematics.rounding(kinematics.coordinates)[None], closure[None], error[None], travel,
                     np.zeros(1, dtype=bool))  # fmt: skip
        at = at if at.opening[0] <= CLOSED_EXACTLY else self.closed(at.q, at, CLOSED_EXACTLY)
        at.doubtful[0] = min(self.weakest(at, 0), default=(1.0, 0))[0] < NEAR_SINGULAR
        return at

    def weakest(self, reached: Reached, i: int) -> list[tuple[float, int]]:
        """Return of each group of loops in a pose the smallest singular value of its dependent coordinates, and the
        coordinate that could move most without the others there.
        """
        result = []
        for rows, dependent in self.blocks:
            if len(dependent):
                _, values, motions = np.linalg.svd(reached.closure[i][rows[:, None], dependent])
                result.append((float(values[-1]), int(dependent[np.argmax(np.abs(motions[-1]))])))
        return result

    def _attempt(self, before: Reached, change: Array, values: Array, enough: float) -> tuple[Reached, Mask]:
        """One step with closed loops: ``values`` (v, n) of the independent coordinates, which change by ``change``.

        Returns the poses, and a mask of those without dependent motions many times larger than the step, which
        indicate a jump or a dead point.
        """
        scale, by = self.kinematics.scale, self._with_dependent(before.closure, change)
        small = np.abs(by).max(axis=1, initial=0.0) <= 10.0 * LONGEST
        q = np.where(self.depends, before.q + scale * np.where(small[:, None], by, 0.0), values)
        return self.closed(q, before, enough), small

    def _with_dependent(self, closure: Array, change: Array) -> Array:
        """The changes of all coordinates, in their units, where the independent ones change by ``change`` (v, n)."""
        by = np.where(self.depends, 0.0, change / self.kinematics.scale)
        right = (closure @ by[..., None])[..., 0] if self.blocks else by
        for rows, dependent in self.blocks:
            by[:, dependent] = -_solved(closure, rows, dependent, right)
        return by

    def along(self, reached: Reached, change: Array) -> Pose:
        """Return imaginary steps from poses (v) with closed loops: the independent coordinates change by ``change``
        (v, n), the others such that loops stay closed.
        """
        kinematics = self.kinematics
        at = reached if kinematics.cuts is None else self._with_closure(reached)
        q = at.q + 1j * kinematics.scale * self._with_dependent(at.closure, change)
        return kinematics.tree.moved(kinematics.described, kinematics.coordinates, q)

    def changes(self, reached: Reached, steps: Array) -> Array:
        """Return how the values of the coordinates change by ``steps`` (n,) of the coordinates of one pose.

        They differ for components of a rotation vector and for curved joints; see ``Tree.by_values``.
        """
        kinematics, result = self.kinematics, np.array(steps)
        pose = reached.pose[0]
        own, _ = kinematics.at(pose)
        values = kinematics.tree.by_values(kinematics.described, kinematics.coordinates, reached.q[0], pose, own)
        own_twists, by_values = (np.concatenate((part.linear, part.angular)) for part in (own, values))
        for columns in kinematics.tree.joints_by_values:
            twist = own_twists[:, columns] @ steps[columns]
            result[columns] = np.linalg.lstsq(by_values[:, columns], twist, rcond=None)[0]
        return result

    def near(self, q: Array, before: Reached) -> Reached:
        """Return the poses for values (v, n) next to others, with loops closed."""
        return self._open(q, None) if self.kinematics.cuts is None else self.closed(q, before, CLOSED_EXACTLY)

    def closed(self, q: Array, before: Reached | None, enough: float) -> Reached:
        """Return the poses for values (v, n) with the dependent ones changed such that loops are closed.

        ``before``: these poses, or one, nearby. ``enough``: what loops may stay open. Phi J is computed anew where
        loops are open by more than ``RENEWED``.
        """
        todo, scale = np.arange(len(q)), self.kinematics.scale
        best = self._with_closure(self._open(q, before))
        going, previous = best.opening > enough, np.full(len(q), np.inf)
        for _ in range(CORRECTIONS):
            going &= ~((best.opening[todo] < CLOSED) & (best.opening[todo] > 0.1 * previous))
            if not going.any():
                break
            if not going.all():
                todo = todo[going]
            at = best if len(todo) == len(q) else best[todo]
            new = at.q.copy()
            for rows, dependent in self.blocks:
                new[:, dependent] -= scale[dependent] * _solved(at.closure, rows, dependent, at.error)
            after, previous = self._open(new, at), at.opening.copy()
            going = after.opening < previous
            if (going & (after.opening > np.clip(SLOW * previous, CLOSED, RENEWED))).any():
                after = self._with_closure(after)
            if going.all():
                best.update(todo, after)
            else:
                best.update(todo[going], after[going])
            going &= after.opening > enough
        return best

    def _open(self, q: Array, near: Reached | None) -> Reached:
        """Return the poses of values (v, n), as open as they are, with the Phi J of poses nearby."""
        kinematics, count = self.kinematics, len(q)
        pose = kinematics.tree.moved(kinematics.described, kinematics.coordinates, q)
        rounding = np.zeros(count) if near is None else np.broadcast_to(near.rounding, count)
        closure = np.zeros((count, 0, 0)) if near is None else near.closure
        error, travel = kinematics.openings(pose), np.zeros((count, 0))
        couplings = None if kinematics.cuts is None else kinematics.cuts.couplings
        if couplings is not None:
            travel = coupler_travel(self.couplers, kinematics.topology.joints, pose,
                                    None if near is None else near.travel)  # fmt: skip
            tree = couplings.column >= 0
            travel[:, tree] = q[:, couplings.column[tree]]
            error = np.concatenate((error, couplings.sums(travel)), axis=1)
        error = error * kinematics.row_scale
        return Reached(q, pose, np.abs(error).max(axis=1, initial=0.0), rounding, closure, error, travel,
                       np.zeros(count, dtype=bool))  # fmt: skip

    def _with_closure(self, at: Reached) -> Reached:
        """Return the same poses with their own Phi J."""
        kinematics, (q, pose) = self.kinematics, (at.q, at.pose)
        if len(q) == 1:  # faster without an axis of poses
            q, pose = q[0], pose[0]
        coordinates, cuts = kinematics.at(pose)
        assert cuts is not None
        by_values = kinematics.tree.by_values(kinematics.described, kinematics.coordinates, q, pose, coordinates)
        closure = locked(by_values, cuts) * kinematics.row_scale[:, None] * kinematics.scale
        if len(at.q) == 1:
            closure = closure[None]
        rounding = np.array(np.broadcast_to(kinematics.rounding(coordinates), len(at.q)))
        return replace(at, closure=closure, rounding=rounding)

    def _near(self, first: Reached, second: Reached) -> Mask:
        """Tell whether no body moved so far in one step that loops may have jumped to another branch."""
        turned = (first.pose.rotations * second.pose.rotations).sum(axis=(-1, -2))
        went = np.abs(second.pose.centre - first.pose.centre).max(axis=(1, 2))
        far = 1.0 + 2.0 * np.cos(5.0 * LONGEST), 5.0 * LONGEST * self.kinematics.size
        return np.asarray((turned.min(axis=1) > far[0]) & (went < far[1]))

    def _same_branch(self, first: Reached, second: Reached, which: Mask) -> tuple[Mask, Mask]:
        """Tell of poses ``which`` whether there is no dead point between, and which are far from one.

        A change of norm below ``NEARBY`` takes no eigenvalue of 1 near 0; others are looked at one by one.
        """
        same, far = which.copy(), which.copy()
        for rows, dependent in self.blocks:
            before, after = (at.closure[:, rows[:, None], dependent] for at in (first, second))
            change = _inverse(before) @ (after - before)
            near = np.zeros(len(change), dtype=bool)
            for power in (1, 2, 4):  # no eigenvalue is larger than the root of the norm of a power
                near |= np.abs(change).sum(axis=-2).max(axis=-1, initial=0.0) < NEARBY**power
                if near.all():
                    break
                change = change @ change
            far &= near
            for i in np.flatnonzero(which & ~near).tolist():
                same[i] &= no_dead_point(before[i if len(before) > 1 else 0], after[i])
        return same, far


def _inverse(a: Array) -> Array:
    try:
        return np.asarray(np.linalg.inv(a))
    except np.linalg.LinAlgError:
        return np.asarray(np.linalg.pinv(a))


def _solved(closure: Array, rows: Index, dependent: Index, right: Array) -> Array:
    """Return A^-1 e (v, r) of the ``rows`` of e (v, all rows) and the ``dependent`` columns."""
    a, e = closure[:, rows[:, None], dependent], right[:, rows, None]
    try:
        return np.asarray(np.linalg.solve(a, e)[..., 0])
    except np.linalg.LinAlgError:
        return np.asarray((np.linalg.pinv(a) @ e)[..., 0])
