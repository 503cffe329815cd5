"""Other engines that linearize a model by themselves: independent eigenvalues for a cross-check."""

from __future__ import annotations

import warnings
from importlib.metadata import version
from importlib.util import find_spec
from typing import TYPE_CHECKING

import numpy as np

from mbsvib.errors import LeftOutWarning, MbsvibError

if TYPE_CHECKING:
    from mbsvib.api.model import Model
    from mbsvib.common.arrays import Complex

# Engines that have no way to take a mechanism of this kind, and why.
OTHERS = {
    "mujoco": "a model has no words in MJCF for bushings and loops",
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
