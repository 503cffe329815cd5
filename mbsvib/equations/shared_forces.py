"""Wrenches of the mass of beams and reduced models on their bodies."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from mbsvib.linalg.products import concatenated
from mbsvib.linalg.rotations import components_last

if TYPE_CHECKING:
    from mbsvib.common.arrays import Array
    from mbsvib.equations.scene import Scene
    from mbsvib.kinematics.loops import Reduction
    from mbsvib.kinematics.relative_motion import Triplets
    from mbsvib.kinematics.shared_rows import Composite


def shared_inertia(scene: Scene, relative: Triplets, reduction: Reduction) -> tuple[Array, Array] | None:
    """Return the wrenches of shared mass rows on bodies, per unit of q'' (..., bodies + 1, 6, m) and of inputs
    (..., bodies + 1, 6, inputs), None without such rows. Moments are about the centres of mass, the origin for ground.
    """
    mass = None if scene.shared is None else scene.shared.mass
    if mass is None:
        return None
    position = np.concatenate((scene.position, np.zeros((*scene.position.shape[:-2], 1, 3))), axis=-2)
    start = scene.locked + len(scene.springs.owner) + len(scene.port.rows.first)
    base_rows = reduction.apply(relative.dense(start, start + len(mass.rows.first)))
    inertia = -_of_masses(mass, mass.of(base_rows), position)
    base = np.zeros((*inertia.shape[:-1], len(scene.port.input_units)), inertia.dtype)
    for column, source in scene.port.base_motions:
        wrench = np.array(source.wrench)
        ground_motion = mass.of_ground_motion(wrench[:3], wrench[3:], np.array(source.position))
        base[..., column] -= _of_masses(mass, ground_motion, position)[..., 0]
    return inertia, base


def _of_masses(composite: Composite, forces: Array, position: Array) -> Array:
    """Wrenches (..., bodies + 1, 6, n) of forces (..., rows, n) along mass rows, none on internal coordinates; those on
    the ground are at its nodes.
    """
    rows, ground = composite.rows, position.shape[-2] - 1
    along = composite.back(forces) * composite.moves_with_ground[:, None]
    point, force, moment = (components_last(array) for array in (rows.point, rows.force, rows.moment))
    result: Array | float = 0.0
    for body, sign in ((rows.second, np.ones(len(rows.first))), (rows.first, -1.0 * (rows.first != ground))):
        wrench = concatenated((force, moment + np.cross(point - position[..., body, :], force)), -1)
        each = wrench[..., None] * along[..., None, :]
        on_body = (np.eye(ground + 1)[body] * sign[:, None]).T
        flat = on_body @ each.reshape(*each.shape[:-2], -1)
        result = result + flat.reshape(*flat.shape[:-1], *each.shape[-2:])
    return np.asarray(result)
