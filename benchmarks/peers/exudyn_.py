"""exudyn: absolute coordinates projected on the constraints' null space, or a kinematic tree."""

import numpy as np

from benchmarks.peers import harness
from benchmarks.peers.scenes import open_tree, scene

import exudyn as exu  # isort: skip
from exudyn.itemInterface import NodeGenericODE2, ObjectKinematicTree  # isort: skip
from exudyn.utilities import RigidBodyInertia  # isort: skip

exu.config.printToConsole = False


def absolute(closed):
    """Rigid bodies, joints as constraints, six-direction spring-dampers."""
    container = exu.SystemContainer()
    mbs = container.AddSystem()
    ground = mbs.CreateGround()
    bodies = [mbs.CreateRigidBody(referencePosition=b.centre, inertia=RigidBodyInertia(b.mass, b.inertia))
              for b in closed.bodies]  # fmt: skip
    centre = [b.centre for b in closed.bodies] + [np.zeros(3)]  # -1 is ground
    bodies.append(ground)
    for link in closed.links:
        pair = [bodies[link.parent], bodies[link.child]]
        if link.kind == "revolute":
            mbs.CreateRevoluteJoint(itemNumbers=pair, position=link.point, axis=link.axes[:, 2])
        elif link.kind == "prismatic":
            mbs.CreatePrismaticJoint(itemNumbers=pair, position=link.point, axis=link.axes[:, 2])
        else:
            mbs.CreateSphericalJoint(itemNumbers=pair, position=link.point)
        mbs.CreateRigidBodySpringDamper(
            itemNumbers=pair, localPosition0=link.point - centre[link.parent],
            localPosition1=link.point - centre[link.child], stiffness=np.diag(link.stiffness),
            damping=np.diag(link.damping), rotationMatrixJoint=link.spring_axes, useGlobalFrame=True)  # fmt: skip
    mbs.Assemble()
    return container, mbs


def tree(opened):
    """One object with minimal joint coordinates; its joint controllers are the spring-dampers."""
    container = exu.SystemContainer()
    mbs = container.AddSystem()
    n = len(opened.links)
    zeros = [0.0] * n
    node = mbs.AddNode(NodeGenericODE2(referenceCoordinates=zeros, initialCoordinates=zeros,
                                       initialCoordinates_t=zeros, numberOfODE2Coordinates=n))  # fmt: skip
    turn, offset, inertia, centre = exu.Matrix3DList(), exu.Vector3DList(), exu.Matrix3DList(), exu.Vector3DList()
    for link, body in zip(opened.links, opened.bodies, strict=True):
        before = opened.links[link.parent] if link.parent >= 0 else None
        frame = np.eye(3) if before is None else before.axes
        turn.Append(frame.T @ link.axes)
        offset.Append(frame.T @ (link.point - (0.0 if before is None else before.point)))
        inertia.Append(link.axes.T @ body.inertia @ link.axes)
        centre.Append(link.axes.T @ (body.centre - link.point))
    mbs.AddObject(ObjectKinematicTree(
        nodeNumber=node, jointTypes=[exu.JointType.RevoluteZ] * n, linkParents=[link.parent for link in opened.links],
        jointTransformations=turn, jointOffsets=offset, linkInertiasCOM=inertia, linkCOMs=centre,
        linkMasses=[b.mass for b in opened.bodies], jointPositionOffsetVector=zeros, jointVelocityOffsetVector=zeros,
        jointPControlVector=[link.along[1] for link in opened.links],
        jointDControlVector=[link.along[2] for link in opened.links]))  # fmt: skip
    mbs.Assemble()
    return container, mbs


def linearise(built, project):
    """Return M, C, K as ``ComputeLinearizedSystem`` gives them."""
    stiffness = built[1].ComputeLinearizedSystem(projectIntoConstraintNullspace=project)
    return harness.Second(np.array(stiffness[0]), np.array(stiffness[2]), np.array(stiffness[1]))


METHODS = {
    "exudyn": harness.Method(absolute, lambda b: linearise(b, True), scene,
                             "redundant coordinates, differences, SVD of all constraint rows"),
    "exudyn tree": harness.Method(tree, lambda b: linearise(b, False), lambda name: open_tree(scene(name)),
                                  "minimal coordinates, differences; open trees only",
                                  lambda s: not s.welds and all(j.kind == "revolute" for j in s.links)),
}  # fmt: skip

if __name__ == "__main__":
    harness.main(exu.config.Version(), METHODS)
