"""Pinocchio: analytic derivatives of the inverse dynamics; spring-dampers and loops are the user's own algebra."""

import numpy as np
import pinocchio as pin

from benchmarks.peers import harness
from benchmarks.peers.scenes import open_tree, scene

JOINTS = {
    "revolute": pin.JointModelRevoluteUnaligned, "prismatic": pin.JointModelPrismaticUnaligned,
    "spherical": lambda _: pin.JointModelSpherical(),
}  # fmt: skip


def build(opened):
    """Model with one joint a body, depth first: in another order of addJoint the mass matrix comes out wrong."""
    model = pin.Model()
    model.gravity = pin.Motion.Zero()
    number, stiffness, damping = [], [], []
    for link, body in zip(opened.links, opened.bodies, strict=True):
        parent, origin = (number[link.parent], opened.links[link.parent].point) if link.parent >= 0 else (0, 0.0)
        axis, k, c = link.along
        joint = model.addJoint(parent, JOINTS[link.kind](axis), pin.SE3(np.eye(3), link.point - origin), body.name)
        model.appendBodyToJoint(joint, pin.Inertia(body.mass, body.centre - link.point, body.inertia),
                                pin.SE3.Identity())  # fmt: skip
        number.append(joint)
        count = 3 if link.kind == "spherical" else 1  # the three torsion springs of these scenes are equal
        stiffness += [k] * count
        damping += [c] * count
    return model, pin.Data(model), number, opened.welds, np.array(stiffness), np.array(damping)


def linearise(built):
    """Return M, C, K; loops by the difference of both pieces' Jacobians and its null space."""
    model, data, number, welds, stiffness, damping = built
    q, zero = pin.neutral(model), np.zeros(model.nv)
    pin.computeRNEADerivatives(model, data, q, zero, zero)
    mass = np.triu(data.M) + np.triu(data.M, 1).T
    matrices = mass, data.dtau_dv + np.diag(damping), data.dtau_dq + np.diag(stiffness)
    if not welds:
        return harness.Second(*matrices)
    pin.computeJointJacobians(model, data, q)
    seen = lambda i: pin.getJointJacobian(model, data, number[i], pin.ReferenceFrame.WORLD)  # noqa: E731
    return harness.projected(*matrices, np.vstack([seen(a) - seen(b) for a, b in welds]))


METHODS = {
    "pinocchio": harness.Method(build, linearise, lambda name: open_tree(scene(name)),
                                "no spring-dampers in the model, no loops in its derivatives: both added by hand"),
}  # fmt: skip

if __name__ == "__main__":
    harness.main(pin.__version__, METHODS)
