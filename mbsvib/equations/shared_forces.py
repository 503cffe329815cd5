"""Wrenches of beams and reduced models on their bodies, by stiffness, damping and inertia."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from mbsvib.equations.wrench_pairs import unit_wrenches

if TYPE_CHECKING:
    from mbsvib.common.arrays import Array
    from mbsvib.equations.scene import Scene
    from mbsvib.kinematics.loops import Reduction
    from mbsvib.kinematics.relative_motion import Triplets
    from mbsvib.kinematics.shared_rows import Composite


def shared_wrenches(
    scene: Scene, relative: Triplets, reduction: Reduction, position: Array
) -> tuple[Array, Array, Array, Array]:
    """Return the wrenches of shared rows on bodies, per unit of q, q', q'' and inputs.

    ``position`` (3, bodies + 1): centres of mass and the origin [m]. Returns wrenches (6, bodies + 1, m) of
    stiffness, damping and inertia, and (6, bodies + 1, inputs) of base motion, zero without shared rows.
    """
    bodies, m = position.shape[1], len(reduction.independent)
    elastic, damping, inertia = (np.zeros((6, bodies, m)) for _ in range(3))
    base = np.zeros((6, bodies, len(scene.port.input_units)))
    shared = scene.shared
    if shared is None:
        return elastic, damping, inertia, base
    start = scene.locked + len(scene.springs.owner) + len(scene.port.rows.first)
    base_rows = reduction.apply(relative.dense(start, relative.shape[0]))
    count = 0
    if shared.mass is not None:
        count = len(shared.mass.rows.first)
        inertia -= _of_masses(shared.mass, shared.mass.of(base_rows[:count]), position)
        for column, source in scene.port.base_motions:
            wrench = np.array(source.wrench)
            ground_motion = shared.mass.of_ground_motion(wrench[:3], wrench[3:], np.array(source.position))
            base[:, :, column] -= _of_masses(shared.mass, ground_motion, position)[:, :, 0]
    if shared.elastic is not None:
        rows = shared.elastic.composite.of(base_rows[count:])
        elastic -= _on_bodies(shared.elastic.composite, shared.elastic.stiffness[:, None] * rows, position)
        damping -= _on_bodies(shared.elastic.composite, shared.elastic.damping[:, None] * rows, position)
    return elastic, damping, inertia, base


def _on_bodies(composite: Composite, forces: Array, position: Array) -> Array:
    """Wrenches (6, bodies + 1, n) of forces (rows, n) along composite rows; none on internal coordinates."""
    along_rows = composite.back(forces) * composite.moves_with_ground[:, None]
    return np.asarray(np.einsum("cbr,rn->cbn", unit_wrenches(composite.rows, position), along_rows))


def _of_masses(composite: Composite, forces: Array, position: Array) -> Array:
    """Wrenches (6, bodies + 1, n) of forces (rows, n) along mass rows; those on the ground are at its nodes."""
    result, rows = _on_bodies(composite, forces, position), composite.rows
    on_ground = rows.second == position.shape[1] - 1
    point, force, moment = (array[:, on_ground] for array in (rows.point, rows.force, rows.moment))
    wrench = np.concatenate((force, moment + np.cross(point, force, axis=0)))
    result[:, -1] = wrench @ (composite.back(forces) * composite.moves_with_ground[:, None])[on_ground]
    return result
