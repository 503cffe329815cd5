"""A mechanism with its prescribed motion, and that of all its coordinates: loops followed on the branch of the
described pose, rates and accelerations.
"""

from __future__ import annotations

import warnings
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields, replace
from functools import cached_property
from typing import Any

import casadi as ca
import numpy as np
from numpy.typing import ArrayLike

from mbsvib.common import arguments as check
from mbsvib.common.arrays import Array, Index
from mbsvib.cycles.expressions import Statement, statement
from mbsvib.cycles.prescribed import Prescribed, prescribed
from mbsvib.elements.bushing import LARGEST_ANGLE
from mbsvib.errors import ModelError, NearSingularWarning, SingularPoseError
from mbsvib.finite_motion.elastic_block import elastic_blocks
from mbsvib.finite_motion.evaluation import Called, evaluated, matrices
from mbsvib.finite_motion.excited import with_interfaces
from mbsvib.finite_motion.loops import DrivenLoops, Loops, straight_way
from mbsvib.kinematics.pose import length_of
from mbsvib.linalg.dead_points import is_unknown
from mbsvib.linalg.rank import EPS, NEAR_SINGULAR, RANK_FACTOR, REDUNDANT_LOOPS
from mbsvib.mechanism.mechanism import Mechanism
from mbsvib.mechanism.topology import cut_elsewhere
from mbsvib.mechanism.unit_warnings import TURNS_OF_CYCLES, with_angles

# Loops count as closed when they are open by less than this [rad, mechanism sizes]: a thousandth of what results are
# promised to.
ACCEPTED = 1e-12
# Frames from the warning up to the call of the user.
USER = 8
# A generic neighbour of the described pose, to tell a singular pose from a freedom that no drive has.
NEARBY = 0.03


def followed(loops: DrivenLoops, motion: Prescribed) -> Array:
    """Return the tree coordinates (samples, n) [rad, m] at every sample."""
    pose, depends = np.zeros(len(loops.names)), loops.dependent
    _check_mobility(loops, motion)
    result: Array = np.zeros((len(motion.values), len(pose)))
    if not len(depends):
        result[:, loops.driven] = motion.values
        return result
    least, where, matrix = np.inf, 0, loops.jacobian(pose)
    for i, target in enumerate(motion.values):
        start = pose[loops.driven]
        (pose, matrix), done = loops.followed((pose, matrix), target)
        if done < 1.0:
            raise _singular(loops, motion, start + done * (target - start), matrix)
        result[i] = pose
        smallest = loops.smallest(matrix)
        if is_unknown(smallest, loops.closed):
            raise _singular(loops, motion, target, matrix)
        if smallest < least:
            least, where = smallest, i
    if least < NEAR_SINGULAR:
        warnings.warn(f"cycle: at {motion.words(motion.values[where])} the mechanism is near a singular pose (smallest "
                      f"singular value of its loops {least:.1e}); rates and forces lose as many digits there.",
                      NearSingularWarning, stacklevel=USER)  # fmt: skip
    return result


def _check_mobility(loops: DrivenLoops, motion: Prescribed) -> None:
    """Refuse drives that do not move the mechanism, or do not determine its motion."""
    matrix = loops.jacobian(np.zeros(len(loops.names)))
    if not len(matrix) and not len(loops.dependent):
        return
    undriven = _undetermined(loops, matrix)
    if undriven:
        generic = _neighbour(loops)
        if generic is not None and not _undetermined(loops, generic):
            raise _singular(loops, motion, np.zeros(len(motion.names)), matrix)
        raise ModelError(
            f"cycle: the drive {_several(motion.names)} does not determine the motion of {_several(undriven)}; drive "
            f"{'that' if len(undriven) == 1 else 'one of these'} too by motion={{...}}, lock it by another joint, or "
            f"make a ball joint universal.",
            element=undriven[0], field="drive",
        )  # fmt: skip
    motions = _motions(matrix)[loops.driven]
    for name, row in zip(motion.names, motions, strict=True):
        if np.linalg.norm(row) < REDUNDANT_LOOPS:
            raise ModelError(f"cycle: the drive '{name}' does not move the mechanism: its loops hold that coordinate. "
                             f"Drive one of {', '.join(_moving(loops, matrix)) or 'none, it is fully locked'}.",
                             element=name, field="drive")  # fmt: skip
    rank = np.linalg.matrix_rank(motions, tol=REDUNDANT_LOOPS)
    if rank < len(motion.names):
        raise ModelError(
            f"cycle: the loops tie the drives {_several(motion.names)} to each other: the mechanism has {rank} degrees "
            f"of freedom for {len(motion.names)} drives; leave out {len(motion.names) - rank}.",
            element=motion.names[-1], field="motion",
        )  # fmt: skip


def _motions(matrix: Array) -> Array:
    """Basis (n, dof) of the motions that loops allow."""
    if not len(matrix):
        return np.eye(matrix.shape[1])
    _, values, v = np.linalg.svd(matrix, full_matrices=True)
    rank = int((values > REDUNDANT_LOOPS * max(1.0, float(values.max(initial=0.0)))).sum())
    return np.asarray(v[rank:].T)


def _moving(loops: DrivenLoops, matrix: Array) -> list[str]:
    """Coordinates that move in some motion that changes none of the rows."""
    motions = _motions(matrix)
    return [name for name, row in zip(loops.names, motions, strict=True) if np.linalg.norm(row) > REDUNDANT_LOOPS]


def _undetermined(loops: DrivenLoops, matrix: Array) -> list[str]:
    """Coordinates that move while the driven ones stand still."""
    return _moving(loops, np.vstack([matrix, np.eye(len(loops.names))[loops.driven]]))


def _neighbour(loops: DrivenLoops) -> Array | None:
    """The derivative of the openings at a generic pose near the described one, where loops close; None: not found."""
    scale = loops.loops.coordinate_scale
    trial = NEARBY * scale * np.random.default_rng(0).uniform(-1.0, 1.0, len(scale))
    q, opening = loops.loops.projected(trial, loops.bases)
    return loops.jacobian(q) if opening < ACCEPTED and np.abs(q / scale).max() > 1e-3 * NEARBY else None


def _several(names: Sequence[str]) -> str:
    quoted = [f"'{name}'" for name in names[:6]]
    return ", ".join(quoted) + (", ..." if len(names) > 6 else "")


def _singular(loops: DrivenLoops, motion: Prescribed, values: Array, matrix: Array) -> SingularPoseError:
    return SingularPoseError(
        f"cycle: at {motion.words(values)} the mechanism is in a singular pose (dead centre), and the drive "
        f"{_several(motion.names)} does not lead it through: '{loops.loose(matrix)}' could move by itself. Stay short "
        f"of it, or drive another coordinate."
    )  # fmt: skip


@dataclass(frozen=True)
class Machine:
    """A mechanism with its prescribed motion, the point ``about`` (3,) of moments, ``cut`` joints and ``size`` [m].

    ``farthest`` [m] is the largest coordinate of any point.

    ``compiled`` are its equations, or those of a like machine with other values of its parameters, and ``known`` its
    motion, if a like machine moves alike; default: none yet. ``period`` [s]: of machines with beams, that over which
    the samples are spread.
    """

    model: Mechanism
    motion: Prescribed
    about: Array
    cut: tuple[str, ...]
    size: float
    farthest: float
    compiled: Statement | None = None
    known: Solved | None = None
    period: float | None = None

    def __getstate__(self) -> dict[str, Any]:
        """Return all but its equations, which pickle cannot hold, and are made again when they are asked for."""
        kept = {field.name: getattr(self, field.name) for field in fields(self)}
        return kept | {"compiled": None, "known": vars(self).get("solved", self.known)}

    @property
    def rounding(self) -> float:
        """How far loops may be open as points are rounded relative to the origin, in units of ``size``."""
        return float(RANK_FACTOR * EPS * max(1.0, self.farthest / self.size))

    @cached_property
    def statement(self) -> Statement:
        """Its equations."""
        return statement(self.model, self.cut) if self.compiled is None else self.compiled

    def values(self, expressions: Statement) -> Array:
        """Return the values of the parameters of its equations."""
        known = self.model.parameters
        return np.array([float(known[name]) for name in expressions.names])

    def with_symbols(self, parameters: tuple[str, ...]) -> Statement:
        """Return its equations with at least these numbers as symbols."""
        if set(parameters) <= set(self.statement.names):
            return self.statement
        return statement(self.model, self.cut, parameters)

    @cached_property
    def solved(self) -> Solved:
        """Coordinates, rates and accelerations at every sample."""
        return solved(self, self.statement) if self.known is None else self.known

    def moves_alike(self, other: Machine) -> bool:
        """Whether another machine with the same equations and drives has the same motion, as loops close alike."""
        closing = self.statement.closing
        if self.statement.elastic:
            return False
        return bool((self.values(self.statement)[closing] == other.values(self.statement)[closing]).all())


@dataclass(frozen=True)
class Solved:
    """Tree coordinates ``q``, rates ``qd`` and accelerations ``qdd`` (samples, n), and kinematic ``coefficients``
    (samples, n, m), the derivatives of q to the driven coordinates, which are at ``driven`` (m,).
    """

    q: Array
    qd: Array
    qdd: Array
    coefficients: Array
    driven: Index


def machine(
    model: Mechanism, drive: Any, angles: Any, speed: Any, motion: Mapping[str, Any] | None, about: ArrayLike | None,
    like: Machine | None = None,
) -> Machine:  # fmt: skip
    """Return a mechanism with its prescribed motion, checked.

    ``like`` is a machine with the same motion of its drives that differs by values of symbols only, whose equations
    serve again; the other arguments are those of ``Model.cycle``.
    """
    prescription = prescribed(model, drive, angles, speed, motion)
    model = with_angles(model, dict(zip(prescription.names, prescription.values.T, strict=True)), TURNS_OF_CYCLES)
    coupled = {name.rpartition(".")[0] for part in model.couplers.values() for name, _ in part.terms}
    blocks = elastic_blocks(model)
    links = {name for block in blocks for name in block.joints}
    jointed = with_interfaces(model, blocks)
    cut, closing = cut_elsewhere(jointed, {*prescription.joints, *coupled, *links})
    while closing in links:  # of frames of beams, whose links make up loops
        links.remove(closing)
        cut, closing = cut_elsewhere(jointed, {*prescription.joints, *coupled, *links})
    if closing is not None:
        raise ModelError(f"cycle: all joints of the loop that '{closing}' closes are driven or coupled; leave one of "
                         f"them to follow from the others.", element=closing, field="motion")  # fmt: skip
    pivot = model.joints[prescription.joints[0]].position
    at = (pivot or (0.0, 0.0, 0.0)) if about is None else check.vector(about, "cycle", "about")
    points = [body.position for body in model.bodies.values()]
    points += [joint.position for joint in model.joints.values() if joint.position is not None]
    array = np.array(points)
    result = Machine(model, prescription, np.array(at), cut, length_of(array), float(np.abs(array).max()),
                   None if like is None else like.statement)  # fmt: skip
    return replace(result, known=like.solved) if like is not None and result.moves_alike(like) else result


def solved(plant: Machine, expressions: Statement) -> Solved:
    """Return coordinates, rates and accelerations at every sample.

    J_d q_d' = -J_i q_i',  J_d q_d'' = -J_i q_i'' - J' q'
    """
    kinematics, motion = expressions.motion.motion, plant.motion
    driven = np.array([kinematics.names.index(name) for name in motion.names], dtype=np.intp)
    units, row_units = kinematics.scales(plant.size)
    phi, _, phi_acceleration = expressions.closures
    position = expressions.compiled("closures", lambda: (ca.densify(phi), ca.densify(ca.jacobian(phi, expressions.q))))
    curved = expressions.compiled("bias", lambda: (phi_acceleration,))
    p, zero = plant.values(expressions), np.zeros(len(units))

    at = Called(position, zero, zero, zero, p, plant.about)
    closures = Loops(lambda q, _: at(q), units, 1.0 / row_units, len(units) - len(driven))
    loops = DrivenLoops(kinematics.names, driven, closures, max(ACCEPTED, plant.rounding),
                        kinematics.no_turns)  # fmt: skip
    q = followed(loops, motion)
    _check_angles(plant, expressions, q)
    matrix = matrices(position, q, zero, zero, p, plant.about)[1] * units / row_units[:, None]
    depends = loops.dependent
    inverse = np.linalg.pinv(matrix[:, :, depends]) if len(depends) else np.zeros((len(q), 0, len(row_units)))
    coefficients = np.zeros((len(q), len(units), len(driven)))
    coefficients[:, driven, np.arange(len(driven))] = units[driven]
    coefficients[:, depends] = -inverse @ (matrix[:, :, driven])
    coefficients = coefficients * np.where(np.isin(np.arange(len(units)), depends), units, 1.0)[:, None] / units[driven]
    qd = np.einsum("snm,sm->sn", coefficients, motion.rates)
    bias = evaluated(curved, q, qd, zero, p, plant.about)[0]
    qdd = np.einsum("snm,sm->sn", coefficients, motion.accelerations)
    qdd[:, depends] -= (inverse @ (bias / row_units)[:, :, None])[:, :, 0] * units[depends]
    return Solved(q, qd, qdd, coefficients, driven)


def _check_angles(plant: Machine, expressions: Statement, q: Array) -> None:
    """Refuse springs that the motion q (samples, n) from the described pose on turns beyond where moments are defined.
    """
    angles = {name: part.angle for name, part in expressions.motion.connections.items() if part.angle is not None}
    if not angles:
        return
    kinematics = expressions.motion.motion
    way = np.concatenate((np.zeros((1, q.shape[1])), q))
    poses = np.concatenate([straight_way(a, b, kinematics.turns) for a, b in zip(way[:-1], q, strict=True)])
    function = expressions.compiled("angles", lambda: (ca.vertcat(*angles.values()),))
    zero = np.zeros(q.shape[1])
    beyond = np.argwhere(~(evaluated(function, poses, zero, zero, plant.values(expressions), plant.about)[0]
                           <= LARGEST_ANGLE))  # fmt: skip
    if len(beyond):
        at, which = beyond[0]
        name = list(angles)[which]
        driven = poses[at][[kinematics.names.index(drive) for drive in plant.motion.names]]
        raise ModelError(f"cycle: at {plant.motion.words(driven)} '{name}' is turned so far from the pose as described "
                         f"that its moment is no longer defined (limit {np.degrees(LARGEST_ANGLE):.0f} degrees). "
                         f"Describe the model in the middle of the motion, or ask for less of it.",
                         element=name, field="motion")  # fmt: skip
