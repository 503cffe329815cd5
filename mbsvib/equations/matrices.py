"""Matrices of a mechanism and their factors, from its rows."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from mbsvib.equations.ports import port_matrices
from mbsvib.equations.terms import Terms
from mbsvib.kinematics.body_motion import body_motion
from mbsvib.linalg.products import gram_matrix, weighted_gram

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from mbsvib.equations.scene import Scene
    from mbsvib.kinematics.loops import Reduction
    from mbsvib.kinematics.relative_motion import Triplets


def matrices(
    scene: Scene, relative: Triplets, reduction: Reduction, acting: NDArray[np.bool_] | None = None
) -> Terms:
    """Return the matrices of a mechanism and their factors.

    Parameters
    ----------
    scene : Scene
        The mechanism in numbers.
    relative : Triplets
        Its relative displacements.
    reduction : Reduction
        Its minimal coordinates.
    acting : array, shape (elastic rows,), optional
        Elastic rows that are to be kept, less those that loops hold still; default: all, whether they move or not.

    Returns
    -------
    Terms
        M, C, K, B, Cq, Cv, Ca, D, the factors of M, K and C, and the motion of the bodies.
    """
    springs, locked, felt = scene.springs, scene.locked, len(scene.springs.owner)
    motion = reduction.apply_to_bodies(body_motion(scene.coordinates, scene.position))
    factor = scene.inertia.factor(motion)
    # elastic rows, those of ports and, where more than two bodies share mass or springs, the base rows of these
    end = felt + len(scene.port.rows.first) if scene.shared is None else relative.shape[0] - locked
    keep = None
    if acting is not None:
        keep, felt = np.empty(end, dtype=bool), int(np.count_nonzero(acting))
        keep[: len(acting)], keep[len(acting) :] = acting, True
    every = reduction.apply_exactly(relative.dense(locked, locked + end, keep), felt)
    ports_end = felt + len(scene.port.rows.first)
    elastic, seen = every[..., :felt, :], every[..., felt:ports_end, :]
    if acting is not None:
        kept = acting.nonzero()[0]
        if reduction.matrix is not None:
            moves = np.asarray(elastic.any(axis=1)).nonzero()[0]
            kept, elastic = kept.take(moves), elastic.take(moves, axis=0)
        springs = springs.take(kept)
    rows, k, c, owner = elastic, springs.stiffness, springs.damping, springs.owner
    if springs.inertance is not None:
        others = (springs.inertance == 0.0).nonzero()[0]
        rows, k, c, owner = rows[others], k[others], c[others], owner[others]
    if scene.shared is not None:
        base = every[..., ports_end:, :]
        factor = scene.shared.inertia_rows(factor, base)
        rows, k, c, owner = scene.shared.elastic_rows(base, rows, k, c, owner)
    seen_by_ports: Any = port_matrices(scene.port, seen, springs, elastic, scene.inertia, factor, scene.position,
                                       scene.shared)  # fmt: skip
    if springs.inertance is not None:  # no moving ground carries these rows along
        inertial = springs.inertance.nonzero()[0]
        factor = np.concatenate((factor, np.sqrt(springs.inertance[inertial])[:, None] * elastic[inertial]))
    return Terms(
        gram_matrix(factor), weighted_gram(rows, c), weighted_gram(rows, k), **seen_by_ports,
        inertia_factor=factor, elastic_rows=rows, row_stiffness=k, row_damping=c, row_owner=owner, body_motion=motion,
    )  # fmt: skip
