"""A mechanism with its prescribed motion, and that of all its coordinates: loops followed, rates and accelerations."""

from __future__ import annotations

from dataclasses import dataclass, fields, replace
from functools import cached_property
from typing import TYPE_CHECKING, Any

import casadi as ca
import numpy as np

from mbsvib.common import arguments as check
from mbsvib.cycles.expressions import Statement, statement
from mbsvib.cycles.following import ACCEPTED, followed
from mbsvib.cycles.prescribed import Prescribed, prescribed
from mbsvib.elements.bushing import LARGEST_ANGLE
from mbsvib.errors import ModelError
from mbsvib.finite_motion.elastic_block import elastic_blocks
from mbsvib.finite_motion.evaluation import Called, evaluated, matrices
from mbsvib.finite_motion.excited import with_interfaces
from mbsvib.finite_motion.following import DrivenLoops, straight_way
from mbsvib.finite_motion.loops import Loops
from mbsvib.kinematics.pose import length_of
from mbsvib.linalg.rank import EPS, RANK_FACTOR
from mbsvib.mechanism.topology import cut_elsewhere
from mbsvib.mechanism.unit_warnings import TURNS_OF_CYCLES, with_angles

if TYPE_CHECKING:
    from collections.abc import Mapping

    from numpy.typing import ArrayLike, NDArray

    from mbsvib.common.arrays import Array
    from mbsvib.mechanism.mechanism import Mechanism


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
    driven: NDArray[np.intp]


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
