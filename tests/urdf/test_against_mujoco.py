"""The same file read by MuJoCo: the mass matrix in joint coordinates, in any pose."""

import numpy as np
import pytest

import mbsvib as mv
from tests.urdf.test_robot import ARM

mujoco = pytest.importorskip("mujoco", reason="mujoco is not installed: pip install 'mbsvib[mjcf]'")

JOINTS = ("pan", "lift", "elbow", "wrist_1", "wrist_2", "wrist_3")


@pytest.mark.parametrize("seed", range(3))
def test_the_mass_matrix_is_that_of_mujoco(seed):
    position = np.random.default_rng(seed).uniform(-3.0, 3.0, 6)
    model = mujoco.MjModel.from_xml_path(str(ARM))
    assert [model.joint(i).name for i in range(6)] == list(JOINTS)
    data = mujoco.MjData(model)
    data.qpos[:] = position
    mujoco.mj_forward(model, data)
    expected = np.zeros((6, 6))
    try:
        mujoco.mj_fullM(model, expected, data.qM)
    except (AttributeError, TypeError):  # later versions take the data themselves
        mujoco.mj_fullM(model, data, expected)
    system = mv.load_urdf(ARM, pose=dict(zip(JOINTS, position, strict=True))).linearize()
    np.testing.assert_allclose(system.M, expected, atol=1e-13 * np.abs(expected).max())
