"""Beams and superelements within a mechanism: their interfaces as bodies, and which of their coordinates ever move."""

from __future__ import annotations

from collections.abc import Sequence

import casadi as ca
import numpy as np

from mbsvib.common.arrays import Array, Index
from mbsvib.elements.body import Body
from mbsvib.elements.joint import make as make_joint
from mbsvib.finite_motion.elastic_block import ElasticBlock, point_as_described
from mbsvib.finite_motion.lagrange import FiniteMotion
from mbsvib.linalg.groups import part_numbers
from mbsvib.mechanism.mechanism import GROUND, Mechanism

# Derivatives below this share of the largest of their kind are rounding of zeros.
ROUNDING = 1e-11
# Where derivatives are looked at: coordinates and rates of this size, in as many states.
SIZE, STATES = 0.05, 3


def with_interfaces(model: Mechanism, blocks: Sequence[ElasticBlock]) -> Mechanism:
    """Return a mechanism in which fixed joints stand for beams and superelements, from their root to their interface.

    Interface nodes are among its bodies, without mass of their own.
    """
    bodies, joints = dict(model.bodies), dict(model.joints)
    for block in blocks:
        for body, station in zip(block.bodies, block.interface, strict=True):
            x, y, z = point_as_described(block, station).tolist()
            bodies.setdefault(body, Body(body, 0.0, (0.0,) * 6, (x, y, z)))
        if block.root not in bodies and block.root != GROUND:
            x, y, z = block.points[0].tolist()
            bodies[block.root] = Body(block.root, 0.0, (0.0,) * 6, (x, y, z))
    for block in blocks:
        for name, body, station in zip(block.joints, block.bodies, block.interface, strict=True):
            point = point_as_described(block, station)
            joints[name] = make_joint(name, "fixed", block.root, body, point, None, None, None, None, None)
    return model.with_parts(bodies=bodies, joints=joints, composed={})


def touched(statement: FiniteMotion, blocks: Sequence[ElasticBlock]) -> dict[str, tuple[int, ...]]:
    """Return the directions of interface nodes that the rest of the mechanism acts on, by the names of their links.

    Links that are no coordinates of the tree are not among them. ``statement``: has all directions of all interface
    nodes as coordinates.
    """
    motion = statement.motion
    q, qd, names = motion.q, motion.qd, motion.names
    bending = {block.name for block in blocks}
    groups = statement.kinetic, statement.potential, statement.dissipation
    energies = [value for group in groups for name, value in group.items() if name not in bending]
    slopes = [ca.gradient(value, way) for value in (*energies, statement.gyroscopic) for way in (q, qd)]
    powers = [ca.gradient(value, qd) for value in (*statement.loads.values(), *statement.inputs.values())]
    frames = [ca.jacobian(motion.closures, q).T, *slopes, *powers]
    links = [joint for block in blocks for joint in block.joints if f"{joint}.x" in names]
    number_of = {joint: names.index(f"{joint}.x") for joint in links}
    function = ca.Function("touch", [q, qd, statement.yields, motion.bases, motion.numbers.symbols],
                           [ca.horzcat(*map(ca.densify, frames))])  # fmt: skip
    generator = np.random.default_rng(0)
    size = np.zeros(len(names))
    for _ in range(STATES):
        where, rates = (SIZE * generator.standard_normal(len(names)) for _ in range(2))
        values = np.abs(np.asarray(function(where, rates, 0.1 * np.ones(statement.yields.shape), motion.no_turns,
                                            _varied(statement, generator))))  # fmt: skip
        values /= np.maximum(values.max(axis=0), 1e-300)
        size = np.maximum(size, values.max(axis=1, initial=0.0))
    return {joint: tuple([d for d in range(6) if size[k + d] > ROUNDING]) for joint, k in number_of.items()}


def at_rest(statement: FiniteMotion, blocks: Sequence[ElasticBlock]) -> frozenset[str]:
    """Return modes of blocks on the ground that nothing moves, neither forces nor other coordinates."""
    motion = statement.motion
    names = motion.names
    modes = {name for block in blocks if block.root == GROUND for name in block.mode_names}
    still = [i for i, name in enumerate(names) if name in modes]
    if not still:
        return frozenset()
    bending = {name for block in blocks for name in (*block.interface_names, *block.mode_names)}
    function, moving = _terms(statement), len(names) + 1
    while len(still) < moving:  # slopes of what moves may move others, though these have no linear part in it
        moving = len(still)
        links, excited = _coupling(function, statement, still, [i for i, name in enumerate(names) if name in bending])
        part = part_numbers(links)
        alive = set(part[excited].tolist())
        still = [i for i in still if part[i] not in alive]
    return frozenset(names[i] for i in still)


def _terms(statement: FiniteMotion) -> ca.Function:
    """Mass matrix, derivatives of forces, Jacobian of closures, forces and inputs as a function of the state."""
    motion = statement.motion
    q, qd = motion.q, motion.qd
    inputs = ca.sum2(ca.fabs(statement.input_forces)) if statement.inputs else ca.DM.zeros(len(motion.names))
    requested = [statement.mass, ca.jacobian(statement.forces, q), ca.jacobian(statement.forces, qd),
                 statement.jacobian, ca.densify(statement.forces), ca.densify(inputs)]  # fmt: skip
    return ca.Function("coupling", [q, qd, statement.yields, motion.bases, motion.numbers.symbols], requested)


def _varied(statement: FiniteMotion, generator: np.random.Generator) -> Array:
    """Values of the parameters near those of the model: what acts only as one changes counts in derivatives to it."""
    values = statement.motion.numbers.values
    return np.asarray(values + SIZE * np.where(values == 0.0, 1.0, values) * generator.standard_normal(len(values)))


def _coupling(
    function: ca.Function, statement: FiniteMotion, movable: list[int], bending: list[int]
) -> tuple[Array, Index]:
    """Which coordinates (n, n) act on one another, and which (k,) are moved from outside of the movable ones.

    Forces on the movable ones are rounding beside the largest on all that are ``bending``.
    """
    motion, n = statement.motion, len(statement.motion.names)
    generator = np.random.default_rng(0)
    yields, bases = np.zeros(statement.yields.shape), motion.no_turns
    links, force = np.zeros((n, n)), np.zeros(n)
    rows = np.zeros((statement.jacobian.shape[0], n))
    inside = np.zeros(n, dtype=bool)
    inside[movable] = True
    for k in range(STATES):
        # the movable ones at rest, so that only what the others do to them shows
        where, rates = (SIZE * generator.standard_normal(n) * (k > 0) for _ in range(2))
        where[inside] = rates[inside] = 0.0
        values = function(where, rates, yields, bases, _varied(statement, generator))
        mass, stiffness, damping, jacobian, pulled, driven = (np.abs(np.asarray(array)) for array in values)
        for matrix in (mass, stiffness, damping):
            scale = np.sqrt(np.maximum(matrix.diagonal(), 1e-300))
            links = np.maximum(links, matrix / np.outer(scale, scale))
        rows = np.maximum(rows, jacobian / max(float(jacobian.max(initial=0.0)), 1e-300))
        size = np.sqrt(np.maximum(stiffness.diagonal(), 1e-300))
        force = np.maximum(force, (pulled[:, 0] + driven[:, 0]) / size)
    excited = ~inside | (rows > ROUNDING).any(axis=0)
    excited |= inside & (force > ROUNDING * max(float(force[bending].max()), 1e-300))
    coupled = links > ROUNDING
    return (coupled | coupled.T).astype(float), np.flatnonzero(excited)
