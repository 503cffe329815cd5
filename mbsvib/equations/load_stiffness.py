"""The stiffness of the forces at the pose in minimal coordinates, as signed squares of rows; arrays may have an axis of
variants in front.

Couplers whose relation is not linear have a stiffness: its second derivatives times the force at rest in the coupler.

With the relation g(q) = sum of c_i q_i + sum of h_k q_k^2 / 2 = 0 and its multiplier lambda, balance is
V' = lambda g', and the second variation of V - lambda g along motions with g' dq = 0 is the stiffness

    K - lambda sum of h_k r_k r_k^T

with r_k the row of the coordinate q_k in minimal coordinates.

Source: Haug, Computer Aided Kinematics and Dynamics of Mechanical Systems (1989), section 6.6; Luenberger & Ye, Linear
and Nonlinear Programming (2008), section 11.4.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType

import numpy as np

from mbsvib.common.arrays import Array, Index
from mbsvib.core.geometric_stiffness import (
    GeometricStiffness,
    MotionOrder,
    Pairs,
    TwistsAt,
    geometric_stiffness,
    motion_order,
)
from mbsvib.core.pairs import (
    CutJoints,
    displacement_curvature,
    of_lines,
    of_measured,
    of_places,
    of_sixes,
    opening_hessians,
)
from mbsvib.elements.coupler import Coupling
from mbsvib.equations.scene import Scene
from mbsvib.equations.wrenches import AppliedWrenches, leading
from mbsvib.errors import ModelError
from mbsvib.kinematics.couplers import couplings
from mbsvib.kinematics.loops import Reduction
from mbsvib.kinematics.relative_motion import Twists
from mbsvib.linalg.products import concatenated, squares_of_products
from mbsvib.linalg.rank import ZERO_FORM, ZERO_SUM


@dataclass(frozen=True, slots=True)
class LoadStiffness:
    """The symmetric ``matrix`` (..., m, m), and its factors: ``rows`` (..., r, m) with signed ``stiffness`` (..., r).
    ``circulatory`` (..., m, m) is the antisymmetric part, None without.
    """

    matrix: Array
    rows: Array
    stiffness: Array
    circulatory: Array | None


@dataclass(frozen=True, slots=True)
class LoadedPairs:
    """The applied ``pairs``, and the cut joints without their forces; with the ``motion`` J (..., 6, p, n) of both, and
    the generalized forces ``gradient`` (..., n), dV / dq of the potentials of the applied ones.

    ``rod_curvature`` (..., rods, 6, f, f): second derivatives of the motions of rods in the tree, None without.
    ``axes`` (..., 3, 3) and ``lengths`` (...): of joints by name, where variants differ in them.
    """

    twists: TwistsAt
    order: MotionOrder
    pairs: Pairs
    cut: CutJoints | None
    motion: Array
    gradient: Array
    rod_curvature: Array | None
    axes: Mapping[str, Array]
    lengths: Mapping[str, Array]


def twists_at(coordinates: Twists) -> TwistsAt:
    """Return the twists of the joint coordinates with axes of variants in front."""
    angular, linear, point = (leading(array) for array in (coordinates.angular, coordinates.linear, coordinates.point))
    return TwistsAt(angular, linear, point, coordinates.path)


def loaded_pairs(
    scene: Scene, axes: Mapping[str, Array] = MappingProxyType({}), lengths: Mapping[str, Array] = MappingProxyType({})
) -> LoadedPairs:
    """Return the pairs of a scene: loads, weights and preloads, and cut joints.

    ``axes`` (..., 3, 3) and ``lengths`` (...): of joints by name, where variants differ in them.
    """
    assert scene.loads is not None
    topology, cuts, twists = scene.topology, scene.cuts, twists_at(scene.coordinates)
    order = motion_order(topology)
    pairs, cut = applied_pairs(scene.loads[0], scene.position), None
    motion = twists.motion(pairs.first, pairs.second, pairs.point)
    gradient = np.einsum("...ip,...ipk->...k", pairs.wrench, motion)
    if cuts is not None and len(cuts.rows.first):
        rows, count = cuts.rows, len(cuts.rows.first)
        hessian = opening_hessians([topology.joints[k] for k in topology.cut], axes, lengths)
        work = concatenated((leading(rows.moment), leading(rows.force)), -2)
        cut = CutJoints(rows.first[cuts.start], rows.second[cuts.start], leading(rows.point)[..., cuts.start], work,
                        cuts.joint[:count], cuts.start, hessian)  # fmt: skip
        motion = concatenated((motion, twists.motion(cut.first, cut.second, cut.point)), -2)
    rods = [displacement_curvature(joint, axes.get(joint.name), lengths.get(joint.name))[..., None, :, :, :]
            for joint in [topology.joints[number] for number, _ in order.rods]]  # fmt: skip
    curvature = concatenated(rods, -4) if rods else None
    return LoadedPairs(twists, order, pairs, cut, motion, gradient, curvature, axes, lengths)


def applied_pairs(applied: AppliedWrenches, position: Array) -> Pairs:
    """Return the pairs of loads, weights (none, or one for each body) and preloads.

    ``position`` (..., bodies, 3): centres of mass [m].
    """
    pairs, loads, lines = applied.pairs, slice(applied.loads), slice(applied.loads, applied.loads + applied.lines)
    others = slice(lines.stop, None)
    start, end, force, torque = (leading(array) for array in (pairs.start, pairs.end, pairs.force, pairs.torque))
    parts = []
    if applied.loads:
        parts.append(of_places(pairs.first[loads], pairs.second[loads], end[..., loads], force[..., loads],
                               torque[..., loads], applied.follower))  # fmt: skip
    weight = leading(applied.weight)[..., :-1]
    if weight.any():
        bodies = np.arange(weight.shape[-1])
        ground = np.full(len(bodies), len(bodies))
        parts.append(of_places(ground, bodies, position.swapaxes(-1, -2), weight, np.zeros((3, 1)),
                               np.zeros(len(bodies), dtype=bool)))  # fmt: skip
    if applied.lines:
        parts.append(of_lines(pairs.first[lines], pairs.second[lines], start[..., lines], end[..., lines],
                              force[..., lines]))  # fmt: skip
    if len(applied.names) > lines.stop:
        parts.append(of_sixes(pairs.first[others], pairs.second[others], end[..., others], force[..., others],
                              torque[..., others]))  # fmt: skip
    return Pairs.join(parts)


def load_stiffness(
    scene: Scene, reduction: Reduction, loaded: LoadedPairs, multipliers: Array, every: bool = False
) -> LoadStiffness:
    """Return the stiffness of the forces at the pose.

    ``multipliers`` (..., locked rows): lambda with Phi^T lambda = - dV / dq, those of couplers last. If ``every``, rows
    that are zero are there too.
    """
    result, matrix = _second_derivatives(scene, loaded, multipliers)
    upper = np.triu(matrix)
    diagonal = np.arange(upper.shape[-1])
    upper[..., diagonal, diagonal] *= 0.5
    used = diagonal if every else np.flatnonzero(upper.any(axis=-1))
    identity = np.eye(len(diagonal)) if reduction.matrix is None else reduction.matrix
    second = reduction.apply_exactly(upper[..., used, :])
    rows, stiffness = squares_of_products(identity[..., used, :], second)
    circulatory = None
    if result.antisymmetric is not None:
        part = projected(result.antisymmetric, reduction)
        circulatory = 0.5 * (part - part.swapaxes(-1, -2)) if part.any() else None
    symmetric = projected(matrix, reduction)
    return LoadStiffness(0.5 * (symmetric + symmetric.swapaxes(-1, -2)), rows, stiffness, circulatory)


def all_pairs(scene: Scene, loaded: LoadedPairs, multipliers: Array) -> tuple[Pairs, Array]:
    """Return the applied pairs, those of cut joints and of couplers with their forces, and their motion J."""
    pairs, motion = [loaded.pairs], loaded.motion
    if loaded.cut is not None:
        pairs.append(loaded.cut.pairs(multipliers[..., : len(loaded.cut.number)]))
    measured = _measured(scene, loaded, multipliers)
    if measured is not None:
        pairs.append(measured)
        own = loaded.twists.motion(measured.first, measured.second, measured.point)
        motion = concatenated((motion, own), -2)
    return Pairs.join(pairs), motion


def _measured(scene: Scene, loaded: LoadedPairs, multipliers: Array) -> Pairs | None:
    """The pairs of coordinates of cut joints that couplers measure; None without any."""
    cuts = scene.cuts
    if cuts is None or cuts.couplings is None or not len(cuts.couplings.measured.first):
        return None
    measured, (coupler, coefficient) = cuts.couplings.measured, cuts.couplings.of_measured
    work = multipliers[..., len(cuts.rows.first) + coupler] * coefficient
    vectors = leading(measured.point), leading(measured.force), leading(measured.moment)
    return of_measured((measured.first, measured.second), vectors, scene.measured, work, loaded.axes, loaded.lengths)


def rounding(twists: TwistsAt, pairs: Pairs) -> Array:
    """Sizes (..., n, n) up to which second derivatives are rounding of the forces that both coordinates transmit."""
    on_way = (twists.path[pairs.second] != twists.path[pairs.first]).astype(float)
    lengths = np.square(np.abs(pairs.wrench))
    moment, force = (np.sqrt(lengths[..., part, :].sum(axis=-2)) @ on_way for part in (slice(3), slice(3, 6)))
    turns, shifts, reach = twists.sizes
    reach = max(reach, float(np.abs(pairs.point).max(initial=0.0)))
    force, moment = (np.minimum(array[..., None], array[..., None, :]) for array in (force, moment))
    both, mixed = turns[..., None] * turns[..., None, :], turns[..., None] * shifts[..., None, :]
    return np.asarray(ZERO_FORM * (force * (mixed + mixed.swapaxes(-1, -2) + reach * both) + moment * both))


def load_tangent(scene: Scene, reduction: Reduction, loaded: LoadedPairs, multipliers: Array) -> Array:
    """Return the stiffness (..., m, m) of forces at the pose with its antisymmetric part; see ``load_stiffness``."""
    result, matrix = _second_derivatives(scene, loaded, multipliers)
    return projected(matrix if result.antisymmetric is None else matrix + result.antisymmetric, reduction)


def _second_derivatives(scene: Scene, loaded: LoadedPairs, multipliers: Array) -> tuple[GeometricStiffness, Array]:
    """The second derivatives of the forces at the pose, and their symmetric part (..., n, n) without rounding."""
    joined, motion = all_pairs(scene, loaded, multipliers)
    result = geometric_stiffness(loaded.twists, loaded.order, joined, motion, loaded.rod_curvature)
    matrix = result.symmetric
    matrix.real[np.abs(matrix) <= rounding(loaded.twists, joined)] = 0.0
    return result, matrix


def projected(matrix: Array, reduction: Reduction) -> Array:
    """Return a matrix (..., n, n) in minimal coordinates, zero where its terms cancel."""
    if reduction.matrix is None:
        return matrix
    left, magnitude = reduction.matrix.swapaxes(-1, -2), np.abs(reduction.matrix)
    result = left @ matrix @ reduction.matrix
    result.real[np.abs(result) <= ZERO_SUM * (magnitude.swapaxes(-1, -2) @ np.abs(matrix) @ magnitude)] = 0.0
    return result


def curvature_stiffness(scene: Scene, reduction: Reduction, multipliers: Array) -> tuple[Array, Array, Index]:
    """Return rows (..., k, m) in minimal coordinates, their stiffness (..., k) and the joint (k,) that each belongs to.

    ``multipliers`` (..., locked rows): forces at rest in the locked rows, those of couplers last.
    """
    joints = {joint.name: k for k, joint in enumerate(scene.topology.joints)}
    parts, stiffness, owner = [], [], []
    first = multipliers.shape[-1] - len(scene.couplers)
    for i, coupler in enumerate(scene.couplers):
        for name, second_derivative in coupler.curvatures or ():
            if any(group.surplus and first + i in group.rows for group in reduction.groups):
                raise ModelError(f"coupler '{coupler.name}': redundant constraints share its force at rest, so that "
                                 f"the stiffness of its curvature is not determined. Leave one of them out.",
                                 element=coupler.name, field="curvature")  # fmt: skip
            parts.append(Coupling(coupler.name, ((name, 1.0),)))
            stiffness.append(-multipliers[..., first + i] * second_derivative)
            owner.append(joints[name.rpartition(".")[0]])
    rows = couplings(parts, scene.topology, scene.bodies, scene.topology.body_numbers, scene.coordinates)
    values = np.stack(stiffness, axis=-1)
    return reduction.apply(rows.dense(scene.coordinates)), values, np.array(owner, dtype=np.intp)
