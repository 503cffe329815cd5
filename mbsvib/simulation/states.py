"""States of a run: rotation vectors that start anew on top of rotations that are kept, and the choice of the tree
coordinates that are independent, by pivots, and anew where loops have moved on.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
from scipy.linalg import qr

from mbsvib.common.arrays import Array, Index
from mbsvib.finite_motion.loops import CLOSED, Loops
from mbsvib.linalg.dead_points import is_unknown
from mbsvib.linalg.rotations import exponential, inverse_jacobian, logarithm

if TYPE_CHECKING:
    from mbsvib.finite_motion.kinematics import Kinematics


@dataclass(frozen=True, slots=True)
class State:
    """Where a run is: time [s], tree coordinates and their rates (n,), what Maxwell dampers yield (k,), and the work
    [J] that dampers have taken, loads and inputs have given (3,).
    """

    time: float
    q: Array
    qd: Array
    y: Array
    work: Array


@dataclass(frozen=True, slots=True)
class FreeRotation:
    """A joint with three free rotations, the components of one rotation vector on top of a base.

    ``rotations`` (3,) are the numbers of its rotations among the coordinates, ``base`` the number of the first entry of
    its base, ``axes`` (3, 3) its axes (columns).
    """

    name: str
    rotations: Index
    base: int
    axes: Array

    def total(self, q: Array, bases: Array) -> Array:
        """Return the rotation matrix (3, 3) since the pose as described."""
        base = bases[self.base : self.base + 9].reshape(3, 3, order="F")
        return np.asarray(exponential(self.axes @ q[self.rotations]) @ base)


def free_rotations(motion: Kinematics) -> tuple[FreeRotation, ...]:
    """Return the joints whose rotations come on top of a base."""
    result = []
    joints = {joint.name: joint for joint in motion.topology.joints}
    for i, name in enumerate(motion.based):
        rotations = np.array([motion.names.index(f"{name}.{d}") for d in ("rx", "ry", "rz")])
        axes = np.array(joints[name].axes) if name in joints else np.eye(3)
        result.append(FreeRotation(name, rotations, 9 * i, axes))
    return tuple(result)


def restarted(state: State, bases: Array, free_rotations: Sequence[FreeRotation], beyond: float) -> tuple[State, Array]:
    """Return a state whose rotation vectors longer than ``beyond`` [rad] start anew from 0, and the new bases.

    The angular velocity stays: w' = J^-1 q' at a vector q, w' = q' at 0.
    """
    q, qd, new = state.q, state.qd, bases
    for joint in free_rotations:
        w = joint.axes @ q[joint.rotations]
        if np.linalg.norm(w) > beyond:
            total = joint.total(q, new)
            spin = np.linalg.solve(inverse_jacobian(w), joint.axes @ qd[joint.rotations])
            q, qd, new = q.copy(), qd.copy(), new.copy()
            q[joint.rotations], qd[joint.rotations] = 0.0, joint.axes.T @ spin
            new[joint.base : joint.base + 9] = total.reshape(-1, order="F")
    return replace(state, q=q, qd=qd), new


def continued(vectors: Array, spins: Array, time: Array) -> Array:
    """Return rotation vectors (n, 3) of the same rotations that go on from sample to sample, beyond half a turn.

    Angular velocities ``spins`` (n, 3) [rad/s] at ``time`` (n,) [s] tell how many whole turns lie between samples.
    """
    result = vectors.copy()
    for k in range(1, len(result)):
        angle = float(np.linalg.norm(result[k]))
        axis = result[k] / angle if angle > 0.0 else _direction(result[k - 1])
        expected = result[k - 1] + 0.5 * (time[k] - time[k - 1]) * (spins[k - 1] + spins[k])
        near = float(axis @ expected)
        result[k] = axis * (angle + 2.0 * np.pi * round((near - angle) / (2.0 * np.pi)))
    return result


def _direction(vector: Array) -> Array:
    length = float(np.linalg.norm(vector))
    return np.asarray(vector / length) if length > 0.0 else np.zeros(3)


def as_described(
    q: Array, qd: Array, time: Array, bases: Sequence[Array], free_rotations: Sequence[FreeRotation]
) -> tuple[Array, Array]:
    """Return tree coordinates and rates (samples, n) as displacements from the pose as described.

    ``q``, ``qd`` (samples, n): coordinates on top of bases, and their rates. ``time`` (samples,): when [s]. ``bases``
    (9 b,): the bases of each sample. Returns (samples, n): the same with rotation vectors of whole rotations.
    """
    result, rates = np.array(q), np.array(qd)
    for joint in free_rotations:
        spins = np.array([
            np.linalg.solve(inverse_jacobian(joint.axes @ angles), joint.axes @ speeds)
            for angles, speeds in zip(q[:, joint.rotations], qd[:, joint.rotations], strict=True)
        ])  # fmt: skip
        totals = [logarithm(joint.total(coordinates, base)) for coordinates, base in zip(q, bases, strict=True)]
        vectors = continued(np.array(totals), spins, time)
        result[:, joint.rotations] = vectors @ joint.axes
        for k, vector in enumerate(vectors):
            rates[k, joint.rotations] = joint.axes.T @ inverse_jacobian(vector) @ spins[k]
    return result, rates


# Independent coordinates are chosen anew where the dependent ones follow worse than the best choice by this factor.
POOR_IN_BLOCK = 0.2
# A rotation vector is started anew from 0 beyond this angle [rad]; beyond LONGEST_TURN it must not go in one step.
LONG_TURN, LONGEST_TURN = 1.0, 2.8


@dataclass(frozen=True)
class Chart:
    """A choice of independent coordinates.

    ``independent`` (m,) and ``dependent`` (rank,) number the coordinates, ``order`` P (n, n) takes the independent ones
    and then the dependent ones, ``rows`` W (rank, rows) combines closures to as many as are independent; ``bases``
    (9 b,) are the rotations on top of which rotation vectors come. The choice holds while dependent coordinates go less
    than ``limit`` times as fast as independent ones, in units of like size.
    """

    independent: Index
    dependent: Index
    order: Array
    rows: Array
    bases: Array
    limit: float


def chart_at(loops: Loops, q: Array, bases: Array) -> Chart:
    """Return the choice of independent coordinates that is best in a pose, by pivots.

    ``q`` (n,): the pose. ``bases`` (9 b,): rotations on top of which those of q come.
    """
    n, rank = len(loops.coordinate_scale), loops.rank
    dependent = np.zeros(0, dtype=np.intp)
    rows = np.zeros((0, len(loops.row_scale)))
    if rank:
        jacobian = loops.scaled(q, bases)[1]
        left = np.linalg.svd(jacobian, full_matrices=False)[0][:, :rank].T
        dependent = np.sort(qr(left @ jacobian, mode="r", pivoting=True)[1][:rank])
        rows = left * loops.row_scale
    independent = np.setdiff1d(np.arange(n), dependent)
    ratio = 1.0
    if rank:
        closures = left @ jacobian
        ratio = float(np.abs(np.linalg.solve(closures[:, dependent], closures[:, independent])).max(initial=1.0))
    order = np.eye(n)[np.concatenate((independent, dependent))]
    return Chart(independent, dependent, order, rows, bases, ratio / POOR_IN_BLOCK)


@dataclass(frozen=True, slots=True)
class Conditioning:
    """How well the dependent coordinates of a choice follow in a pose.

    ``share`` is the smallest singular value of the closures' derivative to the dependent coordinates over that of all;
    ``smallest`` is the latter over the largest.
    """

    share: float = 1.0
    smallest: float = 1.0

    @property
    def is_singular(self) -> bool:
        """Whether the pose is a singular one, as far as loops that count as closed can tell."""
        return is_unknown(self.smallest, CLOSED)


def conditioning(loops: Loops, chart: Chart, q: Array) -> Conditioning:
    """Return how well the dependent coordinates of a choice follow in a pose q (n,)."""
    if not loops.rank:
        return Conditioning()
    jacobian = loops.scaled(q, chart.bases)[1]
    closures = (chart.rows / loops.row_scale) @ jacobian
    values = np.linalg.svd(closures, compute_uv=False)
    dependent_values = np.linalg.svd(closures[:, chart.dependent], compute_uv=False)
    return Conditioning(float(dependent_values[-1] / max(values[-1], 1e-300)), float(values[-1] / values[0]))
