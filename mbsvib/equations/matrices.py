"""Matrices of a mechanism and their factors, from its rows."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from mbsvib.common.fast_init import fast_init
from mbsvib.equations.ports import feedthrough_of_motions, port_matrices
from mbsvib.equations.terms import Terms
from mbsvib.kinematics.body_motion import body_motion
from mbsvib.linalg.products import concatenated, gram_matrix, weighted_gram

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from mbsvib.common.arrays import Array
    from mbsvib.equations.scene import Scene
    from mbsvib.kinematics.loops import Reduction
    from mbsvib.kinematics.relative_motion import Triplets


@fast_init
@dataclass(frozen=True, slots=True)
class MinimalRows:
    """What geometry alone gives in minimal coordinates: the ``motion`` (..., bodies, 6, m) of the bodies, and ``rows``
    (..., rows, m) of elements (those that are ``used``, None: all), ports, and base rows of shared mass and stiffness.
    """

    motion: Array
    rows: Array
    used: NDArray[np.bool_] | None = None


def minimal_rows(
    scene: Scene, relative: Triplets, reduction: Reduction, used: NDArray[np.bool_] | None = None
) -> MinimalRows:
    """Return the rows of a scene in minimal coordinates.

    ``relative``: its relative displacements. ``used`` (elastic rows,): those to take; default: all, also zero ones.
    """
    locked, count = scene.locked, len(scene.springs.owner)
    motion = reduction.apply_to_bodies(body_motion(scene.coordinates, scene.position))
    # elastic rows, those of ports, and base rows of shared mass and stiffness
    end = count + len(scene.port.rows.first) if scene.shared is None else relative.shape[0] - locked
    mask = None
    if used is not None:
        mask, count = np.empty(end, dtype=bool), int(np.count_nonzero(used))
        mask[: len(used)], mask[len(used) :] = used, True
    return MinimalRows(motion, reduction.apply_exactly(relative.dense(locked, locked + end, mask), count), used)


def matrices(scene: Scene, minimal: MinimalRows, closed: bool) -> Terms:
    """Return the matrices of a mechanism and their factors.

    Parameters
    ----------
    scene : Scene
        The arrays of the mechanism.
    minimal : MinimalRows
        Its rows in minimal coordinates.
    closed : bool
        Whether it has loops, so that elastic rows may be zero; among rows that are ``used`` these are left out.

    Returns
    -------
    Terms
        M, C, K, B, Cq, Cv, Ca, D, the factors of M, K and C, and the motion of the bodies.
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
        inertial = np.asarray(inertance.reshape(-1, inertance.shape[-1]).any(axis=0))
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
