"""Statics: whether a pose is balanced, and the forces in joints.

Source: principle of virtual work; Haug, Computer Aided Kinematics and Dynamics of Mechanical Systems (1989), chapter 6.

Wrenches in all joints follow by their work along virtual motions that release them.

With the potentials V of all applied forces and Phi the locked rows of the cut joints, over the joint coordinates and
over virtual motions v of the joints, balance and the wrenches w on the second bodies are

    Phi^T lambda = -dV/dq  in the dependent coordinates,    w . v = (dV/dv + Phi_v^T lambda) . v

With redundant constraints lambda is not unique; the wrenches of least norm that balance the bodies are taken
(``self_stress``). The second-order terms do not depend on this choice.

Source: Haug, Computer Aided Kinematics and Dynamics of Mechanical Systems (1989), section 6.6.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from mbsvib.common.arguments import DIRECTIONS
from mbsvib.common.arrays import Array, Bools
from mbsvib.core.geometric_stiffness import TwistsAt
from mbsvib.elements import Joint
from mbsvib.equations.load_stiffness import LoadedPairs
from mbsvib.equations.scene import Scene
from mbsvib.equations.self_stress import SelfStress, Undetermined, of_loops
from mbsvib.equations.virtual_motions import Kept, VirtualMotions, joint_ends, joint_points, opened, virtual_motions
from mbsvib.equations.wrenches import AppliedWrenches, WrenchPairs
from mbsvib.errors import EquilibriumError
from mbsvib.kinematics.loops import Reduction
from mbsvib.linalg.rank import BALANCE, POSITION_ROUNDING
from mbsvib.linalg.rotations import components_first
from mbsvib.mechanism.topology import Topology

# Lever arms smaller than this share of the largest coordinate are taken for rounding of points.
LEAST_LEVER = POSITION_ROUNDING / BALANCE


@dataclass(frozen=True)
class Statics:
    """The forces at the pose: the ``applied`` wrenches, and those in joints by ``reactions`` of the ``loaded`` pairs
    and the ``multipliers`` (locked rows,) of the loops, computed when asked.

    ``residual`` (m,) is the unbalanced force along each coordinate, ``size`` (m,) that of the forces that should
    cancel.
    """

    applied: AppliedWrenches
    reactions: Reactions
    loaded: LoadedPairs
    multipliers: Array
    residual: Array
    size: Array

    @property
    def topology(self) -> Topology:
        """The tree of the mechanism."""
        return self.reactions.scene.topology

    @property
    def owners(self) -> tuple[str, ...]:
        """Names of all pairs, the applied ones, then the joints."""
        return (*self.applied.names, *[joint.name for joint in self.topology.joints])

    @cached_property
    def position(self) -> Array:
        """Centres of mass (3, bodies + 1) [m], the origin for ground."""
        return self.reactions.scene.centres.T

    @cached_property
    def joints(self) -> Array:
        """Wrenches (6, joints) in the joints on their second bodies."""
        return self.reactions.wrenches(self.loaded, self.multipliers)

    @cached_property
    def pairs(self) -> WrenchPairs:
        """The applied wrenches, then those in joints."""
        first, second, start, end, _ = joint_ends(self.topology, self.position)
        joints = WrenchPairs(first, second, start, end, self.joints[:3], self.joints[3:])
        return WrenchPairs.join(self.applied.pairs, joints)

    @property
    def undetermined(self) -> tuple[Undetermined, ...]:
        """Forces in joints that redundant constraints do not determine."""
        names = self.owners[len(self.applied.names) :]
        return tuple([stress.undetermined(names, {}) for stress in self.reactions.stress])

    @property
    def imbalance(self) -> float:
        """The largest unbalanced share of the forces along a coordinate."""
        return float(shares(self.residual, self.size).max(initial=0.0))


def forces_along(scene: Scene, motion: Array) -> tuple[Array, Array]:
    """Return the forces along minimal coordinates and the size of those that should cancel there, (..., m) each.

    ``motion`` (..., bodies, 6, m): motion of the bodies.
    """
    assert scene.loads is not None
    applied, known = scene.loads
    if "on_bodies" not in known:  # of a single model they are kept with its loads
        known["on_bodies"] = applied.on_bodies(components_first(scene.centres))
    wrench, sizes = known["on_bodies"]
    points = (applied.pairs.start, scene.position, scene.coordinates.point)
    reach = max([float(np.abs(array).max(initial=0.0)) for array in points])
    return balance(wrench[..., :-1], sizes[..., :-1], motion, reach)


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


def rounding(stiffness: Array, position: Array, turns: Bools) -> Array:
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


@dataclass(frozen=True)
class Reactions:
    """The wrenches in all joints of a ``scene``, with the locked rows ``phi`` (..., locked rows, n) and the ``kept``
    rows and dependent coordinates of its loops; ``fixed`` are the points of joints as in ``joint_points``. Forces are
    at the joints' points and moments about them, in world axes, as they act on the second bodies; first bodies take
    the opposite.
    """

    scene: Scene
    reduction: Reduction
    phi: Array
    kept: Kept
    fixed: Mapping[int, Array]

    @cached_property
    def motions(self) -> VirtualMotions:
        """Six virtual motions of each joint, in world axes."""
        joints = self.scene.topology.joints
        world = {joint.name: np.eye(3) for joint in joints}
        every = range(len(joints))
        return virtual_motions(self.scene, every, world, joint_points(self.scene, every, self.fixed))

    @cached_property
    def of_rows(self) -> Array:
        """The wrenches (..., 6, joints, locked rows) in all joints per unit of each multiplier."""
        phi_v = opened(self.scene, self.motions)
        *lead, rows, _ = phi_v.shape
        return np.moveaxis(phi_v.reshape(*lead, rows, len(self.scene.topology.joints), 6), (-3, -1), (-1, -3))

    @cached_property
    def stress(self) -> tuple[SelfStress, ...]:
        """States of self-stress of redundant constraints."""
        if not any(group.surplus for group in self.reduction.groups):
            return ()
        point = self.motions.point[..., ::6].swapaxes(-1, -2)
        return tuple(of_loops(self.scene, self.reduction, self.phi, self.kept, self.of_rows, point))

    def wrenches(self, loaded: LoadedPairs, multipliers: Array) -> Array:
        """Return the wrenches (..., 6, joints), of least norm, of pairs and ``multipliers`` (..., locked rows)."""
        result = self.with_loops(loaded, multipliers)
        for stress in self.stress:
            result = stress.minimum_norm(result)
        return result[..., 0]

    def with_loops(self, loaded: LoadedPairs, multipliers: Array) -> Array:
        """Return the wrenches (..., 6, joints, 1) of applied pairs and of these ``multipliers`` (..., locked rows)."""
        pairs, motions = loaded.pairs, self.motions
        virtual = TwistsAt(motions.six[..., :3, :], motions.six[..., 3:, :], motions.point, motions.twists.path)
        along = virtual.motion(pairs.first, pairs.second, pairs.point)
        gradient = np.einsum("...ip,...ipk->...k", pairs.wrench, along)
        wrench = gradient.reshape(*gradient.shape[:-1], -1, 6).swapaxes(-1, -2)[..., None]
        return np.asarray(wrench + self.of_rows @ multipliers[..., None, :, None])


def loop_multipliers(reduction: Reduction, kept: Kept, phi: Array, gradient: Array) -> Array:
    """Return lambda (..., locked rows) with Phi^T lambda = -dV/dq in the dependent coordinates.

    ``phi`` (..., locked rows, n); ``gradient`` (..., n): dV/dq. Redundant rows have none; the stiffness of loads does
    not depend on this choice.
    """
    lead = np.broadcast_shapes(phi.shape[:-2], gradient.shape[:-1])
    result = np.zeros((*lead, phi.shape[-2]), np.result_type(phi, gradient))
    for group, (rows, dependent) in zip(reduction.groups, kept, strict=True):
        if len(dependent):
            right = -gradient[..., dependent, None]
            try:
                solution = np.linalg.solve(phi[..., rows[:, None], dependent].swapaxes(-1, -2), right)
            except np.linalg.LinAlgError:  # a variant whose rank was decided anew
                rows = group.rows
                solution = np.linalg.pinv(phi[..., rows[:, None], dependent].swapaxes(-1, -2)) @ right
            result[..., rows] = solution[..., 0]
    return result
