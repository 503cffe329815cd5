"""Loops in finite motion, in units of like size: closed by coordinates nearest by, and rates that keep them so.

They are followed along a way where some tree coordinates have given values, on the branch of the pose before.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from mbsvib.common.arrays import Array, Bools, Index
from mbsvib.linalg.dead_points import no_dead_point
from mbsvib.linalg.qr import minimum_norm_solution
from mbsvib.linalg.rank import REDUNDANT_LOOPS

# Newton's method of projection: corrections at most, and where they count as rounding.
CORRECTIONS, CLOSED = 12, 1e-14


@dataclass(frozen=True)
class Loops:
    """The closures of a mechanism: a function (q, bases) -> (phi, J).

    ``coordinate_scale`` (n,) and ``row_scale`` (rows,) make one of 1 rad and the size of the mechanism; ``rank`` is
    that of J where it matters.
    """

    closures: Callable[[Array, Array], Any]
    coordinate_scale: Array
    row_scale: Array
    rank: int = 0

    def scaled(self, q: Array, bases: Array) -> tuple[Array, Array]:
        """Return phi (rows,) and J (rows, n) in units of like size."""
        phi, jacobian = self.closures(q, bases)
        return (np.asarray(phi)[:, 0] * self.row_scale,
                np.asarray(jacobian) * self.row_scale[:, None] * self.coordinate_scale)  # fmt: skip

    def projected(self, q: Array, bases: Array, may_move: Index | None = None) -> tuple[Array, float]:
        """Return the coordinates (n,) nearest by that close the loops, and the largest opening left, in units of 1 rad
        and the size of the mechanism.

        ``q`` (n,): coordinates next to such a pose. ``bases`` (9 b,): rotations on top of which those of q come.
        ``may_move``: coordinates that may change; default: all.
        """
        if not len(self.row_scale):
            return q, 0.0
        allowed = np.arange(len(q)) if may_move is None else may_move
        smallest = np.inf
        for _ in range(CORRECTIONS):
            phi, jacobian = self.scaled(q, bases)
            opening = float(np.abs(phi).max())
            if opening <= CLOSED or not opening < smallest:
                break
            smallest, best = opening, q
            q = q.copy()
            step = -minimum_norm_solution(jacobian[:, allowed], phi)
            q[allowed] += self.coordinate_scale[allowed] * step
        return (q, opening) if opening < smallest else (best, smallest)

    def rates(self, q: Array, bases: Array, qd: Array) -> Array:
        """Return the rates nearest by that keep the loops closed."""
        if not len(self.row_scale):
            return qd
        _, jacobian = self.scaled(q, bases)
        scaled = qd / self.coordinate_scale
        scaled = scaled - minimum_norm_solution(jacobian, jacobian @ scaled)
        return np.asarray(scaled * self.coordinate_scale)

    def rank_at(self, q: Array, bases: Array) -> int:
        """Return the number of independent closures in a pose."""
        values = np.linalg.svd(self.scaled(q, bases)[1], compute_uv=False)
        return int(np.count_nonzero(values > REDUNDANT_LOOPS * max(1.0, float(values.max(initial=0.0)))))


# The longest step [rad, mechanism sizes] along which loops are followed, and the shortest that is still tried.
LONGEST, SHORTEST = 0.1, 1e-7
# A way is looked at in steps of at most this [rad], less than the angles beyond the limit of springs, from 3 rad to
# 2 pi - 3 rad.
LOOK = 0.25


def straight_way(start: Array, end: Array, turns: Bools) -> Array:
    """Return poses (steps, n) on the way from tree coordinates (n,) to others, the last one included; ``turns`` (n,)
    tells which are rotations.
    """
    count = 1 + int(np.abs((end - start)[turns]).sum() / LOOK)
    return np.linspace(start, end, count + 1)[1:]


@dataclass(frozen=True)
class DrivenLoops:
    """The loops of a mechanism whose tree coordinates ``names`` (n,) are prescribed where they are ``driven`` (m,).

    Loops count as ``closed`` where they are open by less, in units of 1 rad and the size of the mechanism. ``bases``
    (9 b,) are the rotations on top of which rotation vectors come.
    """

    names: tuple[str, ...]
    driven: Index
    loops: Loops
    closed: float
    bases: Array

    @property
    def dependent(self) -> Index:
        """Numbers of the other coordinates."""
        return np.setdiff1d(np.arange(len(self.names)), self.driven)

    def jacobian(self, q: Array) -> Array:
        """Return the derivative (rows, n) of the openings in units of like size."""
        return self.loops.scaled(q, self.bases)[1]

    def followed(self, at: tuple[Array, Array], target: Array) -> tuple[tuple[Array, Array], float]:
        """Take the driven coordinates to their values in steps along which the loops stay closed.

        ``at``: a pose (n,) and the derivative of the openings there. ``target`` (m,) [rad, m]. Returns those of the
        last pose that was reached, and its share of the way.
        """
        (pose, matrix), depends, driven, scale = at, self.dependent, self.driven, self.loops.coordinate_scale
        start, change = pose[driven], target - pose[driven]
        longest = float(np.abs(change / scale[driven]).max(initial=0.0))
        done, step = 0.0, min(1.0, LONGEST / max(longest, LONGEST))
        while done < 1.0:
            share = min(step, 1.0 - done)
            trial = pose.copy()
            trial[driven] = target if done + share >= 1.0 else start + (done + share) * change
            moved = (trial - pose)[driven] / scale[driven]
            guess = np.linalg.lstsq(matrix[:, depends], -matrix[:, driven] @ moved, rcond=None)[0]
            trial[depends] += scale[depends] * guess
            opening = np.inf
            if np.abs(guess).max(initial=0.0) < 10.0 * LONGEST:
                trial, opening = self.loops.projected(trial, self.bases, depends)
            if opening < self.closed:
                after = self.jacobian(trial)
                if no_dead_point(matrix[:, depends], after[:, depends]):
                    pose, matrix, done = trial, after, done + share
                    step = min(2.0 * step, LONGEST / max(longest, LONGEST))
                    continue
            step = 0.5 * share
            if step * longest < SHORTEST:
                break
        return (pose, matrix), done

    def smallest(self, matrix: Array) -> float:
        """Return the smallest singular value, redundant loops apart, of the openings by the dependent coordinates."""
        values = np.linalg.svd(matrix[:, self.dependent], compute_uv=False)
        retained = values[: self.loops.rank]
        return float(retained.min(initial=np.inf))

    def loose(self, matrix: Array) -> str:
        """Return the dependent coordinate that could move most by itself in a singular pose."""
        values, vectors = np.linalg.svd(matrix[:, self.dependent])[1:]
        most = int(np.argmax(np.abs(vectors[min(len(values), len(vectors)) - 1])))
        return self.names[int(self.dependent[most])]
