"""Finite motion along the tree: bodies moved exactly by joint coordinates, and loops closed by Newton's method."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from scipy.linalg import eigvals, qr

from mbsvib.elements import Bushing
from mbsvib.equations.scene import cut_rows
from mbsvib.equilibrium.couplers import point_of, terms, travelled
from mbsvib.equilibrium.joints import displacement, opening
from mbsvib.equilibrium.moved_parts import skeleton
from mbsvib.kinematics.characteristic_length import length_of
from mbsvib.kinematics.couplers import with_couplers
from mbsvib.kinematics.loops import EPS, RANK_FACTOR
from mbsvib.kinematics.relative_motion import relative_motion, twists
from mbsvib.linalg.rotations import exponential
from mbsvib.mechanism.topology import FLOATS, span

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from mbsvib.common.arrays import Array
    from mbsvib.equilibrium.pose import Pose
    from mbsvib.kinematics.loops import Cuts
    from mbsvib.kinematics.relative_motion import Twists
    from mbsvib.mechanism.mechanism import Mechanism
    from mbsvib.mechanism.topology import Topology

CORRECTIONS = 25
# Singular values of the scaled loop equations below this are redundant rows. Rows are of the size of one; in loops that
# are redundant as a whole the largest value is rounding too, and what they are open by then moves nothing.
RANK = 1e-9
# Loops count as closed when they are open by no more than this share of their size, and get no closer.
CLOSED = 1e-13


@dataclass(frozen=True, slots=True)
class Stance:
    """A model in one pose: the model as ``described``, its ``pose``, and what moves it from there.

    ``size`` [m] is the size of the mechanism. ``travel`` (terms,) tells how far the coordinates that couplers couple
    have gone, whole turns included.
    """

    described: Mechanism
    pose: Pose
    cut: tuple[str, ...]
    topology: Topology
    coordinates: Twists
    cuts: Cuts | None
    size: float
    travel: Array

    @property
    def scale(self) -> Array:
        """Units (n,) in which all joint coordinates are of like size: 1 rad, or the size of the mechanism."""
        return np.where(self.coordinates.turns, 1.0, self.size)

    @property
    def rounding(self) -> float:
        """How far loops may be open as points are rounded relative to the origin, in units of ``size``."""
        points = self.coordinates.point
        return float(RANK_FACTOR * EPS * points.shape[1] * np.abs(points).max(initial=0.0) / self.size)

    @property
    def closure(self) -> Array:
        """Phi (locked rows, n): what cut joints and couplers lock, in units of 1 rad and the size of the mechanism."""
        if self.cuts is None:
            return np.zeros((0, len(self.coordinates.names)))
        phi = relative_motion(self.coordinates, self.cuts.rows).dense(0, len(self.cuts.rows.first))
        if self.cuts.couplings is not None:
            phi = np.concatenate((phi, self.cuts.couplings.dense(self.coordinates)))
        return np.asarray(phi * self.cuts.row_scale(self.size)[:, None])

    def at(self, pose: Pose) -> Stance:
        """Return the same model in another pose that is not far off."""
        return stance(self.described, pose, self.cut, self.travel)

    def moved(self, q: Array) -> Stance:
        """Return the same model after finite joint motions (n,); loops are not looked at."""
        travel = self.travel
        if self.cuts is not None and self.cuts.couplings is not None:
            travel = travel + terms(self.cuts.couplings, self.coordinates) @ q
        return stance(self.described, along_tree(self, q), self.cut, travel)


def stance(described: Mechanism, pose: Pose, cut: Sequence[str] = (), near: Array | None = None) -> Stance:
    """Return a model in one pose with the way to move it.

    Parameters
    ----------
    described : Mechanism
        The model as described.
    pose : Pose
        The pose.
    cut : sequence of str
        Joints at which loops are to be cut.
    near : array, shape (terms,), optional
        About how far the coupled coordinates have gone, to tell whole turns; default: not at all.

    Returns
    -------
    Stance
        Its tree, coordinates and loops there.
    """
    model = skeleton(described, pose)
    topology = span(model, cut)
    bodies = list(model.bodies.values())
    coordinates = twists(topology, bodies)
    cuts = cut_rows(topology, bodies, dict(pose.number))
    travel = np.zeros(0)
    if model.couplers:
        parts = tuple(model.couplers.values())
        cuts = with_couplers(cuts, parts, topology, bodies, dict(pose.number), coordinates)
        travel = travelled(described, pose, near)
    return Stance(described, pose, tuple(cut), topology, coordinates, cuts, size_of(described), travel)


def size_of(model: Mechanism) -> float:
    """Return the size [m] of a mechanism as described: the root mean square distance from their mean of the centres of
    mass, the points of joints and bushings, and the ends of springs; 1 m if all are one point.
    """
    points = [body.position for body in model.bodies.values()]
    points += [joint.point for joint in model.joints.values() if joint.point is not None]
    for spring in model.springs.values():
        points += [spring.position] if isinstance(spring, Bushing) else [spring.start, spring.end]
    return length_of(np.array(points).reshape(-1, 3))


def along_tree(at: Stance, q: Array) -> Pose:
    """Return the pose after finite joint motions from a stance, one coordinate after the other along the tree.

    Parameters
    ----------
    at : Stance
        Where the motion starts; loops are not looked at.
    q : array, shape (n,)
        Joint coordinates of the tree [m, rad].

    Returns
    -------
    Pose
        The pose after it.
    """
    centre, turn = at.pose.centre.copy(), np.tile(np.eye(3), (len(at.pose.centre), 1, 1))
    place = {name: i for i, name in enumerate(at.coordinates.names)}
    for branch in at.topology.branches:
        body, parent = branch.body, branch.parent
        here = at.pose.centre[body]
        if branch.joint == FLOATS:
            first = place[f"{at.topology.bodies[body]}.x"]
            turn[body], centre[body] = exponential(q[first + 3 : first + 6]), here + q[first : first + 3]
            continue
        joint = at.topology.joints[branch.joint]
        values = q[[place[f"{joint.name}.{direction}"] for direction, _ in joint.freedom]]
        if values.any():
            rotation, shift = displacement(joint, values)
            point = here if joint.point is None else np.array(joint.point)
            if branch.sign < 0:  # the second body is the one nearer to ground
                rotation = rotation.T
                relative = point + rotation @ (here - point - shift)
            else:
                relative = point + shift + rotation @ (here - point)
            turn[body] = turn[parent] @ rotation
        else:
            relative, turn[body] = here, turn[parent]
        if (turn[parent] == np.eye(3)).all():
            centre[body] = relative + (centre[parent] - at.pose.centre[parent])
        else:
            centre[body] = centre[parent] + turn[parent] @ (relative - at.pose.centre[parent])
    return at.pose.moved_to(centre, turn)


def openings(at: Stance) -> Array:
    """Return how far loops and couplers are open, one value for each row of ``closure``, in the same units."""
    if at.cuts is None:
        return np.zeros(0)
    values: list[Array] = [np.zeros(0)]
    for here in (at.topology.joints[k] for k in at.topology.cut):
        joint = at.described.joints[here.name]
        open_by = opening(joint, at.pose, point_of(joint, at.described, at.pose))
        values.append(np.array([six for _, six in here.locked]).reshape(-1, 6) @ open_by)
    couplings = at.cuts.couplings
    if couplings is not None:
        values.append(np.asarray(np.bincount(couplings.row, couplings.value * at.travel, len(couplings.touched))))
    return np.concatenate(values) * at.cuts.row_scale(at.size)


def close(at: Stance, may_move: NDArray[np.bool_] | None = None) -> tuple[Stance, float]:
    """Close the loops by the smallest joint motions that do it, starting from a pose not far off.

    q <- q - pinv(Phi) e  with the exact openings e of cut joints and couplers

    Parameters
    ----------
    at : Stance
        Where to start from.
    may_move : array of bool, shape (n,), optional
        Joint coordinates that may be used; default: all.

    Returns
    -------
    Stance
        The stance with its loops closed, as far as they could be.
    float
        How far they are still open at most, in units of 1 rad and the size of the mechanism.
    """
    if at.cuts is None:
        return at, 0.0
    allowed = slice(None) if may_move is None else may_move
    here, best, left = at, at, np.inf
    for _ in range(CORRECTIONS):
        error = openings(here)
        now = float(np.abs(error).max(initial=0.0))
        if not now < left:  # it gets no closer
            break
        best, gain, left = here, left, now
        if now < CLOSED and now > 0.1 * gain:
            break
        scale = here.scale[allowed]
        step = np.zeros(len(here.scale))
        limit = max(RANK, here.rounding)
        step[allowed] = -scale * _smallest(here.closure[:, allowed] * scale, error, limit)
        here = here.moved(step)
    return best, left


def _smallest(a: Array, right: Array, limit: float) -> Array:
    """The smallest solution of a x = right in the sense of least squares, without singular values up to ``limit``."""
    u, values, v = np.linalg.svd(a, full_matrices=False)
    kept = values > limit * max(1.0, float(values.max(initial=0.0)))
    return np.asarray((u[:, kept].T @ right / values[kept]) @ v[kept])


def same_side(here: Stance, there: Stance, depends: NDArray[np.bool_]) -> bool:
    """Return whether A = dPhi/dq of dependent coordinates goes over into that of the next pose without a dead point.

    Beyond a dead point an eigenvalue of A(here)^-1 A(there) has changed its sign; where two loops pass theirs at once
    two have, which the determinant does not tell.
    """
    if not depends.any():  # all loops are redundant
        return True
    before, after = ((stance.closure * stance.scale)[:, depends] for stance in (here, there))
    rows = qr(before.T, mode="r", pivoting=True)[1][: before.shape[1]]
    alpha, beta = eigvals(after[rows], before[rows], homogeneous_eigvals=True)
    return bool(((alpha * beta.conj()).real > 0.0).all())
