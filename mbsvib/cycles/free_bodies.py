"""Bodies on their own in the motion of a mechanism: what they lack, what joints supply, and what drives do to them.

Every body has a translation and a rotation of its own, x, whose equations M x'' = f are those of the mechanism without
joints: springs, weight and loads are in f. What bodies lack is M x'' - f. A joint supplies combinations of the
derivatives dPhi/dx of its openings. All is stated in terms of the tree coordinates.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import accumulate
from typing import TYPE_CHECKING

import casadi as ca

from mbsvib.cycles.expressions import Statement, statement
from mbsvib.finite_motion.forces import velocity
from mbsvib.finite_motion.joints import openings, point_of
from mbsvib.finite_motion.rotations import Expression, axial, skew
from mbsvib.mechanism.mechanism import GROUND, Mechanism

if TYPE_CHECKING:
    from collections.abc import Sequence

    from mbsvib.elements import Joint


@dataclass(frozen=True)
class FreeBodies:
    """Expressions of the symbols of a statement: ``required`` (6 N,), what bodies lack; ``rows`` (L, 6 N), dPhi/dx of
    all joints one after the other, ``counts`` of them each; ``unit_wrenches`` (6, L), those of unit multipliers of
    these rows on the second bodies, at the joints' points; ``drive_wrenches`` (6 N, drives + couplers), what one unit
    along each driven coordinate, and each coupler, does.
    """

    required: Expression
    rows: Expression
    counts: list[int]
    unit_wrenches: Expression
    drive_wrenches: Expression

    @property
    def slices(self) -> list[slice]:
        """The rows of each joint."""
        return [slice(end - count, end) for count, end in zip(self.counts, accumulate(self.counts), strict=True)]


def free_bodies(model: Mechanism, expressions: Statement, drives: Sequence[str]) -> FreeBodies:
    """Return the equations of all bodies without joints between them."""
    tree = expressions.motion.motion
    selected = [i for i, name in enumerate(expressions.names) if model.parameters.entry(name).part not in model.joints]
    without_joints = model.with_parts(joints={}, couplers={}, inputs={}, outputs={})
    free = statement(without_joints, None, [expressions.names[i] for i in selected], bases=True)
    kinematics = free.motion.motion
    first_row = {name: kinematics.names.index(f"{name}.x") for name in model.bodies}
    size = 6 * len(first_row)
    q, qd, qdd = (ca.SX.zeros(size) for _ in range(3))
    bases, origins = ca.SX.zeros(9 * len(first_row)), {}
    for name, k in first_row.items():
        described = tree.numbers.vector(model.bodies[name], "position")
        origins[name] = tree.point(name, described)
        q[k : k + 3] = origins[name] - described
        twist = ca.vertcat(*velocity(tree, name, described))
        qd[k : k + 6], qdd[k : k + 6] = twist, expressions.rate(twist)
        start = 9 * kinematics.based.index(name)
        bases[start : start + 9] = ca.vec(tree.frames[name].rotation)
    rows, counts, points = [], [], {}
    for joint in model.joints.values():
        relative = kinematics.frames[joint.second].seen_from(kinematics.frames[joint.first])
        opened = [value for _, value in openings(joint, tree.numbers, relative)]
        rows += opened
        counts.append(len(opened))
        points[joint.name] = tree.frames[joint.second].point(point_of(joint, tree.numbers))
    phi = ca.vertcat(*rows) if rows else ca.SX.zeros(0)
    p = expressions.p[selected]
    jacobian = ca.Function("f", [free.q, kinematics.bases, free.p, expressions.p], [ca.jacobian(phi, free.q)])
    unbalanced = ca.Function("f", [free.q, free.qd, free.qdd, kinematics.bases, free.p], [free.required])
    of_joints, where = jacobian(q, bases, p, expressions.p), (first_row, origins, points)
    unit_wrenches, start = [], 0
    for joint, count in zip(model.joints.values(), counts, strict=True):
        end, sign = (joint.second, 1.0) if joint.second != GROUND else (joint.first, -1.0)
        k, arm = first_row[end], origins[end] - points[joint.name]
        at_centre = sign * of_joints[start : start + count, k : k + 6].T
        unit_wrenches.append(ca.vertcat(at_centre[:3, :], at_centre[3:, :] + skew(arm) @ at_centre[:3, :]))
        start += count
    return FreeBodies(unbalanced(q, qd, qdd, bases, p), of_joints, counts,
                      ca.horzcat(ca.SX.zeros(6, 0), *unit_wrenches),
                      _drive_wrenches(model, expressions, drives, where))  # fmt: skip


def _drive_wrenches(
    model: Mechanism, expressions: Statement, drives: Sequence[str],
    where: tuple[dict[str, int], dict[str, Expression], dict[str, Expression]],
) -> Expression:  # fmt: skip
    """Generalized forces (6 N, drives + couplers) of units along driven and coupled coordinates."""
    first_row, origins, points = where
    size = 6 * len(first_row)

    def onto(name: str) -> Expression:
        joint = model.joints[name.rpartition(".")[0]]
        wrench, column = _along(joint, name, expressions), ca.SX.zeros(size)
        for end, sign in ((joint.second, 1.0), (joint.first, -1.0)):
            if end != GROUND:
                k, arm = first_row[end], points[joint.name] - origins[end]
                column[k : k + 3] = sign * wrench[:3]
                column[k + 3 : k + 6] = sign * (wrench[3:] + ca.cross(arm, wrench[:3]))
        return column

    columns = [onto(name) for name in drives]
    columns += [sum((value * onto(name) for name, value in part.terms), ca.SX.zeros(size))
                for part in model.couplers.values()]  # fmt: skip
    return ca.horzcat(*columns)


def _along(joint: Joint, name: str, expressions: Statement) -> Expression:
    """The wrench (6,) that acts with one unit along a joint coordinate, and not along its others of the same kind."""
    tree, turns = expressions.motion.motion, name.rpartition(".")[2].startswith("r")
    coordinates = [f"{joint.name}.{direction}" for direction, _ in joint.freedom if (direction[0] == "r") is turns]
    first = tree.frames[joint.first]
    relative = tree.frames[joint.second].seen_from(first)
    spin = ca.reshape(tree.rate(ca.vec(relative.rotation)), 3, 3) @ relative.rotation.T
    rate = axial(spin) if turns else tree.rate(relative.point(point_of(joint, tree.numbers)))
    columns = [tree.names.index(coordinate) for coordinate in coordinates]
    twists = ca.jacobian(first.rotation @ rate, expressions.qd)[:, columns]
    dual = ca.densify(twists) @ ca.inv(twists.T @ twists)
    direction = dual[:, coordinates.index(name)]
    return ca.vertcat(ca.SX.zeros(3), direction) if turns else ca.vertcat(direction, ca.SX.zeros(3))
