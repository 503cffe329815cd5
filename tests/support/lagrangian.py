"""An exact nonlinear reference of a model in CasADi: constraints, potential, forces, multipliers, their derivatives.

Every body j is at c_j and turned by R_j since the model's pose; about any such pose its coordinates are x_j = (u,
theta) with the rotation exp(theta) R_j. Nothing is taken from the library but the words of the parts, and their axes.

With A = R_a Q, B = R_b Q the joint's axes in the first and the second body, p_a and p_b its point in both,
d = A^T (p_b - p_a) and the relative rotation E = A^T B, what is exact is this:

- locked translations: that component of d is zero (in axes that turn with the first body); screw: d_z = pitch * angle;
- no rotation free: E = 1; one about e: E e = e; homokinetic: log E has no component along z; other two: the axis named
  first (universal: ``axis``) stays in the first body, the other (``axis2``) in the second, and the angle between them
  stays; three: nothing;
- line spring: potential F (L - L0) + k (L - L0)^2 / 2 with F the preload (tension) in the model's pose;
- bushing: s = (d, log E), potential s . k s / 2 - preload . s: the preload is the wrench on the second body;
- gravity and dead forces: fixed in the world; follower forces turn with their body. Moments do the work tau . omega, a
  dead one too, whose tangent is therefore not symmetric.
"""

from dataclasses import dataclass
from functools import cached_property

import casadi as ca
import numpy as np

DIRECTIONS = ("x", "y", "z", "rx", "ry", "rz")


def skew(w):
    return ca.vertcat(ca.horzcat(0, -w[2], w[1]), ca.horzcat(w[2], 0, -w[0]), ca.horzcat(-w[1], w[0], 0))


def exponential(w):
    """exp([w]x) as a series that is exact about zero, the only place at which it is evaluated."""
    t, x = ca.dot(w, w), skew(w)
    return ca.DM.eye(3) + (1 - t / 6 + t**2 / 120) * x + (0.5 - t / 24 + t**2 / 720) * x @ x


def spatial_velocity(w):
    """The matrix W with omega = W d(theta)/dt."""
    t, x = ca.dot(w, w), skew(w)
    return ca.DM.eye(3) + (0.5 - t / 24) * x + (1 / 6 - t / 120) * x @ x


def axial(e):
    return ca.vertcat(e[2, 1] - e[1, 2], e[0, 2] - e[2, 0], e[1, 0] - e[0, 1]) / 2


def logarithm(e):
    """The rotation vector of a rotation matrix, below half a turn."""
    cosine = ca.sqrt(1 + e[0, 0] + e[1, 1] + e[2, 2]) / 2  # of half the angle
    tangent = axial(e) / (2 * cosine**2)
    s = ca.dot(tangent, tangent)
    near = s < 1e-2
    series = 0.0
    for k in range(8, -1, -1):
        series = 1 / (2 * k + 1) - s * series
    root = ca.sqrt(ca.if_else(near, 1.0, s))
    return 2 * tangent * ca.if_else(near, series, ca.atan(root) / root)


@dataclass
class Frame:
    """A body (or the ground) in symbols: where it is, how it is turned, and where it was in the model's pose."""

    centre: object
    turn: object
    origin: np.ndarray
    spin: object

    def point(self, p):
        return self.centre + self.turn @ ca.DM(np.subtract(p, self.origin))


def constraints(joint, a, b, point):
    """The rows phi of a joint, zero where it is assembled."""
    q = np.array(joint.axes)
    first, second = a.turn @ q, b.turn @ q
    if joint.kind == "distance":
        gap = b.point(joint.end) - a.point(joint.position)
        return [(ca.dot(gap, gap) - np.sum(np.subtract(joint.end, joint.position) ** 2)) / 2]
    d, e = first.T @ (b.point(point) - a.point(point)), first.T @ second
    free = dict(joint.freedom)
    rows = [d[i] for i in range(3) if DIRECTIONS[i] not in free]
    if joint.kind == "screw":
        rows[2] -= joint.pitch * ca.atan2(e[1, 0] - e[0, 1], e[0, 0] + e[1, 1])
    rotating = [DIRECTIONS.index(name) - 3 for name in free if name[0] == "r"]  # as they were named
    if joint.kind == "homokinetic":
        rows.append(logarithm(e)[2])
    elif not rotating:
        rows += ca.vertsplit(axial(e))
    elif len(rotating) == 1:
        rows += [e[i, rotating[0]] for i in range(3) if i != rotating[0]]
    elif len(rotating) == 2:
        one, two = (np.eye(3)[i] for i in rotating)
        if joint.axis2 is not None:
            one, two = (q.T @ np.array(v) / np.linalg.norm(v) for v in (joint.axis, joint.axis2))
        rows.append(ca.dot(ca.DM(one), e @ two) - float(one @ two))
    return rows


def coordinate(joint, direction, a, b, point):
    """A joint's coordinate, zero in the model's pose, as couplers know it."""
    q = np.array(joint.axes)
    first, second = a.turn @ q, b.turn @ q
    k, e = DIRECTIONS.index(direction), first.T @ second
    if k < 3:
        return (first.T @ (b.point(point) - a.point(point)))[k]
    rotating = [name for name, _ in joint.freedom if name[0] == "r"]
    if len(rotating) == 2 and joint.kind != "homokinetic":
        one, two = (np.eye(3)[DIRECTIONS.index(name) - 3] for name in rotating)
        if joint.axis2 is not None:
            one, two = (q.T @ np.array(v) / np.linalg.norm(v) for v in (joint.axis, joint.axis2))
        return angle(one, two, e @ two) if direction == rotating[0] else angle(two, e.T @ one, one)
    if rotating == [direction]:
        i, j = (k - 2) % 3, (k - 1) % 3
        return ca.atan2(e[j, i] - e[i, j], e[i, i] + e[j, j])
    return logarithm(e)[k - 3]


def angle(axis, start, end):
    """The angle about an axis from one vector to another, which make the same angle with it."""
    axis, start = ca.DM(axis), ca.SX(start)
    across = start - axis * ca.dot(axis, start)
    return ca.atan2(ca.dot(ca.cross(axis, across), end), ca.dot(across, end))


def potential(spring, a, b):
    """The potential of a line spring or bushing."""
    preload = getattr(spring, "preload", None)
    if hasattr(spring, "line"):
        length = float(np.linalg.norm(np.subtract(spring.end, spring.start)))
        free = getattr(spring, "free_length", None)
        tension = preload or 0.0 if free is None else spring.stiffness * (length - free)
        stretch = ca.norm_2(b.point(spring.end) - a.point(spring.start)) - length
        return tension * stretch + spring.stiffness * stretch**2 / 2
    q, k = np.array(spring.orientation), np.array(spring.stiffness)
    first, second = a.turn @ q, b.turn @ q
    s = ca.vertcat(first.T @ (b.point(spring.position) - a.point(spring.position)), logarithm(first.T @ second))
    force = ca.DM(np.zeros(6) if preload is None else np.array(preload))
    return ca.dot(s, ca.DM(np.diag(k) if k.ndim == 1 else k) @ s) / 2 - ca.dot(force, s)


@dataclass(frozen=True)
class Local:
    """The model about one pose, in the coordinates x of all bodies: numbers.

    ``gradient`` of the potential less the forces, ``jacobian`` of the constraints ``phi``, ``multipliers`` that come
    nearest to holding it (of minimum norm), ``tangent`` = Hessian of V + lambda . phi, less the forces' derivative.
    """

    gradient: np.ndarray
    phi: np.ndarray
    jacobian: np.ndarray
    multipliers: np.ndarray
    tangent: np.ndarray
    mass: np.ndarray

    @property
    def residual(self):
        """What the constraints cannot hold (6 bodies,)."""
        return self.gradient + self.jacobian.T @ self.multipliers


class Lagrangian:
    """The exact equations of a model; a pose is (centres (bodies, 3), rotations (bodies, 3, 3) since the model's)."""

    def __init__(self, model):
        self.model = model
        self.bodies = list(model.bodies.values())
        n = len(self.bodies)
        self.start = (np.array([body.position for body in self.bodies], dtype=float), np.tile(np.eye(3), (n, 1, 1)))
        centre, turn, x = ca.SX.sym("c", 3, n), [ca.SX.sym(f"R{j}", 3, 3) for j in range(n)], ca.SX.sym("x", 6 * n)
        frames = {"ground": Frame(ca.DM.zeros(3), ca.DM.eye(3), np.zeros(3), ca.DM.zeros(3, 3))}
        for j, body in enumerate(self.bodies):
            u, theta = x[6 * j : 6 * j + 3], x[6 * j + 3 : 6 * j + 6]
            frames[body.name] = Frame(centre[:, j] + u, exponential(theta) @ turn[j], np.array(body.position),
                                      spatial_velocity(theta))  # fmt: skip
        rows = [ca.SX(0, 1)]
        for joint in model.joints.values():
            inner = next(body for body in (joint.first, joint.second) if body != "ground")
            point = joint.position or model.bodies[inner].position
            rows += constraints(joint, frames[joint.first], frames[joint.second], point)
        for coupler in getattr(model, "couplers", {}).values():
            rows.append(ca.SX(0))
            for term, factor in coupler.terms:
                name, _, direction = term.rpartition(".")
                joint = model.joints[name]
                inner = next(body for body in (joint.first, joint.second) if body != "ground")
                point = joint.position or model.bodies[inner].position
                rows[-1] += factor * coordinate(joint, direction, frames[joint.first], frames[joint.second], point)
        phi = ca.vertcat(*rows)
        v = sum((potential(s, frames[s.first], frames[s.second]) for s in model.springs.values()), start=ca.SX(0))
        gravity = getattr(model, "gravity", None)
        if gravity is not None:
            v -= sum(body.mass * ca.dot(ca.DM(gravity), frames[body.name].centre) for body in self.bodies)
        force = self._forces(frames, x)
        self._pose = [centre, ca.horzcat(*turn), x]
        self._symbols = v, force, phi
        self._first = ca.Function("first", self._pose, [ca.gradient(v, x) - force, phi, ca.jacobian(phi, x)])

    @cached_property
    def _second(self):
        """The tangent, for a pose and multipliers: most of the work, which not everybody needs."""
        v, force, phi = self._symbols
        multipliers, x = ca.SX.sym("lambda", phi.shape[0]), self._pose[-1]
        tangent = ca.hessian(v + ca.dot(phi, multipliers), x)[0] - ca.jacobian(force, x)
        return ca.Function("second", [*self._pose, multipliers], [tangent])

    def _forces(self, frames, x):
        """Generalised forces of the loads, dead and follower."""
        total = ca.SX.zeros(x.shape[0])
        for load in getattr(self.model, "loads", {}).values():
            frame, j = frames[load.body], list(self.model.bodies).index(load.body)
            turn = frame.turn if load.follower else ca.DM.eye(3)
            location = load.position or self.model.bodies[load.body].position
            own = x[6 * j : 6 * j + 6]
            total[6 * j : 6 * j + 6] += ca.jacobian(frame.point(location), own).T @ (turn @ ca.DM(load.force))
            total[6 * j + 3 : 6 * j + 6] += frame.spin.T @ (turn @ ca.DM(load.torque))
        return total

    def at(self, pose=None, multipliers=None):
        """The equations about a pose, with the multipliers that come nearest to holding it unless they are given."""
        pose = self.start if pose is None else pose
        gradient, phi, jacobian = self.forces(pose)
        if multipliers is None:
            multipliers = np.linalg.lstsq(jacobian.T, -gradient, rcond=1e-11)[0] if len(phi) else np.zeros(0)
        tangent = np.array(self._second(*self._numbers(pose), multipliers))
        return Local(gradient, phi, jacobian, multipliers, tangent, self._mass(pose[1]))

    def forces(self, pose=None):
        """The gradient of the potential less the forces, the constraints phi and their Jacobian about a pose."""
        gradient, phi, jacobian = map(np.array, self._first(*self._numbers(self.start if pose is None else pose)))
        return gradient[:, 0], phi[:, 0], jacobian

    def _numbers(self, pose):
        centre, turn = pose
        return [np.asarray(centre).T, np.hstack(list(turn)), np.zeros(6 * len(self.bodies))]

    def _mass(self, turn):
        m = np.zeros((6 * len(self.bodies),) * 2)
        for j, (body, r) in enumerate(zip(self.bodies, turn, strict=True)):
            xx, yy, zz, xy, xz, yz = body.inertia
            axes = r @ np.array(body.orientation)
            m[6 * j : 6 * j + 3, 6 * j : 6 * j + 3] = body.mass * np.eye(3)
            tensor = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
            m[6 * j + 3 : 6 * j + 6, 6 * j + 3 : 6 * j + 6] = axes @ tensor @ axes.T
        return m

    def moved(self, pose, x):
        """The pose after x (6 bodies,)."""
        centre, turn = pose
        parts = np.reshape(x, (-1, 2, 3))
        return centre + parts[:, 0], np.array([finite(w) @ r for w, r in zip(parts[:, 1], turn, strict=True)])

    def equilibrium(self, pose=None, iterations=60, tolerance=1e-13):
        """The pose of equilibrium by Newton's method on all coordinates and multipliers at once; steps are cut short.

        Returns the pose, and the size of the last step.
        """
        pose, size, n = self.start if pose is None else pose, np.inf, 6 * len(self.bodies)
        for _ in range(iterations):
            local = self.at(pose)
            stiff = np.abs(local.tangent).max()  # constraints are put on a par with it, lest their values count as zero
            j = stiff * local.jacobian
            matrix = np.block([[local.tangent, j.T], [j, np.zeros((len(j), len(j)))]])
            step = np.linalg.lstsq(matrix, -np.concatenate([local.residual, stiff * local.phi]), rcond=1e-12)[0][:n]
            before, size = size, float(np.abs(step).max())
            pose = self.moved(pose, step * min(1.0, 0.3 / max(size, 1e-300)))
            if size < tolerance or (size < 1e-9 and size >= before):
                break
        return pose, size


def finite(w):
    """exp([w]x) in numbers, by Rodrigues' formula."""
    angle = float(np.linalg.norm(w))
    x = np.array([[0, -w[2], w[1]], [w[2], 0, -w[0]], [-w[1], w[0], 0]])
    return np.eye(3) + np.sinc(angle / np.pi) * x + 0.5 * np.sinc(angle / 2 / np.pi) ** 2 * x @ x


def projected(model, system):
    """Tangent stiffness and mass matrix of the exact equations in a system's minimal coordinates, and the residual.

    (T^T H T, T^T M T, T^T (gradient + J^T lambda)) with T the motion of the bodies.
    """
    local = Lagrangian(model).at()
    basis = np.asarray(system.body_motion).reshape(6 * len(model.bodies), system.dof)
    assert np.abs(local.jacobian @ basis).max(initial=0.0) < 1e-9 * max(1.0, np.abs(basis).max(initial=0.0))
    return basis.T @ local.tangent @ basis, basis.T @ local.mass @ basis, basis.T @ local.residual
