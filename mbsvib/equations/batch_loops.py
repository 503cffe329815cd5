"""Loops: B'' of all variants at once, with the pivots of the nominal pose.

The pivot rows and columns of a pivoted QR in the nominal pose are used for all variants, so that these have the same
minimal coordinates: in each group of loops Phi = [A R; P Q] with A square, and B'' is -A^-1 R if the redundant rows
(P, Q) are satisfied by it. |A^-1| measures the distance of A from singular: with A0 of the nominal pose, and
d = |1 - A0^-1 A| < 1, it is at most |A0^-1| / (1 - d). The residual of (P, Q) shows whether they are still redundant.
Where either is in doubt the variant gets the rank decision of a single pose.

Of complex values x + i h v the functions give F + i h dF: real parts are those of the variant, imaginary parts the
derivative along v, as exact as F itself. All decisions are those of the variant.

B'' of loops follows from Phi B'' = 0: dB'' = -A^-1 dPhi B'' in the dependent coordinates. A direction along which a
redundant constraint contradicts the others takes degrees of freedom away: it has no derivative.

Source: Martins, Sturdza & Alonso, The complex-step derivative approximation, ACM Trans. Math. Softw. 29 (2003) 245.
"""

from __future__ import annotations

import warnings
from dataclasses import dataclass, replace
from functools import cached_property, partial

import numpy as np

from mbsvib.common.arrays import Array, Bools, Index
from mbsvib.elements.coupler import Coupling
from mbsvib.equations.batch_values import Values
from mbsvib.equations.draft import Variants
from mbsvib.equations.locked_loops import check_loops
from mbsvib.equations.placing import scene_of_variant
from mbsvib.equations.scene import Scene
from mbsvib.equations.statics import loop_multipliers
from mbsvib.errors import ModelError, NearSingularWarning, SingularPoseError, counted
from mbsvib.kinematics.loops import Cuts, LoopGroup, Reduction, kept_rows, reduce
from mbsvib.kinematics.mobility import check_mobility, phi_nearby
from mbsvib.kinematics.relative_motion import Twists, arm
from mbsvib.linalg.rank import EPS, NEAR_SINGULAR, NEIGHBOUR_PIVOT, RANK_FACTOR, ZERO_ALONG

# Where 1 / |A^-1| is below this factor times the limit of a nearly singular pose, the pivots of the variant decide ...
CLEARLY_REGULAR = 10.0
# ... unless it is above this share of its value in the nominal pose, for which that decision was taken.
AS_NOMINAL = 0.5
# Variants in which the residual of redundant rows is above this share of the limit get a rank decision of their own.
CLEARLY_REDUNDANT = 0.1
HELP = (
    "All variants of a batch have the same coordinates: leave this one out, linearize it by itself, or pin other "
    "coordinates with independent=."
)


@dataclass(frozen=True, slots=True)
class Block:
    """Pivots of the nominal pose in ``groups`` (g,) of loops of like shape: the columns ``dependent`` (g, r) and
    ``others``, the ``rows``, those of A first, the ``inverse`` (g, r, r) of the nominal A and its
    ``reciprocal_condition`` (g,); ``length`` (g, 1) [m] makes their rows and columns dimensionless.
    ``columns`` (g, columns) are all columns, dependent ones first, ``units`` those of the coordinates, and ``entries``
    (g, rows, columns) the numbers of their entries in Phi.
    """

    groups: tuple[LoopGroup, ...]
    dependent: Index
    others: Index
    rows: Index
    length: Array
    columns: Index
    units: Array
    entries: Index
    inverse: Array
    reciprocal_condition: Array

    @property
    def redundant(self) -> bool:
        """Whether there are rows beside those of A."""
        return bool(self.rows.shape[1] > self.dependent.shape[1])


@dataclass(frozen=True)
class LoopPivots:
    """Pivots of the nominal pose of a ``scene``: its ``reduction``, and what follows from it where places vary."""

    scene: Scene
    reduction: Reduction

    @cached_property
    def kept(self) -> tuple[tuple[Index, Index], ...]:
        """The independent rows and the dependent coordinates of each group of loops."""
        return tuple(kept_rows(self.scene.cuts, self.reduction))

    @property
    def redundant(self) -> bool:
        """Whether there are rows beside those that are independent."""
        return any(group.surplus for group in self.reduction.groups)

    def multipliers(self, phi: Array, gradient: Array) -> Array:
        """Return the multipliers (..., locked rows) of loops, see ``loop_multipliers``."""
        return loop_multipliers(self.reduction, self.kept, phi, gradient)

    @cached_property
    def blocks(self) -> tuple[Block, ...]:
        """The pivots of groups of like shape."""
        scene = self.scene
        if scene.cuts is None:
            return ()
        phi = scene.closure(scene.relative_of())[None]
        like: dict[tuple[int, ...], list[tuple[LoopGroup, Index, Index, Index]]] = {}
        for group, (rows, dependent) in zip(self.reduction.groups, self.kept, strict=True):
            free = np.setdiff1d(group.columns, dependent, assume_unique=True)
            every = np.concatenate((rows, np.setdiff1d(group.rows, rows, assume_unique=True)))
            like.setdefault((len(dependent), len(free), len(every)), []).append((group, dependent, free, every))
        blocks = []
        for members in like.values():
            groups = tuple(group for group, *_ in members)
            dependents, others, ordered = (np.array([one[k] for one in members], dtype=np.intp) for k in (1, 2, 3))
            length = np.array([[group.length] for group in groups])
            columns, r = np.concatenate((dependents, others), axis=1), dependents.shape[1]
            units = np.where(scene.coordinates.turns[columns], 1.0, length)
            entries = ordered[:, :, None] * phi.shape[2] + columns[:, None]
            block = Block(groups, dependents, others, ordered, length, columns, units, entries, np.zeros((0, 0)),
                          np.zeros(0))  # fmt: skip
            inverse, reciprocal_condition = inverse_of(_scaled(scene.cuts, phi, block)[0, :, :r, :r])
            blocks.append(replace(block, inverse=inverse, reciprocal_condition=reciprocal_condition))
        return tuple(blocks)


def reduce_batch(
    scene: Scene, values: Values, phi: Array, pivots: LoopPivots, variants: Variants
) -> tuple[Reduction, int]:
    """Return B'' of all variants in the minimal coordinates of the nominal pose, and how many got a rank decision of
    their own.

    ``phi`` (variants, locked rows, n): locked rows of their cut joints. B'' becomes
    (variants, n, m).
    """
    nominal, cuts = pivots.reduction, scene.cuts
    if cuts is None or nominal.matrix is None or phi.ndim == 2:
        return nominal, 0
    count, (n, m) = len(phi), nominal.matrix.shape
    column = np.zeros(n, dtype=np.intp)
    column[nominal.independent] = np.arange(m)
    result = np.zeros((count, n, m))
    result[:, nominal.independent, np.arange(m)] = 1.0
    uncertain = np.zeros(count, dtype=bool)
    for block in pivots.blocks:
        solution, remainder, doubtful = _solved(cuts, phi, block)
        result[:, block.dependent[:, :, None], column[block.others][:, None]] = solution
        uncertain |= doubtful.any(axis=-1)
        if block.redundant:
            noise = np.stack([_noise(scene.coordinates, cuts, group) for group in block.groups], axis=-1)
            uncertain |= (remainder > CLEARLY_REDUNDANT * RANK_FACTOR * noise).any(axis=-1)
    reduction = replace(nominal, matrix=result)
    jumps = _may_jump(scene, variants, pivots, reduction)
    own = np.flatnonzero(uncertain | jumps).tolist()
    for i in own:
        result[i] = _single_decision(scene, values, phi[i], nominal, i, variants.first,
                                     bool(uncertain[i]), result[i])
    return reduction, len(own)


def _may_jump(scene: Scene, variants: Variants, pivots: LoopPivots, reduction: Reduction) -> Bools:
    """Mask of variants whose redundant constraints may be independent in neighbouring poses."""
    assert scene.cuts is not None
    assert reduction.matrix is not None
    result = np.zeros(len(reduction.matrix), dtype=bool)
    blocks = [block for block in pivots.blocks if block.redundant]
    if reduction.matrix.shape[2] and blocks:
        nearby = phi_nearby(scene.topology, scene.coordinates, scene.cuts, reduction, scene.position, variants.axes,
                            variants.lengths)  # fmt: skip
        for block in blocks:
            remainder = _solved(scene.cuts, nearby, block)[1]
            result |= ~(remainder <= CLEARLY_REDUNDANT * NEIGHBOUR_PIVOT).all(axis=-1)
    return result


def _scaled(cuts: Cuts, phi: Array, block: Block) -> Array:
    """Phi of groups of loops, rows of A first, dependent columns first, (variants, g, rows, columns) without units."""
    result: Array = phi.reshape(len(phi), -1).take(block.entries, axis=1)
    result *= cuts.row_scale(block.length, block.rows)[..., None]
    result *= block.units[:, None]
    return result


def _solved(cuts: Cuts, phi: Array, block: Block) -> tuple[Array, Array, Bools]:
    """Parts of B'' (variants, g, r, others), the residuals (variants, g) of the redundant rows, and a mask of variants
    and groups in which A may be nearly singular.
    """
    scaled, r = _scaled(cuts, phi, block), block.dependent.shape[1]
    a, right = scaled[..., :r, :r], scaled[..., :r, r:]
    size = np.maximum(1.0, _size(a))  # rows have size one: all of A may be rounding
    change = block.inverse @ a
    change.reshape(*change.shape[:-2], r * r)[..., :: r + 1] -= 1.0
    difference = _size(change)
    reciprocal_condition = np.maximum(0.0, 1.0 - difference) / (size * np.maximum(_size(block.inverse), 1e-300))
    doubtful = near_singular(reciprocal_condition, block.reciprocal_condition)
    if np.count_nonzero(doubtful):
        nominal = np.broadcast_to(block.reciprocal_condition, doubtful.shape)[doubtful]
        doubtful[doubtful] = near_singular(inverse_of(a[doubtful])[1], nominal)
    try:
        solution = np.linalg.solve(a, right)
    except np.linalg.LinAlgError:
        singular = np.linalg.slogdet(a)[0] == 0.0
        solution = np.linalg.solve(np.where(singular[..., None, None], np.eye(r), a), right)
        solution[singular] = 0.0
    remainder = np.zeros(scaled.shape[:2])
    if block.redundant and block.others.shape[1]:
        redundant = scaled[..., r:, r:] - scaled[..., r:, :r] @ solution
        remainder = np.abs(redundant).max(axis=(-2, -1))
    solution *= -(block.units[:, :r, None] / block.units[:, None, r:])
    return np.asarray(solution), remainder, doubtful


def near_singular(reciprocal_condition: Array, nominal: Array) -> Bools:
    """Return where the dependent columns of groups of loops may be nearly singular, ``nominal`` is that of the pose."""
    return np.asarray(reciprocal_condition < np.minimum(CLEARLY_REGULAR * NEAR_SINGULAR, AS_NOMINAL * nominal))


def inverse_of(a: Array) -> tuple[Array, Array]:
    """Return A^-1 (..., r, r) and the reciprocal condition 1 / (max(1, |A|) |A^-1|), 0 if A is singular."""
    unit = np.eye(a.shape[-1])
    singular = np.linalg.slogdet(a)[0] == 0.0
    inverse = np.linalg.inv(np.where(singular[..., None, None], unit, a))
    growth = np.maximum(1.0, _size(a)) * _size(inverse)
    reciprocal_condition = np.divide(1.0, growth, out=np.ones_like(growth), where=growth > 0.0)
    return inverse, np.where(singular, 0.0, reciprocal_condition)


def _size(a: Array) -> Array:
    """Frobenius norms of matrices (..., r, c)."""
    flat = a.reshape(*a.shape[:-2], -1)
    return np.asarray(np.sqrt(np.add.reduce(flat * flat, axis=-1)))


def _noise(coordinates: Twists, cuts: Cuts, group: LoopGroup) -> Array:
    """Rounding of the scaled rows: positions are rounded relative to the origin, see ``mbsvib.kinematics.loops``."""
    cut = group.rows[group.rows < len(cuts.rows.first)]
    largest = [np.abs(array[..., selection]).max(axis=(0, -1), initial=0.0)
           for array, selection in ((cuts.rows.point, cut), (coordinates.point, group.columns))]  # fmt: skip
    noise: Array = EPS * max(len(group.rows), len(group.columns)) * np.maximum(1.0, np.maximum(*largest) / group.length)
    return np.maximum(noise, group.noise)


def _single_decision(
    scene: Scene, values: Values, phi: Array, nominal: Reduction, i: int, first: int, uncertain: bool, matrix: Array
) -> Array:
    """Return B'' of one variant by the decisions of a single pose."""
    variant = scene_of_variant(scene, i)
    coordinates, cuts, position = variant.coordinates, variant.cuts, variant.position
    assert cuts is not None
    names = [coordinates.names[k] for k in nominal.independent]
    reduction = replace(nominal, matrix=matrix)
    topology = replace(scene.topology, joints=tuple([values.of_variant(joint, i) for joint in scene.topology.joints]))
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always", NearSingularWarning)
        try:
            if uncertain:
                reduction = reduce(coordinates, cuts, phi, names, partial(arm, topology, position))
                check_loops(None, reduction.groups, coordinates.names, 2)
            check_mobility(topology, coordinates, cuts, reduction, position)
            check_freedom(len(reduction.independent), len(nominal.independent))
        except ModelError as error:  # the nominal coordinates depend on each other
            raise SingularPoseError(
                f"variant {first + i}: the loops closed by {', '.join(cuts.joints)} tie the coordinates "
                f"{', '.join(names)} of the nominal pose to each other. {HELP}"
            ) from error
        except SingularPoseError as error:
            raise SingularPoseError(f"variant {first + i}: {error}") from error
    for warning in caught:
        warnings.warn(f"variant {first + i}: {warning.message}", warning.category, stacklevel=5)
    assert reduction.matrix is not None
    return reduction.matrix


def check_freedom(freedom: int, expected: int) -> None:
    """Refuse a variant with another number of degrees of freedom than the nominal pose."""
    if freedom != expected:
        raise SingularPoseError(
            f"its loops leave {counted(freedom, 'degree')} of freedom, those of the nominal pose {expected}. {HELP}"
        )


def closure_along(
    scene: Scene, values: Values, phi: Array, pivots: LoopPivots, closure: Array | None
) -> tuple[Reduction, Bools]:
    """Return B'' + i h dB'' (variants, n, m), and a mask (variants,) of directions that take degrees of freedom away.

    ``phi`` (variants, locked rows, n): Phi + i h dPhi. ``closure`` (variants, n, m): B'', None for the nominal one.
    """
    cuts, nominal = scene.cuts, pivots.reduction
    lost = np.zeros(len(phi), dtype=bool)
    if cuts is None or nominal.matrix is None:
        return nominal, lost
    before = nominal.matrix if closure is None else closure
    change = phi.imag @ before
    result = np.broadcast_to(before, (*change.shape[:-2], *before.shape[-2:])).astype(complex)
    for block in pivots.blocks:
        kept = block.dependent.shape[1]
        row_scale = cuts.row_scale(block.length, block.rows)[..., None]
        column_scale = block.units[:, :kept]
        matrix = row_scale * phi.real[:, block.rows[:, :, None], block.dependent[:, None]] * column_scale[:, None]
        right = row_scale * change[:, block.rows]
        regular = ~near_singular(inverse_of(matrix[..., :kept, :])[1], block.reciprocal_condition)
        solution = np.empty((*matrix.shape[:2], kept, right.shape[-1]))
        solution[regular] = np.linalg.solve(matrix[regular, :kept], right[regular, :kept])
        solution[~regular] = np.linalg.pinv(matrix[~regular]) @ right[~regular]
        result.imag[:, block.dependent] = -column_scale[..., None] * solution
        left = np.abs(right - matrix @ solution)
        sizes = np.abs(before[..., block.columns, :]) / block.units[..., None]
        largest = sizes.max(axis=-2, keepdims=True, initial=0.0)
        moved = np.stack([_moved(values, group.length) for group in block.groups], axis=-1)
        lost |= (left > ZERO_ALONG * moved[..., None, None] * largest).any(axis=(1, 2, 3))
    return replace(nominal, matrix=result), lost


def _moved(values: Values, length: float) -> Array:
    """The largest motion or rotation of a body or joint, and change of a ratio, of steps (variants,) per ``length``."""
    result = np.zeros(values.count)
    for name, array in values.displacements.items():
        result = np.maximum(result, np.abs(array.imag) / (1.0 if name.rpartition(".")[2][0] == "r" else length))
    for part, fields in values.fields.items():
        for field, array in fields.items():
            if field in ("position", "start", "end", "pitch"):
                size = length
            elif field == "orientation":
                size = 1.0
            elif isinstance(values.parameters.parts[part], Coupling):
                size = float(np.abs(array.real).max()) or 1.0
            else:
                continue
            result = np.maximum(result, np.abs(array.imag).reshape(-1, values.count).max(axis=0) / size)
    return result
