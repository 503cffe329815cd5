"""Inverse dynamics of a mechanism over a prescribed motion, loops included."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import TypeVar

import casadi as ca
import numpy as np

from mbsvib.common.arrays import Array
from mbsvib.cycles.expressions import Statement
from mbsvib.cycles.machine import Machine
from mbsvib.cycles.result import CycleData
from mbsvib.finite_motion.elastic_block import point_as_described
from mbsvib.finite_motion.evaluation import evaluated
from mbsvib.finite_motion.excited import with_interfaces
from mbsvib.finite_motion.forces import velocity
from mbsvib.finite_motion.frames import Expression

C = TypeVar("C", bound=CycleData)


def inverse_dynamics(plant: Machine, kind: type[C]) -> C:
    """Return the inverse dynamics over the motion of a machine.

    tau = (dq/dq_i)^T (M q'' - f),  F = -sum of m a,  M_O = -sum of (r - O) x m a + I alpha + w x I w
    """
    motion, expressions = plant.solved, plant.statement
    places, kinematics = _places(expressions), expressions.motion.motion
    function = expressions.compiled("dynamics", lambda: _outputs(expressions))
    required, force, moment, at, axes, rates, accelerations = evaluated(
        function, motion.q, motion.qd, motion.qdd, plant.values(expressions), plant.about)  # fmt: skip
    n, bodies = len(motion.q), plant.model.bodies
    described = np.array([bodies[name].orientation if name in bodies else np.eye(3) for name in places])
    turned = axes.reshape(n, 3, len(places), 3).transpose(2, 0, 1, 3) @ described[:, None]
    torques = np.einsum("snm,sn->sm", motion.coefficients, required)
    by_body = (at.reshape(n, -1, 3), rates.reshape(n, -1, 6), accelerations.reshape(n, -1, 6))
    positions, velocities, body_accelerations = (
        {name: _fixed(array[:, i]) for i, name in enumerate(places)} for array in by_body)  # fmt: skip
    tree = {name: i for i, name in enumerate(kinematics.names)}
    return kind(
        plant, plant.motion.names, _columns(tree, motion.q), _columns(tree, motion.qd), _columns(tree, motion.qdd),
        positions, {name: _fixed(turned[i]) for i, name in enumerate(places)}, velocities, body_accelerations,
        {name: _fixed(torques[:, i]) for i, name in enumerate(plant.motion.names)}, _fixed(force), _fixed(moment),
        _fixed(plant.about),
    )  # fmt: skip


def _outputs(expressions: Statement) -> list[Expression]:
    """Generalized forces, shaking force and moment; places, rotations, twists and their rates of bodies and nodes."""
    statement, places = expressions.motion, _places(expressions)
    kinematics = replace(statement.motion, frames=statement.frames)
    centres = [kinematics.point(name, point) for name, point in places.items()]
    twists = [ca.vertcat(*velocity(kinematics, name, point)) for name, point in places.items()]
    return [
        expressions.required, expressions.force, expressions.moment, ca.vertcat(*centres),
        ca.horzcat(*(kinematics.frames[name].rotation for name in places)), ca.vertcat(*twists),
        ca.vertcat(*map(expressions.rate, twists)),
    ]  # fmt: skip


def _places(expressions: Statement) -> dict[str, Expression]:
    """Centres of mass of bodies, and nodes of beams and superelements, by name, as described."""
    blocks, numbers = expressions.motion.blocks, expressions.motion.motion.numbers
    bodies = with_interfaces(expressions.model, blocks).bodies
    nodes = {name: ca.SX(point_as_described(block, k)) for block in blocks for k, name in enumerate(block.nodes)}
    return nodes | {name: numbers.vector(body, "position") for name, body in bodies.items()}


def _columns(tree: Mapping[str, int], array: Array) -> dict[str, Array]:
    return {name: _fixed(array[:, i]) for name, i in tree.items()}


def _fixed(array: Array) -> Array:
    result = np.array(array)
    result.flags.writeable = False
    return result
