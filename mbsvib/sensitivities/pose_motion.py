"""How the pose of a loaded scene gives way to parameters, along its coordinates: dq/dp = K^-1 dR/dp."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from mbsvib.linalg.rank import CANCELLED, ZERO_STIFFNESS, ZERO_UNHELD_FORCE
from mbsvib.linalg.vectors import inverse_root

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray
    from scipy.sparse import csr_array

    from mbsvib.common.arrays import Array
    from mbsvib.sensitivities.loaded_network import LoadedNetwork

    # Of forces f, torques t and T / L (n, 1), and of the relative shifts v and turns w (n, m) that they see.
    Sizes = tuple[Array, Array, Array, Array, Array]


def pose_motion(loaded: LoadedNetwork, rates: csr_array | None) -> tuple[Array, NDArray[np.bool_]]:
    """Return the motion of the pose by which it gives way to variables, and which of them load a motion that no
    stiffness holds.

    The motion (variables, c) is along the coordinates, then along the other motions, of which each variable has its own
    or none; the mask is (variables,). ``rates`` (variables, parameters): how variables move parameters; None: variables
    are the parameters.
    """
    count, m = loaded.changes.count, loaded.dof
    direct = loaded.generalized_force_jacobian[:count]
    forces = direct if rates is None else rates @ direct
    of_openings = np.eye(len(forces), loaded.motions.shape[2] - m)
    if of_openings.size:
        forces = forces + loaded.parameter_rates[:, m:].T @ direct + loaded.generalized_force_jacobian[count + m :]
    # K but for couplers of several rotations of one joint, which go by small rotations in each pose anew
    stiffness = -(loaded.parameter_rates[:, :m].T @ direct + loaded.generalized_force_jacobian[count : count + m]).T
    unit = inverse_root(np.abs(np.diagonal(stiffness)) + loaded.size_of_forces / loaded.steps)

    def terms() -> Array:
        # forces that all but vanish at rest are rounding of those that cancel
        size = _term_sizes(loaded, _sizes(loaded)) + CANCELLED / ZERO_UNHELD_FORCE * loaded.size_of_forces
        return size if rates is None else np.asarray(abs(rates) @ size)

    motion, unresisted = balancing_motion(stiffness, unit, forces, terms, loaded.relaxing)
    return np.concatenate((motion, of_openings), axis=1), unresisted


def balancing_motion(
    stiffness: Array, unit: Array, forces: Array, terms: Callable[[], Array], relaxing: NDArray[np.bool_] | None = None
) -> tuple[Array, NDArray[np.bool_]]:
    """Return the smallest motions x (v, m) that balance forces, K x = f, and which forces (v,) act on a motion that no
    stiffness holds.

    Where several motions do, as some motion is held by nothing, the others are x + N c with K N = 0. ``stiffness``
    (m, m): K. ``unit`` (m,): one over the root of what the stiffness along each coordinate is measured by. ``forces``
    (v, m): f, one row after the other. ``terms``: returns the sizes (v, m) of the products that the forces are sums of,
    asked for where some motion is held by nothing. ``relaxing`` (m,): coordinates that do not count in the size of a
    motion, as they only follow others.
    """
    left, sizes, right = np.linalg.svd(unit[:, None] * stiffness * unit)
    holds = sizes > ZERO_STIFFNESS
    along = (forces * unit) @ left
    motion = (along[:, holds] / sizes[holds]) @ right[holds]
    if holds.all():
        return unit * motion, np.zeros(len(forces), dtype=bool)
    if relaxing is not None and relaxing.any():
        free, counts = right[~holds], ~relaxing
        motion = motion - np.linalg.lstsq(free[:, counts].T, motion[:, counts].T)[0].T @ free
    over = np.abs(along[:, ~holds] @ left[:, ~holds].T)
    size = terms() @ unit + np.abs(forces * unit).max(axis=1)
    return unit * motion, (over > ZERO_UNHELD_FORCE * size[:, None]).any(axis=1)


def _sizes(loaded: LoadedNetwork) -> Sizes:
    """Sizes of forces and of what they see of motions along the coordinates."""
    forces = loaded.forces
    relative = forces.relative_motions(loaded.motions[:, :, : loaded.dof])[1]
    v, w = np.linalg.norm(relative[:, :3], axis=1), np.linalg.norm(relative[:, 3:], axis=1)
    f, t = (np.linalg.norm(part, axis=1)[:, None] for part in (forces.wrench[:, :3], forces.wrench[:, 3:]))
    return f, t, np.abs(forces.tension_over_length)[:, None], v, w


def _term_sizes(loaded: LoadedNetwork, sizes: Sizes) -> Array:
    """Sizes (parameters, m) of the products whose sums are the derivatives of the forces along the coordinates."""
    forces, at = loaded.forces, loaded.changes.at
    (f, t, tension_over_length, v, w), joints = sizes, forces.counts[0]
    rows = np.zeros((at.size, v.shape[1]))
    rows[at.point] = (f * w + tension_over_length * v).repeat(3, axis=0)
    rows[at.start] = (tension_over_length * v)[forces.lines].repeat(3, axis=0)
    both = np.stack((v, w), axis=1)[joints:].repeat(3, axis=1)
    rows[at.wrench] = both.reshape(6 * len(both), v.shape[1])
    result: Array = abs(loaded.changes.matrix) @ rows
    turned = f * v + t * w
    of = {"orientation": turned, "pitch": f * w}
    for group in loaded.groups:
        if group.kind == "joint":
            size = of.get(group.field, f * w + turned / forces.length[:, None])[group.number]
            result[group.rows] += size[:, None]
    return result
