"""MuJoCo: finite differences of its time step (the documented way) or of its inverse dynamics."""

import sys

import mujoco
import numpy as np

from benchmarks.peers import harness
from benchmarks.peers.scenes import open_tree, scene

# a chain is written as one body inside the other
sys.setrecursionlimit(20_000)

# Time step [s]: the default, 2 ms, is as long as the periods of these scenes; their error falls with the step, and that
# of loops grows again below this one. Differences: the step that the documentation names.
STEP, DIFFERENCE = 1e-6, 1e-6
# As stiff as the documentation lets a constraint be: a time constant of two steps.
WELD = f'solref="{2 * STEP} 1" solimp="0.9999 0.9999 0.001"'
KINDS = {"revolute": "hinge", "prismatic": "slide", "spherical": "ball"}


def words(*values):
    """Numbers with all their digits, as XML wants them."""
    return " ".join(f"{v:.17g}" for v in np.concatenate([np.atleast_1d(v) for v in values]))


def text(opened):
    """Return the scene as MJCF: loops are welds, which MuJoCo keeps by soft constraints."""
    children, result = {}, []
    for i, link in enumerate(opened.links):
        children.setdefault(link.parent, []).append(i)

    def add(i):
        link, body = opened.links[i], opened.bodies[i]
        origin = opened.links[link.parent].point if link.parent >= 0 else np.zeros(3)
        axis, k, c = link.along
        j = body.inertia
        direction = "" if link.kind == "spherical" else f' axis="{words(axis)}"'
        result.append(
            f'<body name="x{i}" pos="{words(link.point - origin)}"><inertial pos="{words(body.centre - link.point)}" '
            f'mass="{words(body.mass)}" fullinertia="{words(np.diag(j), j[0, 1:], j[1, 2])}"/>'
            f'<joint type="{KINDS[link.kind]}"{direction} stiffness="{words(k)}" damping="{words(c)}"/>'
        )
        for child in children.get(i, []):
            add(child)
        result.append("</body>")

    for root in children[-1]:
        add(root)
    welds = "".join(f'<weld body1="x{a}" body2="x{b}" {WELD}/>' for a, b in opened.welds)
    return (f'<mujoco><compiler angle="radian" inertiafromgeom="false" boundmass="0" boundinertia="0"/>'
            f'<option gravity="0 0 0" timestep="{STEP}"/><size memory="2G"/><worldbody>{"".join(result)}</worldbody>'
            f"<equality>{welds}</equality></mujoco>")  # fmt: skip


def build(opened):
    """Compile the model."""
    model = mujoco.MjModel.from_xml_string(text(opened))
    return model, mujoco.MjData(model)


def stepped(built):
    """Return the transition matrix of one time step by central differences."""
    model, data = built
    a = np.zeros((2 * model.nv, 2 * model.nv))
    mujoco.mjd_transitionFD(model, data, DIFFERENCE, 1, a, None, None, None)
    return harness.Discrete(a, model.opt.timestep)


def inverse(built):
    """Return M, C, K by differences of the inverse dynamics; loops by the null space of the welds' Jacobian."""
    model, data = built
    n = model.nv
    model.opt.disableflags = 0
    model.opt.jacobian = mujoco.mjtJacobian.mjJAC_DENSE
    mujoco.mj_forward(model, data)
    jacobian = data.efc_J.reshape(-1, n).copy() if data.nefc else None
    model.opt.disableflags |= mujoco.mjtDisableBit.mjDSBL_EQUALITY
    stiffness, damping, mass = np.zeros((3, n, n))
    data.qacc[:] = 0.0
    mujoco.mjd_inverseFD(model, data, DIFFERENCE, 0, stiffness, damping, mass, None, None, None, None)
    matrices = mass.T, damping.T, stiffness.T
    return harness.Second(*matrices) if jacobian is None else harness.projected(*matrices, jacobian)


def prepare(name):
    """Return the opened scene."""
    return open_tree(scene(name))


METHODS = {
    "mujoco step": harness.Method(build, stepped, prepare,
                                  f"discrete time, step {STEP} s; loops by soft constraints"),
    "mujoco inverse": harness.Method(build, inverse, prepare,
                                     "differences of the inverse dynamics; loops projected by hand"),
}  # fmt: skip

if __name__ == "__main__":
    harness.main(mujoco.__version__, METHODS)
