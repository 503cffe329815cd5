"""Statics: whether a pose is balanced, and the forces in joints.

Source: principle of virtual work; Haug, Computer Aided Kinematics and Dynamics of Mechanical Systems (1989), chapter 6.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np

from mbsvib.common.arguments import DIRECTIONS
from mbsvib.errors import EquilibriumError
from mbsvib.linalg.rank import BALANCE, POSITION_ROUNDING

if TYPE_CHECKING:
    from collections.abc import Mapping

    from numpy.typing import NDArray

    from mbsvib.common.arrays import Array
    from mbsvib.elements import Joint
    from mbsvib.equations.reactions import Reactions
    from mbsvib.equations.scene import Scene
    from mbsvib.equations.self_stress import Undetermined
    from mbsvib.equations.wrench_pairs import WrenchPairs
    from mbsvib.equations.wrenches import AppliedWrenches
    from mbsvib.kinematics.loops import Reduction
    from mbsvib.mechanism.topology import Topology

# Lever arms smaller than this share of the largest coordinate are taken for rounding of points.
LEAST_LEVER = POSITION_ROUNDING / BALANCE


@dataclass(frozen=True)
class Statics:
    """The forces at the pose: the ``applied`` wrenches, and those in joints by ``reactions``, both computed when asked.

    ``geometry`` are all pairs of wrenches, the applied ones, then those in joints, whose sizes are not there yet;
    ``tree_wrenches`` (6, joints, 1) are those of joints of the open tree, ``multipliers`` (locked rows, 1) those of the
    loops. ``position`` (3, bodies + 1) are the centres of mass. ``residual`` (m,) is the unbalanced force along each
    coordinate, ``size`` (m,) that of the forces that should cancel. ``owners`` are the names of all pairs.
    """

    applied: AppliedWrenches
    reactions: Reactions
    geometry: WrenchPairs
    tree_wrenches: Array
    multipliers: Array
    position: Array
    residual: Array
    size: Array
    owners: tuple[str, ...]

    @cached_property
    def joints(self) -> Array:
        """Wrenches (6, joints) in the joints on their second bodies."""
        return self.reactions.with_loops(self.tree_wrenches, self.multipliers)[:, :, 0]

    @cached_property
    def pairs(self) -> WrenchPairs:
        """The applied wrenches, then those in joints."""
        pairs, joints = self.applied.pairs, self.joints
        return replace(self.geometry, force=np.concatenate((pairs.force, joints[:3]), axis=1),
                       torque=np.concatenate((pairs.torque, joints[3:]), axis=1))  # fmt: skip

    @property
    def undetermined(self) -> tuple[Undetermined, ...]:
        """Forces in joints that redundant constraints do not determine."""
        names = self.owners[len(self.applied.names) :]
        return tuple([stress.undetermined(names, {}) for stress in self.reactions.stress])

    @property
    def imbalance(self) -> float:
        """The largest unbalanced share of the forces along a coordinate."""
        return float(shares(self.residual, self.size).max(initial=0.0))


def balance(wrench: Array, size: Array, motion: Array, reach: float) -> tuple[Array, Array]:
    """Return the forces along the minimal coordinates and the size of the forces that should cancel there.

    ``wrench`` (..., 6, bodies): forces and moments about the centres of mass [N, N m]. ``size`` (..., 2, bodies): sizes
    of the forces and of the moments that add up to them. ``motion`` (..., bodies, 6, m): motion of the bodies.
    ``reach``: largest coordinate of a point [m]. Returns ``residual, size`` (..., m): B''^T B'^T W, and the same with
    the lengths of all vectors [N or N m], or with the rounding of points as lever arm, or that of the motion, if that
    is larger: the lever arm of a weight about an axis through the centre of mass is only rounding.
    """
    *lead, bodies, _, m = motion.shape
    vectors = motion.reshape(*lead, 2 * bodies, 3, m)
    lengths = np.sqrt(np.einsum("...bcm,...bcm->...bm", vectors, vectors))
    translation, rotation = lengths[..., ::2, :], lengths[..., 1::2, :]
    # bodies that move by rounding of what the others move, as loops let one move alone
    moved = size @ ((translation > 0.0) | (rotation > 0.0))
    largest = np.stack((translation.max(axis=-2, initial=0.0), rotation.max(axis=-2, initial=0.0)), axis=-2)
    of_points = (size[..., :1, :] @ rotation)[..., 0, :]
    rounding_size = LEAST_LEVER * np.maximum(reach * of_points, (moved * largest).sum(axis=-2))
    total = np.maximum(_dot(size, lengths), rounding_size)
    return _dot(wrench, motion.reshape(*lead, 6 * bodies, m)), total


def _dot(vectors: Array, rows: Array) -> Array:
    """Sums (..., m) over bodies of their vectors (..., c, bodies) times rows (..., c bodies, m), body by body."""
    flat = vectors.swapaxes(-1, -2).reshape(*vectors.shape[:-2], 1, rows.shape[-2])
    return np.asarray((flat @ rows)[..., 0, :])


def rounding(stiffness: Array, position: Array, turns: NDArray[np.bool_]) -> Array:
    """Return the forces due to rounding of the pose along the minimal coordinates.

    ``stiffness`` (m, m): K of the springs. ``position`` (bodies, 3): centres of mass [m], whose size is that of the
    mechanism. ``turns`` (m,): which coordinates are rotations. Returns (m,): forces [N or N m].
    """
    result: Array = POSITION_ROUNDING * np.abs(stiffness) @ np.where(turns, 1.0, np.abs(position).max())
    return result


def check_balance(
    residual: Array, size: Array, stiffness: Array, scene: Scene, reduction: Reduction, model: str
) -> None:
    """Refuse a pose that is not in balance, by body, direction and missing force.

    ``residual``, ``size`` (m,): forces along the minimal coordinates and their sizes. ``stiffness`` (m, m): K of the
    springs.
    """
    off = (np.abs(residual) > BALANCE * size).nonzero()[0]
    if not len(off):
        return
    turns = scene.coordinates.turns[reduction.independent]
    off = off[np.abs(residual[off]) > (BALANCE * size + rounding(stiffness, scene.position, turns))[off]]
    if not len(off):
        return
    share = shares(residual, size)
    worst = int(off[np.argmax(share[off])])
    more = "" if len(off) == 1 else f" {len(off) - 1} more of the coordinates are off balance too."
    name = scene.coordinates.names[int(reduction.independent[worst])]
    missing = -float(residual[worst])
    raise unbalanced(model, name, bool(turns[worst]), missing, float(share[worst]), scene.topology, more)


def shares(residual: Array, size: Array) -> Array:
    """Return the sizes (m,) of residuals as shares of the forces that should cancel."""
    return np.asarray(np.abs(residual / np.where(size > 0.0, size, 1.0)))


def unbalanced(
    model: str, coordinate: str, turns: bool, missing: float, share: float, topology: Topology, more: str = ""
) -> EquilibriumError:
    """Return the error of a pose that is not in balance, by body, direction and missing force [N or N m].

    ``share`` is that of the forces that should cancel, ``more`` a sentence on other coordinates.
    """
    joints = {part.name: part for part in topology.joints}
    text, details = unbalanced_in_words(coordinate, turns, missing, share, joints)
    free = "" if coordinate.rpartition(".")[0] in joints else \
        f" No joint leads from body '{details['body']}' to the ground: join them if it should not move freely."
    return EquilibriumError(
        f"model '{model}' is not in balance in the given pose: {text}; allowed {BALANCE:g}).{more}{free} Find the pose "
        f"with model.equilibrium(), or hold it with a load or a preload of a spring.", **details,
    )  # fmt: skip


def unbalanced_in_words(
    coordinate: str, turns: bool, missing: float, share: float, joints: Mapping[str, Joint]
) -> tuple[str, dict[str, Any]]:
    """Return an unbalanced force in words, without the last bracket, and the fields of an ``EquilibriumError``."""
    kind, unit = ("moment", "N m") if turns else ("force", "N")
    owner, _, direction = coordinate.rpartition(".")
    joint = joints.get(owner)
    body = owner if joint is None else joint.first if joint.second == "ground" else joint.second
    where = f"{'along' if direction in DIRECTIONS[:3] else 'about'} {direction[-1:]}"
    if joint is not None and "." not in owner:  # those of nodes are no joints of the user
        where += f" of joint '{owner}' (coordinate '{coordinate}')"
    text = (f"unbalanced {kind} on body '{body}', {missing:.6g} {unit} missing {where} ({share:.1e} of the forces that "
            f"should cancel there")  # fmt: skip
    return text, {"body": body, "coordinate": coordinate, "missing": missing, "unit": unit}
