"""The textbook way: absolute coordinates, every joint's constraint rows, SVD null space, dense eigenproblem."""

import numpy as np
import scipy

from benchmarks.peers import harness
from benchmarks.peers.scenes import scene

LOCKED = {"revolute": (0, 1, 2, 3, 4), "prismatic": (0, 1, 3, 4, 5), "spherical": (0, 1, 2)}


def cross(r):
    """Matrix of the cross product r x."""
    return np.array([[0.0, -r[2], r[1]], [r[2], 0.0, -r[0]], [-r[1], r[0], 0.0]])


def build(closed):
    """Return M, C, K and the constraint Jacobian in six coordinates a body."""
    size = 6 * len(closed.bodies)
    mass, damping, stiffness = np.zeros((3, size, size))
    for i, body in enumerate(closed.bodies):
        at = 6 * i
        mass[at : at + 3, at : at + 3] = body.mass * np.eye(3)
        mass[at + 3 : at + 6, at + 3 : at + 6] = body.inertia
    constraints = []
    for link in closed.links:
        ends = [(sign, body) for sign, body in ((-1.0, link.parent), (1.0, link.child)) if body >= 0]
        columns = np.concatenate([np.arange(6 * body, 6 * body + 6) for _, body in ends])
        rows = {}
        for name, axes in (("joint", link.axes), ("spring", link.spring_axes)):
            blocks = []
            for sign, body in ends:
                block = np.zeros((6, 6))
                block[:3, :3] = block[3:, 3:] = axes.T
                block[:3, 3:] = -axes.T @ cross(link.point - closed.bodies[body].centre)
                blocks.append(sign * block)
            rows[name] = np.concatenate(blocks, axis=1)
        where = np.ix_(columns, columns)
        stiffness[where] += rows["spring"].T @ (link.stiffness[:, None] * rows["spring"])
        damping[where] += rows["spring"].T @ (link.damping[:, None] * rows["spring"])
        locked = np.zeros((len(LOCKED[link.kind]), size))
        locked[:, columns] = rows["joint"][list(LOCKED[link.kind])]
        constraints.append(locked)
    return mass, damping, stiffness, np.concatenate(constraints)


METHODS = {
    "traditional": harness.Method(build, lambda built: harness.projected(*built), scene,
                                  "6 coordinates a body, SVD of all constraint rows"),
}  # fmt: skip

if __name__ == "__main__":
    harness.main(f"numpy {np.__version__}, scipy {scipy.__version__}", METHODS)
