"""Other engines that linearize a model by themselves: independent eigenvalues for a cross-check."""

from __future__ import annotations

import tempfile
import warnings
from importlib.metadata import version
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from mbsvib.errors import LeftOutWarning, MbsvibError
from mbsvib.urdf.saving import save_urdf

if TYPE_CHECKING:
    from mbsvib.api.model import Model
    from mbsvib.common.arrays import Array, Complex

# Engines that have no way to take a mechanism of this kind, and why.
OTHERS = {
    "pinocchio": "it has no springs and no bushings between bodies",
}


def by_exudyn(model: Model) -> tuple[Complex, str]:
    """Return the eigenvalues that exudyn finds in its own redundant coordinates, by differences, and its version.

    Raises MbsvibError where it has nothing for a part, or finds no mass in a motion.
    """
    if find_spec("exudyn") is None:
        raise MbsvibError("not installed; pip install exudyn")
    if model.loads or model.gravity is not None:
        raise MbsvibError("its pose under loads would be the result of a search of its own, another one in its digits")
    from mbsvib_export import to_exudyn

    with warnings.catch_warnings():
        warnings.simplefilter("ignore", LeftOutWarning)  # ports have no eigenvalues
        system = to_exudyn(model)
    mass, stiffness, damping = (np.array(part) for part in system.ComputeLinearizedSystem(
        projectIntoConstraintNullspace=True)[:3])  # fmt: skip
    n = len(mass)
    try:
        lower = -np.linalg.solve(mass, np.concatenate((stiffness, damping), axis=1))
    except np.linalg.LinAlgError as error:
        raise MbsvibError("it has motions without mass") from error
    upper = np.concatenate((np.zeros((n, n)), np.eye(n)), axis=1)
    result: Complex = np.linalg.eigvals(np.concatenate((upper, lower))).astype(complex)
    return result, version("exudyn")


def mass_by_mujoco(model: Model) -> tuple[Array, tuple[str, ...], str]:
    """Return the mass matrix that MuJoCo finds for a tree of joints in the given pose, the joint of each of its rows,
    and its version.

    Raises MbsvibError where a model has loops, or parts that a URDF file has no words for.
    """
    if find_spec("mujoco") is None:
        raise MbsvibError("mujoco is not installed; pip install mujoco")
    if model.couplers or model.composed or len(model.joints) > len(model.bodies):
        raise MbsvibError("mujoco has the inertia of trees of joints without couplers, beams and superelements")
    import mujoco

    tree = model.with_parts(springs={}, inputs={}, outputs={}, loads={}, rotors={}, gravity=None)
    with tempfile.TemporaryDirectory() as folder, warnings.catch_warnings():
        warnings.simplefilter("ignore", LeftOutWarning)
        engine = mujoco.MjModel.from_xml_path(str(save_urdf(tree, Path(folder) / "tree.urdf")))
    if engine.nv != engine.njnt:
        raise MbsvibError("mujoco has other coordinates of joints with several freedoms")
    data = mujoco.MjData(engine)
    mujoco.mj_forward(engine, data)
    mass = np.zeros((engine.nv, engine.nv))
    for row, unit in zip(mass, np.eye(engine.nv), strict=True):
        mujoco.mj_mulM(engine, data, row, unit)
    names = [mujoco.mj_id2name(engine, mujoco.mjtObj.mjOBJ_JOINT, k) for k in range(engine.njnt)]
    return mass, tuple(map(str, names)), version("mujoco")
