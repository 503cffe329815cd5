"""Other engines that linearize a model by themselves: independent eigenvalues for a cross-check."""

from __future__ import annotations

import tempfile
import warnings
from collections.abc import Callable
from importlib.metadata import version
from importlib.util import find_spec
from pathlib import Path

import numpy as np

from mbsvib.api.model import Model
from mbsvib.common.arrays import Array, Complex
from mbsvib.errors import LeftOutWarning, MbsvibError
from mbsvib.urdf.saving import save_urdf


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


def _by_mujoco(path: Path) -> tuple[Array, tuple[str, ...]]:
    """Return the mass matrix of a URDF in its zero pose by MuJoCo, and the joint of each of its rows."""
    import mujoco

    try:
        engine = mujoco.MjModel.from_xml_path(str(path))
    except ValueError as error:  # as of bodies without mass
        raise MbsvibError(f"mujoco: {error}") from error
    if engine.nv != engine.njnt:
        raise MbsvibError("mujoco has other coordinates of joints with several freedoms")
    data = mujoco.MjData(engine)
    mujoco.mj_forward(engine, data)
    mass = np.zeros((engine.nv, engine.nv))
    for row, unit in zip(mass, np.eye(engine.nv), strict=True):
        mujoco.mj_mulM(engine, data, row, unit)
    names = [mujoco.mj_id2name(engine, mujoco.mjtObj.mjOBJ_JOINT, k) for k in range(engine.njnt)]
    return mass, tuple(map(str, names))


def _by_pinocchio(path: Path) -> tuple[Array, tuple[str, ...]]:
    """Return the mass matrix of a URDF in its zero pose by Pinocchio, and the joint of each of its rows."""
    import pinocchio

    engine = pinocchio.buildModelFromUrdf(str(path))
    moving = list(engine.names)[1:]
    if engine.nv != len(moving):
        raise MbsvibError("pinocchio has other coordinates of joints with several freedoms")
    upper = np.triu(pinocchio.crba(engine, engine.createData(), pinocchio.neutral(engine)))
    return upper + np.triu(upper, 1).T, tuple(moving)


# Engines that have the inertia of trees of joints, and no springs and bushings: module, package, mass matrix of a URDF.
OF_TREES: dict[str, tuple[str, Callable[[Path], tuple[Array, tuple[str, ...]]]]] = {
    "mujoco": ("mujoco", _by_mujoco), "pinocchio": ("pin", _by_pinocchio)}


def masses_of_tree(model: Model) -> dict[str, tuple[Array, tuple[str, ...], str]]:
    """Return the mass matrix that each engine that is installed finds for a tree of joints in the given pose, the joint
    of each of its rows, and its version.

    Raises MbsvibError where none is installed, or a model has loops, or parts that a URDF file has no words for.
    """
    installed = [name for name in OF_TREES if find_spec(name) is not None]
    if not installed:
        raise MbsvibError("neither mujoco nor pinocchio is installed; pip install mujoco")
    if model.couplers or model.composed or len(model.joints) > len(model.bodies):
        raise MbsvibError(f"{' and '.join(installed)} has the inertia of trees of joints without couplers, beams and "
                          f"superelements")  # fmt: skip
    tree = model.with_parts(springs={}, inputs={}, outputs={}, loads={}, rotors={}, gravity=None)
    with tempfile.TemporaryDirectory() as folder, warnings.catch_warnings():
        warnings.simplefilter("ignore", LeftOutWarning)
        path = save_urdf(tree, Path(folder) / "tree.urdf")
        return {name: (*OF_TREES[name][1](path), version(OF_TREES[name][0])) for name in installed}
