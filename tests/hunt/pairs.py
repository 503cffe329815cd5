"""What two bodies do to each other in any pose: rows of joints, springs and couplers with exact derivatives, by CasADi.

A row is a function of the displacements (u, theta) of two bodies since the pose, each turned by exp(theta) about its
centre; vectors are in the element's axes as they are in the pose. With A and B the two rotations, p_a and p_b the
points that both bodies carry, d = A^T (p_b - p_a) and the relative rotation E = A^T B, the rows are

- locked translations: that component of d; screw: d_z - pitch angle_z;
- no rotation free: the rotation vector of E; one about e: the two others of E e; universal: e . E e2 of the axis e that
  stays in the first body and e2 in the second; homokinetic: the z component of the rotation vector of E;
- distance and line spring: |p_b - p_a| less the same in the pose;
- bushing: all of d and of the rotation vector of E;
- torsion spring: the twist of E about z, of which a swing about an axis across z is taken off.

Each function is made once for its kind; ``tests/support/lagrangian.py`` says the same for whole models.
"""

from functools import cache

import casadi as ca
import numpy as np

from tests.support.lagrangian import axial, exponential, logarithm, spatial_velocity

DIRECTIONS = ("x", "y", "z", "rx", "ry", "rz")


def _rows(kind, free, d, e, other):
    """Rows of a joint: ``other`` holds the second axis of a universal joint, or the pitch of a screw."""
    rows = [d[i] for i in range(3) if DIRECTIONS[i] not in free]
    turns = [i for i in range(3) if DIRECTIONS[3 + i] in free]
    if kind == "screw":
        rows[2] -= other[0] * ca.atan2(e[1, 0] - e[0, 1], e[0, 0] + e[1, 1])
    if kind == "homokinetic":
        return [*rows, logarithm(e)[2]]
    if not turns:
        return [*rows, *ca.vertsplit(axial(e))]
    if len(turns) == 1:
        return rows + [e[i, turns[0]] for i in range(3) if i != turns[0]]
    if len(turns) == 2:
        one = np.eye(3)[turns[0]]
        two = other if kind == "universal" else ca.DM(np.eye(3)[turns[1]])
        return [*rows, ca.dot(ca.DM(one), e @ two) - ca.dot(ca.DM(one), two)]
    return rows


def _coordinate(kind, free, direction, d, e, second):
    """A joint's coordinate as couplers know it."""
    k = DIRECTIONS.index(direction)
    if k < 3:
        return d[k]
    if kind == "universal":
        first = ca.DM(np.eye(3)[0])
        return _angle(first, second, e @ second) if direction == "rx" else _angle(second, e.T @ first, first)
    if [name for name in free if name[0] == "r"] == [direction]:
        i, j = (k - 2) % 3, (k - 1) % 3
        return ca.atan2(e[j, i] - e[i, j], e[i, i] + e[j, j])
    return logarithm(e)[k - 3]


def _angle(axis, start, end):
    """The angle about an axis from one vector to another, which make the same angle with it."""
    across = start - axis * ca.dot(axis, start)
    return ca.atan2(ca.dot(ca.cross(axis, across), end), ca.dot(across, end))


@cache
def pair(what, kind="", free=(), direction=""):
    """The function of one kind of rows: (multipliers, r_a, r_b, gap, other) -> values and derivatives in the pose.

    ``what`` is "joint", "coordinate", "line", "twist" or "bushing"; r_a and r_b lead from the centres to the points,
    ``gap`` from the first point to the second. Returns rows, Jacobian, Hessian of multipliers . rows, the wrench on the
    second body at its point, and the derivatives of that wrench, in axes that the first body carries, by displacements
    and multipliers.
    """
    x = ca.SX.sym("x", 12)
    ra, rb, gap, other = (ca.SX.sym(name, 3) for name in ("ra", "rb", "gap", "other"))
    a, b = exponential(x[3:6]), exponential(x[9:12])
    start, end = x[0:3] + a @ ra - ra, x[6:9] + b @ rb - rb + gap
    d, e = a.T @ (end - start), a.T @ b
    if what == "joint":
        rows = _rows(kind, free, d, e, other)
    elif what == "coordinate":
        rows = [_coordinate(kind, free, direction, d, e, other)]
    elif what == "line":
        rows = [ca.norm_2(end - start)]
    elif what == "twist":  # that of e = swing after twist about z
        rows = [ca.atan2(e[1, 0] - e[0, 1], e[0, 0] + e[1, 1])]
    else:
        rows = [d, logarithm(e)]
    phi = ca.vertcat(ca.SX(0, 1), *rows)
    weights = ca.SX.sym("lambda", phi.shape[0])
    gradient = ca.gradient(ca.dot(weights, phi), x) if phi.shape[0] else ca.SX.zeros(12)
    force = -gradient[6:9]
    moment = ca.inv(spatial_velocity(x[9:12]).T) @ -gradient[9:12] - ca.cross(b @ rb, force)
    parts = ca.vertcat(0, 0, -ca.sum1(weights), 0, 0, 0) if what == "line" else ca.vertcat(a.T @ force, a.T @ moment)
    outputs = [phi, ca.jacobian(phi, x), ca.jacobian(gradient, x), ca.vertcat(force, moment), ca.jacobian(parts, x),
               ca.jacobian(parts, weights)]  # fmt: skip
    function = ca.Function("pair", [x, weights, ra, rb, gap, other], outputs)
    count = phi.shape[0]

    def evaluate(multipliers, r_a, r_b, gap=(0, 0, 0), other=(0, 0, 0)):
        weights = np.zeros(count) if multipliers is None else multipliers
        return [np.array(out) for out in function(np.zeros(12), weights, r_a, r_b, gap, other)]

    return evaluate


@cache
def load(follower):
    """The function of a load: (force, torque, arm) -> generalised force on (u, theta), and its derivative."""
    x = ca.SX.sym("x", 6)
    force, torque, arm = (ca.SX.sym(name, 3) for name in ("f", "t", "r"))
    turn = exponential(x[3:])
    direction = turn if follower else ca.SX.eye(3)
    general = ca.jacobian(x[:3] + turn @ arm, x).T @ (direction @ force)
    general[3:] += spatial_velocity(x[3:]).T @ (direction @ torque)
    function = ca.Function("load", [x, force, torque, arm], [general, ca.jacobian(general, x)])
    return lambda f, t, r: [np.array(out) for out in function(np.zeros(6), f, t, r)]
