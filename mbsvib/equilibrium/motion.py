"""Finite motion along the tree: bodies moved exactly by joint coordinates, and loops closed by Newton's method."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from mbsvib.common.arrays import Array, Bools, Index
from mbsvib.elements.pose import Pose
from mbsvib.equations.scene import twists_and_cuts
from mbsvib.kinematics.closing import CLOSED, CORRECTIONS
from mbsvib.kinematics.couplers import locked
from mbsvib.kinematics.couplings import Couplings, coupler_travel
from mbsvib.kinematics.loops import Cuts
from mbsvib.kinematics.pose import size_of, start
from mbsvib.kinematics.pose_kinematics import PoseKinematics, pose_kinematics
from mbsvib.kinematics.relative_motion import Twists, relative_motion
from mbsvib.linalg.dead_points import no_dead_point
from mbsvib.linalg.qr import minimum_norm_solution
from mbsvib.linalg.rank import CLOSED_EXACTLY, REDUNDANT_LOOPS
from mbsvib.linalg.rotations import logarithm
from mbsvib.mechanism.mechanism import Mechanism
from mbsvib.mechanism.topology import span


@dataclass(frozen=True)
class PosedModel:
    """A model in one pose: the ``reference`` model, the ``pose``, and the ``kinematics`` of its motion.

    ``travel`` (terms,) are the displacements of the coordinates in couplers from the reference pose, full turns
    included.
    """

    reference: Mechanism
    pose: Pose
    cut: tuple[str, ...]
    kinematics: PoseKinematics
    travel: Array

    @cached_property
    def _rows(self) -> tuple[Twists, Cuts | None]:
        return self.kinematics.at(self.pose)

    @property
    def coordinates(self) -> Twists:
        """The joint coordinates of the tree in this pose."""
        return self._rows[0]

    @property
    def cuts(self) -> Cuts | None:
        """The constraints of cut joints and couplers in this pose; None where there are none."""
        return self._rows[1]

    @property
    def size(self) -> float:
        """The size of the mechanism [m]."""
        return self.kinematics.size

    @property
    def scale(self) -> Array:
        """Units (n,) that make joint coordinates comparable: 1 rad, or the size of the mechanism [m]."""
        return self.kinematics.scale

    @cached_property
    def rounding(self) -> float:
        """The opening of loops by the rounding of points relative to the origin, in units of ``size``."""
        return float(self.kinematics.rounding(self.coordinates))

    @property
    def closure(self) -> Array:
        """Phi (locked rows, n): Jacobian of the constraints [m, rad per m, rad]."""
        if self.cuts is None or self.pose.as_described:
            return self.kinematics.closure
        return locked(self.coordinates, self.cuts)

    @cached_property
    def scaled_closure(self) -> Array:
        """``closure`` in units of 1 rad and the size of the mechanism, rows and columns."""
        return self.closure * self.kinematics.closure_scale

    @cached_property
    def openings(self) -> Array:
        """Violation of the constraints, one value for each row of ``scaled_closure``, in the same units."""
        if self.cuts is None:
            return np.zeros(0)
        values, couplings = self.kinematics.openings(self.pose), self.cuts.couplings
        if couplings is not None:
            values = np.append(values, couplings.sums(self.travel))
        return np.asarray(values * self.kinematics.row_scale)

    def under(self, model: Mechanism) -> PosedModel:
        """Return the same pose of a model with other loads."""
        return replace(self, reference=model)

    def moved(self, q: Array) -> PosedModel:
        """Return the same model after finite joint motions (n,); loops are not closed."""
        travel, pose = self.travel, self.kinematics.tree.at(self.pose, self.coordinates).moved(q)
        if self.cuts is not None and self.cuts.couplings is not None:
            estimate = travel + coupled_coordinates(self.cuts.couplings, self.coordinates) @ q
            travel = _travel(self.reference, pose, estimate)
        return PosedModel(self.reference, pose, self.cut, self.kinematics, travel)


def posed_model(reference: Mechanism, pose: Pose | None = None, cut: Sequence[str] = ()) -> PosedModel:
    """Return a model in one pose, by default its reference pose, with the kinematics of its motion."""
    kinematics = kinematics_of(reference, cut)
    pose = pose or kinematics.described
    return PosedModel(reference, pose, tuple(cut), kinematics, _travel(reference, pose, None))


def kinematics_of(model: Mechanism, cut: Sequence[str] = ()) -> PoseKinematics:
    """Return the kinematic data of a mechanism for all of its poses."""
    return model.derived(_prepared, tuple(cut))


def _prepared(model: Mechanism, cut: tuple[str, ...]) -> PoseKinematics:
    topology, bodies, pose = span(model, cut), list(model.bodies.values()), start(model)
    coordinates, cuts = twists_and_cuts(topology, bodies, tuple(model.couplers.values()))
    return pose_kinematics(topology, pose, coordinates, cuts, size_of(model))


def _travel(model: Mechanism, pose: Pose, near: Array | None) -> Array:
    return coupler_travel(tuple(model.couplers.values()), tuple(model.joints.values()), pose, near)


def coupled_coordinates(couplings: Couplings, coordinates: Twists) -> Array:
    """Return the coupled coordinates (terms, n) per unit joint coordinate."""
    measured = relative_motion(coordinates, couplings.measured).dense(0, len(couplings.measured.first))
    result = np.zeros((len(couplings.column), len(coordinates.names)))
    tree = couplings.column >= 0
    result[np.flatnonzero(tree), couplings.column[tree]] = 1.0
    result[~tree] = measured
    return result


def close(at: PosedModel, may_move: Bools | None = None) -> tuple[PosedModel, float]:
    """Close the loops by joint motions of least norm, starting from a pose nearby.

    q <- q - pinv(Phi) e  with the exact openings e of cut joints and couplers.

    ``may_move`` (n,): joint coordinates that may be used; None: all. Returns the model with its loops closed, as far as
    they could be, and the largest opening that is left, in units of 1 rad and the size of the mechanism.
    """
    if at.cuts is None:
        return at, 0.0
    allowed = np.arange(len(at.scale)) if may_move is None else may_move.nonzero()[0]
    closer, best, opening = at, at, np.inf
    for _ in range(CORRECTIONS):
        error = closer.openings
        current = float(np.abs(error).max(initial=0.0))
        if not current < opening:
            break
        best, previous, opening = closer, opening, current
        if current <= CLOSED_EXACTLY or (current < CLOSED and current > 0.1 * previous):
            break
        step, limit = np.zeros(len(at.scale)), max(REDUNDANT_LOOPS, closer.rounding)
        step[allowed] = minimum_norm_solution(closer.scaled_closure[:, allowed], -error, limit)
        closer = closer.moved(at.scale * step)
    return best, opening


def same_branch(first: PosedModel, second: PosedModel, depends: Bools) -> bool:
    """Tell whether there is no dead point of the coordinates that depend on others between two poses."""
    return no_dead_point(first.scaled_closure[:, depends], second.scaled_closure[:, depends])


def leaps(first: PosedModel, second: PosedModel, q: Array) -> bool:
    """Tell whether joint motions q (n,) from a pose to another turn a spring past half a turn, where the angle of its
    moment goes on from the other side.
    """
    one, other = first.reference.derived(_wound)
    if not len(one):
        return False
    before, after = (logarithm(pose.rotations[one].swapaxes(1, 2) @ pose.rotations[other])
                     for pose in (first.pose, second.pose))  # fmt: skip
    path, axes = first.coordinates.path.astype(float), first.pose.rotations[one]
    turn = ((path[other] - path[one]) * q) @ first.coordinates.angular.T
    change = before + (turn[:, None] @ axes)[:, 0] - after
    return bool((np.linalg.norm(change, axis=1) > np.pi).any())


def _wound(model: Mechanism) -> tuple[Index, Index]:
    """Numbers of the bodies (k,) of springs with a stiffness about axes."""
    number = start(model).number
    pairs = [(number[part.first], number[part.second]) for part in model.springs.values()
             if part.law is not None and part.law.rotations is not None
             and np.atleast_1d(getattr(part, part.law.stiffness))[part.law.rotations].any()]  # fmt: skip
    one, other = np.array(pairs, dtype=np.intp).reshape(-1, 2).T
    return one, other
