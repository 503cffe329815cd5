"""States of a run, and rotation vectors that start anew on top of rotations that are kept."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from mbsvib.linalg.rotations import exponential, inverse_jacobian, logarithm

if TYPE_CHECKING:
    from collections.abc import Sequence

    from mbsvib.common.arrays import Array, Index
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
