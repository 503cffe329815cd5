"""Wrenches of the mass of beams and reduced models on their bodies."""

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


def shared_inertia(
    scene: Scene, relative: Triplets, reduction: Reduction, position: Array
) -> tuple[Array, Array]:
    """Return the wrenches of shared mass rows on bodies, per unit of q'' and of inputs.

    ``position`` (3, bodies + 1): centres of mass and the origin [m]. Returns wrenches (6, bodies + 1, m) of inertia,
    and (6, bodies + 1, inputs) of base motion, zero without such rows.
    """
    bodies, m = position.shape[1], len(reduction.independent)
    inertia, base = np.zeros((6, bodies, m)), np.zeros((6, bodies, len(scene.port.input_units)))
    mass = None if scene.shared is None else scene.shared.mass
    if mass is None:
        return inertia, base
    start = scene.locked + len(scene.springs.owner) + len(scene.port.rows.first)
    base_rows = reduction.apply(relative.dense(start, start + len(mass.rows.first)))
    inertia -= _of_masses(mass, mass.of(base_rows), position)
    for column, source in scene.port.base_motions:
        wrench = np.array(source.wrench)
        ground_motion = mass.of_ground_motion(wrench[:3], wrench[3:], np.array(source.position))
        base[:, :, column] -= _of_masses(mass, ground_motion, position)[:, :, 0]
    return inertia, base


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
