"""The residual of the forces in some pose along minimal coordinates, and its tangent."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np

from mbsvib.common.arrays import Array, Bools
from mbsvib.equations.expansion import expanded
from mbsvib.equations.load_stiffness import curvature_stiffness, load_tangent, loaded_pairs
from mbsvib.equations.posed_scene import PosedScene, follows_poses, of_parts
from mbsvib.equations.scene import Scene, scene
from mbsvib.equations.spin_terms import CrossCoupling, cross_couplings
from mbsvib.equations.statics import forces_along, loop_multipliers, shares, unbalanced_in_words
from mbsvib.equilibrium.articulation import elastic_scale, expanded_articulation
from mbsvib.equilibrium.motion import PosedModel, kinematics_of
from mbsvib.equilibrium.moved_parts import model_in_pose
from mbsvib.kinematics.loops import Reduction, kept_rows, reduce
from mbsvib.kinematics.relative_motion import arm, body_motion
from mbsvib.linalg.products import weighted_gram
from mbsvib.linalg.rank import EPS
from mbsvib.mechanism.mechanism import Mechanism

# Positions are rounded by eps of the mechanism's size: forces of which this share is that rounding count as resolved.
RESOLVED = 1e-12


@dataclass(frozen=True, slots=True)
class Balance:
    """The forces of a model in one pose, along its minimal coordinates.

    ``residual`` (m,) is the sum of the forces, ``balanced_forces`` (m,) the size of those that should cancel [N, N m].
    ``size`` (m,) is the same, but no less than the smallest force that rounded positions can resolve. ``tangent``
    (m, m) is -d(residual)/dz, exact where the residual is zero. ``scale`` (m,) makes coordinates comparable: 1 rad or
    the size of the mechanism, and less along stiff coordinates of a beam or superelement. ``names`` (m,) are the
    names of the coordinates; ``reduction`` maps them to those of all joints.
    """

    reduction: Reduction
    names: tuple[str, ...]
    residual: Array
    balanced_forces: Array
    size: Array
    tangent: Array
    scale: Array

    @property
    def share(self) -> float:
        """The residual over the forces along its coordinate, the largest of all coordinates."""
        return float(shares(self.residual, self.size).max(initial=0.0))

    @property
    def strict_share(self) -> float:
        """The same without allowance for the rounding of positions, as in ``linearize``."""
        return float(shares(self.residual, self.balanced_forces).max(initial=0.0))

    @property
    def depends(self) -> Bools:
        """Which joint coordinates of the tree (n,) depend on the minimal ones."""
        matrix = self.reduction.matrix
        result = np.ones(len(self.names) if matrix is None else len(matrix), dtype=bool)
        result[self.reduction.independent] = False
        return result

    @property
    def scaled_tangent(self) -> Array:
        """The tangent with coordinates scaled alike."""
        return np.asarray(self.tangent * np.multiply.outer(self.scale, self.scale))

    def all_joints(self, step: Array) -> Array:
        """Return the motion of all joints of the tree (n,) for a step (m,) of the minimal coordinates."""
        if self.reduction.matrix is None:
            return step
        return np.asarray(self.reduction.matrix @ step)


def balance(at: PosedModel, independent: Sequence[str] | None = None) -> Balance:
    """Return the forces and their tangent in a pose, with the exact geometry of springs.

    ``independent``: joint coordinates that shall be among the minimal ones.
    """
    numbers, axes, crossed = _scene_in(at)
    shared, springs, locked = numbers.shared, numbers.springs, numbers.locked
    relative = numbers.relative_of(springs.rows, *(() if shared is None else shared.base))
    phi = numbers.closure(relative)
    arms = partial(arm, numbers.topology, at.kinematics.described.centre[:-1])
    reduction = reduce(numbers.coordinates, numbers.cuts, phi, independent, arms)
    count = len(springs.owner)
    rows, k = reduction.apply_exactly(relative.dense(locked, relative.shape[0])), springs.stiffness
    if shared is not None:
        rows, k, *_ = shared.elastic_rows(rows[count:], rows[:count], k, springs.damping, springs.owner)
    stiffness = weighted_gram(rows, k)
    for part in crossed:
        motion = part.relative(numbers.coordinates, reduction)
        stiffness = stiffness + motion.T @ part.stiffness @ motion
    residual = balanced_forces = np.zeros(len(stiffness))
    if numbers.loads is not None:
        solve = partial(loop_multipliers, reduction, kept_rows(numbers.cuts, reduction), phi)
        residual, balanced_forces, loaded = of_loads(numbers, axes, reduction, solve)
        stiffness = stiffness + loaded
    names = tuple([numbers.coordinates.names[i] for i in reduction.independent.tolist()])
    lengths = at.scale[reduction.independent]
    size = np.maximum(balanced_forces, EPS / RESOLVED * (np.abs(stiffness) @ lengths))
    scale = lengths * elastic_scale(at.reference, names, stiffness.diagonal() * lengths**2)
    return Balance(reduction, names, residual, balanced_forces, size, stiffness, scale)


def _scene_in(at: PosedModel) -> tuple[Scene, Mapping[str, Array], Sequence[CrossCoupling]]:
    """The arrays of a model in a pose, the axes of its joints there as far as they differ from those described, and
    its elements with unsymmetric stiffness.

    Parts are made anew where they are bent, or have a stiffness without potential, or joints whose axes bend.
    """
    posed = at.reference.derived(_posed, at.cut)
    if posed is not None:
        described, in_pose = posed
        if at.pose.as_described:
            return described, {}, ()
        return in_pose.at(described, at.pose, rows=(at.coordinates, at.cuts)), in_pose.joint_axes(at.pose), ()
    model = expanded_articulation(at.reference if at.pose.as_described else model_in_pose(at.reference, at.pose))
    numbers = scene(model, at.cut)
    return numbers, {}, cross_couplings(model.with_parts(rotors={}), numbers.bodies, numbers.elements)


def _posed(model: Mechanism, cut: tuple[str, ...]) -> tuple[Scene, PosedScene] | None:
    """The arrays of a mechanism as described, and how they follow from poses; None where that is not stated."""
    if model.composed or model.hubs or any(part.cross_coupling is not None for part in model.springs.values()):
        return None
    plain = expanded(model)
    numbers = scene(plain, cut)
    if not follows_poses(model, numbers):
        return None
    return numbers, of_parts(plain, numbers, kinematics_of(model, cut), model)


def of_loads(
    numbers: Scene, axes: Mapping[str, Array], reduction: Reduction, multipliers: Callable[[Array], Array]
) -> tuple[Array, Array, Array]:
    """Return the residual of the forces, the size of those that should cancel (..., m), and their stiffness
    (..., m, m).

    ``axes`` (..., 3, 3): of joints that have turned, by name. ``multipliers`` takes dV / dq (..., n) and returns lambda
    (..., locked rows) with Phi^T lambda = -dV / dq.
    """
    motion = reduction.apply_to_bodies(body_motion(numbers.coordinates, numbers.position))
    residual, size = forces_along(numbers, motion)
    loaded = loaded_pairs(numbers, axes)
    forces = np.zeros(0) if numbers.cuts is None else multipliers(loaded.gradient)
    stiffness = load_tangent(numbers, reduction, loaded, forces)
    if any(coupler.curvatures for coupler in numbers.couplers):
        rows, values, _ = curvature_stiffness(numbers, reduction, -forces)
        stiffness = stiffness + weighted_gram(rows, values)
    return residual, size, stiffness


def unbalanced_force(at: PosedModel, forces: Balance) -> tuple[str, dict[str, Any]]:
    """Return the largest unbalanced force of a pose in words, and the fields of an ``EquilibriumError``."""
    worst = int(np.argmax(shares(forces.residual, forces.size)))
    share, missing = shares(forces.residual, forces.balanced_forces)[worst], -float(forces.residual[worst])
    k = int(forces.reduction.independent[worst])
    text, details = unbalanced_in_words(at.coordinates.names[k], bool(at.coordinates.turns[k]), missing, float(share),
                                        at.reference.joints)  # fmt: skip
    return f"{text})", details
