"""SymPy: symbolic equations by Kane's method, linearised symbolically; small open trees of revolute joints."""

import numpy as np
import sympy
from sympy.physics.mechanics import (
    Inertia,
    PinJoint,
    ReferenceFrame,
    RigidBody,
    System,
    TorqueActuator,
    dynamicsymbols,
)

from benchmarks.peers import harness
from benchmarks.peers.scenes import open_tree, scene

# Beyond this the symbolic equations take minutes.
MOST = 4


def build(opened):
    """System of bodies, pin joints and torques, with its equations of motion."""
    ground = RigidBody("ground")
    system = System.from_newtonian(ground)
    bodies = []
    for n, (link, rigid) in enumerate(zip(opened.links, opened.bodies, strict=True)):
        frame = ReferenceFrame(f"frame{n}")
        body = RigidBody(f"body{n}", frame=frame, mass=rigid.mass)
        j = rigid.inertia
        body.central_inertia = Inertia.from_inertia_scalars(
            body.masscenter, frame, j[0, 0], j[1, 1], j[2, 2], j[0, 1], j[1, 2], j[0, 2]).dyadic  # fmt: skip
        parent = bodies[link.parent] if link.parent >= 0 else ground
        origin = opened.bodies[link.parent].centre if link.parent >= 0 else np.zeros(3)
        q, u = dynamicsymbols(f"q{n} u{n}")
        axis, k, c = link.along
        unit = sum(float(a) * e for a, e in zip(axis, (parent.x, parent.y, parent.z), strict=True))
        place = lambda body, arm: sum(float(a) * e for a, e in zip(arm, (body.x, body.y, body.z), strict=True))  # noqa: E731
        system.add_joints(PinJoint(
            f"pin{n}", parent, body, q, u, parent_point=place(parent, link.point - origin),
            child_point=place(body, link.point - rigid.centre), joint_axis=unit))  # fmt: skip
        system.add_actuators(TorqueActuator(-k * q - c * u, unit, body.frame, parent.frame))
        bodies.append(body)
    system.form_eoms()
    return system


def linearise(system):
    """Return A, evaluated at the pose."""
    kane = system.eom_method
    at = dict.fromkeys([*system.q, *system.u], 0)
    mass, a, _ = kane.to_linearizer().linearize(op_point=at, A_and_B=False, simplify=False)
    mass, a = (np.array(m.subs(at), dtype=float) for m in (mass, a))
    return harness.First(np.linalg.solve(mass, a))


METHODS = {
    "sympy": harness.Method(build, linearise, lambda name: open_tree(scene(name)),
                            f"symbolic, Kane's method; measured up to {MOST} bodies",
                            lambda s: not s.welds and len(s.bodies) <= MOST),
}  # fmt: skip

if __name__ == "__main__":
    harness.main(sympy.__version__, METHODS)
