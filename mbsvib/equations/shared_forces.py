"""What beams and reduced models do to the bodies that they share: inertia, stiffness and damping as wrenches."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from mbsvib.equations.wrench_pairs import Pairs, spread

if TYPE_CHECKING:
    from mbsvib.common.arrays import Array
    from mbsvib.equations.scene import Scene
    from mbsvib.kinematics.loops import Reduction
    from mbsvib.kinematics.relative_motion import Triplets
    from mbsvib.kinematics.shared_rows import Composite


def shared_wrenches(
    scene: Scene, relative: Triplets, reduction: Reduction, position: Array
) -> tuple[Array, Array, Array, Array]:
    """Return the wrenches on bodies of rows that more than two bodies share, per unit of q, q', q'' and inputs.

    Parameters
    ----------
    scene : Scene
        The mechanism in numbers.
    relative : Triplets
        Its relative displacements.
    reduction : Reduction
        Its minimal coordinates.
    position : array, shape (3, bodies + 1)
        Centres of mass and the origin [m].

    Returns
    -------
    tuple of four arrays, shape (6, bodies + 1, m) and (6, bodies + 1, inputs)
        Those of stiffness, damping, inertia and base motion, zero where nothing is shared.
    """
    bodies, m = position.shape[1], len(reduction.independent)
    elastic, damping, inertia = (np.zeros((6, bodies, m)) for _ in range(3))
    base = np.zeros((6, bodies, len(scene.port.input_units)))
    shared = scene.shared
    if shared is None:
        return elastic, damping, inertia, base
    start = scene.locked + len(scene.springs.owner) + len(scene.port.rows.first)
    moved = reduction.apply(relative.dense(start, relative.shape[0]))
    count = 0
    if shared.mass is not None:
        count = len(shared.mass.rows.first)
        inertia -= _of_masses(shared.mass, shared.mass.of(moved[:count]), position)
        for column, source in scene.port.base_motions:
            wrench = np.array(source.wrench)
            carried = shared.mass.carried(wrench[:3], wrench[3:], np.array(source.position))
            base[:, :, column] -= _of_masses(shared.mass, carried, position)[:, :, 0]
    if shared.elastic is not None:
        rows = shared.elastic.composite.of(moved[count:])
        elastic -= _on_bodies(shared.elastic.composite, shared.elastic.stiffness[:, None] * rows, position)
        damping -= _on_bodies(shared.elastic.composite, shared.elastic.damping[:, None] * rows, position)
    return elastic, damping, inertia, base


def _on_bodies(composite: Composite, forces: Array, position: Array) -> Array:
    """Wrenches (6, bodies + 1, n) of forces (rows, n) along composite rows; none on internal coordinates."""
    rows = composite.rows
    each = Pairs(rows.first, rows.second, rows.point, rows.point, rows.force, rows.moment)
    result: Array = np.einsum("cbr,rn->cbn", spread(each, position), composite.back(forces) * composite.rides[:, None])
    return result


def _of_masses(composite: Composite, forces: Array, position: Array) -> Array:
    """Wrenches (6, bodies + 1, n) of forces (rows, n) along rows of masses, which move against inertial space: of the
    ground those of nodes that it holds.
    """
    result, rows = _on_bodies(composite, forces, position), composite.rows
    held = rows.second == position.shape[1] - 1
    point, force, moment = (array[:, held] for array in (rows.point, rows.force, rows.moment))
    wrench = np.concatenate((force, moment + np.cross(point, force, axis=0)))
    result[:, -1] = wrench @ (composite.back(forces) * composite.rides[:, None])[held]
    return result
