"""Matrices of a mechanism and their factors, from its rows."""

from __future__ import annotations

from dataclasses import dataclass, fields, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from mbsvib.common.arrays import Array, Bools, Index
from mbsvib.common.fast_init import fast_init
from mbsvib.equations.ports import feedthrough_of_motions, port_matrices
from mbsvib.kinematics.relative_motion import Triplets, body_motion
from mbsvib.linalg.products import concatenated, gram_matrix, weighted_gram

if TYPE_CHECKING:
    from mbsvib.equations.scene import Scene
    from mbsvib.kinematics.loops import Reduction


@fast_init
@dataclass(frozen=True, slots=True)
class MinimalRows:
    """What geometry alone gives in minimal coordinates: the ``motion`` (..., bodies, 6, m) of the bodies, and ``rows``
    (..., rows, m) of elements (those that are ``used``, None: all), ports, and base rows of shared mass and stiffness.
    """

    motion: Array
    rows: Array
    used: Bools | None = None


def minimal_rows(
    scene: Scene, relative: Triplets, reduction: Reduction, used: Bools | None = None
) -> MinimalRows:
    """Return the rows of a scene in minimal coordinates.

    ``relative``: its relative displacements. ``used`` (elastic rows,): those to take; default: all, also zero ones.
    """
    locked = scene.locked
    motion = reduction.apply_to_bodies(body_motion(scene.coordinates, scene.position))
    # elastic rows, those of ports, and base rows of shared mass and stiffness
    end = len(scene.springs.owner) + len(scene.port.rows.first) if scene.shared is None else relative.shape[0] - locked
    mask = None
    if used is not None:
        mask = np.empty(end, dtype=bool)
        mask[: len(used)], mask[len(used) :] = used, True
    return MinimalRows(motion, reduction.apply_exactly(relative.dense(locked, locked + end, mask)), used)


def matrices(scene: Scene, minimal: MinimalRows, closed: bool) -> Terms:
    """Return the matrices of a mechanism and their factors.

    If ``closed`` there are loops, so that elastic rows may be zero; among rows that are ``used`` these are left out.
    """
    springs, motion, all_rows, used = scene.springs, minimal.motion, minimal.rows, minimal.used
    count = len(springs.owner) if used is None else int(np.count_nonzero(used))
    factor = scene.inertia.factor(motion)
    ports_end = count + len(scene.port.rows.first)
    elastic, port_rows = all_rows[..., :count, :], all_rows[..., count:ports_end, :]
    rows, k, c, owner, inertance = elastic, springs.stiffness, springs.damping, springs.owner, springs.inertance
    if used is not None:
        which = used.nonzero()[0]
        if closed:
            nonzero = np.asarray(elastic.any(axis=1)).nonzero()[0]
            which, elastic = which.take(nonzero), elastic.take(nonzero, axis=0)
        rows, k, c, owner = elastic, k.take(which, axis=-1), c.take(which, axis=-1), owner.take(which)
        inertance = None if inertance is None else inertance.take(which)
        if scene.port.needs_elements:  # nothing else needs more of the elements
            springs = springs.take(which)
    if inertance is not None:
        inertial = np.asarray(inertance.any(axis=tuple(range(inertance.ndim - 1))))
        others = (~inertial).nonzero()[0]
        rows, k, c, owner = rows[..., others, :], k[..., others], c[..., others], owner[others]
    if scene.shared is not None:
        base = all_rows[..., ports_end:, :]
        factor = scene.shared.inertia_rows(factor, base)
        rows, k, c, owner = scene.shared.elastic_rows(base, rows, k, c, owner)
    of_ports: Any = port_matrices(scene.port, port_rows, springs, elastic, scene.inertia, factor, scene.position,
                                  scene.shared)  # fmt: skip
    if scene.port.motion_forces:
        of_ports["D"] = feedthrough_of_motions(scene.port, scene.springs, of_ports["D"])
    if inertance is not None:  # these rows are zero in a motion with the ground
        added = np.sqrt(inertance[..., inertial])[..., None] * elastic[..., inertial, :]
        factor = concatenated((factor, added), -2)
    return Terms(
        gram_matrix(factor), weighted_gram(rows, c), weighted_gram(rows, k), **of_ports,
        inertia_factor=factor, elastic_rows=rows, row_stiffness=k, row_damping=c, row_owner=owner, body_motion=motion,
    )  # fmt: skip


@fast_init
@dataclass(frozen=True, repr=False, eq=False)
class Matrices:
    """Matrices and factors of M q'' + C q' + K q = B u, y = Cq q + Cv q' + Ca q'' + D u, described in ``Equations``.

    In many variants arrays may have an axis of variants in front.
    """

    _engine = "body_motion elastic_rows inertia_factor null_inertia row_damping row_owner row_stiffness"

    M: Array
    """Mass matrix (m, m), symmetric [kg, kg m, kg m^2]."""
    C: Array
    """Damping matrix (m, m) [N s/m, N s, N m s]; not the output matrix, which is ``state_space().C``."""
    K: Array
    """Stiffness matrix (m, m) with the geometric stiffness of loads [N/m, N, N m]."""
    B: Array
    """Generalized forces by a unit of each input (m, inputs)."""
    Cq: Array
    """Outputs by the coordinates (outputs, m)."""
    Cv: Array
    """Outputs by the rates of the coordinates (outputs, m)."""
    Ca: Array
    """Outputs by the accelerations of the coordinates (outputs, m)."""
    D: Array
    """Outputs by the inputs directly (outputs, inputs)."""
    inertia_factor: Array
    """W (6 bodies, m) of M = W^T W."""
    elastic_rows: Array
    """D (rows, m): relative displacements in springs and dampers by the coordinates, K = D^T diag(k) D."""
    row_stiffness: Array
    """Stiffness k of each elastic row (rows,) [N/m, N m/rad]."""
    row_damping: Array
    """Damping c of each elastic row (rows,) [N s/m, N m s/rad]."""
    row_owner: Index
    """Number of the spring-damper of each elastic row (rows,)."""
    body_motion: Array
    """Displacements of the bodies by the coordinates (bodies, 6, m), world axes."""
    gyroscopic: Array | None = None
    """Antisymmetric part of C from spinning bodies and cross-coupling (m, m), None without."""
    circulatory: Array | None = None
    """Antisymmetric part of K from follower loads, rotating dampers and cross-coupling (m, m), None without."""
    massless: int = 0
    """Number of motions that move dampers but no mass: one state each in place of two."""
    null_inertia: Array | None = None
    """These motions (m, massless), None without."""

    @property
    def mass(self) -> Array:
        """The mass matrix M (m, m) by its other name, in a batch (variants, m, m)."""
        return self.M

    @property
    def damping(self) -> Array:
        """The damping matrix C (m, m) by its other name, in a batch (variants, m, m); the output matrix of first-order
        equations is ``state_space().C``.
        """
        return self.C

    @property
    def stiffness(self) -> Array:
        """The stiffness matrix K (m, m) by its other name, in a batch (variants, m, m)."""
        return self.K


_NAMES = tuple([item.name for item in fields(Matrices)])
MATRICES = _NAMES[: _NAMES.index("inertia_factor")]
# Number of axes of each term of a single system; in many variants there may be one more in front.
AXES = dict.fromkeys(_NAMES, 2) | {"row_stiffness": 1, "row_damping": 1, "row_owner": 1, "body_motion": 3}
# Arrays that equations without spin, follower loads, cross-coupling and massless motions lack.
OPTIONAL = ("gyroscopic", "circulatory", "null_inertia")


@fast_init
@dataclass(frozen=True, repr=False, eq=False)
class Terms(Matrices):
    """Matrices and factors during the assembly."""

    def named(self) -> dict[str, Any]:
        """Return all terms by their names."""
        return dict(vars(self))

    def of_variants(self, which: Any) -> Terms:
        """Return the terms of one variant, or of some; arrays that are constant stay as they are.

        ``which``: an index or a mask along the axis of variants.
        """
        return Terms(**{key: array[which] if isinstance(array, np.ndarray) and array.ndim > AXES[key] else array
                        for key, array in self.named().items()})  # fmt: skip

    def with_rows(self, rows: Array, stiffness: Array, owner: Index, matrix: Array | None = None) -> Terms:
        """Return the terms with more rows of stiffness without damping, K + D^T diag(k) D.

        ``rows`` (..., rows, m): rows in minimal coordinates. ``stiffness`` (..., rows): signed values. ``owner``
        (rows,): numbers of their owners. ``matrix`` (..., m, m): their product, if known with fewer rounding errors.
        """
        added = weighted_gram(rows, stiffness) if matrix is None else matrix
        return replace(
            self, K=self.K + 0.5 * (added + added.swapaxes(-1, -2)),
            elastic_rows=concatenated((self.elastic_rows, rows), -2),
            row_stiffness=concatenated((self.row_stiffness, stiffness), -1),
            row_damping=concatenated((self.row_damping, np.zeros(stiffness.shape[-1])), -1),
            row_owner=np.concatenate((self.row_owner, owner)),
        )  # fmt: skip

    def with_antisymmetric(self, gyroscopic: Array | None, circulatory: Array | None) -> Terms:
        """Return the terms with antisymmetric matrices (m, m) or None added to C and to K."""
        result = self
        if gyroscopic is not None:
            before = 0.0 if self.gyroscopic is None else self.gyroscopic
            result = replace(result, gyroscopic=before + gyroscopic, C=self.C + gyroscopic)
        if circulatory is not None:
            before = 0.0 if self.circulatory is None else self.circulatory
            result = replace(result, circulatory=before + circulatory, K=self.K + circulatory)
        return result
