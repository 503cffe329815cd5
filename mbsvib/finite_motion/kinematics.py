"""Kinematics of a mechanism in finite motion: joint coordinates of the spanning tree to frames of all bodies."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import casadi as ca
import numpy as np

from mbsvib.common.arguments import DIRECTIONS
from mbsvib.elements.joint import make as make_joint
from mbsvib.errors import ModelError
from mbsvib.finite_motion.elastic_nodes import coordinates_of, node_displacement
from mbsvib.finite_motion.frames import REST, Frame, angular_velocity, rate
from mbsvib.finite_motion.joints import displacement, openings, small_displacement, virtual_displacement
from mbsvib.finite_motion.rotations import Expression
from mbsvib.mechanism.mechanism import GROUND
from mbsvib.mechanism.topology import FLOATS, cut_elsewhere, span

if TYPE_CHECKING:
    from collections.abc import Callable, Collection, Iterable, Mapping, Sequence

    from numpy.typing import NDArray

    from mbsvib.elements import Joint
    from mbsvib.finite_motion.elastic_block import ElasticBlock
    from mbsvib.finite_motion.numbers import Numbers
    from mbsvib.mechanism.mechanism import Mechanism
    from mbsvib.mechanism.topology import Branch, Topology


@dataclass(frozen=True)
class Kinematics:
    """Where bodies are by joint coordinates of the spanning tree, and what loops demand of these.

    ``names`` are those of the coordinates ``q`` (n,), displacements from the pose as described, ``turns`` (n,) tells
    rotations [rad] from translations [m]; ``qd`` (n,) are their rates. ``frames`` has the displacement of each body by
    name, ground included. ``closures`` (rows,) are zero where the loops are closed and couplers hold, row by row the
    opening [m, rad] of ``closure_names``, ``"JOINT.direction"`` or a coupler; ``closure_turns`` (rows,) tells which of
    them are rotations. ``bases`` (9 b,) are rotation matrices, column by column, on top of which the rotations of the
    joints ``based`` come: those with three free rotations, if asked for, else none. ``elastic`` has the displacements b
    of its interface and its modes z for each beam or superelement.
    """

    topology: Topology
    numbers: Numbers
    names: tuple[str, ...]
    turns: NDArray[np.bool_]
    q: Expression
    qd: Expression
    frames: Mapping[str, Frame]
    closures: Expression
    closure_names: tuple[str, ...]
    closure_turns: NDArray[np.bool_]
    bases: Expression
    based: tuple[str, ...]
    elastic: Mapping[str, tuple[Expression, Expression]] = field(default_factory=dict)

    def point(self, body: str, at: Expression) -> Expression:
        """Return where the point (3,) of a body is that was ``at`` [m] as described."""
        return self.frames[body].point(at)

    def rate(self, expression: Expression) -> Expression:
        """Return the time derivative of an expression of the coordinates."""
        return rate(expression, self.q, self.qd)

    def angular_velocity(self, body: str) -> Expression:
        """Return the angular velocity (3,) [rad/s] of a body in axes that turn with it."""
        return angular_velocity(self.frames[body], self.q, self.qd)

    def relative(self, first: str, second: str) -> Frame:
        """Return the displacement of the second body against the first, in the axes of the first as described."""
        return self.frames[second].seen_from(self.frames[first])


def kinematics(
    model: Mechanism, numbers: Numbers, cut: Sequence[str] | None = None, bases: bool = False,
    blocks: Sequence[ElasticBlock] = (), inactive: Collection[str] = (), virtual: Sequence[str] = (),
) -> Kinematics:  # fmt: skip
    """Return the finite motion of a mechanism along its spanning tree.

    ``model``: the mechanism; its beams and superelements are fixed joints between root and interface. ``cut``: joints
    at which loops are to be cut; default: as ``linearize`` does, but for joints whose coordinates couplers couple.
    ``bases``: whether joints with three free rotations get a rotation on top of which theirs come, so that no rotation
    vector needs to be long. ``inactive``: coordinates of these that stay 0 and are left out. ``virtual``: joints, and
    the ground, that get six virtual displacements each, ``"JOINT.virtual.x"`` to ``rz``, the last coordinates of all:
    of the second body against the first, and of the ground itself.
    """
    topology = span(model, coupled_in_tree(model) if cut is None else cut)
    ways = {branch.joint: branch for branch in topology.branches if branch.joint != FLOATS}
    joints = {topology.joints[k].name: (topology.joints[k], ways[k]) for k in sorted(ways)}
    floating = {b.body: _floating(topology, model, b) for b in topology.branches if b.joint == FLOATS}
    order = [*joints.values(), *((floating[k], None) for k in topology.floating)]
    links = {name: (block, k) for block in blocks for k, name in enumerate(block.joints)}
    by_joint = {joint.name: _directions(joint, links) for joint, _ in order}
    names = [f"{joint}.{d}" for joint in by_joint for d in by_joint[joint] if f"{joint}.{d}" not in inactive]
    names += [name for block in blocks for name in block.mode_names if name not in inactive]
    names += [f"{joint}.virtual.{d}" for joint in virtual for d in DIRECTIONS]
    turns = [name.rpartition(".")[2][0] == "r" for name in names]
    q, qd = ca.SX.sym("q", len(names)), ca.SX.sym("qd", len(names))
    symbol = {name: q[i] for i, name in enumerate(names)}

    def values(names: Iterable[str]) -> Expression:
        return ca.vertcat(*(symbol.get(name, ca.SX(0.0)) for name in names))

    three_rotations = [joint.name for joint, _ in order if len(joint.rotation_axes) == 3]
    based = tuple(three_rotations) if bases else ()
    symbols = ca.SX.sym("base", 9 * len(based))
    extra = {name: values(f"{name}.virtual.{d}" for d in DIRECTIONS) for name in virtual}
    frames: dict[str, Frame] = {GROUND: REST}
    if GROUND in extra:
        frames[GROUND] = small_displacement(ca.SX.eye(3), ca.SX.zeros(3), extra[GROUND])
    for branch in topology.branches:
        joint = floating[branch.body] if branch.joint == FLOATS else topology.joints[branch.joint]
        own_q = values(f"{joint.name}.{d}" for d in by_joint[joint.name])
        base = None
        if joint.name in based:
            k = 9 * based.index(joint.name)
            base = ca.reshape(symbols[k : k + 9], 3, 3)
        if joint.name in links:
            block, k = links[joint.name]
            both = ca.vertcat(values(block.mode_names), values(block.interface_names))
            motion = node_displacement(block, block.interface[k], both)
        else:
            motion = displacement(joint, numbers, own_q, base)
        if joint.name in extra:
            motion = virtual_displacement(joint, numbers, model.bodies, motion, extra[joint.name]).then(motion)
        parent = GROUND if branch.parent == len(topology.bodies) else topology.bodies[branch.parent]
        frames[topology.bodies[branch.body]] = frames[parent].then(motion if branch.sign > 0 else motion.inverse())
    rows: list[tuple[str, Expression, bool]] = []
    for k in topology.cut:
        joint = topology.joints[k]
        if joint.name in links:  # its coordinates follow
            continue
        relative = frames[joint.second].seen_from(frames[joint.first])
        if joint.name in extra:
            moved = virtual_displacement(joint, numbers, model.bodies, relative, extra[joint.name])
            relative = moved.inverse().then(relative)
        rows += [(f"{joint.name}.{name}", value, name[0] == "r") for name, value in openings(joint, numbers, relative)]
    for part in model.couplers.values():
        absent = next((name for name, _ in part.terms if name not in symbol and name not in inactive), None)
        if absent is not None:
            joint_name = absent.rpartition(".")[0]
            raise ModelError(f"coupler '{part.name}': joint '{joint_name}' of its coordinate '{absent}' is cut, so "
                             f"that the tree has no such coordinate; cut another joint of that loop: "
                             f"linearize(cut=[...]).", element=part.name)  # fmt: skip
        rows.append((part.name, sum((value * symbol[name] for name, value in part.terms), ca.SX(0.0)),
                     all(name.rpartition(".")[2][0] == "r" for name, _ in part.terms)))  # fmt: skip
    return Kinematics(
        topology, numbers, tuple(names), np.array(turns, dtype=bool), q, qd, frames,
        ca.vertcat(*(value for _, value, _ in rows)) if rows else ca.SX.zeros(0),
        tuple([name for name, _, _ in rows]), np.array([turn for _, _, turn in rows], dtype=bool), symbols, based,
        {block.name: (_interface(block, values, by_joint, frames), values(block.mode_names)) for block in blocks},
    )  # fmt: skip


def _directions(joint: Joint, links: Mapping[str, tuple[ElasticBlock, int]]) -> tuple[str, ...]:
    """Names of the directions in which a joint, or the link to an interface node, has coordinates."""
    if joint.name not in links:
        return tuple([direction for direction, _ in joint.freedom])
    block, k = links[joint.name]
    return tuple([DIRECTIONS[d] for d in block.held[k]])


def _interface(
    block: ElasticBlock, values: Callable[[Iterable[str]], Expression], by_joint: Collection[str],
    frames: Mapping[str, Frame],
) -> Expression:  # fmt: skip
    """Displacements b of the interface of a block: coordinates of the tree, or what follows from the frames."""
    parts = [
        values(f"{joint}.{DIRECTIONS[d]}" for d in held) if joint in by_joint else
        coordinates_of(block, station, frames[body].seen_from(frames[block.root]))
        for joint, body, station, held in zip(block.joints, block.bodies, block.interface, block.held, strict=True)
    ]  # fmt: skip
    return ca.vertcat(*parts)


def _floating(topology: Topology, model: Mechanism, branch: Branch) -> Joint:
    """The free joint on which a floating body hangs, called like the body."""
    name = topology.bodies[branch.body]
    return make_joint(name, "free", GROUND, name, model.bodies[name].position, None, None, None, None, None)


def coupled_in_tree(model: Mechanism) -> tuple[str, ...]:
    """Return joints to cut so that those whose coordinates couplers couple are in the tree."""
    requested = {name.rpartition(".")[0]: part.name for part in model.couplers.values() for name, _ in part.terms}
    for name, coupler in requested.items():
        joint = model.joints[name]
        if joint.turns_by_vector:
            raise ModelError(
                f"coupler '{coupler}': joint '{name}' ({joint.kind}) turns by a rotation vector, whose components are "
                f"no angles in finite motion; couple joints with one or two successive free rotations.",
                element=coupler, field="coefficients",
            )  # fmt: skip
    cut, closing = cut_elsewhere(model, requested)
    if closing is not None:
        raise ModelError(
            f"coupler '{requested[closing]}': all joints of the loop that '{closing}' closes are coupled; leave one "
            f"out.", element=requested[closing], field="coefficients",
        )  # fmt: skip
    return cut
