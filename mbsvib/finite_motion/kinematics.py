"""Kinematics of a mechanism in finite motion: joint coordinates of the spanning tree to frames of all bodies."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass, field

import casadi as ca
import numpy as np

from mbsvib.common.arguments import DIRECTIONS
from mbsvib.common.arrays import Array, Bools
from mbsvib.elements import Joint
from mbsvib.elements.coupler import Coupling, refuse_curved
from mbsvib.elements.joint import make as make_joint
from mbsvib.errors import ModelError
from mbsvib.finite_motion.elastic_block import ElasticBlock, coordinates_of, node_displacement
from mbsvib.finite_motion.frames import REST, Expression, Frame, angular_velocity, rate
from mbsvib.finite_motion.joints import coordinates, displacement, openings, small_displacement, virtual_displacement
from mbsvib.finite_motion.numbers import Numbers
from mbsvib.mechanism.mechanism import GROUND, Mechanism
from mbsvib.mechanism.topology import Topology, cut_elsewhere, span


@dataclass(frozen=True)
class Kinematics:
    """Where bodies are by joint coordinates of the spanning tree, and what loops demand of these.

    ``names`` are those of the coordinates ``q`` (n,), displacements from the pose as described, ``turns`` (n,) tells
    rotations [rad] from translations [m]; ``qd`` (n,) are their rates. ``frames`` has the displacement of each body by
    name, ground included. ``closures`` (rows,) are zero where the loops are closed and couplers hold, row by row the
    opening [m, rad] of ``closure_names``, ``"JOINT.direction"`` or a coupler; ``closure_turns`` (rows,) tells which of
    them are rotations. ``bases`` (9 b,) are rotation matrices, column by column, on top of which the rotations of the
    joints ``based`` come: those with three free rotations, if asked for, else none. ``elastic`` has the displacements b
    of its interface and its modes z for each beam or superelement. ``cut`` has the coordinates of joints at which loops
    are cut, by name; they follow from q, angles within half a turn. ``spins`` has the angular velocity (3,) [rad/s] and
    a point of the axis (3,) [m] of the frame in which a body is described, if that turns.
    """

    topology: Topology
    numbers: Numbers
    names: tuple[str, ...]
    turns: Bools
    q: Expression
    qd: Expression
    frames: Mapping[str, Frame]
    closures: Expression
    closure_names: tuple[str, ...]
    closure_turns: Bools
    bases: Expression
    based: tuple[str, ...]
    elastic: Mapping[str, tuple[Expression, Expression]] = field(default_factory=dict)
    cut: Mapping[str, Expression] = field(default_factory=dict)
    spins: Mapping[str, tuple[Array, Array]] = field(default_factory=dict)

    @property
    def no_turns(self) -> Array:
        """Bases (9 b,) in the pose as described."""
        return np.tile(np.eye(3).reshape(-1), len(self.based))

    def scales(self, size: float) -> tuple[Array, Array]:
        """Return units (n,) of coordinates and (rows,) of closures: 1 rad, or the size of the mechanism [m]."""
        return np.where(self.turns, 1.0, size), np.where(self.closure_turns, 1.0, size)

    def point(self, body: str, at: Expression) -> Expression:
        """Return where the point (3,) of a body is that was ``at`` [m] as described."""
        return self.frames[body].point(at)

    def rate(self, expression: Expression) -> Expression:
        """Return the time derivative of an expression of the coordinates."""
        return rate(expression, self.q, self.qd)

    def velocity(self, body: str, point: Expression) -> Expression:
        """Return the velocity (3,) [m/s] of a point of a body, which is there, that of its turning frame included."""
        if body not in self.spins:
            return self.rate(point)
        w, centre = map(ca.SX, self.spins[body])
        return self.rate(point) + ca.cross(w, point - centre)

    def angular_velocity(self, body: str) -> Expression:
        """Return the angular velocity (3,) [rad/s] of a body in axes that turn with it, that of its turning frame
        included.
        """
        own = angular_velocity(self.frames[body], self.q, self.qd)
        return own + self.frames[body].rotation.T @ ca.SX(self.spins[body][0]) if body in self.spins else own

    def relative(self, first: str, second: str) -> Frame:
        """Return the displacement of the second body against the first, in the axes of the first as described."""
        return self.frames[second].seen_from(self.frames[first])


def kinematics(
    model: Mechanism, numbers: Numbers, cut: Sequence[str] | None = None, bases: bool = False,
    blocks: Sequence[ElasticBlock] = (), inactive: Collection[str] = (), virtual: Sequence[str] = (),
    tree_joints: Collection[str] = (),
) -> Kinematics:  # fmt: skip
    """Return the finite motion of a mechanism along its spanning tree.

    ``model``: the mechanism; its beams and superelements are fixed joints between root and interface. ``cut``: joints
    at which loops are to be cut; default: as ``linearize`` does, but for joints whose coordinates couplers couple.
    ``bases``: whether joints with three free rotations get a rotation on top of which theirs come, so that no rotation
    vector needs to be long. ``inactive``: coordinates of these that stay 0 and are left out. ``virtual``: joints, and
    the ground, that get six virtual displacements each, ``"JOINT.virtual.x"`` to ``rz``, the last coordinates of all:
    of the second body against the first, and of the ground itself. ``tree_joints``: joints that are to be in the
    spanning tree where ``cut`` is not given.
    """
    topology = span(model, in_tree(model, tree_joints) if cut is None else cut)
    branches = topology.branch_of
    joints = {branches[k].body: topology.joints[k] for k in sorted(branches)}
    joints |= {k: _floating(topology, model, k) for k in topology.floating}
    links = {name: (block, k) for block in blocks for k, name in enumerate(block.joints)}
    by_joint = {joint.name: _directions(joint, links) for joint in joints.values()}
    names = [f"{joint}.{d}" for joint in by_joint for d in by_joint[joint]]
    names += [name for block in blocks for name in block.mode_names]
    names = [name for name in names if name not in inactive] + [f"{v}.virtual.{d}" for v in virtual for d in DIRECTIONS]
    q, qd = ca.SX.sym("q", len(names)), ca.SX.sym("qd", len(names))
    symbol = {name: q[i] for i, name in enumerate(names)}
    based = tuple([joint.name for joint in joints.values() if bases and len(joint.rotation_axes) == 3])
    symbols = ca.SX.sym("base", 9 * len(based))
    base_of = {name: ca.reshape(symbols[9 * k : 9 * k + 9], 3, 3) for k, name in enumerate(based)}
    tree = _Tree(model, numbers, symbol, by_joint, base_of, links, virtual)
    frames: dict[str, Frame] = {GROUND: REST}
    if GROUND in virtual:
        frames[GROUND] = small_displacement(ca.SX.eye(3), ca.SX.zeros(3), tree.virtual_values(GROUND))
    for branch in topology.branches:
        relative = tree.displacement(joints[branch.body])
        parent = GROUND if branch.parent == len(topology.bodies) else topology.bodies[branch.parent]
        frames[topology.bodies[branch.body]] = frames[parent].then(relative if branch.sign > 0 else relative.inverse())
    # the coordinates of links that are cut follow
    cut_joints = [topology.joints[k] for k in topology.cut if topology.joints[k].name not in links]
    rows = [row for joint in cut_joints for row in tree.openings(joint, frames)]
    rows += [_coupled(part, model.joints, symbol, inactive) for part in model.couplers.values()]
    return Kinematics(
        topology, numbers, tuple(names), np.array([_turns(name) for name in names], dtype=bool), q, qd, frames,
        ca.vertcat(*(value for _, value, _ in rows)) if rows else ca.SX.zeros(0),
        tuple([name for name, _, _ in rows]), np.array([turn for _, _, turn in rows], dtype=bool), symbols, based,
        {block.name: (tree.interface(block, frames), tree.values(block.mode_names)) for block in blocks},
        {f"{joint.name}.{d}": value for joint in cut_joints for d, value in
         coordinates(joint, numbers, frames[joint.second].seen_from(frames[joint.first]))},
    )  # fmt: skip


@dataclass(frozen=True)
class _Tree:
    """Displacements of joints by symbols of coordinates; those without a symbol are zero.

    ``directions`` are those of the coordinates of each joint of the tree, ``base_of`` rotations on top of which others
    come, ``links`` the blocks and numbers of interface nodes, ``virtual`` joints with virtual displacements.
    """

    model: Mechanism
    numbers: Numbers
    symbol: Mapping[str, Expression]
    directions: Mapping[str, tuple[str, ...]]
    base_of: Mapping[str, Expression]
    links: Mapping[str, tuple[ElasticBlock, int]]
    virtual: Sequence[str]

    def values(self, names: Iterable[str]) -> Expression:
        return ca.vertcat(*(self.symbol.get(name, ca.SX(0.0)) for name in names))

    def virtual_values(self, joint: str) -> Expression:
        return self.values(f"{joint}.virtual.{d}" for d in DIRECTIONS)

    def displacement(self, joint: Joint) -> Frame:
        """The displacement of the second body of a joint of the tree against the first."""
        if joint.name in self.links:
            block, k = self.links[joint.name]
            both = ca.vertcat(self.values(block.mode_names), self.values(block.interface_names))
            result = node_displacement(block, block.interface[k], both)
        else:
            own = self.values(f"{joint.name}.{d}" for d in self.directions[joint.name])
            result = displacement(joint, self.numbers, own, self.base_of.get(joint.name))
        return self._moved(joint, result).then(result) if joint.name in self.virtual else result

    def openings(self, joint: Joint, frames: Mapping[str, Frame]) -> list[tuple[str, Expression, bool]]:
        """Names of the locked directions of a cut joint, how far it is open, and whether that is a rotation."""
        relative = frames[joint.second].seen_from(frames[joint.first])
        if joint.name in self.virtual:
            relative = self._moved(joint, relative).inverse().then(relative)
        return [(f"{joint.name}.{name}", value, name[0] == "r")
                for name, value in openings(joint, self.numbers, relative)]  # fmt: skip

    def interface(self, block: ElasticBlock, frames: Mapping[str, Frame]) -> Expression:
        """Displacements b of the interface of a block: coordinates of the tree, or what follows from the frames."""
        return ca.vertcat(*(
            self.values(f"{joint}.{DIRECTIONS[d]}" for d in held) if joint in self.directions else
            coordinates_of(block, station, frames[body].seen_from(frames[block.root]))
            for joint, body, station, held in zip(block.joints, block.bodies, block.interface, block.held, strict=True)
        ))  # fmt: skip

    def _moved(self, joint: Joint, relative: Frame) -> Frame:
        return virtual_displacement(joint, self.numbers, self.model.bodies, relative, self.virtual_values(joint.name))


def _turns(name: str) -> bool:
    return name.rpartition(".")[2][0] == "r"


def _coupled(
    part: Coupling, joints: Mapping[str, Joint], symbol: Mapping[str, Expression], inactive: Collection[str]
) -> tuple[str, Expression, bool]:
    """Name of a coupler, the sum that it holds at zero, and whether that is of rotations only."""
    refuse_curved([part], "which finite motions leave; it holds for linear equations.")
    for name, _ in part.terms:
        joint = joints[name.rpartition(".")[0]]
        if joint.turns_by_vector:
            raise ModelError(f"coupler '{part.name}': joint '{joint.name}' ({joint.kind}) turns by a rotation vector, "
                             f"whose components are no angles in finite motion; couple joints with one or two "
                             f"successive free rotations.", element=part.name, field="coefficients")  # fmt: skip
        if name not in symbol and name not in inactive:
            raise ModelError(f"coupler '{part.name}': joint '{joint.name}' of its coordinate '{name}' is "
                             f"cut, so that the tree has no such coordinate; cut another joint of that loop: "
                             f"linearize(cut=[...]).", element=part.name)  # fmt: skip
    total = sum((value * symbol[name] for name, value in part.terms), ca.SX(0.0))
    return part.name, total, all(_turns(name) for name, _ in part.terms)


def _directions(joint: Joint, links: Mapping[str, tuple[ElasticBlock, int]]) -> tuple[str, ...]:
    """Names of the directions in which a joint, or the link to an interface node, has coordinates."""
    if joint.name not in links:
        return tuple([direction for direction, _ in joint.freedom])
    block, k = links[joint.name]
    return tuple([DIRECTIONS[d] for d in block.held[k]])


def _floating(topology: Topology, model: Mechanism, body: int) -> Joint:
    """The free joint on which a floating body hangs, called like the body."""
    name = topology.bodies[body]
    return make_joint(name, "free", GROUND, name, model.bodies[name].position, None, None, None, None, None)


def in_tree(model: Mechanism, joints: Collection[str] = ()) -> tuple[str, ...]:
    """Return joints to cut so that those whose coordinates couplers couple are in the tree, and, unless they make up a
    loop with these, others that are asked for.
    """
    requested = {name.rpartition(".")[0]: part.name for part in model.couplers.values() for name, _ in part.terms}
    cut, closing = cut_elsewhere(model, {*requested, *joints})
    if joints and closing is not None:
        return in_tree(model)
    if closing is not None:
        raise ModelError(
            f"coupler '{requested[closing]}': all joints of the loop that '{closing}' closes are coupled; leave one "
            f"out.", element=requested[closing], field="coefficients",
        )  # fmt: skip
    return cut
