"""Bushings: spatial spring-dampers that act at a point, in up to six directions of their own axes.

In finite motion a bushing has the potential s . k s / 2 - preload . s with s = (d, rho): d = A^T (p_b - p_a) in axes A
that rotate with the first body, rho = log(A^T B). In another pose the preload is minus the first derivative of this
potential, and the stiffness is its second derivative.

Its rows are one for each direction with stiffness or damping, or one for each eigenvector of a 6x6 matrix.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from mbsvib.common import arguments as check
from mbsvib.common.arguments import IDENTITY, Matrix3, Vector
from mbsvib.common.arrays import Array, Bools, Index
from mbsvib.common.fast_init import fast_init
from mbsvib.elements.connection import ENDS, Connection, PreloadForm, check_ends
from mbsvib.elements.deformations import Law
from mbsvib.elements.deformations import six as deformation
from mbsvib.elements.part import Part
from mbsvib.elements.pose import Pose
from mbsvib.elements.roles import DAMPING, STIFFNESS, axes, batched, is_unsymmetric, point, six
from mbsvib.elements.rows import ElementRows, Rows, columns, table
from mbsvib.errors import ModelError
from mbsvib.linalg.products import eigenrows, signed_rows
from mbsvib.linalg.rank import EPS, UNSYMMETRIC
from mbsvib.linalg.rotations import components_first, inverse_jacobian, logarithm, second_order

Six = tuple[float, ...]
Matrix6 = tuple[Six, ...]
StiffnessDampingPreload = tuple[Six | Matrix6, Six | Matrix6, Six | None]
ZERO: Six = (0.0,) * 6
# Largest angle [rad] between the bodies of a bushing with moments: close to pi the rotation vector is not unique.
LARGEST_ANGLE = 3.0
FINITE = "values that are finite in this pose"
_SIX = np.eye(6)


@fast_init
@dataclass(frozen=True, slots=True)
class Bushing(Connection):
    """A spatial spring-damper between ``first`` and ``second`` at ``position`` [m], in the axes ``orientation``.

    ``stiffness`` [N/m, N m/rad] and ``damping`` [N s/m, N m s/rad] are six values (x y z rx ry rz) or 6x6 matrices;
    they act on the displacement of the second body relative to the first. Unsymmetric ones are cross-coupled, as those
    of journal bearings and seals are. ``preload`` [N, N m] is the wrench on the second body in the reference pose, in
    these axes; its reaction acts on the first body at the same point.
    """

    law = Law(deformation, "stiffness", "damping", preload="preload", wrench=True, rotations=slice(3, 6))

    roles = batched(**ENDS, stiffness=STIFFNESS, damping=DAMPING, position=point("second"), orientation=axes("first"),
                   preload=six(("N", "N", "N m"), wrench=True))  # fmt: skip

    position: Vector
    stiffness: Six | Matrix6 = ZERO
    damping: Six | Matrix6 = ZERO
    orientation: Matrix3 = check.IDENTITY
    preload: Six | None = None

    @property
    def loaded(self) -> bool:
        return self.preload is not None and any(self.preload)

    @property
    def rest_wrench(self) -> tuple[float, ...]:
        force, moment = (np.array(self.orientation) @ np.array(self.preload or ZERO).reshape(2, 3).T).T.tolist()
        return (*force, *moment)

    @property
    def cross_coupling(self) -> tuple[Array, Array] | None:
        if not any(is_unsymmetric(value) for value in (self.stiffness, self.damping)):
            return None
        axes = np.kron(np.eye(2), np.array(self.orientation))
        stiffness, damping = (axes @ (value - symmetric_part(value)) @ axes.T for value in
                              map(matrix6, (self.stiffness, self.damping)))  # fmt: skip
        return stiffness, damping

    def preload_form(self, size: float) -> PreloadForm | None:
        stiffness = np.array(self.stiffness)
        sizes, axes = np.array([1.0] * 3 + [1.0 / size] * 3), np.kron(np.eye(2), np.array(self.orientation))
        values, units = (stiffness, _SIX) if stiffness.ndim == 1 else eigenrows(_with_same_range(stiffness, sizes))
        if not values.any():
            return None
        wrenches = np.linalg.qr((units[values != 0.0] * sizes).T)[0].T / sizes
        largest = np.abs(stiffness) if stiffness.ndim == 1 else np.abs(stiffness).max(axis=1)
        resolution = EPS * float(max(largest[:3].max() * size, largest[3:].max() / size))
        return PreloadForm(
            self.position, wrenches @ axes.T, np.array(self.rest_wrench), resolution,
            lambda wrench: {"preload": None if wrench is None else (axes.T @ wrench).tolist()},
        )  # fmt: skip

    def in_pose(self, pose: Pose, relaxed: bool) -> Part | dict[str, Any]:
        return self.all_in_pose([self], pose, relaxed)[0]

    @staticmethod
    def all_in_pose(parts: Sequence[Any], pose: Pose, relaxed: bool) -> list[Part | dict[str, Any]]:
        moved = [part for part in parts if not (pose.is_unmoved(part.first) and pose.is_unmoved(part.second))]
        coefficients = [(part.stiffness, part.damping, part.preload) for part in moved] if relaxed or not moved else \
            _expanded_about(moved, *deflections(moved, pose))  # fmt: skip
        bushings = {
            part.name: Bushing(part.name, part.first, part.second, pose.point(part.second, part.position), stiffness,
                               damping, pose.rotated_axes(part.first, part.orientation), preload)
            for part, (stiffness, damping, preload) in zip(moved, coefficients, strict=True)
        }  # fmt: skip
        return [bushings.get(part.name, part) for part in parts]


def make(
    name: str, first: str, second: str, position: Any, stiffness: Any, damping: Any, orientation: Any,
    preload: Any = None,
) -> Bushing:  # fmt: skip
    """Check the values of a bushing and build it."""
    who = f"bushing '{name}'"
    check_ends(who, first, second)
    at = check.vector(position, who, "position")
    k = coefficients(stiffness, who, "stiffness")
    c = coefficients(damping, who, "damping")
    if preload is not None:
        expected = "the wrench on the second body: 6 values in the bushing's axes [N, N m]"
        preload = check.numbers(preload, (6,), who, "preload", expected)
    if not _is_nonzero(k) and not _is_nonzero(c) and not (preload and any(preload)):
        raise ModelError(f"{who}: neither stiffness nor damping is given; give one, or leave the bushing out.",
                         element=who, field="stiffness")  # fmt: skip
    return Bushing(name, first, second, at, k, c, check.orientation(orientation, who), preload)


def deflections(bushings: Sequence[Bushing], pose: Pose) -> tuple[Array, Array]:
    """Return d [m] and rho [rad] (n, 3) of bushings relative to the reference pose, in their axes."""
    first, second = (np.array([pose.number[body] for body in bodies]) for bodies in (
        [part.first for part in bushings], [part.second for part in bushings]))  # fmt: skip
    axes, point = np.array([part.orientation for part in bushings]), np.array([part.position for part in bushings])
    to_local = (pose.rotations.take(first, axis=0) @ axes).swapaxes(-1, -2)
    displacement = pose.points(second, point) - pose.points(first, point)
    return ((to_local @ displacement[..., None])[..., 0],
            logarithm(to_local @ (pose.rotations.take(second, axis=0) @ axes)))  # fmt: skip


def _expanded_about(bushings: Sequence[Bushing], d: Array, rho: Array) -> list[StiffnessDampingPreload]:
    """Stiffness, damping and preload of bushings about the pose with the deflections d and rho."""
    k, c = (np.array([matrix6(value) for value in values]) for values in (
        [part.stiffness for part in bushings], [part.damping for part in bushings]))  # fmt: skip
    preload = np.array([part.preload or ZERO for part in bushings])
    tangent, slope, wrench, has_moment = about(k, c, preload, d, rho)
    check_angles(bushings, rho, has_moment)
    damps_rotation = np.asarray(rho.any(axis=1) & c[:, 3:].any(axis=(1, 2)))
    stiffness = _finite(tangent, bushings, "stiffness", has_moment)
    damping = _finite(slope, bushings, "damping", damps_rotation)
    return [(stiffness.get(i, part.stiffness), damping.get(i, part.damping), _preload(part, values))
            for i, (part, values) in enumerate(zip(bushings, wrench.tolist(), strict=True))]


def about(k: Array, c: Array, preload: Array, d: Array, rho: Array) -> tuple[Array, Array, Array, Bools]:
    """Return stiffness, damping (..., n, 6, 6) and preload (..., n, 6) of bushings about a pose, in their axes there.

    ``k``, ``c`` (..., n, 6, 6) and ``preload`` (..., n, 6) as described; ``d`` [m], ``rho`` [rad] (..., n, 3): the
    deflections. The last array (..., n) tells which have turned and have a moment.
    """
    wrench = preload - (k @ np.concatenate((d, rho), axis=-1)[..., None])[..., 0]
    has_moment = rho.any(axis=-1) & (wrench[..., 3:].any(axis=-1) | k[..., 3:, :].any(axis=(-1, -2)))
    jacobian = np.zeros((*rho.shape[:-1], 6, 6), rho.dtype)  # d(d, rho) / d(displacement, rotation)
    jacobian[..., :3, :3], jacobian[..., 3:, 3:] = _SIX[:3, :3], inverse_jacobian(rho)
    transposed = jacobian.swapaxes(-1, -2)
    tangent = transposed @ k @ jacobian
    tangent[..., 3:, 3:] -= second_order(rho, wrench[..., 3:])
    return tangent, transposed @ c @ jacobian, (transposed @ wrench[..., None])[..., 0], np.asarray(has_moment)


def check_angles(bushings: Sequence[Any], rho: Array, has_moment: Bools) -> None:
    """Refuse bushings with a moment (..., n) that are turned by rotation vectors ``rho`` (..., n, 3) close to pi."""
    beyond = np.argwhere(has_moment & (np.square(rho).sum(axis=-1) > LARGEST_ANGLE**2)).tolist()
    if beyond:
        raise _angle_error(bushings[beyond[0][-1]], rho[tuple(beyond[0])])


def matrix6(value: Six | Matrix6) -> Array:
    """Return six values, or a matrix of them, as a matrix (6, 6)."""
    array = np.array(value, dtype=float)
    return array * _SIX if array.ndim == 1 else array


def symmetric_part(matrix: Array) -> Array:
    """Return the symmetric part of matrices (..., 6, 6)."""
    return 0.5 * (matrix + matrix.swapaxes(-1, -2))


def _with_same_range(matrix: Array, sizes: Array) -> Array:
    """Return a symmetric matrix (6, 6) with the range of one whose symmetric part is not negative: K_s + |K_a|.

    ``sizes`` (6,): units of forces and moments, in which the size of the antisymmetric part is measured.
    """
    symmetric = symmetric_part(matrix)
    _, values, units = np.linalg.svd((matrix - symmetric) * np.multiply.outer(sizes, sizes))
    return np.asarray(symmetric + (units.T * values) @ units / np.multiply.outer(sizes, sizes))


def _finite(matrices: Array, bushings: Sequence[Bushing], field: str, which: Bools) -> dict[int, Matrix6]:
    """Some of the matrices, by number; those that should be symmetric are so exactly."""
    result: dict[int, Matrix6] = {}
    for i in which.nonzero()[0].tolist():
        unsymmetric = is_unsymmetric(getattr(bushings[i], field))
        matrix = matrices[i] if unsymmetric else symmetric_part(matrices[i])
        if not np.isfinite(matrix).all():
            raise check.refuse(f"bushing '{bushings[i].name}'", field, matrix, FINITE)
        result[i] = tuple(map(tuple, matrix.tolist()))
    return result


def _preload(bushing: Bushing, wrench: list[float]) -> Six | None:
    if bushing.preload is None and not any(wrench):
        return None
    return check.numbers(wrench, (6,), f"bushing '{bushing.name}'", "preload", FINITE)


def _angle_error(bushing: Bushing, rho: Array) -> ModelError:
    """Close to half a turn the rotation vector, and with it the moment, may as well have the opposite direction."""
    who, angle = f"bushing '{bushing.name}'", float(np.linalg.norm(rho))
    return ModelError(f"{who}: is turned by {np.degrees(angle):.0f} degrees, where its moment is no longer defined "
                      f"(limit {np.degrees(LARGEST_ANGLE):.0f}). Describe the model in a nearer pose.",
                      element=who, field="stiffness")  # fmt: skip


def _is_nonzero(value: Six | Matrix6) -> bool:
    return any(map(any, value)) if isinstance(value[0], tuple) else any(value)


def coefficients(value: Any, who: str, field: str) -> Six | Matrix6:
    """Return stiffness or damping as six finite floats, or as a 6x6 matrix of them, symmetric if it is so to rounding.
    """
    expected = "6 values (x y z rx ry rz) or a 6x6 matrix"
    items = value if type(value) is tuple else value.tolist() if hasattr(value, "tolist") else value
    if not (hasattr(items, "__len__") and len(items) == 6 and hasattr(items[0], "__len__")):
        return check.numbers(items, (6,), who, field, expected)
    rows = check.square(items, 6, who, field, expected)
    matrix = np.array(rows)
    blocks = np.abs(matrix).reshape(2, 3, 2, 3).max(axis=(1, 3))  # entries of a block have the same unit
    blocks = np.maximum(np.maximum(blocks, blocks.T), np.sqrt(np.multiply.outer(*2 * [blocks.diagonal()])))
    limit = UNSYMMETRIC * np.kron(blocks, np.ones((3, 3)))
    if (np.abs(matrix - matrix.T) > limit).any():
        return rows
    return tuple(tuple(0.5 * (rows[i][j] + rows[j][i]) for j in range(6)) for i in range(6))


def rows(parts: Sequence[tuple[int, Bushing]], number: Mapping[str, int]) -> ElementRows:
    """Return the rows of bushings, of those with six values first.

    ``parts``: the bushings and their numbers among the model's connections. ``number``: that of each body, ground
    included.
    """
    with_values: list[tuple[int, Bushing]] = []
    with_matrices: list[tuple[int, Bushing]] = []
    for item in parts:
        matrix = isinstance(item[1].stiffness[0], tuple) or isinstance(item[1].damping[0], tuple)
        (with_matrices if matrix else with_values).append(item)
    return ElementRows.join([*([_rows_of_values(with_values, number)] if with_values else []),
                             *([_rows_of_matrices(with_matrices, number)] if with_matrices else [])])  # fmt: skip


def _rows_of_values(parts: Sequence[tuple[int, Bushing]], number: Mapping[str, int]) -> ElementRows:
    k, c = table([part.stiffness for _, part in parts] + [part.damping for _, part in parts], 6).reshape(2, -1)
    used: Index = ((k != 0.0) | (c != 0.0)).nonzero()[0]
    which = used // 6
    return _in_world(parts, number, which, _SIX.take(used - 6 * which, axis=0), k.take(used), c.take(used))


def _rows_of_matrices(parts: Sequence[tuple[int, Bushing]], number: Mapping[str, int]) -> ElementRows:
    """One row for each eigenvector of K if C is proportional to it, else rows of K and rows of C.

    Both are the symmetric parts; ``cross_coupling`` of a bushing is the rest.
    """
    which, units, k, c = [], [np.zeros((0, 6))], [np.zeros(0)], [np.zeros(0)]
    for i, (_, part) in enumerate(parts):
        stiffness, damping = (symmetric_part(matrix6(value)) for value in (part.stiffness, part.damping))
        values, vectors = _eigenrows(stiffness if stiffness.any() else damping)
        ratio = _proportion(damping, stiffness)
        if ratio is not None:
            which += [i] * len(values)
            units.append(vectors)
            k.append(values)
            c.append(ratio * values)
        else:
            elastic = len(values) if stiffness.any() else 0
            damping_values, damping_vectors = _eigenrows(damping)
            which += [i] * (elastic + len(damping_values))
            units += [vectors[:elastic], damping_vectors]
            k += [values[:elastic], np.zeros_like(damping_values)]
            c += [np.zeros(elastic), damping_values]
    return _in_world(parts, number, np.array(which, dtype=np.intp), np.concatenate(units), np.concatenate(k),
                     np.concatenate(c))  # fmt: skip


def rows_of_matrices(ends: Sequence[Index], point: Array, axes: Array, matrices: Sequence[Array]) -> ElementRows:
    """Return the rows of bushings (b,) with matrices: eigenvectors of the stiffness of each, then of its damping.

    ``ends``: numbers (b,) of their first and second bodies and their own. ``point`` (..., b, 3) [m], ``axes``
    (..., b, 3, 3); ``matrices``: stiffness and damping (..., b, 6, 6), of which the symmetric parts are taken.
    """
    (k, stiff), (c, damps) = (signed_rows(symmetric_part(array)) for array in matrices)
    units = np.concatenate((stiff, damps), axis=-2)
    lead, each = units.shape[:-3], units.shape[-2]
    count = each * len(ends[0])
    k, c = (np.concatenate(pair, axis=-1).reshape(*lead, count) for pair in (
        (k, np.zeros_like(c)), (np.zeros_like(k), c)))  # fmt: skip
    turned = units.reshape(*units.shape[:-1], 2, 3) @ axes.swapaxes(-1, -2)[..., None, :, :]
    force, moment = (components_first(turned[..., i, :].reshape(*lead, count, 3)) for i in (0, 1))
    first, second, owner = (np.repeat(array, each) for array in ends)
    rows = Rows(first, second, components_first(np.repeat(point, each, axis=-2)), force, moment)
    return ElementRows(rows, k, c, owner, units.reshape(*lead, count, 6))


def _in_world(
    parts: Sequence[tuple[int, Bushing]], number: Mapping[str, int], which: Index, unit: Array, k: Array, c: Array
) -> ElementRows:
    """Rows in world axes along directions ``unit`` (n, 6) in the axes of the bushings ``which`` (n,)."""
    ends = columns([(number[b.first], number[b.second], i, *b.position) for i, b in parts], 6).take(which, axis=1)
    first, second, owner = ends[:3].astype(np.intp)
    both = np.ascontiguousarray(unit.T).reshape(2, 3, -1)
    if any(part.orientation is not IDENTITY for _, part in parts):
        axes = columns([x + y + z for x, y, z in [part.orientation for _, part in parts]], 9).take(which, axis=1)
        both = np.einsum("abn,cbn->can", axes.reshape(3, 3, -1), both)
    force, moment = both
    return ElementRows(Rows(first, second, ends[3:], force, moment), k, c, owner, unit)


def _proportion(damping: Array, stiffness: Array) -> float | None:
    """The ratio C / K of two proportional matrices, None where they are not proportional to rounding."""
    if not damping.any():
        return 0.0
    if not stiffness.any():
        return None
    largest = np.unravel_index(np.argmax(np.abs(stiffness)), stiffness.shape)
    ratio = float(damping[largest] / stiffness[largest])
    return ratio if np.allclose(damping, ratio * stiffness, rtol=1e-15, atol=0.0) else None


def _eigenrows(matrix: Array) -> tuple[Array, Array]:
    """Nonzero eigenvalues and their rows."""
    values, vectors = eigenrows(matrix)
    nonzero = values != 0.0
    return values[nonzero], vectors[nonzero]
