"""The stiffness of the forces at the pose in minimal coordinates, as signed squares of rows; arrays may have an axis of
variants in front.
"""

from __future__ import annotations

from dataclasses import dataclass
from types import MappingProxyType
from typing import TYPE_CHECKING

import numpy as np

from mbsvib.core.geometric_stiffness import Pairs, TwistsAt, geometric_stiffness
from mbsvib.core.motion_order import motion_order
from mbsvib.core.pairs import (
    CutJoints,
    displacement_curvature,
    of_lines,
    of_measured,
    of_places,
    of_sixes,
    opening_hessians,
)  # fmt: skip
from mbsvib.linalg.products import concatenated, squares_of_products
from mbsvib.linalg.rank import ZERO_FORM, ZERO_SUM

if TYPE_CHECKING:
    from collections.abc import Mapping

    from mbsvib.common.arrays import Array
    from mbsvib.core.motion_order import MotionOrder
    from mbsvib.equations.scene import Scene
    from mbsvib.equations.wrenches import AppliedWrenches
    from mbsvib.kinematics.loops import Reduction
    from mbsvib.kinematics.relative_motion import Twists


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
    """The applied ``pairs`` with their ``motion`` J (..., 6, p, n), and the generalized forces ``gradient`` (..., n),
    dV / dq of their potentials.
    """

    twists: TwistsAt
    pairs: Pairs
    motion: Array
    gradient: Array


def twists_at(coordinates: Twists) -> TwistsAt:
    """Return the twists of the joint coordinates with axes of variants in front."""
    angular, linear, point = (leading(array) for array in (coordinates.angular, coordinates.linear, coordinates.point))
    return TwistsAt(angular, linear, point, coordinates.path)


def leading(vectors: Array) -> Array:
    """Return vectors (3, variants, n) as (variants, 3, n); (3, n) stay as they are."""
    return vectors if vectors.ndim == 2 else vectors.swapaxes(0, 1)


def applied_pairs(applied: AppliedWrenches, position: Array, coordinates: Twists) -> LoadedPairs:
    """Return the pairs of loads, weights and preloads.

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
    joined, twists = Pairs.join(parts), twists_at(coordinates)
    motion = twists.motion(joined.first, joined.second, joined.point)
    return LoadedPairs(twists, joined, motion, np.einsum("...ip,...ipk->...k", joined.wrench, motion))


def load_stiffness(
    scene: Scene, reduction: Reduction, loaded: LoadedPairs, multipliers: Array,
    axes: Mapping[str, Array] = MappingProxyType({}), lengths: Mapping[str, Array] = MappingProxyType({}),
    every: bool = False,
) -> LoadStiffness:  # fmt: skip
    """Return the stiffness of the forces at the pose.

    ``multipliers`` (..., locked rows): lambda with Phi^T lambda = - dV / dq, those of couplers last. ``axes``
    (..., 3, 3) and ``lengths`` (...): of joints by name, where variants differ in them. If ``every``, rows that are
    zero are there too.
    """
    twists, order = loaded.twists, motion_order(scene.topology)
    reacting = _reacting(scene, multipliers, axes, lengths)
    pairs, motion = loaded.pairs, loaded.motion
    if reacting is not None:
        own = twists.motion(reacting.first, reacting.second, reacting.point)
        pairs, motion = Pairs.join([pairs, reacting]), _joined(motion, own)
    of_rods = [scene.topology.joints[number] for number, _ in order.rods]
    rods = [displacement_curvature(joint, axes.get(joint.name), lengths.get(joint.name))[..., None, :, :, :]
            for joint in of_rods]  # fmt: skip
    result = geometric_stiffness(twists, order, pairs, motion, concatenated(rods, -4) if rods else None)
    matrix, rounding = result.symmetric, _rounding(twists, pairs, order)
    matrix[np.abs(matrix) <= rounding] = 0.0
    upper = np.triu(matrix, 1) + 0.5 * np.triu(np.tril(matrix))
    used = np.arange(upper.shape[-1])
    if not every:
        used = used[upper.any(axis=-1)]
    identity = np.eye(upper.shape[-1]) if reduction.matrix is None else reduction.matrix
    second = reduction.apply_exactly(upper[..., used, :])
    rows, stiffness = squares_of_products(identity[..., used, :], second)
    circulatory = None
    if result.antisymmetric is not None:
        projected = _projected(result.antisymmetric, reduction)
        circulatory = 0.5 * (projected - projected.swapaxes(-1, -2)) if projected.any() else None
    projected = _projected(matrix, reduction)
    matrix = 0.5 * (projected + projected.swapaxes(-1, -2))
    return LoadStiffness(matrix, rows, stiffness, circulatory)


def _reacting(
    scene: Scene, multipliers: Array, axes: Mapping[str, Array], lengths: Mapping[str, Array]
) -> Pairs | None:
    """The pairs of cut joints, and of couplers that measure coordinates of these; None without any."""
    cuts, topology = scene.cuts, scene.topology
    if cuts is None:
        return None
    count, parts = len(cuts.rows.first), []
    if count:
        joints = [topology.joints[k] for k in topology.cut]
        rows = CutJoints(cuts.rows, cuts.joint[:count], cuts.start, opening_hessians(joints, axes, lengths))
        parts.append(rows.pairs(leading(cuts.rows.point), leading(cuts.rows.force), leading(cuts.rows.moment),
                                multipliers[..., :count]))  # fmt: skip
    if cuts.couplings is not None and len(cuts.couplings.measured.first):
        couplings = cuts.couplings
        terms = (couplings.column < 0).nonzero()[0]
        work = multipliers[..., count + couplings.row[terms]] * couplings.value[..., terms]
        known = set(scene.coordinates.names)
        joint_of = {joint.name: joint for joint in topology.joints}
        names = [name.rpartition(".") for coupler in scene.couplers for name, _ in coupler.terms if name not in known]
        measured, of_names = couplings.measured, [(joint_of[owner], direction) for owner, _, direction in names]
        vectors = leading(measured.point), leading(measured.force), leading(measured.moment)
        parts.append(of_measured((measured.first, measured.second), vectors, of_names, work, axes, lengths))
    return Pairs.join(parts) if parts else None


def _joined(a: Array, b: Array) -> Array:
    """Motions (..., 6, p, n) of two groups of pairs in one array."""
    lead = np.broadcast_shapes(a.shape[:-3], b.shape[:-3])
    return np.concatenate([np.broadcast_to(part, (*lead, *part.shape[-3:])) for part in (a, b)], axis=-2)


def _rounding(twists: TwistsAt, pairs: Pairs, order: MotionOrder) -> Array:
    """Sizes (..., n, n) up to which second derivatives are rounding of the forces that both coordinates transmit."""
    on_way = (twists.path[pairs.second] != twists.path[pairs.first]).astype(float)
    moment, force = (np.sqrt(np.square(pairs.wrench[..., part, :]).sum(axis=-2)) @ on_way
                     for part in (slice(3), slice(3, 6)))  # fmt: skip
    turns, shifts = (np.sqrt(np.square(array).sum(axis=-2)) for array in (twists.angular, twists.linear))
    reach = max(float(np.abs(pairs.point).max(initial=0.0)), float(np.abs(twists.point).max(initial=0.0)))
    force, moment = (np.minimum(array[..., None], array[..., None, :]) for array in (force, moment))
    both = turns[..., None] * turns[..., None, :]
    mixed = turns[..., None] * shifts[..., None, :]
    return np.asarray(ZERO_FORM * (force * (mixed + mixed.swapaxes(-1, -2) + reach * both) + moment * both))


def _projected(matrix: Array, reduction: Reduction) -> Array:
    """A matrix (..., n, n) in minimal coordinates, zero where its terms cancel."""
    if reduction.matrix is None:
        return matrix
    left, magnitude = reduction.matrix.swapaxes(-1, -2), np.abs(reduction.matrix)
    result = left @ matrix @ reduction.matrix
    result[np.abs(result) <= ZERO_SUM * (magnitude.swapaxes(-1, -2) @ np.abs(matrix) @ magnitude)] = 0.0
    return result
