"""Loops: B'' of all variants at once, with the pivots of the pose as it is.

The rows and columns that a pivoted QR chose in the pose as given are kept, so that all variants have the same minimal
coordinates: in each group of loops Phi = [A R; P Q] with A square, and B'' is -A^-1 R where the redundant rows (P, Q)
hold by themselves. |A^-1| tells how far A is from singular: with A0 of the pose as given, and d = |1 - A0^-1 A| < 1,
it is |A0^-1| / (1 - d) at most. What (P, Q) leave tells whether they are redundant still. Where either is in doubt the
variant goes through the rank decision that a single pose goes through.
"""

from __future__ import annotations

import warnings
from dataclasses import dataclass, replace
from functools import partial
from typing import TYPE_CHECKING

import numpy as np

from mbsvib.elements import Joint
from mbsvib.equations.batch_geometry import scene_of_variant
from mbsvib.errors import ModelError, NearSingularWarning, SingularPoseError, counted
from mbsvib.kinematics.loops import Reduction, reduce
from mbsvib.kinematics.mobility import check_mobility, crossing_axes, phi_nearby, rods_in_loops
from mbsvib.kinematics.relative_motion import arm
from mbsvib.linalg.rank import EPS, NEAR_SINGULAR, NEIGHBOUR_PIVOT, RANK_FACTOR
from mbsvib.linalg.rotations import exponential

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from mbsvib.common.arrays import Array, Index
    from mbsvib.equations.batch_values import Values
    from mbsvib.equations.scene import Scene
    from mbsvib.kinematics.loop_group import LoopGroup
    from mbsvib.kinematics.loops import Cuts
    from mbsvib.kinematics.relative_motion import Twists

    Mask = NDArray[np.bool_]

# 1 / |A^-1| within this factor above the limit of a nearly singular pose is decided by the pivots themselves ...
WELL_ABOVE = 10.0
# ... unless it is of the size that it has in the pose as given, which went through that decision.
AS_GIVEN = 0.5
# Redundant rows that leave more than this share of the limit of a decision go through the decision itself.
WELL_BELOW = 0.1
HELP = (
    "All variants of a batch have the same coordinates: leave this one out, linearize it by itself, or pin other "
    "coordinates with independent=."
)


@dataclass(frozen=True, slots=True)
class Block:
    """The choice of the pose as given in a group of loops: the columns ``dependent`` (r,) and ``others``, the ``rows``,
    those of A first, ``inverse`` (r, r) of A as given, and how far A is from singular (``health``).
    """

    group: LoopGroup
    dependent: Index
    others: Index
    rows: Index
    inverse: Array
    health: float


@dataclass(frozen=True, slots=True)
class Pivots:
    """The choice of the pose as given: its ``reduction``, and a block of each group of loops."""

    reduction: Reduction
    blocks: tuple[Block, ...]


def pivots(scene: Scene, nominal: Reduction) -> Pivots:
    """Return the pivots of the pose as given, which all variants use.

    Parameters
    ----------
    scene : Scene
        The mechanism in numbers, as given.
    nominal : Reduction
        Its minimal coordinates.

    Returns
    -------
    Pivots
        Columns of each group of loops.
    """
    if scene.cuts is None or not nominal.groups:
        return Pivots(nominal, ())
    phi = scene.closure(scene.relative())[None]
    kept = np.zeros(phi.shape[-1], dtype=bool)
    kept[nominal.independent] = True
    blocks = []
    for group in nominal.groups:
        dependent, others = group.columns[~kept[group.columns]], group.columns[kept[group.columns]]
        redundant = np.array([scene.cuts.names[row] in group.redundant for row in group.rows], dtype=bool)
        rows = np.concatenate((group.rows[~redundant], group.rows[redundant]))
        block = Block(group, dependent, others, rows, np.zeros((0, 0)), 0.0)
        a = _scaled(scene.coordinates, scene.cuts, phi, block)[:, : len(dependent), : len(dependent)]
        inverse, health = _inverted(a)
        blocks.append(replace(block, inverse=inverse[0], health=float(health[0])))
    return Pivots(nominal, tuple(blocks))


def reduce_batch(scene: Scene, values: Values, phi: Array, chosen: Pivots, first: int) -> Reduction:
    """Return B'' of all variants in the coordinates that were chosen for the pose as given.

    Parameters
    ----------
    scene : Scene
        The variants in numbers.
    values : Values
        What varies.
    phi : array, shape (variants, locked rows, n)
        What their cut joints lock.
    chosen : Pivots
        The pivots of the pose as given.
    first : int
        Index of the first of these variants, for messages.

    Returns
    -------
    Reduction
        The same coordinates, B'' as (variants, n, m).

    Raises
    ------
    ModelError, SingularPoseError
        If in a variant the coordinates are not independent, or the number of degrees of freedom is another one or in
        doubt, by index.
    """
    nominal, cuts = chosen.reduction, scene.cuts
    if cuts is None or nominal.matrix is None or phi.ndim == 2:
        return nominal
    variants, (n, m) = len(phi), nominal.matrix.shape
    place = np.zeros(n, dtype=np.intp)
    place[nominal.independent] = np.arange(m)
    result = np.zeros((variants, n, m))
    result[:, nominal.independent, np.arange(m)] = 1.0
    doubt = np.zeros(variants, dtype=bool)
    for block in chosen.blocks:
        found, left, near = _solved(scene.coordinates, cuts, phi, block)
        result[:, block.dependent[:, None], place[block.others]] = found
        doubt |= near
        if len(block.rows) > len(block.dependent):
            doubt |= left > WELL_BELOW * RANK_FACTOR * _noise(scene.coordinates, cuts, block.group)
    reduction = replace(nominal, matrix=result)
    jumps = _may_jump(scene, values, chosen, reduction)
    for i in np.flatnonzero(doubt | jumps).tolist():
        result[i] = _alone(scene, values, phi[i], nominal, i, first, bool(doubt[i]), result[i])
    return reduction


def _may_jump(scene: Scene, values: Values, chosen: Pivots, reduction: Reduction) -> Mask:
    """Tell the variants in which constraints that are redundant here may not be in neighbouring poses."""
    assert scene.cuts is not None
    assert reduction.matrix is not None
    result = np.zeros(len(reduction.matrix), dtype=bool)
    if reduction.matrix.shape[2] and any(len(block.rows) > len(block.dependent) for block in chosen.blocks):
        crossing = []
        for row, *axes in crossing_axes(scene.topology, scene.cuts):
            whole = values.fields.get(scene.cuts.joints[scene.cuts.joint[row]], {})
            if "orientation" in whole:
                axes = [(exponential(whole["orientation"].T) @ axis).T for axis in axes]
            crossing.append((row, axes[0], axes[1]))
        nearby = phi_nearby(scene.topology, scene.coordinates, scene.cuts, reduction, scene.position, crossing,
                            rods_in_loops(scene.topology, scene.coordinates, scene.cuts))  # fmt: skip
        for block in chosen.blocks:
            if len(block.rows) > len(block.dependent):
                left = _solved(scene.coordinates, scene.cuts, nearby, block)[1]
                result |= ~(left <= WELL_BELOW * NEIGHBOUR_PIVOT)
    return result


def _scaled(coordinates: Twists, cuts: Cuts, phi: Array, block: Block) -> Array:
    """Phi of a group of loops, rows of A first, dependent columns first, (variants, rows, columns) without units."""
    length, columns = block.group.length, np.concatenate((block.dependent, block.others))
    result: Array = phi.reshape(len(phi), -1).take(block.rows[:, None] * phi.shape[2] + columns, axis=1)
    result *= cuts.row_scale(length)[..., block.rows, None]
    result *= np.where(coordinates.turns[columns], 1.0, length)
    return result


def _solved(coordinates: Twists, cuts: Cuts, phi: Array, block: Block) -> tuple[Array, Array, Mask]:
    """Part of B'', what the redundant rows leave, and where A is nearer to singular than can be told without pivots."""
    scaled, r = _scaled(coordinates, cuts, phi, block), len(block.dependent)
    a, right = scaled[:, :r, :r], scaled[:, :r, r:]
    size = np.maximum(1.0, _size(a))  # rows are of the size of one: the whole of A may be rounding
    apart = _size(np.eye(r) - block.inverse @ a)
    health = np.maximum(0.0, 1.0 - apart) / (size * max(float(_size(block.inverse)), 1e-300))
    near = _near(health, block)
    if near.any():
        near[near] = _near(_inverted(a[near])[1], block)
    try:
        found = np.linalg.solve(a, right)
    except np.linalg.LinAlgError:
        singular = np.linalg.slogdet(a)[0] == 0.0
        found = np.linalg.solve(np.where(singular[:, None, None], np.eye(r), a), right)
        found[singular] = 0.0
    left = np.zeros(len(phi))
    if len(block.rows) > r and len(block.others):
        rest = scaled[:, r:, r:] - scaled[:, r:, :r] @ found
        left = np.abs(rest).max(axis=(1, 2))
    scale = np.where(coordinates.turns, 1.0, block.group.length)
    found *= -(scale[block.dependent, None] / scale[block.others])
    return np.asarray(found), left, near


def _near(health: Array, block: Block) -> Mask:
    return (health < WELL_ABOVE * NEAR_SINGULAR) & (health < AS_GIVEN * block.health)


def _inverted(a: Array) -> tuple[Array, Array]:
    """A^-1 (variants, r, r), and how far A is from singular over its size where that is more than one, 0 if it is."""
    unit = np.eye(a.shape[-1])
    singular = np.linalg.slogdet(a)[0] == 0.0
    inverse = np.linalg.inv(np.where(singular[:, None, None], unit, a))
    growth = np.maximum(1.0, _size(a)) * _size(inverse)
    health = np.divide(1.0, growth, out=np.ones_like(growth), where=growth > 0.0)
    return inverse, np.where(singular, 0.0, health)


def _size(a: Array) -> Array:
    """Frobenius norms of matrices (..., r, c)."""
    flat = a.reshape(*a.shape[:-2], -1)
    return np.asarray(np.sqrt(np.einsum("...i,...i->...", flat, flat)))


def _noise(coordinates: Twists, cuts: Cuts, group: LoopGroup) -> Array:
    """Rounding of the scaled rows: positions are rounded relative to the origin, see ``mbsvib.kinematics.loops``."""
    cut = group.rows[group.rows < len(cuts.rows.first)]
    far = [np.abs(array[..., of]).max(axis=(0, -1), initial=0.0)
           for array, of in ((cuts.rows.point, cut), (coordinates.point, group.columns))]  # fmt: skip
    noise: Array = EPS * max(len(group.rows), len(group.columns)) * np.maximum(1.0, np.maximum(*far) / group.length)
    return np.maximum(noise, group.noise)


def _alone(
    scene: Scene, values: Values, phi: Array, nominal: Reduction, i: int, first: int, doubt: bool, matrix: Array
) -> Array:
    """Send one variant through the decisions that a single pose goes through; return its B''."""
    one = scene_of_variant(scene, i)
    coordinates, cuts, position = one.coordinates, one.cuts, one.position
    assert cuts is not None
    names = [coordinates.names[k] for k in nominal.independent]
    reduction = replace(nominal, matrix=matrix)
    joints = [values.part(joint.name, i) for joint in scene.topology.joints]
    topology = replace(scene.topology, joints=tuple(joint for joint in joints if isinstance(joint, Joint)))
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always", NearSingularWarning)
        try:
            if doubt:
                reduction = reduce(coordinates, cuts, phi, names, partial(arm, topology, position))
            check_mobility(topology, coordinates, cuts, reduction, position)
            check_freedom(len(reduction.independent), len(nominal.independent))
        except ModelError as error:  # the coordinates, which this variant did not choose, depend on each other
            raise SingularPoseError(
                f"variant {first + i}: the loops closed by {', '.join(cuts.joints)} tie the coordinates "
                f"{', '.join(names)} of the pose as given to each other. {HELP}"
            ) from error
        except SingularPoseError as error:
            raise SingularPoseError(f"variant {first + i}: {error}") from error
    for warning in caught:
        warnings.warn(f"variant {first + i}: {warning.message}", warning.category, stacklevel=5)
    assert reduction.matrix is not None
    return reduction.matrix


def check_freedom(found: int, expected: int) -> None:
    """Refuse a variant with another number of degrees of freedom than the pose as given.

    Parameters
    ----------
    found, expected : int
        Degrees of freedom that loops leave in the variant, and in the pose as given.

    Raises
    ------
    SingularPoseError
        If they differ.
    """
    if found != expected:
        raise SingularPoseError(
            f"its loops leave {counted(found, 'degree')} of freedom, those of the pose as given {expected}. {HELP}"
        )
