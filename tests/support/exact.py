"""An independent reference: the same mechanism in absolute coordinates and 50 digits, by a road of its own.

Every body has six coordinates (translation of its centre of mass, small rotation; world axes). Every joint, in a loop
or not, gives rows of a Jacobian; Gauss-Jordan elimination with full pivoting gives its null space; the block matrices
are projected on it. There is no spanning tree, no path rule, no factor, and no floating-point matrix.
"""

from functools import cached_property

import numpy as np

from tests.support import fast_digits
from tests.support.digits import (
    clean,
    columns,
    combination,
    cross,
    dot,
    double,
    exact,
    mp,
    null_space,
    product,
    rounded,
    solve,
    transpose,
    unit_vector,
)  # fmt: skip

DIRECTIONS = ("x", "y", "z", "rx", "ry", "rz")
FREE = {
    "revolute": ("rz",), "prismatic": ("z",), "cylindrical": ("z", "rz"), "spherical": ("rx", "ry", "rz"),
    "homokinetic": ("rx", "ry"),
    "planar": ("x", "y", "rz"), "fixed": (), "free": DIRECTIONS, "point_on_line": ("z", "rx", "ry", "rz"),
    "point_on_plane": ("x", "y", "rx", "ry", "rz"), "distance": ("x", "y", "rx", "ry", "rz"),
}  # fmt: skip


def covectors(joint):
    """Joint coordinates {direction: six-covector}, and locked covectors, of the relative displacement, world axes.

    A covector (f, m) reads f . u + m . theta.
    """
    x, y, z = columns(joint.axes)
    none = [mp.mpf(0)] * 3
    unit = {"x": x + none, "y": y + none, "z": z + none, "rx": none + x, "ry": none + y, "rz": none + z}
    if joint.kind == "universal":
        a, b = (unit_vector(joint.axis), unit_vector(joint.axis2)) if joint.axis is not None else (x, y)
        normal = cross(a, b)
        square = dot(normal, normal)
        first, second = cross(b, normal), cross(normal, a)  # theta = q1 a + q2 b, solved for q1 and q2
        coordinates = {"rx": none + [v / square for v in first], "ry": none + [v / square for v in second]}
        return coordinates, [unit["x"], unit["y"], unit["z"], none + normal]
    if joint.kind == "screw":
        advance = z + [-mp.mpf(joint.pitch) * v for v in z]
        return {"rz": unit["rz"]}, [unit["x"], unit["y"], unit["rx"], unit["ry"], advance]
    free = joint.free if joint.kind == "custom" else FREE[joint.kind]
    return {d: unit[d] for d in free}, [unit[d] for d in DIRECTIONS if d not in free]


class Exact:
    """The linear equations of a model in 50 digits, in coordinates of its own."""

    def __init__(self, model):
        self.model = model
        self.number = {name: 6 * i for i, name in enumerate(model.bodies)}
        self.width = 6 * len(self.number)
        locked = [row for joint in model.joints.values() for row in self._joint(joint)[1]]
        for coupler in model.couplers.values():
            rows = {name: row for joint in model.joints.values() for name, row in self._joint(joint)[0].items()}
            terms = [[mp.mpf(c) * v for v in rows[name]] for name, c in coupler.terms]
            locked.append([sum(entries) for entries in zip(*terms, strict=True)])
        self.jacobian = locked
        self.basis, self.retained, self.dropped = null_space(locked, self.width)
        self.dof = len(self.basis[0]) if self.basis else 0
        self.redundant = len(locked) - (self.width - self.dof)
        self._project()

    def row(self, body, point, covector):
        """Row over all body coordinates of f . u + m . theta at a point of a body (ground: zeros)."""
        result = [mp.mpf(0)] * self.width
        if body in self.number:
            arm = [p - c for p, c in zip(point, exact(self.model.bodies[body].position), strict=True)]
            moment = [a + b for a, b in zip(cross(arm, covector[:3]), covector[3:], strict=True)]
            start = self.number[body]
            result[start : start + 6] = [*covector[:3], *moment]
        return result

    def relative(self, first, second, point, covector):
        a, b = self.row(first, point, covector), self.row(second, point, covector)
        return [q - p for p, q in zip(a, b, strict=True)]

    def _joint(self, joint):
        position = joint.end or joint.position
        if position is None:  # no rotation is free: every point does
            position = next(self.model.bodies[b].position for b in (joint.second, joint.first) if b in self.number)
        free, locked = covectors(joint)
        relative = lambda w: self.relative(joint.first, joint.second, exact(position), w)  # noqa: E731
        return {f"{joint.name}.{d}": relative(w) for d, w in free.items()}, [relative(w) for w in locked]

    def _spring(self, spring):
        """Relative displacements of a spring or bushing in its own axes, six rows or (line) one; and its k and c."""
        if hasattr(spring, "line"):
            start, end = exact(spring.start), exact(spring.end)
            covector = unit_vector([b - a for a, b in zip(start, end, strict=True)]) + [mp.mpf(0)] * 3
            a, b = self.row(spring.first, start, covector), self.row(spring.second, end, covector)
            rows = [[q - p for p, q in zip(a, b, strict=True)]]
            return rows, [[mp.mpf(spring.stiffness)]], [[mp.mpf(spring.damping)]]
        x, y, z = columns(spring.orientation)
        none = [mp.mpf(0)] * 3
        directions = [x + none, y + none, z + none, none + x, none + y, none + z]
        point = exact(spring.position)
        rows = [self.relative(spring.first, spring.second, point, w) for w in directions]
        full = [
            [exact(r) for r in v] if np.ndim(v) == 2
            else [[mp.mpf(v[i]) if i == j else mp.mpf(0) for j in range(6)] for i in range(6)]
            for v in (spring.stiffness, spring.damping)
        ]  # fmt: skip
        return rows, full[0], full[1]

    def _mass(self):
        """Rows of the mass matrix times the basis, body by body."""
        result = []
        for body in self.model.bodies.values():
            start = self.number[body.name]
            xx, yy, zz, xy, xz, yz = exact(body.inertia)
            axes = [exact(r) for r in body.orientation]
            inertia = product(product(axes, [[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]]), transpose(axes))
            block = [[mp.mpf(body.mass) if i == j else mp.mpf(0) for j in range(6)] for i in range(3)]
            block += [[mp.mpf(0)] * 3 + row for row in inertia]
            result += product(block, self.basis[start : start + 6])
        return result

    def _project(self):
        basis, m = self.basis, self.dof
        mass = self._mass()
        self.M = product(transpose(basis), mass) if m else []
        self.K = self.C = [[mp.mpf(0)] * m for _ in range(m)]
        elements = {}
        for spring in self.model.springs.values():
            rows, k, c = self._spring(spring)
            moved = product(rows, basis)
            elements[spring.name] = moved, k, c
            moved = clean(moved)
            self.K = combination((self.K, 1), (product(transpose(moved), product(k, moved)), 1))
            self.C = combination((self.C, 1), (product(transpose(moved), product(c, moved)), 1))
        fields, forces = [], []
        for source in self.model.inputs.values():
            wrench = exact(source.wrench)
            if hasattr(source, "body"):
                rows = [self.relative(source.relative_to, source.body, self._point(source), wrench)]
                forces.append(product(rows, basis)[0])
                fields.append(None)
            else:
                fields.append(self._field(exact(source.position), wrench))
                forces.append([-v for v in product([fields[-1]], mass)[0]])
        self.B = transpose(forces) if forces else [[] for _ in range(m)]
        self.Cq, self.Cv, self.Ca, self.D = [], [], [], []
        for output in self.model.outputs.values():
            self._output(output, elements, fields)

    def _point(self, port):
        if port.position is not None:
            return exact(port.position)
        return exact(self.model.bodies[port.body].position)

    def _field(self, centre, wrench):
        """Acceleration of every body in a rigid acceleration of the ground."""
        result = []
        for body in self.model.bodies.values():
            arm = [p - c for p, c in zip(exact(body.position), centre, strict=True)]
            result += [a + b for a, b in zip(wrench[:3], cross(wrench[3:], arm), strict=True)] + wrench[3:]
        return result

    def _output(self, output, elements, fields):
        zero, direct = [mp.mpf(0)] * self.dof, [mp.mpf(0)] * len(fields)
        wrench = exact(output.wrench)
        rows = {"displacement": zero, "velocity": zero, "acceleration": zero}
        if output.element is not None:
            moved, k, c = elements[output.element]
            weights = [wrench if len(k) == 6 else wrench[2:3]]
            rows["displacement"] = product(product(weights, k), moved)[0]
            rows["velocity"] = product(product(weights, c), moved)[0]
        else:
            row = self.relative(output.relative_to, output.body, self._point(output), wrench)
            rows[output.quantity] = product([row], self.basis)[0]
            if output.quantity == "acceleration" and output.relative_to == "ground" and output.absolute is not False:
                direct = [dot(row, field) if field else mp.mpf(0) for field in fields]
        for target, key in ((self.Cq, "displacement"), (self.Cv, "velocity"), (self.Ca, "acceleration")):
            target.append(rows[key])
        self.D.append(direct)

    def change(self, names):
        """Columns: this reference's coordinates per unit of each of the named ones ("hip1.rx", floating "body.x")."""
        known = {}
        for joint in self.model.joints.values():
            known.update(self._joint(joint)[0])
        for body in self.model.bodies.values():
            for i, direction in enumerate(DIRECTIONS):
                unit = [mp.mpf(j == self.number[body.name] + i) for j in range(self.width)]
                known.setdefault(f"{body.name}.{direction}", unit)
        return solve(product([known[name] for name in names], self.basis), mp.eye(self.dof).tolist())

    def minimal(self, names):
        """The matrices and the body displacements T in the named coordinates, rounded to doubles once."""
        to = self.change(names)
        back = transpose(to)
        result = {key: double(product(back, product(getattr(self, key), to)), self.dof) for key in "MCK"}
        result["B"] = double(product(back, self.B), len(self.model.inputs))
        for key in ("Cq", "Cv", "Ca"):
            result[key] = double(product(getattr(self, key), to), self.dof)
        result["D"] = double(self.D, len(self.model.inputs))
        result["T"] = double(product(self.basis, to), self.dof)
        return result

    def violation(self, displacements):
        """Largest locked relative displacement in any joint, for displacements {body: (6,)} in doubles."""
        moved = exact([v for name in self.number for v in displacements[name]])
        return max((abs(float(dot(row, moved))) for row in self.jacobian), default=0.0)

    @cached_property
    def squares(self):
        """Undamped omega^2, ascending; negative where unstable."""
        if not self.dof:
            return np.empty(0)
        lower = mp.cholesky(mp.matrix(self.M)).tolist()
        half = transpose(solve(lower, self.K))
        values = fast_digits.symmetric_eigenvalues(mp.matrix(solve(lower, half)))
        return rounded(values, "1e-32").real

    @cached_property
    def eigenvalues(self):
        """All 2 m roots of det(lambda^2 M + lambda C + K), zeros exact, as complex doubles."""
        m = self.dof
        if not m:
            return np.empty(0, complex)
        right = solve(self.M, [[-v for v in (*k, *c)] for k, c in zip(self.K, self.C, strict=True)])
        top = [[mp.mpf(j == m + i) for j in range(2 * m)] for i in range(m)]
        values = fast_digits.eigenvalues(mp.matrix(top + right))
        return rounded(values, "1e-18")  # a double zero keeps half of the digits

    @cached_property
    def zeros(self):
        """Number of rigid modes: the nullity of K."""
        return int(np.sum(self.squares == 0.0))

    def frequency_response(self, omega):
        """(outputs, inputs, frequencies), in 50 digits for each frequency."""
        direct = double(self.D, len(self.model.inputs))
        if not self.dof or not direct.size:
            return direct[:, :, None] + np.zeros(len(omega), complex)
        matrices = (self.M, self.C, self.K, self.B, self.Cq, self.Cv, self.Ca, self.D)
        return np.stack([fast_digits.transfer(matrices, mp.mpc(0, float(w)), mp) for w in omega], axis=-1)

    def static(self):
        """Static response of the outputs to the inputs (K regular)."""
        return self.frequency_response([0.0])[:, :, 0].real
