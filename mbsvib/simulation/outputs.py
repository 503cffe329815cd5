"""Outputs of a run: displacements, velocities, accelerations, forces and strains, since the pose as described."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import casadi as ca
import numpy as np

from mbsvib.common.arrays import Array
from mbsvib.elements.beam import Beam
from mbsvib.elements.beam_expansion import elements
from mbsvib.elements.families import EXPANSIONS
from mbsvib.elements.motion_input import acting_inputs
from mbsvib.elements.ports import ForceOutput, Output
from mbsvib.elements.strain_output import StrainOutput, expand
from mbsvib.finite_motion.connections import change
from mbsvib.finite_motion.elastic import strain_of_slopes
from mbsvib.finite_motion.elastic_block import ElasticBlock, node_row, point_as_described
from mbsvib.finite_motion.forces import angular_momentum, moved_end_force, relative_motion
from mbsvib.finite_motion.frames import Expression, logarithm, rate_in_motion
from mbsvib.finite_motion.lagrange import FiniteMotion
from mbsvib.mechanism.mechanism import GROUND, Mechanism
from mbsvib.simulation.reactions import ReactionOutputs, is_reaction, reaction_outputs
from mbsvib.simulation.states import continued


def beam_of(model: Mechanism, element: str | None) -> Any:
    """Return the beam that has an element of this name, or None."""
    return next((part for part in model.composed.values() if element in part.element_names), None)


def strain(part: StrainOutput, beam: Beam, statement: FiniteMotion) -> Expression:
    """Return a strain of a beam, a relative displacement of two nodes in the axes of the body that carries it."""
    measured = expand(part, {beam.name: beam}).outputs[part.name]
    block = _block(beam, statement)
    row = _relative(block, (measured.relative_to, measured.body), measured.position or (0.0, 0.0, 0.0), measured.wrench)
    i = beam.element_names.index(part.element)
    return _along(row[None], block, statement) + _by_slopes(i, block, statement) / beam.lengths()[i]


def element_force(part: ForceOutput, beam: Beam, statement: FiniteMotion) -> Expression:
    """Return the force in a beam element at its midpoint, along its axes; positive where it pulls its ends together."""
    i = beam.element_names.index(part.element)
    block, (_, spring) = _block(beam, statement), elements(beam)[i]
    axes, ends = np.array(spring.orientation), (spring.first, spring.second)
    directions = [(*axes[:, k], 0.0, 0.0, 0.0) for k in range(3)] + [(0.0, 0.0, 0.0, *axes[:, k]) for k in range(3)]
    rows = np.array([_relative(block, ends, spring.position, direction) for direction in directions])
    deformation = _along(rows, block, statement)
    deformation[0] += _by_slopes(i, block, statement)
    stiffness, damping = (ca.SX(np.array(part.wrench) * np.array(values)) for values in (spring.stiffness,
                                                                                         spring.damping))  # fmt: skip
    return ca.dot(stiffness, deformation) + ca.dot(damping, statement.motion.rate(deformation))


def _block(beam: Beam, statement: FiniteMotion) -> ElasticBlock:
    return next(block for block in statement.blocks if block.name == beam.name)


def _relative(
    block: ElasticBlock, ends: tuple[str, str], point: tuple[float, ...], direction: tuple[float, ...]
) -> Array:
    """The row on x of the displacement of the second end against the first."""
    first, second = (node_row(block, body, point, direction) for body in ends)
    return second - first


def _by_slopes(i: int, block: ElasticBlock, statement: FiniteMotion) -> Expression:
    """What slopes add to the change of length of element i since as described [m]."""
    if block.bending is None:
        return ca.SX(0.0)
    b, z = statement.motion.elastic[block.name]
    now, described = (strain_of_slopes(block.bending, block, both) for both in (
        ca.vertcat(z, b), ca.SX.zeros(block.span.shape[1])))  # fmt: skip
    return now[i] - described[i]


def _along(rows: Array, block: ElasticBlock, statement: FiniteMotion) -> Expression:
    b, z = statement.motion.elastic[block.name]
    return ca.sparsify(ca.SX(rows @ block.span)) @ ca.vertcat(z, b)


# Where the force of an element stands among the six of its axes.
ABOUT_Z, ALONG_Z = 5, 2


@dataclass(frozen=True)
class Measured:
    """Outputs as functions (q, q', q'', y, bases, u) -> (values, rotation vectors, angular velocities, rates).

    ``weights`` (outputs, 3) are those of the rotation vectors. ``reactions`` are the outputs that are forces in joints
    or on the ground, and not among ``names``. ``refused`` tells why outputs have no value, and ``needs_accelerations``
    whether q'' has an effect. ``all_names`` are all outputs that have values, in the order of the model.
    """

    all_names: tuple[str, ...]
    names: tuple[str, ...]
    weights: Array
    function: Any
    reactions: ReactionOutputs | None
    refused: Mapping[str, str]
    needs_accelerations: bool

    @property
    def turns(self) -> bool:
        """Whether an output is a rotation, whose whole turns are counted."""
        return any(weight.any() for weight in self.weights)

    def values(self, time: Array, arguments: tuple[Array, ...]) -> tuple[dict[str, Array], dict[str, Array]]:
        """Return all outputs and their rates by name, (samples,) each.

        ``arguments`` are those of the function, (n, samples) each. The rates of accelerations and forces are not
        told; they are NaN.
        """
        values, vectors, spins, rates = (np.asarray(array) for array in self.function(*arguments))
        result, slope = {}, {}
        for i, name in enumerate(self.names):
            result[name] = values[i]
            if self.weights[i].any():
                rows = slice(3 * i, 3 * i + 3)
                result[name] = values[i] + continued(vectors[rows].T, spins[rows].T, time) @ self.weights[i]
            slope[name] = rates[i]
        if self.reactions is not None:
            forces = self.reactions.values(arguments)
            result |= forces
            slope |= {name: np.full(len(time), np.nan) for name in forces}
        return {name: result[name] for name in self.all_names}, slope


@dataclass(frozen=True)
class _Signal:
    """An output: its value and rate, and where it has a rotation, the weight (3,) of its vector and its velocity."""

    value: Expression
    rate: Expression = field(default_factory=lambda: ca.SX(np.nan))
    vector: Expression = field(default_factory=lambda: ca.SX.zeros(3))
    spin: Expression = field(default_factory=lambda: ca.SX.zeros(3))
    weight: Array = field(default_factory=lambda: np.zeros(3))


def measured(model: Mechanism, statement: FiniteMotion) -> Measured:
    """Return the outputs of a model."""
    motion = statement.motion
    state = _State(model, statement, ca.SX.sym("qdd", len(motion.names)), ca.SX.sym("u", len(statement.inputs)))
    signals: dict[str, _Signal] = {}
    refused: dict[str, str] = {}
    reaction_forces: dict[str, ForceOutput] = {}
    base = any(part.moves_ground for part in model.inputs.values())
    outputs: Mapping[str, Any] = model.outputs
    for name, part in outputs.items():
        beam = beam_of(model, part.element)
        if part.law is not None:
            value = change(part, motion)
            signals[name] = _Signal(value, motion.rate(value))
        elif type(part) in EXPANSIONS and beam is not None:
            value = strain(part, beam, statement)
            signals[name] = _Signal(value, motion.rate(value))
        elif type(part) in EXPANSIONS:
            refused[name] = f"output '{name}': a {part.family} has no statement in finite motion yet"
        elif part.element is None and part.inertial and base and part.quantity != "acceleration":
            refused[name] = (f"output '{name}': an absolute {part.quantity} would integrate the acceleration of the "
                             f"ground; ask for absolute=False")  # fmt: skip
        elif part.element is None:
            signals[name] = _motion(part, state)
        elif is_reaction(model, part):
            reaction_forces[name] = part
        elif beam is not None:
            signals[name] = _Signal(element_force(part, beam, statement))
        elif part.element in statement.connections:
            signals[name] = _Signal(_in_element(part, state))
        elif part.element in model.bodies and not model.composed:
            signals[name] = _Signal(_on_body(part, state))
        else:
            refused[name] = (f"output '{name}': a run tells no forces in superelements, and no sums of forces on "
                             f"bodies of models with beams or superelements")  # fmt: skip
    reactions = None
    if reaction_forces:
        dropped = [name for name in model.loads if name not in statement.loads]
        reactions, undetermined = reaction_outputs(model, statement, reaction_forces, dropped)
        refused |= {name: f"output '{name}': redundant joints leave this force undetermined; a bushing in place of one "
                          f"of them determines it" for name in undetermined}  # fmt: skip
    names = tuple([name for name in model.outputs if name not in refused])
    return _measured(names, signals, state, reactions, refused)


def cut_coordinates(model: Mechanism, statement: FiniteMotion) -> Measured:
    """Return the coordinates of joints at which loops are cut."""
    motion = statement.motion
    state = _State(model, statement, ca.SX.sym("qdd", len(motion.names)), ca.SX.sym("u", len(statement.inputs)))
    signals = {}
    for name, value in motion.cut.items():
        rate = motion.rate(value)
        signals[name] = _Signal(value, rate)
        if name.rpartition(".")[2][0] == "r":  # whole turns are counted
            vector, spin = ca.vertcat(value, 0.0, 0.0), ca.vertcat(rate, 0.0, 0.0)
            signals[name] = _Signal(ca.SX(0.0), rate, vector, spin, np.eye(3)[0])
    return _measured(tuple(signals), signals, state, None, {})


def _measured(
    all_names: tuple[str, ...], signals: Mapping[str, _Signal], state: _State, reactions: ReactionOutputs | None,
    refused: Mapping[str, str],
) -> Measured:  # fmt: skip
    statement = state.statement
    motion = statement.motion
    values = ca.vertcat(*(signal.value for signal in signals.values()))
    rates = ca.vertcat(*(signal.rate for signal in signals.values()))
    function = ca.Function("outputs", [motion.q, motion.qd, state.qdd, statement.yields, motion.bases, state.u], [
        values, ca.vertcat(*(signal.vector for signal in signals.values())),
        ca.vertcat(*(signal.spin for signal in signals.values())), rates])  # fmt: skip
    accelerated = reactions is not None or bool(ca.depends_on(ca.vertcat(values, rates), state.qdd))
    weights = np.array([signal.weight for signal in signals.values()]).reshape(-1, 3)
    return Measured(all_names, tuple(signals), weights, function, reactions, refused, accelerated)


@dataclass(frozen=True)
class _State:
    """What outputs are functions of: the statement's symbols, q'' and u."""

    model: Mechanism
    statement: FiniteMotion
    qdd: Expression
    u: Expression

    def onward(self, expression: Expression) -> Expression:
        """The rate of an expression of q and q'."""
        return rate_in_motion(expression, self.statement.motion.q, self.statement.motion.qd, self.qdd)

    @property
    def ground(self) -> Expression:
        """The acceleration (3,) of the ground."""
        base = {name: part for name, part in self.model.inputs.items() if part.moves_ground}
        return sum((self.u[i] * ca.SX(np.array(base[name].wrench[:3]))
                    for i, name in enumerate(self.statement.inputs) if name in base), ca.SX.zeros(3))  # fmt: skip


def _motion(part: Output, state: _State) -> _Signal:
    """A displacement, velocity or acceleration of a point against another body."""
    motion = state.statement.motion
    point = ca.SX(_centre(part.body, state) if part.position is None else np.array(part.position))
    away, relative, spin = relative_motion(part, point, motion)
    wrench = np.array(part.wrench)
    along = ca.SX(wrench[:3])
    speed = ca.dot(along, relative) + ca.dot(ca.SX(wrench[3:]), spin)
    if part.quantity == "velocity":
        return _Signal(speed, state.onward(speed))
    if part.quantity == "acceleration":
        ground = ca.dot(along, state.ground) if part.inertial else 0.0
        return _Signal(state.onward(speed) + ground)
    value = ca.dot(along, away)
    if not wrench[3:].any():
        return _Signal(value, speed)
    turn = motion.frames[part.relative_to].rotation.T @ motion.frames[part.body].rotation
    return _Signal(value, speed, logarithm(turn), spin, wrench[3:])


def _centre(body: str, state: _State) -> Array:
    """The centre of mass of a body, or the point of a node of a beam or superelement, as described; 0 of the ground."""
    if body in state.model.bodies:
        return np.array(state.model.bodies[body].position)
    for block in state.statement.blocks:
        if body in block.nodes:
            return point_as_described(block, block.nodes.index(body))
        if body == block.root and body != GROUND:
            return np.asarray(block.points[0])
    return np.zeros(3)


def _on_body(part: ForceOutput, state: _State) -> Expression:
    """The sum of all forces on a body along a direction: the rate of its momentum, moments about its centre."""
    motion, body = state.statement.motion, state.model.bodies[part.element]
    momentum = body.mass * motion.rate(motion.point(body.name, motion.numbers.vector(body, "position")))
    spin = angular_momentum(body, state.model.rotors, motion)
    wrench = ca.SX(np.array(part.wrench))
    rate = ca.vertcat(state.onward(momentum) + body.mass * state.ground, state.onward(spin))
    return ca.dot(wrench, rate)


def _in_element(part: ForceOutput, state: _State) -> Expression:
    """The force in an element along a direction of its axes, less that in the pose as described."""
    statement = state.statement
    element, connection = state.model.springs[part.element], statement.connections[part.element]
    force = connection.force
    if element.inertance:
        force = element.inertance * state.onward(statement.motion.rate(connection.deformation))
    wrench = ca.SX(np.array(part.wrench))
    axial = ALONG_Z if element.acts_along_line else ABOUT_Z
    along = ca.dot(wrench if force.numel() == 6 else wrench[axial], force)
    if element.inertance:
        return along
    q, qd, y = statement.motion.q, statement.motion.qd, statement.yields
    rest = ca.Function("rest", [q, qd, y, statement.motion.bases], [along])
    along -= float(rest(np.zeros(q.shape), np.zeros(qd.shape), np.zeros(y.shape), statement.motion.no_turns))
    for name, source in acting_inputs(state.model.inputs, state.model.springs).items():
        if source.element == part.element and name in statement.inputs:
            moved = moved_end_force(source, connection) * state.u[list(statement.inputs).index(name)]
            along -= ca.dot(wrench if force.numel() == 6 else wrench[axial], moved)
    return along
