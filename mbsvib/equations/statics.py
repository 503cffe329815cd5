"""Statics: whether a pose is balanced, and the forces in joints.

Source: principle of virtual work; Haug, Computer Aided Kinematics and Dynamics of Mechanical Systems (1989), chapter 6.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from mbsvib.errors import EquilibriumError
from mbsvib.linalg.rank import BALANCE, POSITION_ROUNDING

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from mbsvib.common.arrays import Array
    from mbsvib.equations.scene import Scene
    from mbsvib.equations.second_order_rows import SecondOrderRows
    from mbsvib.equations.self_stress import Undetermined
    from mbsvib.equations.wrench_pairs import WrenchPairs
    from mbsvib.equations.wrenches import AppliedWrenches
    from mbsvib.kinematics.loops import Reduction
    from mbsvib.mechanism.topology import Topology

# Lever arms smaller than this share of the largest coordinate are taken for rounding of points.
LEAST_LEVER = POSITION_ROUNDING / BALANCE
_DIRECTIONS = ("x", "y", "z", "rx", "ry", "rz")


@dataclass(frozen=True, slots=True)
class Statics:
    """The forces at the pose: the ``applied`` wrenches, and the wrench ``joints`` (6, joints) on each second body.

    ``pairs`` are the applied wrenches, then those in joints; ``position`` (3, bodies + 1) the centres of mass.
    ``residual`` (m,) is the unbalanced force along each coordinate, ``size`` (m,) that of the forces that should
    cancel. ``owners`` are the names for rows of geometric stiffness: all pairs, then all bodies; ``undetermined`` are
    the forces in joints that redundant constraints do not determine.
    """

    applied: AppliedWrenches
    joints: Array
    pairs: WrenchPairs
    position: Array
    second_order: SecondOrderRows
    residual: Array
    size: Array
    owners: tuple[str, ...]
    undetermined: tuple[Undetermined, ...]

    @property
    def imbalance(self) -> float:
        """The largest unbalanced share of the forces along a coordinate."""
        share = self.residual / np.where(self.size > 0.0, self.size, 1.0)
        return float(np.abs(share).max(initial=0.0))


def balance(wrench: Array, size: Array, motion: Array, reach: float) -> tuple[Array, Array]:
    """Return the forces along the minimal coordinates and the size of the forces that should cancel there.

    Parameters
    ----------
    wrench : array, shape (6, bodies)
        Forces and moments about the centres of mass [N, N m].
    size : array, shape (2, bodies)
        Sizes of the forces and of the moments that add up to them.
    motion : array, shape (bodies, 6, m)
        Motion of the bodies.
    reach : float
        Largest coordinate of a point [m].

    Returns
    -------
    residual, size : array, shape (m,)
        B''^T B'^T W, and the same with the lengths of all vectors [N or N m], or with the rounding of points as lever
        arm if that is larger: the lever arm of a weight about an axis through the centre of mass is only rounding.
    """
    m = motion.shape[-1]
    vectors = motion.reshape(2 * len(motion), 3, m)
    lengths = np.sqrt(np.einsum("bcm,bcm->bm", vectors, vectors))
    rounding_size = LEAST_LEVER * reach * size[0].dot(lengths[1::2])
    total = np.maximum(size.T.reshape(-1).dot(lengths), rounding_size)
    return wrench.T.reshape(-1).dot(motion.reshape(6 * len(motion), m)), total


def rounding(stiffness: Array, position: Array, turns: NDArray[np.bool_]) -> Array:
    """Return the forces due to rounding of the pose along the minimal coordinates.

    Parameters
    ----------
    stiffness : array, shape (m, m)
        K of the springs.
    position : array, shape (bodies, 3)
        Centres of mass [m], whose size is that of the mechanism.
    turns : array, shape (m,)
        Which coordinates are rotations.

    Returns
    -------
    array, shape (m,)
        Forces [N or N m].
    """
    result: Array = POSITION_ROUNDING * np.abs(stiffness) @ np.where(turns, 1.0, np.abs(position).max())
    return result


def check_balance(
    residual: Array, size: Array, stiffness: Array, scene: Scene, reduction: Reduction, model: str
) -> None:
    """Refuse a pose that is not in balance, by body, direction and missing force.

    Parameters
    ----------
    residual, size : array, shape (m,)
        Forces along the minimal coordinates and their sizes.
    stiffness : array, shape (m, m)
        K of the springs.
    scene : Scene
        The mechanism, to name bodies.
    reduction : Reduction
        Its minimal coordinates.
    model : str
        Name of the model.

    Raises
    ------
    EquilibriumError
        If the residual exceeds ``BALANCE`` times the forces that should cancel and the forces due to rounding.
    """
    off = (np.abs(residual) > BALANCE * size).nonzero()[0]
    if not len(off):
        return
    turns = scene.coordinates.turns[reduction.independent]
    off = off[np.abs(residual[off]) > (BALANCE * size + rounding(stiffness, scene.position, turns))[off]]
    if not len(off):
        return
    names = [scene.coordinates.names[i] for i in reduction.independent.tolist()]
    topology, share = scene.topology, np.abs(residual) / np.where(size > 0.0, size, 1.0)
    worst = int(off[np.argmax(share[off])])
    more = "" if len(off) == 1 else f" {len(off) - 1} more of the coordinates are off balance too."
    missing = -float(residual[worst])
    raise unbalanced(model, names[worst], bool(turns[worst]), missing, float(share[worst]), topology, more)


def unbalanced(
    model: str, coordinate: str, turns: bool, missing: float, share: float, topology: Topology, more: str = ""
) -> EquilibriumError:
    """Return the error of a pose that is not in balance, by body, direction and missing force.

    Parameters
    ----------
    model : str
        Name of the model.
    coordinate : str
        The coordinate with the largest unbalanced share.
    turns : bool
        Whether it is a rotation.
    missing : float
        The missing force there [N or N m].
    share : float
        The same as a share of the forces that should cancel.
    topology : Topology
        The graph, to name the body.
    more : str
        A sentence on other coordinates.

    Returns
    -------
    EquilibriumError
        The error.
    """
    kind, unit = ("moment", "N m") if turns else ("force", "N")
    joint, _, direction = coordinate.rpartition(".")
    body, where = body_and_direction(joint, direction, topology)
    free = "" if any(part.name == joint for part in topology.joints) else \
        f" No joint leads from body '{body}' to the ground: join them if it should not move freely."
    return EquilibriumError(
        f"model '{model}' is not in balance in the given pose: unbalanced {kind} on body '{body}', {missing:.6g} "
        f"{unit} missing {where} ({share:.1e} of the forces that should cancel there; allowed {BALANCE:g}).{more}"
        f"{free} Find the pose with model.equilibrium(), or hold it with a load or a preload of a spring.",
        body=body, coordinate=coordinate, missing=missing, unit=unit,
    )  # fmt: skip


def body_and_direction(joint: str, direction: str, topology: Topology) -> tuple[str, str]:
    """Return the body that a coordinate moves, and a description of its direction."""
    preposition = "along" if direction in _DIRECTIONS[:3] else "about"
    axis = direction[-1:]
    for part in topology.joints:
        if part.name == joint:
            body = part.second if part.second != "ground" else part.first
            return body, f"{preposition} {axis} of joint '{joint}' (coordinate '{joint}.{direction}')"
    return joint, f"{preposition} {axis}"
