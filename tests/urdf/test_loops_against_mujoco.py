"""Robots with closed loops against MuJoCo's tree: N^T M N and N^T K N with its joint Jacobians and a null space."""

import numpy as np
import pytest
from scipy.linalg import eigh, null_space
from scipy.optimize import least_squares

import mbsvib as mv
from tests.urdf.scenes import CASSIE, CASSIE_YAML, CONSTRAINT, DELTA, FIVE_BAR, FOUR_BAR, FRAMES, LOOP, write

mujoco = pytest.importorskip("mujoco", reason="mujoco is not installed: pip install 'mbsvib[mjcf]'")

Y = (0.0, 1.0, 0.0)
HINGE = ("coupler", (0.35, 0, 0), "rocker", (0, 0, 0.3), Y, None)
KNEE = ("left2", (0.26, 0, 0), "right2", (0.25, 0, 0), Y, None)
CARDANS = [(f"rod{i}", (0, 0, -0.4), "plate", 0.5 * 0.1 * np.array((np.cos(angle), np.sin(angle), 0)), (1, 0, 0),
            (-np.sin(angle), np.cos(angle), 0)) for i, angle in enumerate((0.0, 2 * np.pi / 3, -2 * np.pi / 3))]
SOCKET = ("rod", (0, 0, -0.36), "shin", (0.07, 0.04, -0.02), None, None)


class Tree:
    """A tree in MuJoCo; loops are (link, point, link, point, axis in the first, axis in the second link)."""

    def __init__(self, path, loops, change=None):
        spec = mujoco.MjSpec.from_file(str(path))
        if change is not None:
            change(spec)
        self.m = spec.compile()
        self.d, self.loops = mujoco.MjData(self.m), loops

    def put(self, v):
        self.d.qpos[:] = self.m.qpos0
        mujoco.mj_integratePos(self.m, self.d.qpos, v, 1.0)
        mujoco.mj_forward(self.m, self.d)

    def end(self, link, point):
        body = self.m.body(link).id
        axes = self.d.xmat[body].reshape(3, 3)
        at = self.d.xpos[body] + axes @ point
        jp, jr = np.zeros((3, self.m.nv)), np.zeros((3, self.m.nv))
        mujoco.mj_jac(self.m, self.d, jp, jr, at, body)
        return at, axes, jp, jr

    def gaps_and_rows(self):
        gaps, rows = [], []
        for first, p, second, q, axis, axis2 in self.loops:
            (a, A, ja, wa), (b, B, jb, wb) = self.end(first, p), self.end(second, q)
            gaps.append(b - a)
            rows.append(jb - ja)
            if axis2 is not None:
                u, v = A @ axis, B @ axis2
                gaps.append([u @ v])
                rows.append(np.cross(u, v)[None] @ (wb - wa))
            elif axis is not None:
                u, across = A @ axis, null_space((A @ axis)[None])
                gaps.append(across.T @ np.cross(u, B @ axis))
                rows.append(across.T @ (wb - wa))
        return np.concatenate(gaps), np.vstack(rows)

    def squares(self, pose, stiffness):
        """Squared angular frequencies, the number of freedoms, and the positions of joints."""
        columns = {self.m.joint(i).name: int(self.m.jnt_dofadr[i]) for i in range(self.m.njnt)}
        held = [columns[name] for name in pose]
        free = np.setdiff1d(np.arange(self.m.nv), held)
        v = np.zeros(self.m.nv)
        v[held] = list(pose.values())

        def gaps(x):
            v[free] = x
            self.put(v)
            return self.gaps_and_rows()[0]

        found = least_squares(gaps, np.zeros(len(free)), xtol=1e-15, ftol=1e-15, gtol=1e-15)
        assert np.abs(gaps(found.x)).max() < 1e-10
        mass = np.zeros((self.m.nv, self.m.nv))
        try:
            mujoco.mj_fullM(self.m, mass, self.d.qM)
        except (AttributeError, TypeError):  # later versions take the data themselves
            mujoco.mj_fullM(self.m, self.d, mass)
        K = np.diag([stiffness.get(self.m.joint(int(self.m.dof_jntid[i])).name, 0.0) for i in range(self.m.nv)])
        N = null_space(self.gaps_and_rows()[1], rcond=1e-7)
        return eigh(N.T @ K @ N, N.T @ mass @ N, eigvals_only=True), v


def two_hinges(spec):
    """The hinge about y of the rod becomes a universal joint: a second one about x."""
    spec.body("rod").add_joint(name="ball2", type=mujoco.mjtJoint.mjJNT_HINGE, axis=(1, 0, 0))


YAML = "closed_loop: [[tip_A, tip_B]]\ntype: [3d]\n"
SPRINGS = {"a": 50.0, "b": 20.0, "d": 10.0}
LEGS = {f"{side}_{part}": value for side in ("left", "right") for part, value in (("hip", 80.0), ("knee", 30.0))}
MOTORS = {f"motor{i}": 40.0 + i for i in range(3)}


@pytest.mark.parametrize(("words", "yaml", "loops", "pose", "stiffness", "change"), [
    (FOUR_BAR + CONSTRAINT.format("revolute_joint"), None, [HINGE], {"a": 0.2}, SPRINGS, None),
    (FOUR_BAR + CONSTRAINT.format("spherical"), None, [HINGE], {"a": -0.4}, SPRINGS, None),
    (FOUR_BAR + LOOP, None, [HINGE], {"d": 0.1}, SPRINGS, None),
    (FOUR_BAR + FRAMES, YAML, [HINGE], {"a": 0.2}, SPRINGS, None),
    (FIVE_BAR, None, [KNEE], {"left_hip": -1.9, "right_hip": -1.2}, LEGS, None),
    (DELTA, None, CARDANS, {"motor0": 0.3, "motor1": 0.25, "motor2": 0.2}, MOTORS, None),
    (CASSIE, CASSIE_YAML, [SOCKET], {"hip": 0.3, "motor": -0.1}, {"hip": 300.0, "motor": 90.0, "ankle": 20.0},
     two_hinges),
])  # fmt: skip
def test_frequencies(tmp_path, words, yaml, loops, pose, stiffness, change):
    path = write(tmp_path, words, yaml)
    model = mv.load_urdf(path, pose=pose, stiffness={"*": 0.0} | stiffness,
                         loops=None if yaml is None else tmp_path / "loops.yaml")  # fmt: skip
    modes = model.linearize().modes()
    expected, _ = Tree(path, loops, change).squares(pose, stiffness)
    squares = np.sort((2 * np.pi * modes.frequencies) ** 2)
    assert len(squares) == len(expected)
    np.testing.assert_allclose(squares, expected, rtol=1e-9, atol=1e-12 * expected.max())
