"""Poses of mechanisms with loops: Newton's method on the coordinates that depend on others, for many poses at once.

q_d <- q_d - A^-1 e,  A = Phi J in the independent rows and the dependent columns

with the exact openings e of cut joints and couplers, Phi per unit rate of the joint coordinates in the pose, and J the
rates of these per unit rate of the values q, which is one but for rotation vectors and rods. The values of all other
coordinates are held, so that they are exact.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from mbsvib.common.arrays import Array, Bools, Index
from mbsvib.common.fast_init import changed, fast_init
from mbsvib.elements.coupler import Coupling
from mbsvib.elements.pose import Pose
from mbsvib.kinematics.couplers import locked
from mbsvib.kinematics.couplings import coupler_travel
from mbsvib.kinematics.pose_kinematics import PoseKinematics
from mbsvib.linalg.dead_points import NEARBY, no_dead_point
from mbsvib.linalg.rank import CLOSED_EXACTLY, NEAR_SINGULAR

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
# A step closes loops for certain where it is expected to leave less than this share of what they may stay open.
CERTAIN = 0.01
# Loops need be closed no better on the way to a pose.
WAY = 1e-8
# Steps to both sides of the reference pose by which rates are differentiated [rad, mechanism sizes].
DIFFERENCE = 1e-3


@fast_init
@dataclass(frozen=True, slots=True)
class Reached:
    """Some poses (v): the values ``q`` (v, n) of the coordinates and the ``pose``.

    ``opening`` (v,) is what loops are open and ``rounding`` (v,) what of it is rounding, in units of 1 rad and the size
    of the mechanism; ``closure`` (v, rows, n) is Phi J in the same units, ``inverses`` (v, r, r) those of A in each
    group of loops, ``error`` (v, rows) the openings, ``travel`` (v, terms) the displacements of the coordinates in
    couplers. ``doubtful`` (v,) may be next to a dead point.
    """

    q: Array
    pose: Pose
    opening: Array
    rounding: Array
    closure: Array
    inverses: tuple[Array, ...]
    error: Array
    travel: Array
    doubtful: Bools

    def __getitem__(self, which: Index | Bools) -> Reached:
        """Return some of them."""
        return Reached(self.q[which], self.pose[which], self.opening[which], self.rounding[which], self.closure[which],
                       tuple([inverse[which] for inverse in self.inverses]), self.error[which], self.travel[which],
                       self.doubtful[which])  # fmt: skip

    def with_some(self, which: Index | Bools, others: Reached) -> Reached:
        """Replace some of them, in place, and return all, without what the poses before had cached."""
        for name in ("q", "opening", "rounding", "closure", "error", "travel", "doubtful"):
            getattr(self, name)[which] = getattr(others, name)
        for mine, inverse in zip(self.inverses, others.inverses, strict=True):
            mine[which] = inverse
        self.pose.centre[which], self.pose.rotations[which] = others.pose.centre, others.pose.rotations
        # the pose was changed in place: what it had cached goes
        return changed(self, pose=replace(self.pose))


@dataclass(frozen=True)
class Closing:
    """A mechanism whose loops are closed by the coordinates that depend on others.

    ``blocks``: independent rows and dependent coordinates of each group of loops. ``curved`` are the coordinates whose
    values the first guess follows to second order, for many poses from one reference pose.
    """

    kinematics: PoseKinematics
    couplers: tuple[Coupling, ...]
    blocks: tuple[tuple[Index, Index], ...]
    curved: Index | None = None

    @cached_property
    def depends(self) -> Bools:
        """Which coordinates (n,) depend on others."""
        result = np.zeros(len(self.kinematics.coordinates.names), dtype=bool)
        for _, dependent in self.blocks:
            result[dependent] = True
        return result

    def poses(self, target: Array) -> tuple[Reached, Bools, Array]:
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
            if reached is None and (good & ends).all():
                return attempt, lost, share
            reached = (reached or first[np.zeros(count, dtype=np.intp)]).with_some(active[good], attempt[good])
            which, bad = active[good], active[~good]
            done[which] = np.where(ends, 1.0, done[active] + share)[good]
            step[which] = np.minimum(2.0 * step[which], full[which])
            step[bad], open_by[bad] = 0.5 * share[~good], np.where(small, attempt.opening, np.inf)[~good]
            lost[bad] = step[bad] * longest[bad] < SHORTEST
            active = active[(done[active] < 1.0) & ~lost[active]]
            before = reached[active] if len(active) else first
        assert reached is not None
        reached.opening[lost] = open_by[lost]
        return reached, lost, done

    @cached_property
    def described(self) -> Reached:
        """The reference pose, with the loops closed that its rounded numbers leave open."""
        kinematics = self.kinematics
        described, scale = kinematics.described, kinematics.row_scale
        count = len(scale) - len(kinematics.described_openings)
        error = np.append(kinematics.described_openings, np.zeros(count)) * scale
        closure = kinematics.closure * kinematics.closure_scale
        pose = replace(described, centre=described.centre.copy())[None]
        travel = np.zeros((1, sum(len(part.terms) for part in self.couplers)))
        at = Reached(np.zeros((1, closure.shape[1])), pose, np.array([np.abs(error).max(initial=0.0)]),
                     kinematics.rounding(kinematics.coordinates)[None], closure[None], self._inverses(closure[None]),
                     error[None], travel, np.zeros(1, dtype=bool))  # fmt: skip
        at = at if at.opening[0] <= CLOSED_EXACTLY else self.closed(at.q, at, CLOSED_EXACTLY)
        at.doubtful[0] = min(self.weakest(at, 0), default=(1.0, 0))[0] < NEAR_SINGULAR
        return at

    @cached_property
    def curvature(self) -> Array:
        """Half of the second derivatives (k k, n) of the coordinates by the k that are ``curved``, where q is zero.

        Central differences of the rates: points on tangents leave loops open to second order, alike on both sides.
        """
        at, scale, curved = self.described, self.kinematics.scale, self.curved
        assert curved is not None
        steps = np.zeros((2 * len(curved), len(scale)))
        steps[np.arange(len(steps)), np.tile(curved, 2)] = np.repeat((DIFFERENCE, -DIFFERENCE), len(curved))
        near = self._with_closure(self._open(at.q + scale * self._with_dependent(at, scale * steps), at))
        rates = np.stack([self._steps(near, near.closure[..., k]) for k in curved.tolist()], axis=1)
        ahead, behind = rates.reshape(2, -1, len(scale))
        return np.asarray((behind - ahead) / (4.0 * DIFFERENCE))

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

    def _attempt(self, before: Reached, change: Array, values: Array, enough: float) -> tuple[Reached, Bools]:
        """One step with closed loops: ``values`` (v, n) of the independent coordinates, which change by ``change``.

        Returns the poses, and a mask of those without dependent motions many times larger than the step, which
        indicate a jump or a dead point.
        """
        scale, by = self.kinematics.scale, self._with_dependent(before, change)
        if self.curved is not None and before is self.described:
            part = (change / scale).take(self.curved, axis=1)
            second = (part[:, :, None] * part[:, None]).reshape(len(part), -1) @ self.curvature
            by += np.where(np.abs(second).max(axis=1) < np.abs(by).max(axis=1), second.T, 0.0).T
        small = np.abs(by).max(axis=1, initial=0.0) <= 10.0 * LONGEST
        q = np.where(self.depends, before.q + scale * np.where(small[:, None], by, 0.0), values)
        return self.closed(q, before, enough), small

    def _with_dependent(self, at: Reached, change: Array) -> Array:
        """The changes of all coordinates, in their units, where the independent ones change by ``change`` (v, n)."""
        by: Array = np.where(self.depends, 0.0, change / self.kinematics.scale)
        return by - self._steps(at, (at.closure @ by[..., None])[..., 0]) if self.blocks else by

    def _steps(self, at: Reached, error: Array) -> Array:
        """The changes (v, n) of the dependent coordinates, in their units, that ``error`` (v, rows) comes from."""
        result = np.zeros((len(error), len(self.depends)), error.dtype)
        for (rows, dependent), inverse in zip(self.blocks, at.inverses, strict=True):
            result[:, dependent] = (inverse @ error.take(rows, axis=-1)[..., None])[..., 0]
        return result

    def _inverses(self, closure: Array) -> tuple[Array, ...]:
        """A^-1 (v, r, r) of each group of loops."""
        return tuple([_inverse(closure[:, rows[:, None], dependent]) for rows, dependent in self.blocks])

    def along(self, reached: Reached, change: Array) -> Pose:
        """Return imaginary steps from poses (v) with closed loops: the independent coordinates change by ``change``
        (v, n), the others such that loops stay closed.
        """
        kinematics = self.kinematics
        at = reached if kinematics.cuts is None else self._with_closure(reached)
        q = at.q + 1j * kinematics.scale * self._with_dependent(at, change)
        return kinematics.motion.moved(q)

    def changes(self, reached: Reached, steps: Array) -> Array:
        """Return how the values of the coordinates change by ``steps`` (n,) of the coordinates of one pose.

        They differ for components of a rotation vector and for curved joints; see ``FiniteMotion.by_values``.
        """
        kinematics, result = self.kinematics, np.array(steps)
        pose = reached.pose[0]
        own, _ = kinematics.at(pose)
        values = kinematics.motion.by_values(reached.q[0], pose, own)
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
        loops are open by more than ``RENEWED``. Openings are not computed behind a step that closes loops for certain:
        steps with a Phi J of other poses before reduce them by the same factor.
        """
        todo, best = np.arange(len(q)), self._with_closure(self._open(q, before))
        going, certain, renewed = best.opening > enough, np.zeros(len(q), dtype=bool), True
        for _ in range(CORRECTIONS):
            left = np.count_nonzero(going)
            if not left:
                break
            if left < len(todo):
                todo = todo[going]
            at = best if len(todo) == len(q) else best[todo]
            after = self._open(at.q - self.kinematics.scale * self._steps(at, at.error), at)
            closer = after.opening < at.opening
            slow = (after.opening > CLOSED) & (after.opening > np.minimum(SLOW * at.opening, RENEWED))
            chord, renewed = not renewed, bool(np.count_nonzero(closer & slow))
            if renewed:
                after = self._with_closure(after)
            going = closer & (after.opening > enough) & (
                (after.opening >= CLOSED) | (after.opening <= 0.1 * at.opening))
            if chord and not renewed:
                ends = going & (after.opening * after.opening <= CERTAIN * enough * at.opening)
                certain[todo], going = ends, going & ~ends
            if len(q) == len(todo) == np.count_nonzero(closer):
                best = after
            else:
                best = best.with_some(todo[closer], after[closer])
        if count := np.count_nonzero(certain):
            at = best if count == len(certain) else best[certain]
            q = at.q - self.kinematics.scale * self._steps(at, at.error)
            pose, none = self.kinematics.motion.moved(q), np.zeros_like(at.error)
            after = Reached(q, pose, np.full(len(q), enough), at.rounding, at.closure, at.inverses, none, at.travel,
                            at.doubtful)  # fmt: skip
            best = after if count == len(certain) else best.with_some(certain, after)
        return best

    def _open(self, q: Array, near: Reached | None) -> Reached:
        """Return the poses of values (v, n), as open as they are, with the Phi J of poses nearby."""
        kinematics, count = self.kinematics, len(q)
        pose = kinematics.motion.moved(q)
        rounding, closure, inverses = (np.zeros(count), np.zeros((count, 0, 0)), ()) if near is None else (
            near.rounding, near.closure, near.inverses)  # fmt: skip
        error, travel = kinematics.openings(pose), np.zeros((count, 0))
        couplings = None if kinematics.cuts is None else kinematics.cuts.couplings
        if couplings is not None:
            travel = coupler_travel(self.couplers, kinematics.topology.joints, pose,
                                    None if near is None else near.travel)  # fmt: skip
            tree = couplings.column >= 0
            travel[:, tree] = q[:, couplings.column[tree]]
            error = np.concatenate((error, couplings.sums(travel)), axis=1)
        error = error * kinematics.row_scale
        return Reached(q, pose, np.abs(error).max(axis=1, initial=0.0), rounding, closure, inverses, error, travel,
                       np.zeros(count, dtype=bool))  # fmt: skip

    def _with_closure(self, at: Reached) -> Reached:
        """Return the same poses with their own Phi J."""
        kinematics = self.kinematics
        coordinates, cuts = kinematics.at(at.pose)
        assert cuts is not None
        closure = locked(kinematics.motion.by_values(at.q, at.pose, coordinates), cuts) * kinematics.closure_scale
        return Reached(at.q, at.pose, at.opening, kinematics.rounding(coordinates), closure, self._inverses(closure),
                       at.error, at.travel, at.doubtful)  # fmt: skip

    def _near(self, first: Reached, second: Reached) -> Bools:
        """Tell whether no body moved so far in one step that loops may have jumped to another branch."""
        turned = (first.pose.rotations * second.pose.rotations).sum(axis=(-1, -2))
        went = np.abs(second.pose.centre - first.pose.centre).max(axis=(1, 2))
        far = 1.0 + 2.0 * np.cos(5.0 * LONGEST), 5.0 * LONGEST * self.kinematics.size
        return np.asarray((turned.min(axis=1) > far[0]) & (went < far[1]))

    def _same_branch(self, first: Reached, second: Reached, which: Bools) -> tuple[Bools, Bools]:
        """Tell of poses ``which`` whether there is no dead point between, and which are far from one.

        A change of norm below ``NEARBY`` takes no eigenvalue of 1 near 0; others are looked at one by one.
        """
        same, far = which.copy(), which.copy()
        for (rows, dependent), inverse in zip(self.blocks, first.inverses, strict=True):
            after = second.closure[:, rows[:, None], dependent]
            change = inverse @ after
            change.reshape(len(change), -1)[:, :: len(dependent) + 1] -= 1.0
            near = np.zeros(len(change), dtype=bool)
            for power in (1, 2, 4):  # no eigenvalue is larger than the root of the norm of a power
                near |= np.abs(change).sum(axis=-2).max(axis=-1, initial=0.0) < NEARBY**power
                if near.all():
                    break
                change = change @ change
            far &= near
            for i in np.flatnonzero(which & ~near).tolist():
                before = first.closure[i if len(first.closure) > 1 else 0]
                same[i] &= no_dead_point(before[rows[:, None], dependent], after[i])
        return same, far


def _inverse(a: Array) -> Array:
    try:
        return np.asarray(np.linalg.inv(a))
    except np.linalg.LinAlgError:
        return np.asarray(np.linalg.pinv(a))
