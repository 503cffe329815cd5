"""The linear equations of a scene in absolute coordinates, from its calls: no tree, no path rule, no factors.

M x'' + C x' + K x + J^T dlambda = B u,  J x = 0,  y = Rq x + Rv x' + Ra x'' + Rl dlambda + D u

x are six displacements for each body and node (world axes) and internal coordinates; K holds the second-order terms of
all forces in the pose, lambda those of the joints and couplers that balance it.
"""

from dataclasses import dataclass

import numpy as np

from tests.hunt.flexible import beam, points_of, strain, superelement, with_beams
from tests.hunt.forces_in_pose import ForcesInPose
from tests.hunt.restated import acts_on, six, words_of

# Singular values of the constraints (each row and column without units) below this share of the largest are zero.
RANK = 1e-9
ORDERS = ("displacement", "velocity", "acceleration")


def yielding(call):
    """Directions (n, 6) in which what relaxes has stiffness; those of a line and of an axis have one."""
    if call.kind != "bushing":
        return np.eye(6)[[2 if call.kind == "spring" else 5]]
    a = call.arguments
    values, vectors = np.linalg.eigh(square(a.get("dynamic_stiffness", a.get("stiffness", np.zeros(6)))))
    return vectors.T[np.abs(values) > 1e-12 * np.abs(values).max()]


@dataclass
class Ports:
    """Rows of the outputs; ``size`` of the multipliers that they are made of, where components cancel, and ``outside``
    the size of what inputs add to the sums directly; ``force`` is the largest component of outputs that are sums of
    forces, with moments over the length.
    """

    Rq: np.ndarray
    Rv: np.ndarray
    Ra: np.ndarray
    Rl: np.ndarray
    D: np.ndarray
    size: np.ndarray
    outside: np.ndarray
    force: np.ndarray


class Equations:
    """Matrices of a scene; the last six of the displacements are the ground's, which the solution leaves out."""

    def __init__(self, scene):
        scene = with_beams(scene)
        self.scene = scene
        self.origins = {call.name: np.array(call.arguments.get("position", np.zeros(3)), dtype=float)
                        for call in scene.of("body")}  # fmt: skip
        self.flexible = []
        for call in scene.of("beam", "superelement"):
            self.flexible.append(beam(call) if call.kind == "beam" else superelement(call))
            self.origins |= {body: point for body, point in self.flexible[-1].nodes
                             if body.partition(".")[0] == call.name}  # fmt: skip
        self.number = {name: 6 * i for i, name in enumerate([*self.origins, "ground"])}
        elements = [element for part in self.flexible for element in part.elements]
        self.exact = ForcesInPose(scene, self.origins, self.number, elements, self._weights())
        self.length = max(1e-3, float(np.ptp(list(self.origins.values()), axis=0).max()))
        self._number()
        self._statics()
        self._inertia()
        self._elastic()
        self._sources()
        self._outputs()

    def _weights(self):
        """The weight of beams: half of each element's on either node, a sixth of the element inwards.

        These are the consistent nodal loads: force and moment of the cubic deflection.
        """
        result = []
        for call, part in zip(self.scene.of("beam", "superelement"), self.flexible, strict=True):
            if self.scene.gravity is None or call.kind != "beam":
                continue
            points = points_of(call)
            for i in range(len(points) - 1):
                along = points[i + 1] - points[i]
                half = 0.5 * part.line * np.linalg.norm(along) * np.array(self.scene.gravity)
                result += [(body, point + inward * along / 6.0, half)
                           for inward, (body, point) in zip((1.0, -1.0), part.nodes[i : i + 2], strict=True)
                           if body != "ground"]  # fmt: skip
        return result

    def _number(self):
        self.rigid = 6 * len(self.number)
        self.internal, n = {}, self.rigid
        for part in self.flexible:
            self.internal[part.name], n = n, n + part.internal
        for call in self.scene.of("maxwell"):
            self.internal[call.name], n = n, n + 1
        for call in self.scene.of("bushing", "spring", "torsion_spring"):
            self.internal[call.name], n = n, n + len(yielding(call)) * len(words_of(call).get("weights", ()))
        self.size = n
        ground = self.number["ground"]
        self.moving = np.array([i for i in range(n) if not ground <= i < ground + 6])

    def at(self, body, point):
        """Displacement (6, n) of a point of a body, world axes."""
        result = np.zeros((6, self.size))
        k = self.number[body]
        x, y, z = np.subtract(point, self.origins.get(body, np.zeros(3)))
        result[:, k : k + 6] = np.eye(6)
        result[:3, k + 3 : k + 6] = [[0, z, -y], [-z, 0, x], [y, -x, 0]]
        return result

    def relative(self, first, second, point):
        return self.at(second, point) - self.at(first, point)

    def _statics(self):
        """Forces in the pose, the Jacobian with its rank, and the tangent."""
        unit = np.tile([1.0] * 3 + [1.0 / self.length] * 3, len(self.number))
        self.unit = np.concatenate((unit, np.ones(self.size - self.rigid)))  # columns without units
        self.J = np.pad(self.exact.jacobian, ((0, 0), (0, self.size - self.rigid)))
        kinematic = self.J[:, self.moving] * self.unit[self.moving]
        norms = np.linalg.norm(kinematic, axis=1)
        self.row_unit = np.where(norms > 0, 1 / np.where(norms > 0, norms, 1.0), 0.0)
        left, values, right = np.linalg.svd(kinematic * self.row_unit[:, None])
        self.rank = int(np.sum(values > RANK * values.max(initial=0.0)))
        self.retained = float(values[self.rank - 1] / values[0]) if self.rank else 1.0
        self.dropped = float(values[self.rank] / values[0]) if self.rank < len(values) else 0.0
        self.redundant = len(self.J) - self.rank
        self.N = self.unit[self.moving][:, None] * right[self.rank :].T
        self.carry = (left[:, : self.rank], values[: self.rank], right[: self.rank])
        self.undetermined = self.row_unit[:, None] * left[:, self.rank :]
        self.dof = self.N.shape[1]
        g = np.pad(self.exact.sum.gradient, (0, self.size - self.rigid))[self.moving]
        springs = np.concatenate([part.springs.ravel() for part in self.flexible if part.springs is not None] or [[]])
        lines = np.pad(self.exact.stretches(), ((0, 0), (0, self.size - self.rigid)))[:, self.moving]
        root = np.sqrt(springs)
        self.preloads = np.zeros(len(springs))
        if len(springs) and g.any():
            # least energy: p^2 / k, of elements that motions of unit size strain by more than rounding
            strains = lines @ self.N
            strains[np.abs(strains) <= RANK * (np.abs(lines) @ self.unit[self.moving])[:, None]] = 0.0
            self.preloads = root * np.linalg.lstsq((root[:, None] * strains).T, self.N.T @ g, rcond=1e-12)[0]
        self.largest_term = (self.exact.sum.size * unit).max(initial=0.0)
        self.largest_force = np.abs(g * self.unit[self.moving]).max(initial=0.0)
        rest = g - lines.T @ self.preloads
        self.lacking, self.size_of_forces = self.N.T @ rest, np.abs(self.N).T @ np.abs(g)
        self.multipliers = -self.reactions(rest)
        tangent, self.wrenches, self.parts_x, self.parts_l = self.exact.under(self.multipliers, self.preloads)
        self.K = np.zeros((self.size, self.size))
        self.K[: self.rigid, : self.rigid] = tangent

    def reactions(self, forces):
        """Multipliers of least norm (of rows without units) with J^T multipliers = forces (moving, ...)."""
        left, values, right = self.carry
        unit = self.unit[self.moving]
        scaled = (unit * forces.T).T
        shape = (-1,) + (1,) * (forces.ndim - 1)
        return self.row_unit.reshape(shape) * (left @ ((right @ scaled) / values.reshape(shape)))

    def _inertia(self):
        self.M, self.C = np.zeros((2, self.size, self.size))
        self.gyroscopic = np.zeros((self.size, self.size))
        for call in self.scene.of("body"):
            k, a = self.number[call.name], call.arguments
            self.M[k : k + 3, k : k + 3] = a["mass"] * np.eye(3)
            self.M[k + 3 : k + 6, k + 3 : k + 6] = tensor(a)
        for part in self.flexible:
            to = self._to(part)
            self.M += to.T @ part.mass @ to
        self.inerters = np.zeros((self.size, self.size))
        for call in self.scene.of("inerter"):
            row = self._line(call.arguments)
            self.inerters += call.arguments["inertance"] * np.outer(row, row)
        self.M += self.inerters
        for call in self.scene.of("rotor"):
            a, k = call.arguments, self.number[call.arguments["body"]] + 3
            axis = np.array(a["axis"]) / np.linalg.norm(a["axis"])
            body = next(c for c in self.scene.of("body") if c.name == a["body"])
            moment = a.get("inertia") or axis @ tensor(body.arguments) @ axis
            x, y, z = moment * a["speed"] * axis
            self.gyroscopic[k : k + 3, k : k + 3] -= [[0, -z, y], [z, 0, -x], [-y, x, 0]]
        self.C += self.gyroscopic

    def _to(self, part, against_ground=False):
        """From all coordinates to those of a flexible part; displacements may be those against the ground."""
        rows = [self.relative("ground", body, point) if against_ground else self.at(body, point)
                for body, point in part.nodes]  # fmt: skip
        own = np.zeros((part.internal, self.size))
        own[:, self.internal[part.name] :][:, : part.internal] = np.eye(part.internal)
        return np.concatenate((*rows, own))

    def _line(self, a):
        """Change of the distance of two points, (n,)."""
        line = np.subtract(a["end"], a["start"])
        return (line / np.linalg.norm(line)) @ (self.at(a["second"], a["end"]) - self.at(a["first"], a["start"]))[:3]

    def _elastic(self):
        """Dampers, flexible parts and Maxwell elements; what forces in elements see, by element name."""
        self.elements = {}
        for call in self.scene.of("spring", "bushing"):
            a = call.arguments
            if call.kind == "spring":
                rows = np.zeros((6, self.size))
                rows[2] = self._line(a)
                k, c = (
                    np.diag([0, 0, a.get("stiffness", 0.0), 0, 0, 0]),
                    np.diag([0, 0, a.get("damping", 0.0), 0, 0, 0]),
                )
            else:
                axes = np.array(a.get("orientation", np.eye(3)), dtype=float)
                rows = np.kron(np.eye(2), axes.T) @ self.relative(a["first"], a["second"], a["position"])
                k, c = (square(a.get(word, np.zeros(6))) for word in ("stiffness", "damping"))
            self.C += rows.T @ c @ rows
            self.elements[call.name] = (k @ rows, c @ rows)
            if "dynamic" in a:
                self._relaxations(call, rows)
        for call in self.scene.of("torsion_spring"):
            a, rows = call.arguments, np.zeros((6, self.size))
            rows[5] = np.array(a["axis"]) / np.linalg.norm(a["axis"]) @ self.relative(
                a["first"], a["second"], np.zeros(3))[3:]  # fmt: skip
            damped = a.get("damping", 0.0) * rows
            self.C += rows.T @ damped
            self.elements[call.name] = (a["stiffness"] * rows, damped)
            if "dynamic" in a:
                self._relaxations(call, rows)
        for part in self.flexible:
            # what does not let the nodes move as a rigid body stands on the ground
            to = self._to(part, against_ground=True)
            self.K += to.T @ part.stiffness @ to
            self.C += to.T @ part.damping @ to
            for i, (first, second, middle, axes) in enumerate(part.elements):
                rows = np.kron(np.eye(2), axes.T) @ self.relative(first, second, middle)
                force = part.springs[i][:, None] * rows
                self.elements[f"{part.name}.e{i + 1}"] = (force, part.beta * force)
        self._tension()
        self._maxwell()
        self._rotating()

    def _relaxations(self, call, rows):
        """Springs in series with dampers, which yield by displacements of their own, and a damper beside them."""
        words, own = words_of(call), yielding(call)
        stiffness = call.arguments.get("dynamic_stiffness", call.arguments["stiffness"])
        stiffness = square(stiffness) if np.ndim(stiffness) else stiffness * np.eye(6)
        force, damped = self.elements[call.name]
        viscous = words.get("viscous", 0.0) * stiffness
        self.C += rows.T @ viscous @ rows
        inner = own @ stiffness @ own.T
        for j, (g, tau) in enumerate(zip(words["weights"], words["times"], strict=True)):
            yields = np.eye(self.size)[self.internal[call.name] + len(own) * j :][: len(own)]
            spring = own @ rows - yields
            self.K += g * spring.T @ inner @ spring
            self.C += g * tau * yields.T @ inner @ yields
            force = force + g * own.T @ inner @ spring
        self.elements[call.name] = (force, damped + viscous @ rows)

    def _tension(self):
        start = 0
        for part in self.flexible:
            for i, (matrix, weighed) in enumerate(zip(part.under_tension, part.under_weight, strict=True)):
                pair = np.concatenate([self.at(body, point) for body, point in part.nodes[i : i + 2]])
                self.K -= self.preloads[start] * pair.T @ matrix @ pair  # a preload pushes, a tension pulls
                # a force across turns with the mean of both halves: the energy P . (r x d) / 2 beside the first's
                first, second, middle, axes = part.elements[i]
                d, r = np.split(np.kron(np.eye(2), axes.T) @ self.relative(first, second, middle), 2)
                across = np.cross(np.eye(3), np.array([0.0, *self.preloads[start + 1 : start + 3]]))
                term = 0.5 * d.T @ across @ r
                self.K += term + term.T
                start += 6
                if self.scene.gravity is not None:
                    along = np.subtract(part.nodes[i + 1][1], part.nodes[i][1])
                    self.K += part.line * (along @ np.array(self.scene.gravity)) * pair.T @ weighed @ pair

    def _maxwell(self):
        for call in self.scene.of("maxwell"):
            a = call.arguments
            row = self._line(a)
            yields = np.eye(self.size)[self.internal[call.name]]
            spring = row - yields
            self.K += a["stiffness"] * np.outer(spring, spring) + a.get("static_stiffness", 0.0) * np.outer(row, row)
            self.C += a["damping"] * np.outer(yields, yields)
            force = np.zeros((6, self.size))
            force[2] = a["stiffness"] * spring + a.get("static_stiffness", 0.0) * row
            self.elements[call.name] = (force, np.zeros_like(force))

    def _rotating(self):
        """Dampers between two bodies that spin together feel d' - W x d."""
        rotors = [call.arguments for call in self.scene.of("rotor") if "inertia" not in call.arguments]
        own = {a["body"]: a["speed"] * np.array(a["axis"]) / np.linalg.norm(a["axis"]) for a in rotors}
        for call in self.scene.of("bushing"):
            a = call.arguments
            spins = [own.get(a[end]) for end in ("first", "second")]
            if any(spin is None for spin in spins) or not np.allclose(*spins) or "damping" not in a:
                continue
            x, y, z = spins[0]
            turn = np.kron(np.eye(2), [[0, -z, y], [z, 0, -x], [-y, x, 0]])
            axes = np.kron(np.eye(2), np.array(a.get("orientation", np.eye(3)), dtype=float))
            relative = self.relative(a["first"], a["second"], a["position"])
            wrench = axes @ square(a["damping"]) @ axes.T @ turn @ relative
            self.K -= relative.T @ wrench
            stiff, damped = self.elements[call.name]
            self.elements[call.name] = (stiff - axes.T @ wrench, damped)

    def _point(self, a):
        if a.get("position") is not None:
            return np.array(a["position"], dtype=float)
        return self.origins[a["body"] if a["body"] != "ground" else a["relative_to"]]

    def _sources(self):
        calls = self.scene.of("input", "base_motion")
        self.B = np.zeros((self.size, len(calls)))
        self.field = np.zeros((self.size, len(calls)))
        for j, call in enumerate(calls):
            a, wrench = call.arguments, six(call.arguments["direction"])
            if call.kind == "input":
                self.B[:, j] = wrench @ self.relative(a.get("relative_to", "ground"), a["body"], self._point(a))
                continue
            about = np.array(a.get("position", np.zeros(3)), dtype=float)
            for body, k in self.number.items():
                arm = self.origins.get(body, np.zeros(3)) - about
                self.field[k : k + 6, j] = [*(wrench[:3] + np.cross(wrench[3:], arm)), *wrench[3:]]
        self.forces = self.B - self.M @ self.field

    def _outputs(self):
        calls = self.scene.of("output", "force_output", "strain_output")
        p, r = len(calls), len(self.J)
        self.ports = Ports(*(np.zeros((p, self.size)) for _ in range(3)), np.zeros((p, r)),
                           np.zeros((p, self.B.shape[1])), np.zeros((p, r)),
                           np.zeros((p, self.B.shape[1])), np.zeros(p))  # fmt: skip
        for i, call in enumerate(calls):
            {"output": self._motion, "force_output": self._force, "strain_output": self._strain}[call.kind](i, call)

    def _strain(self, i, call):
        name, _, element = call.arguments["element"].partition(".e")
        beam_call = next(item for item in self.scene.of("beam") if item.name == name)
        part = next(part for part in self.flexible if part.name == name)
        k = int(element) - 1
        pair = np.concatenate([self.at(body, point) for body, point in part.nodes[k : k + 2]])
        self.ports.Rq[i] = strain(beam_call, k, call.arguments) @ pair

    def _motion(self, i, call):
        a = call.arguments
        relative_to = a.get("relative_to", "ground")
        row = six(a["direction"]) @ self.relative(relative_to, a["body"], self._point(a))
        order = ORDERS.index(a.get("quantity", "displacement"))
        (self.ports.Rq, self.ports.Rv, self.ports.Ra)[order][i] = row
        absolute = a.get("absolute")
        if order == 2 and relative_to == "ground" and absolute is not False:
            at = self.at(a["body"], self._point(a))
            self.ports.D[i] = six(a["direction"]) @ at @ self.field
            self.ports.outside[i] = np.abs(six(a["direction"])) @ np.abs(at) @ np.abs(self.field)

    def _force(self, i, call):
        name, w = call.arguments["element"], six(call.arguments["direction"])
        kind = acts_on(call, self.scene)
        ports = self.ports
        if kind == "inerter":
            a = next(item.arguments for item in self.scene.of("inerter") if item.name == name)
            ports.Ra[i] = w[2] * a["inertance"] * self._line(a)
            return
        if name in self.elements:
            stiff, damped = self.elements[name]
            ports.Rq[i], ports.Rv[i] = w @ stiff, w @ damped
            return
        ports.outside[i] = np.abs(w).max() * np.abs(self.forces).max(axis=0, initial=0.0)
        ports.force[i] = np.abs(w * np.repeat((1.0, self.length), 3)).max()
        if kind == "joint":
            ports.Rq[i, : self.rigid] = -w @ self.parts_x[name]
            ports.Rl[i] = -w @ self.parts_l[name]
            ports.size[i] = np.abs(w).max() * np.abs(self.parts_l[name]).sum(axis=0)
        elif kind == "body":
            k = self.number[name]
            ports.Ra[i] = w @ (self.M - self.inerters)[k : k + 6]
            ports.Rv[i] = w @ self.gyroscopic[k : k + 6]
            ports.D[i] = w @ self.M[k : k + 6] @ self.field
        else:
            k = self.number["ground"]
            ports.Rq[i], ports.Rv[i], ports.Ra[i] = (-w @ m[k : k + 6] for m in (self.K, self.C, self.M))
            ports.Rl[i] = -w @ self.J[:, k : k + 6].T
            ports.size[i] = np.abs(ports.Rl[i])
            ports.D[i] = w @ (self.B - self.M @ self.field)[k : k + 6]


def tensor(arguments):
    """Inertia of a body about its centre of mass, world axes."""
    value = np.array(arguments["inertia"], dtype=float)
    if value.shape == (3,):
        value = np.diag(value)
    elif value.shape == (6,):
        xx, yy, zz, xy, xz, yz = value
        value = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
    axes = np.array(arguments.get("orientation", np.eye(3)), dtype=float)
    return axes @ value @ axes.T


def square(value):
    value = np.array(value, dtype=float)
    return np.diag(value) if value.ndim == 1 else value
