"""Stiffness of follower loads and torques, whose work depends on the path of the motion.

In coordinates (u, theta) of the exponential map a force f and a torque t about the centre of mass, which rotate with
the body, have the tangent [[0, [f]x], [0, 1/2 [t]x]]; that of a torque fixed in the world is -1/2 [t]x. The symmetric
part of f is a product of rows, 1/2 u . (f x theta); the antisymmetric part is the circulatory matrix N.

Source: Ziegler, Principles of Structural Stability (1968), for circulatory forces and torques.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from mbsvib.elements.contribution import Contribution, Weights, displacement_rows, rotation_rows
from mbsvib.elements.rows import Rows
from mbsvib.equations.second_order_rows import normals
from mbsvib.kinematics.mobility import crossed_product

if TYPE_CHECKING:
    from mbsvib.common.arrays import Array
    from mbsvib.equations.wrenches import AppliedWrenches

_AXES = np.eye(3)
# The pairs (i, j) of directions and their signs in v_i [f]x_ij w_j
_PAIRS = ((0, 1, 2, -1.0), (0, 2, 1, 1.0), (1, 0, 2, 1.0), (1, 2, 0, -1.0), (2, 0, 1, -1.0), (2, 1, 0, 1.0))


def load_stiffness(applied: AppliedWrenches, position: Array) -> Contribution | None:
    """Return the stiffness of follower loads and torques, or None if there are none.

    ``position`` (3, bodies + 1): centres of mass [m].
    """
    parts = [_of_load(applied, position, k) for k in range(applied.loads)
             if applied.follower[k] or applied.pairs.torque[:, k].any()]  # fmt: skip
    return Contribution.join(parts) if parts else None


def _of_load(applied: AppliedWrenches, position: Array, k: int) -> Contribution:
    """Rows u, theta of its body along the world axes (6), and for a follower force across its line (4)."""
    ground, body, follower = position.shape[1] - 1, int(applied.pairs.second[k]), bool(applied.follower[k])
    force, torque, center = applied.pairs.force[:, k], applied.pairs.torque[:, k], position[:, [body]]
    along, size = _AXES, float(np.linalg.norm(force)) if follower else 0.0
    if size > 0.0:
        along = np.concatenate((_AXES, np.stack(normals(force / size), axis=1)), axis=1)
    count = along.shape[1]  # rows: u along x, y, z and the two normals of the force, then theta likewise
    entries: list[tuple[int, int, float]] = []
    products: list[tuple[int, int, float]] = []
    if size > 0.0:
        torque = torque + crossed_product(applied.pairs.end[:, k] - center[:, 0], force)
        entries += [(i, count + j, 0.5 * sign * force[c]) for i, j, c, sign in _PAIRS]
        products += [(4, count + 3, 0.5 * size), (3, count + 4, -0.5 * size)]
    half = 0.5 if follower else -0.5
    entries += [(count + i, count + j, half * sign * torque[c]) for i, j, c, sign in _PAIRS if i < j]
    bodies = np.full(count, body)
    rows = Rows.join([displacement_rows(bodies, along, np.repeat(center, count, axis=1), ground),
                      rotation_rows(bodies, along, ground)])  # fmt: skip
    return Contribution.of(rows, stiffness=_weights(products, k), circulatory=_weights(entries, k))


def _weights(entries: list[tuple[int, int, float]], owner: int) -> Weights:
    used = [entry for entry in entries if entry[2] != 0.0]
    first, second = (np.array([entry[i] for entry in used], dtype=np.intp) for i in (0, 1))
    return Weights(first, second, np.array([entry[2] for entry in used]), np.full(len(used), owner, dtype=np.intp))
