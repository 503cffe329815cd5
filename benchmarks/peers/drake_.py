"""Drake: the whole plant linearised by automatic differentiation; loops by stiff bushings."""

from importlib.metadata import version

import numpy as np
from pydrake.math import RigidTransform, RotationMatrix
from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import (
    BallRpyJoint,
    FixedOffsetFrame,
    LinearBushingRollPitchYaw,
    PrismaticJoint,
    PrismaticSpring,
    RevoluteJoint,
    RevoluteSpring,
    RotationalInertia,
    SpatialInertia,
)
from pydrake.systems.framework import InputPortSelection, OutputPortSelection
from pydrake.systems.primitives import Linearize

from benchmarks.peers import harness
from benchmarks.peers.scenes import open_tree, scene

# Continuous plants have no constraints: what closes a loop is a bushing, in N/m and N m/rad. Softer ones cost more on
# the ladders, stiffer ones on the Stewart platform: of the powers of ten this one has the smallest worst error.
PENALTY = 1e13
AXIS = (0.0, 0.0, 1.0)


def build(opened):
    """Plant in continuous time."""
    plant = MultibodyPlant(time_step=0.0)
    plant.mutable_gravity_field().set_gravity_vector([0.0, 0.0, 0.0])
    bodies = []
    for n, (link, rigid) in enumerate(zip(opened.links, opened.bodies, strict=True)):
        j = rigid.inertia
        inertia = RotationalInertia(j[0, 0], j[1, 1], j[2, 2], j[0, 1], j[0, 2], j[1, 2])
        body = plant.AddRigidBody(rigid.name, SpatialInertia.MakeFromCentralInertia(
            rigid.mass, rigid.centre - link.point, inertia))  # fmt: skip
        bodies.append(body)
        parent, origin = (bodies[link.parent], opened.links[link.parent].point) if link.parent >= 0 \
            else (plant.world_body(), np.zeros(3))  # fmt: skip
        turn = RotationMatrix(link.axes)
        before = plant.AddFrame(FixedOffsetFrame(f"p{n}", parent.body_frame(),
                                                 RigidTransform(turn, link.point - origin)))  # fmt: skip
        after = plant.AddFrame(FixedOffsetFrame(f"c{n}", body.body_frame(), RigidTransform(turn, np.zeros(3))))
        _, k, c = link.along
        if link.kind == "spherical":
            plant.AddJoint(BallRpyJoint(f"q{n}", before, after))
            plant.AddForceElement(LinearBushingRollPitchYaw(before, after, [k] * 3, [c] * 3, [0.0] * 3, [0.0] * 3))
            continue
        kind, spring = (RevoluteJoint, RevoluteSpring) if link.kind == "revolute" else (PrismaticJoint, PrismaticSpring)
        joint = plant.AddJoint(kind(f"q{n}", before, after, AXIS, damping=c))
        plant.AddForceElement(spring(joint, 0.0, k))
    for n, (a, b) in enumerate(opened.welds):
        between = opened.links[b].point - opened.links[a].point
        frame = plant.AddFrame(FixedOffsetFrame(f"w{n}", bodies[a].body_frame(), RigidTransform(between)))
        plant.AddForceElement(LinearBushingRollPitchYaw(
            frame, bodies[b].body_frame(), [PENALTY] * 3, [0.0] * 3, [PENALTY] * 3, [0.0] * 3))  # fmt: skip
    plant.Finalize()
    return plant, bool(opened.welds)


def linearise(built):
    """Return A by forward automatic differentiation."""
    plant, loops = built
    context = plant.CreateDefaultContext()
    # rounding of the stiff bushings is a residual that the check of the equilibrium would refuse
    limit = 1e6 if loops else 1e-6
    return harness.First(Linearize(plant, context, InputPortSelection.kNoInput, OutputPortSelection.kNoOutput,
                                   limit).A())  # fmt: skip


METHODS = {
    "drake": harness.Method(build, linearise, lambda name: open_tree(scene(name)),
                            f"automatic differentiation; loops by bushings of {PENALTY:.0e} N/m"),
}  # fmt: skip

if __name__ == "__main__":
    harness.main(version("drake"), METHODS)
